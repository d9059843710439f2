//! `Tracker`: frames or detections in, states out, one scan a call; for cameras and loops of the caller's own.

use crate::config::PyConfig;
use crate::detections::Given;
use crate::errors::{OrRaise, raised, refused};
use crate::pixels::pixels_of;
use crate::states::States;
use boresight::track::Tracking;
use boresight::vision::Detector;
use boresight::{Config, Detection, Frame, FrameIndex, Pixels, Scan, SourceInfo, Timestamp, track, vision};
use pyo3::prelude::*;
use std::sync::{Mutex, MutexGuard, PoisonError};

struct Inner {
    tracking: Box<dyn Tracking>,
    /// Built for the first frame.
    detector: Option<Box<dyn Detector>>,
    next: u64,
    scan: Scan,
}

impl Inner {
    fn new(config: &Config) -> boresight::Result<Self> {
        Ok(Self { tracking: track::build(&config.tracker)?, detector: None, next: 0, scan: Scan::default() })
    }

    fn detector(&mut self, config: &Config, pixels: &Pixels) -> boresight::Result<&mut Box<dyn Detector>> {
        if self.detector.is_none() {
            let info = SourceInfo {
                label: "arrays".into(),
                reader: "arrays in memory".into(),
                width: pixels.width(),
                height: pixels.height(),
                kind: pixels.kind(),
                n_frames: None,
                rate_hz: None,
                true_times: true,
            };
            self.detector = Some(vision::build(&config.detector, &info)?);
        }
        self.detector
            .as_mut()
            .ok_or_else(|| boresight::Error::new(boresight::ErrorKind::Config, "there is no detector"))
    }

    fn track(&mut self) -> boresight::Result<States> {
        let states = self.tracking.step(&self.scan)?.to_vec();
        self.next += 1;
        Ok(States::after(&self.scan, states))
    }
}

/// A tracker; threads may call it at once, one after the other gets in.
#[pyclass(module = "boresight._boresight", subclass, frozen)]
pub struct Tracker {
    config: Config,
    inner: Mutex<Inner>,
}

impl Tracker {
    fn lock(&self) -> MutexGuard<'_, Inner> {
        // A panic inside would be our bug; what it leaves is as sound as what a refused scan leaves.
        self.inner.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The time of scan `index`: as given, else as the configuration's rate says.
    fn time(&self, time_s: Option<f64>, index: u64) -> Timestamp {
        Timestamp::from_secs_f64(time_s.unwrap_or(index as f64 / self.config.input.rate_hz))
    }

    fn follow(&self, py: Python<'_>, detections: Vec<Detection>, time_s: Option<f64>) -> PyResult<States> {
        check_time(time_s)?;
        let states = py.detach(|| {
            let mut inner = self.lock();
            let index = inner.next;
            inner.scan = Scan::at(FrameIndex(index), self.time(time_s, index)).with_detections(detections);
            inner.track()
        });
        states.map_err(|e| raised(py, &e))
    }
}

fn check_time(time_s: Option<f64>) -> PyResult<()> {
    match time_s.filter(|t| !t.is_finite()) {
        Some(t) => Err(refused("expected a finite time", format!("time_s = {t}"), "seconds, from any zero, rising")),
        None => Ok(()),
    }
}

#[pymethods]
impl Tracker {
    #[new]
    #[pyo3(signature = (config))]
    fn new(py: Python<'_>, config: PyConfig) -> PyResult<Self> {
        let inner = Mutex::new(Inner::new(&config.config).or_raise(py)?);
        Ok(Self { config: config.config, inner })
    }

    #[getter]
    fn native_config(&self) -> PyConfig {
        PyConfig { config: self.config.clone(), reasons: Vec::new() }
    }

    /// Detects and tracks in one frame.
    ///
    /// `frame` is rows x columns, or rows x columns x 3 for colour, of any type that `track` takes; the first one settles size and type. `time_s`
    /// rises; without it frames follow at the configuration's rate. Returns the `States` of all tracks after it.
    #[pyo3(signature = (frame, time_s = None))]
    fn step(&self, py: Python<'_>, frame: &Bound<'_, PyAny>, time_s: Option<f64>) -> PyResult<States> {
        let pixels = pixels_of(frame)?;
        check_time(time_s)?;
        let states = py.detach(|| {
            let mut inner = self.lock();
            let index = inner.next;
            let mut scan = std::mem::take(&mut inner.scan);
            let frame = Frame { index: FrameIndex(index), time: self.time(time_s, index), pixels };
            inner.detector(&self.config, &frame.pixels)?.detect(&frame, &mut scan)?;
            inner.scan = scan;
            inner.track()
        });
        states.map_err(|e| raised(py, &e))
    }

    /// Tracks the detections of one scan.
    #[pyo3(signature = (positions = None, boxes = None, covariances = None, scores = None, classes = None, std_px = None,
        std_per_side = None, time_s = None))]
    fn update_native(
        &self,
        py: Python<'_>,
        positions: Option<Bound<'_, PyAny>>,
        boxes: Option<Bound<'_, PyAny>>,
        covariances: Option<Bound<'_, PyAny>>,
        scores: Option<Bound<'_, PyAny>>,
        classes: Option<Bound<'_, PyAny>>,
        std_px: Option<f64>,
        std_per_side: Option<f64>,
        time_s: Option<f64>,
    ) -> PyResult<States> {
        let table = &self.config.input.table;
        let given = Given {
            positions,
            covariances,
            boxes,
            scores,
            classes,
            std_px: std_px.unwrap_or(table.std_px),
            std_per_side: std_per_side.unwrap_or(table.std_per_side),
        };
        self.follow(py, given.detections()?, time_s)
    }

    /// Forgets all tracks; ids begin at 1 again.
    fn reset(&self, py: Python<'_>) -> PyResult<()> {
        let fresh = Inner::new(&self.config).or_raise(py)?;
        py.detach(|| *self.lock() = fresh);
        Ok(())
    }
}
