//! One run: frames -> detections -> tracks -> sinks, frame by frame, with the time each stage took.
//!
//! A frame that cannot be read ends the run; the sinks are finished first, so what was computed before is kept. A sink that cannot
//! be written is abandoned, and the others go on. A scan that the tracker refuses (a value that is not finite, a time that runs back)
//! costs itself: a warning counts such scans, and if they are most of them, the run counts as broken. A run that did not get one frame finishes no sink: what stood under their names
//! stays. The caller is asked after every frame whether to go on.
//!
//! Reading, detecting and the rest run on threads of their own, with short queues between them (`pipeline/scans.rs`), detecting on several where frames can be taken alone
//! (`pipeline/finders.rs`); the results are the same bytes for any number of threads.

mod finders;
mod held;
mod made;
mod outputs;
mod primed;
mod read_ahead;
mod retrospect;
mod scans;
mod summary;

use self::held::Held;
use self::outputs::{Counts, Outputs};
pub(crate) use self::primed::prime;
use self::retrospect::Retrospect;
use self::scans::Scans;
pub use self::summary::{StageTimes, Summary};
use crate::track::Tracking;
use crate::vision::Detector;
use crate::{Error, Frame, FrameSource, Pixels, PositionFit, Result, Scan, Sink, SourceInfo, Timestamp, View};
use std::num::NonZeroUsize;
use std::ops::ControlFlow;
use std::time::Instant;

/// Where scans come from: frames through a detector, or detections made elsewhere.
pub enum Input {
    /// Frames and what makes detections of them.
    Frames(Box<dyn FrameSource>, Box<dyn Detector>),
    /// Detections made before, in time order.
    Scans(Vec<Scan>),
    /// Detections made before, and a frame for each of them, to be drawn on. A frame is read when the tracks of its scan are given out, so that the tracks are
    /// those of the detections alone however many frames fit into memory.
    Pictured(Box<dyn FrameSource>, Vec<Scan>),
}

opaque_debug!(Input);

/// How a run ended.
#[derive(Debug)]
pub struct Outcome {
    /// What it gave.
    pub summary: Summary,
    /// What broke it off before the end of the input.
    pub broken: Option<Error>,
    /// Why outputs were abandoned; all others are whole.
    pub unwritten: Vec<Error>,
}

impl Outcome {
    /// The summary and what broke the run off, where every output must be whole.
    /// # Errors
    /// The first output's that was abandoned.
    pub fn all_written(self) -> Result<(Summary, Option<Error>)> {
        match self.unwritten.into_iter().next() {
            Some(e) => Err(e),
            None => Ok((self.summary, self.broken)),
        }
    }
}

/// Runs to the end of the input, or until `go_on` breaks, or until no output is left of several, on as many threads as the machine has.
///
/// `tracking` may be `None`: detections only.
pub fn run(
    input: Input,
    tracking: Option<Box<dyn Tracking>>,
    sinks: Vec<Box<dyn Sink + '_>>,
    go_on: &mut dyn FnMut(&Summary) -> ControlFlow<()>,
) -> Outcome {
    run_on(None, input, tracking, sinks, go_on)
}

/// As [`run`], with at most `n_threads` at work at once, or as many as the machine has (video is decoded and encoded on one more each).
pub fn run_on(
    n_threads: Option<NonZeroUsize>,
    input: Input,
    mut tracking: Option<Box<dyn Tracking>>,
    sinks: Vec<Box<dyn Sink + '_>>,
    go_on: &mut dyn FnMut(&Summary) -> ControlFlow<()>,
) -> Outcome {
    let n_threads = n_threads.or_else(|| std::thread::available_parallelism().ok()).map_or(1, usize::from);
    let mut summary = Summary::default();
    let mut counts = Counts::default();
    let mut outputs = Outputs { sinks, unwritten: Vec::new() };
    let held = Retrospect::new(
        tracking.as_ref().map_or(0.0, |t| t.retrospective_s()),
        tracking.as_ref().and_then(|t| t.backward()),
    );
    let run = Run {
        tracking: &mut tracking,
        outputs: &mut outputs,
        summary: &mut summary,
        counts: &mut counts,
        held,
        spare: Vec::new(),
        first: None,
    };
    let mut broken = drive(n_threads, input, run, go_on).err();
    if let Some((n, first)) = counts.refused.take() {
        if n > summary.frames {
            broken.get_or_insert(first);
        } else {
            let text = first.to_string();
            let why = text.lines().next().unwrap_or_default();
            summary.warnings.push(format!("{n} frames are left out, which the tracker refused, the first: {why}"));
        }
    }
    let started = Instant::now();
    let unwritten = outputs.end(summary.frames > 0);
    summary.times.write += started.elapsed();
    counts.into_summary(&mut summary);
    Outcome { summary, broken, unwritten }
}

fn drive(
    n_threads: usize,
    input: Input,
    mut run: Run<'_, '_>,
    go_on: &mut dyn FnMut(&Summary) -> ControlFlow<()>,
) -> Result<()> {
    // Whether there is more to be done.
    let mut asked = |summary: &mut Summary| {
        let answer = go_on(summary);
        summary.interrupted = answer.is_break();
        answer
    };
    match input {
        Input::Scans(scans) => {
            for scan in scans {
                run.track(None, 0, scan);
                if run.give_out(false, None).is_break() || asked(run.summary).is_break() {
                    break;
                }
            }
            let _ = run.give_out(true, None);
            Ok(())
        }
        Input::Pictured(mut pictures, scans) => {
            let mut scans = scans.into_iter();
            let outcome = loop {
                let Some(scan) = scans.next() else { break run.give_pictured(true, &mut *pictures).map(|_| ()) };
                run.track(None, 0, scan);
                match run.give_pictured(false, &mut *pictures) {
                    Ok(ControlFlow::Continue(())) => {}
                    Ok(ControlFlow::Break(())) => break Ok(()),
                    Err(e) => break Err(e),
                }
                if asked(run.summary).is_break() {
                    break run.give_pictured(true, &mut *pictures).map(|_| ());
                }
            };
            // What is left out is known at their end, which is one behind the last scan.
            let outcome =
                if run.summary.interrupted { outcome } else { outcome.and_then(|()| pictures.next_frame().map(drop)) };
            run.summary.warnings = pictures.warnings().to_vec();
            outcome
        }
        Input::Frames(source, mut detector) => {
            let info = source.info();
            let bytes = info.width.saturating_mul(info.height).saturating_mul(info.kind.bytes());
            let wants_frames = run.outputs.sinks.iter().any(|s| s.needs_frames());
            let source = primed::primed(source, &mut *detector);
            let mut scans = Scans::of(source, detector, n_threads);
            let outcome = loop {
                let made = match scans.next() {
                    Ok(Some(made)) => made,
                    Ok(None) => break Ok(()),
                    Err(e) => break Err(e),
                };
                run.summary.times.read += made.read;
                run.summary.times.detect += made.detect;
                if let Some(warnings) = &made.warnings {
                    run.summary.warnings.clone_from(warnings);
                }
                let frame = if wants_frames {
                    Some(made.frame)
                } else {
                    scans.recycle(made.frame, run.spare.pop().unwrap_or_default());
                    None
                };
                run.track(frame, bytes, made.scan);
                if run.give_out(false, Some(&mut scans)).is_break() || asked(run.summary).is_break() {
                    break Ok(());
                }
            };
            let _ = run.give_out(true, Some(&mut scans));
            if let Some(warnings) = scans.last_warnings() {
                run.summary.warnings = warnings;
            }
            outcome
        }
    }
}

/// What a run carries from scan to scan.
struct Run<'r, 's> {
    tracking: &'r mut Option<Box<dyn Tracking>>,
    outputs: &'r mut Outputs<'s>,
    summary: &'r mut Summary,
    counts: &'r mut Counts,
    held: Retrospect,
    /// Scans without their frames, to be used again.
    spare: Vec<Scan>,
    first: Option<Timestamp>,
}

impl Run<'_, '_> {
    /// Tracks one scan, whose frame takes so many bytes, and holds it back; one that the tracker refuses is left out.
    fn track(&mut self, frame: Option<Frame>, bytes: usize, scan: Scan) {
        let started = Instant::now();
        let mut tracks = self.held.memory();
        if let Some(tracking) = self.tracking {
            match tracking.step(&scan) {
                Ok(states) => tracks.extend_from_slice(states),
                Err(e) => {
                    self.counts.refused.get_or_insert((0, e)).0 += 1;
                    return;
                }
            }
        }
        let summary = &mut *self.summary;
        summary.times.track += started.elapsed();
        summary.frames += 1;
        summary.detections += scan.detections.len() as u64;
        for fit in scan.detections.iter().filter_map(|d| d.fit) {
            summary.fits[usize::from(fit == PositionFit::Centroid)] += 1;
        }
        summary.duration_s = scan.time.seconds_since(*self.first.get_or_insert(scan.time));
        self.held.push(frame, bytes, scan, tracks);
        if let Some(tracking) = self.tracking {
            self.held.confirm(tracking.renamed());
        }
    }

    /// Gives every sink a scan with its tracks; breaks when no sink is left.
    fn put(&mut self, frame: Option<&Frame>, held: &Held) -> ControlFlow<()> {
        let started = Instant::now();
        let written = self.outputs.put(&View { frame, scan: &held.scan, tracks: &held.tracks });
        self.summary.times.write += started.elapsed();
        self.counts.add(&held.tracks, self.summary);
        written
    }

    /// As [`Run::give_out`], each scan with its picture, which is read only now.
    fn give_pictured(&mut self, all: bool, pictures: &mut dyn FrameSource) -> Result<ControlFlow<()>> {
        while let Some(held) = self.held.pop(all) {
            let started = Instant::now();
            let frame = loop {
                match pictures.next_frame() {
                    // Of a scan that the tracker refused.
                    Ok(Some(frame)) if frame.index < held.scan.index => pictures.recycle(frame),
                    Ok(frame) => break frame.filter(|f| f.index == held.scan.index),
                    Err(e) => {
                        self.give_on_black(held, pictures.info());
                        return Err(e);
                    }
                }
            };
            self.summary.times.read += started.elapsed();
            let written = self.put(frame.as_ref(), &held);
            frame.into_iter().for_each(|f| pictures.recycle(f));
            self.held.recycle(held.tracks);
            if written.is_break() {
                return Ok(ControlFlow::Break(()));
            }
        }
        Ok(ControlFlow::Continue(()))
    }

    /// Gives every sink all that is held, `first` before the rest, on black: the pictures have broken off, what is tracked is kept.
    fn give_on_black(&mut self, first: Held, info: &SourceInfo) {
        let mut next = Some(first);
        while let Some(held) = next {
            let pixels = Pixels::black(info.kind, info.width, info.height);
            let frame = Frame { index: held.scan.index, time: held.scan.time, pixels };
            if self.put(Some(&frame), &held).is_break() {
                return;
            }
            next = self.held.pop(true);
        }
    }

    /// Gives every sink the scans that need not wait any longer, or all of them; breaks when no sink is left.
    fn give_out(&mut self, all: bool, mut scans: Option<&mut Scans>) -> ControlFlow<()> {
        while let Some(held) = self.held.pop(all) {
            let written = self.put(held.frame.as_ref(), &held);
            let Held { frame, scan, tracks, .. } = held;
            self.held.recycle(tracks);
            match (frame, &mut scans) {
                (Some(frame), Some(scans)) => scans.recycle(frame, scan),
                // Its frame went back at once, with a scan of these.
                (None, Some(_)) => self.spare.push(scan),
                (_, None) => {}
            }
            if written.is_break() {
                return ControlFlow::Break(());
            }
        }
        ControlFlow::Continue(())
    }
}

#[cfg(test)]
mod tests;
