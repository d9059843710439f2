//! One run from Python: plan, run without the interpreter's lock, look at signals between frames.

use crate::columns::{Columns, Recorder};
use crate::config::PyConfig;
use crate::detect::{Found, FoundSink, scans_of};
use crate::detections::detections_of;
use crate::errors::{OrRaise, raised, refused};
use crate::plan::{Plan, Wishes};
use crate::python_detector::PythonDetector;
use crate::source::{ArrayFrames, READER, Raised, Times};
use crate::tracks::Tracks;
use boresight::draw::{AnnotatedVideo, DrawOptions};
use boresight::io::video::Mp4Options;
use boresight::pipeline::{self, Input, Outcome};
use boresight::track::Tracking;
use boresight::{Error, ErrorKind, FrameIndex, Scan, Sink, track};
use numpy::{PyReadonlyArray1, PyReadonlyArray2};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::ops::ControlFlow;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::time::{Duration, Instant};

/// How often signals are looked at, and how often progress is told.
const SIGNALS: Duration = Duration::from_millis(20);
const PROGRESS: Duration = Duration::from_millis(200);

/// What a call of `track` asks for.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub struct Request {
    config: Option<PyConfig>,
    sets: Vec<String>,
    rate_hz: Option<f64>,
    false_tracks_per_hour: Option<f64>,
    detector: Option<Py<PyAny>>,
    detector_word: Option<String>,
    annotate: Option<PathBuf>,
    progress: Option<Py<PyAny>>,
}

impl Request {
    /// The rate of frames without times, frames/s.
    fn rate(&self) -> PyResult<f64> {
        let rate = self.rate_hz.unwrap_or(boresight::ASSUMED_RATE_HZ);
        if (1e-6..=1e9).contains(&rate) {
            return Ok(rate);
        }
        let place = format!("rate_hz = {rate}");
        Err(refused("expected a rate from 1e-6 to 1e9 frames/s", place, "25.0 is that of video"))
    }

    fn wishes(&self, py: Python<'_>, raised: &Raised) -> Wishes {
        let detector = self.detector.as_ref();
        Wishes {
            config: self.config.as_ref().map(|c| c.config.clone()),
            sets: self.sets.clone(),
            rate_hz: self.rate_hz,
            false_tracks_per_hour: self.false_tracks_per_hour,
            word: self.detector_word.clone(),
            detector: detector.map(|f| PythonDetector {
                function: f.clone_ref(py),
                raised: raised.clone(),
                std: (1.0, 0.0),
            }),
        }
    }
}

/// Runs what needs no Python object on a thread of its own and looks at signals meanwhile.
fn patiently<T: Send + 'static>(py: Python<'_>, work: impl FnOnce() -> T + Send + 'static) -> PyResult<T> {
    let (send, receive) = channel();
    std::thread::spawn(move || {
        // Nobody listens any more once the user has interrupted.
        let _ = send.send(work());
    });
    // A receiver may be used by one thread at a time, which `detach` cannot know.
    let receive = std::sync::Mutex::new(receive);
    loop {
        let got = py.detach(|| match receive.lock() {
            Ok(receive) => receive.recv_timeout(SIGNALS),
            Err(_) => Err(RecvTimeoutError::Disconnected),
        });
        match got {
            Ok(done) => return Ok(done),
            Err(RecvTimeoutError::Timeout) => py.check_signals()?,
            Err(RecvTimeoutError::Disconnected) => {
                return Err(pyo3::exceptions::PyRuntimeError::new_err("a thread of boresight ended early: a bug"));
            }
        }
    }
}

/// Tracks a path: a video, a folder, a pattern, a table of detections.
#[pyfunction]
pub fn track_path(py: Python<'_>, path: String, request: Request) -> PyResult<Tracks> {
    let kept = Raised::default();
    let wishes = request.wishes(py, &kept);
    let (label, own_detector) = (path.clone(), request.detector.is_some());
    let plan = if own_detector {
        // The user's function runs in the user's thread.
        py.detach(|| wishes.for_path(&path))
    } else {
        patiently(py, move || wishes.for_path(&path))?
    };
    run(py, settled(py, plan, &kept)?, &request, &kept, label)
}

/// Tracks an iterable of arrays.
#[pyfunction]
#[pyo3(signature = (frames, n_frames, times, twice, request))]
pub fn track_arrays(
    py: Python<'_>,
    frames: &Bound<'_, PyAny>,
    n_frames: Option<u64>,
    times: Option<Vec<f64>>,
    twice: bool,
    request: Request,
) -> PyResult<Tracks> {
    let kept = Raised::default();
    let plan = plan_arrays(py, frames, n_frames, times, twice, &request, &kept)?;
    run(py, plan, &request, &kept, "arrays".into())
}

/// The configuration that the automatic choice takes for an iterable of arrays.
#[pyfunction]
#[pyo3(signature = (frames, n_frames, times, twice, request))]
pub fn choose_for_arrays(
    py: Python<'_>,
    frames: &Bound<'_, PyAny>,
    n_frames: Option<u64>,
    times: Option<Vec<f64>>,
    twice: bool,
    request: Request,
) -> PyResult<PyConfig> {
    let plan = plan_arrays(py, frames, n_frames, times, twice, &request, &Raised::default())?;
    Ok(PyConfig { config: plan.config, reasons: plan.reasons })
}

fn plan_arrays(
    py: Python<'_>,
    frames: &Bound<'_, PyAny>,
    n_frames: Option<u64>,
    times: Option<Vec<f64>>,
    twice: bool,
    request: &Request,
    kept: &Raised,
) -> PyResult<Plan> {
    let rate = request.rate()?;
    let times = times.map_or(Times::Rate(rate), |t| Times::Each(Arc::new(t)));
    let Some(source) = ArrayFrames::start(frames, n_frames, times.clone(), kept.clone())? else {
        return Err(refused("there are no frames", "frames", "give at least one array"));
    };
    let again = if twice { ArrayFrames::start(frames, n_frames, times, kept.clone())? } else { None };
    let wishes = request.wishes(py, kept);
    settled(py, py.detach(|| wishes.for_arrays(source, again)), kept)
}

/// The configuration that the automatic choice takes for a path.
#[pyfunction]
pub fn choose_for_path(py: Python<'_>, path: String, request: Request) -> PyResult<PyConfig> {
    let kept = Raised::default();
    let wishes = request.wishes(py, &kept);
    let plan = settled(py, patiently(py, move || wishes.for_path(&path))?, &kept)?;
    Ok(PyConfig { config: plan.config, reasons: plan.reasons })
}

/// The configuration that the automatic choice takes for detections made elsewhere, one entry a scan.
#[pyfunction]
pub fn choose_for_scans(
    py: Python<'_>,
    scans: Vec<Bound<'_, PyAny>>,
    times: Option<Vec<f64>>,
    request: Request,
) -> PyResult<PyConfig> {
    let kept = Raised::default();
    let wishes = request.wishes(py, &kept);
    let base = wishes.base().or_raise(py)?;
    let std = (base.input.table.std_px, base.input.table.std_per_side);
    let times = times.map_or(Times::Rate(base.input.rate_hz), |t| Times::Each(Arc::new(t)));
    let mut made = Vec::with_capacity(scans.len());
    for (k, found) in scans.iter().enumerate() {
        let scan = Scan::at(FrameIndex(k as u64), times.of(k as u64).or_raise(py)?);
        made.push(scan.with_detections(detections_of(found, std)?));
    }
    let rate = times.rate_hz().unwrap_or(boresight::ASSUMED_RATE_HZ);
    let plan = settled(py, py.detach(|| wishes.for_scans(made, rate, base, "detections".into())), &kept)?;
    Ok(PyConfig { config: plan.config, reasons: plan.reasons })
}

/// The plan, or the exception that the user's own code raised while it was made.
fn settled(py: Python<'_>, plan: boresight::Result<Plan>, kept: &Raised) -> PyResult<Plan> {
    match kept.take() {
        Some(e) => Err(e),
        None => plan.or_raise(py),
    }
}

/// Runs a plan's input to its end; between frames signals are looked at, and progress is told.
fn drive(
    py: Python<'_>,
    input: Input,
    tracking: Option<Box<dyn Tracking>>,
    sinks: Vec<Box<dyn Sink + '_>>,
    request: &Request,
    kept: &Raised,
    total: Option<u64>,
    reader: &str,
) -> PyResult<Outcome> {
    // The threads of a run are not waited for when it is interrupted. One that asks Python for a frame or for detections would do so while the interpreter ends.
    let asks_python = reader == READER || request.detector.is_some();
    let n_threads = asks_python.then_some(std::num::NonZeroUsize::MIN);
    let (mut looked, mut told) = (Instant::now(), Instant::now());
    let mut go_on = |so_far: &pipeline::Summary| -> ControlFlow<()> {
        let now = Instant::now();
        if now - looked < SIGNALS {
            return ControlFlow::Continue(());
        }
        looked = now;
        let tell = now - told >= PROGRESS;
        let outcome = Python::attach(|py| {
            py.check_signals()?;
            match &request.progress {
                Some(f) if tell => f.call1(py, (so_far.frames, total)).map(|_| ()),
                _ => Ok(()),
            }
        });
        if tell {
            told = now;
        }
        match outcome {
            Ok(()) => ControlFlow::Continue(()),
            Err(e) => {
                kept.keep(e);
                ControlFlow::Break(())
            }
        }
    };
    let outcome = py.detach(|| pipeline::run_on(n_threads, input, tracking, sinks, &mut go_on));
    if let Some(e) = kept.take() {
        return Err(e);
    }
    if let Some(f) = &request.progress {
        f.call1(py, (outcome.summary.frames, Some(outcome.summary.frames)))?;
    }
    Ok(outcome)
}

/// What a run without a frame is.
fn empty(label: &str) -> Error {
    Error::new(ErrorKind::Damaged, "holds no frames").at(label)
}

fn run(py: Python<'_>, plan: Plan, request: &Request, kept: &Raised, label: String) -> PyResult<Tracks> {
    let tracking = track::build(&plan.config.tracker).or_raise(py)?;
    let mut columns = Columns::default();
    let mut sinks: Vec<Box<dyn Sink + '_>> = Vec::new();
    if let Some(path) = &request.annotate {
        let video = AnnotatedVideo::create(path, DrawOptions::default(), Mp4Options::default());
        sinks.push(Box::new(video.or_raise(py)?));
    }
    sinks.push(Box::new(Recorder(&mut columns)));
    let Plan { input, config, reasons, lost, total, reader } = plan;
    let outcome = drive(py, input, Some(tracking), sinks, request, kept, total, &reader)?;
    let (summary, broken) = outcome.all_written().or_raise(py)?;
    if summary.frames == 0 {
        return Err(raised(py, &broken.unwrap_or_else(|| empty(&label))));
    }
    let warnings = lost.into_iter().chain(summary.warnings.iter().cloned()).collect();
    let tracks = Tracks::new(columns, config, reasons, warnings, summary, label, reader);
    match broken {
        None => Ok(tracks),
        Some(e) => {
            let error = raised(py, &e);
            error.value(py).setattr("partial", tracks)?;
            Err(error)
        }
    }
}

/// Detections of a plan's frames, and its configuration.
fn detect<'py>(py: Python<'py>, plan: Plan, request: &Request, kept: &Raised, label: &str) -> PyResult<Detected<'py>> {
    let mut found = Found::default();
    let sinks: Vec<Box<dyn Sink + '_>> = vec![Box::new(FoundSink(&mut found))];
    let outcome = drive(py, plan.input, None, sinks, request, kept, plan.total, &plan.reader)?;
    let (summary, broken) = outcome.all_written().or_raise(py)?;
    match broken {
        Some(e) => Err(raised(py, &e)),
        None if summary.frames == 0 => Err(raised(py, &empty(label))),
        None => Ok((found.arrays(py)?, PyConfig { config: plan.config, reasons: plan.reasons })),
    }
}

/// Columns of detections, and the configuration.
type Detected<'py> = (Bound<'py, PyDict>, PyConfig);

/// Detects in a path.
#[pyfunction]
pub fn detect_path<'py>(py: Python<'py>, path: String, request: Request) -> PyResult<Detected<'py>> {
    let kept = Raised::default();
    let (wishes, label) = (request.wishes(py, &kept), path.clone());
    let plan = settled(py, patiently(py, move || wishes.for_path(&path))?, &kept)?;
    detect(py, plan, &request, &kept, &label)
}

/// Detects in an iterable of arrays.
#[pyfunction]
pub fn detect_arrays<'py>(
    py: Python<'py>,
    frames: &Bound<'py, PyAny>,
    n_frames: Option<u64>,
    times: Option<Vec<f64>>,
    twice: bool,
    request: Request,
) -> PyResult<Detected<'py>> {
    let kept = Raised::default();
    let plan = plan_arrays(py, frames, n_frames, times, twice, &request, &kept)?;
    detect(py, plan, &request, &kept, "arrays")
}

/// Tracks detections that are there as columns, sorted by frame.
#[pyfunction]
pub fn track_columns(
    py: Python<'_>,
    frames: PyReadonlyArray1<'_, i64>,
    positions: PyReadonlyArray2<'_, f64>,
    covariances: PyReadonlyArray2<'_, f64>,
    sizes: PyReadonlyArray2<'_, f64>,
    request: Request,
) -> PyResult<Tracks> {
    let kept = Raised::default();
    let rate = request.rate()?;
    let scans = scans_of(&frames, &positions, &covariances, &sizes, rate)?;
    let wishes = request.wishes(py, &kept);
    let plan = py.detach(|| {
        let base = wishes.config.clone().unwrap_or_default();
        wishes.for_scans(scans, rate, base, "columns".into())
    });
    let plan = settled(py, plan, &kept)?;
    run(py, plan, &request, &kept, "columns".into())
}
