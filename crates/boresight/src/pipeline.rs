//! One run: frames -> detections -> tracks -> sinks, frame by frame, with the time each stage took.
//!
//! A frame that cannot be read ends the run; the sinks are finished first, so what was computed before is kept. The caller is asked
//! after every frame whether to go on.

use crate::track::Tracking;
use crate::vision::Detector;
use crate::{Error, FrameSource, Result, Scan, Sink, TrackStatus, View};
use std::collections::BTreeSet;
use std::ops::ControlFlow;
use std::time::{Duration, Instant};

/// Where scans come from: frames through a detector, or detections made elsewhere.
pub enum Input {
    /// Frames and what makes detections of them.
    Frames(Box<dyn FrameSource>, Box<dyn Detector>),
    /// Detections made before, in time order.
    Scans(Vec<Scan>),
}

opaque_debug!(Input);

/// Time spent in each stage.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct StageTimes {
    /// Reading and decoding (waiting for it).
    pub read: Duration,
    /// Frame to detections.
    pub detect: Duration,
    /// Detections to tracks.
    pub track: Duration,
    /// Tables, video, report.
    pub write: Duration,
}

/// What a run gave.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Summary {
    /// Frames done.
    pub frames: u64,
    /// Time from the first to the last frame, s.
    pub duration_s: f64,
    /// Detections in all frames.
    pub detections: u64,
    /// Tracks that were confirmed at some time.
    pub confirmed_tracks: u64,
    /// Most confirmed tracks in one frame.
    pub most_at_once: u64,
    /// Mean normalised innovation squared of confirmed tracks (2 if the filter is consistent), and their number.
    pub mean_nis: Option<(f64, u64)>,
    /// Time in each stage.
    pub times: StageTimes,
    /// Warnings of the source.
    pub warnings: Vec<String>,
    /// Whether the caller ended the run before the source did.
    pub interrupted: bool,
}

/// Runs to the end of the input, or until `go_on` breaks.
///
/// `tracking` may be `None`: detections only. Returns the summary and, if the input broke off, the error that ended it.
/// # Errors
/// A sink that cannot be written or finished.
pub fn run(
    input: Input,
    mut tracking: Option<Box<dyn Tracking>>,
    mut sinks: Vec<Box<dyn Sink + '_>>,
    go_on: &mut dyn FnMut(&Summary) -> ControlFlow<()>,
) -> Result<(Summary, Option<Error>)> {
    let mut summary = Summary::default();
    let mut counts = Counts::default();
    let ended = drive(input, &mut tracking, &mut sinks, go_on, &mut summary, &mut counts);
    let started = Instant::now();
    let mut finish_error = None;
    for sink in sinks {
        // Every sink gets its chance, even if one before it fails.
        if let Err(e) = sink.finish() {
            finish_error.get_or_insert(e);
        }
    }
    summary.times.write += started.elapsed();
    counts.into_summary(&mut summary);
    match (ended, finish_error) {
        (Err(e), _) if e.kind() == crate::ErrorKind::Output => Err(e),
        (_, Some(e)) => Err(e),
        (ended, None) => Ok((summary, ended.err())),
    }
}

#[derive(Default)]
struct Counts {
    confirmed: BTreeSet<u64>,
    nis_sum: f64,
    nis_n: u64,
}

impl Counts {
    fn into_summary(self, summary: &mut Summary) {
        summary.confirmed_tracks = self.confirmed.len() as u64;
        summary.mean_nis = (self.nis_n > 0).then(|| (self.nis_sum / self.nis_n as f64, self.nis_n));
    }
}

fn drive(
    input: Input,
    tracking: &mut Option<Box<dyn Tracking>>,
    sinks: &mut [Box<dyn Sink + '_>],
    go_on: &mut dyn FnMut(&Summary) -> ControlFlow<()>,
    summary: &mut Summary,
    counts: &mut Counts,
) -> Result<()> {
    let mut first = None;
    let mut one = |frame: Option<&crate::Frame>, scan: &Scan, summary: &mut Summary| -> Result<ControlFlow<()>> {
        let started = Instant::now();
        let tracks = match tracking {
            Some(t) => t.step(scan)?,
            None => &[],
        };
        let tracked = Instant::now();
        summary.times.track += tracked - started;
        for sink in sinks.iter_mut() {
            sink.put(&View { frame, scan, tracks })?;
        }
        summary.times.write += tracked.elapsed();
        summary.frames += 1;
        summary.detections += scan.detections.len() as u64;
        summary.duration_s = scan.time.seconds_since(*first.get_or_insert(scan.time));
        let mut now = 0;
        for t in tracks.iter().filter(|t| t.status != TrackStatus::Tentative) {
            now += 1;
            counts.confirmed.insert(t.id.0);
            if let Some(i) = &t.innovation {
                counts.nis_sum += i.nis;
                counts.nis_n += 1;
            }
        }
        summary.most_at_once = summary.most_at_once.max(now);
        Ok(go_on(summary))
    };
    match input {
        Input::Scans(scans) => {
            for scan in &scans {
                if one(None, scan, summary)?.is_break() {
                    summary.interrupted = true;
                    break;
                }
            }
            Ok(())
        }
        Input::Frames(mut source, mut detector) => {
            let mut scan = Scan::default();
            let outcome = loop {
                let started = Instant::now();
                let frame = match source.next_frame() {
                    Ok(Some(frame)) => frame,
                    Ok(None) => break Ok(()),
                    Err(e) => break Err(e),
                };
                let read = Instant::now();
                summary.times.read += read - started;
                if let Err(e) = detector.detect(&frame, &mut scan) {
                    break Err(e);
                }
                summary.times.detect += read.elapsed();
                if source.warnings().len() > summary.warnings.len() {
                    summary.warnings = source.warnings().to_vec();
                }
                match one(Some(&frame), &scan, summary) {
                    Ok(ControlFlow::Continue(())) => source.recycle(frame),
                    Ok(ControlFlow::Break(())) => {
                        summary.interrupted = true;
                        break Ok(());
                    }
                    Err(e) => break Err(e),
                }
            };
            summary.warnings = source.warnings().to_vec();
            outcome
        }
    }
}
