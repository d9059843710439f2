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
mod made;
mod primed;
mod read_ahead;
mod scans;

pub(crate) use self::primed::prime;
use self::scans::Scans;
use crate::track::Tracking;
use crate::vision::Detector;
use crate::{Error, FrameSource, PositionFit, Result, Scan, Sink, TrackStatus, View};
use std::collections::BTreeSet;
use std::num::NonZeroUsize;
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
    /// Frame to detections, of all threads together.
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
    /// Of these, how many have the position of a fitted spot, and how many fell back to the centroid, where a fit was asked for.
    pub fits: [u64; 2],
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
    let mut broken = drive(n_threads, input, &mut tracking, &mut outputs, go_on, &mut summary, &mut counts).err();
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

/// The sinks that can still be written, and why others could not.
struct Outputs<'s> {
    sinks: Vec<Box<dyn Sink + 's>>,
    unwritten: Vec<Error>,
}

impl Outputs<'_> {
    /// Shows a view to every sink; one that fails is dropped unfinished. Breaks when the last one is gone.
    fn put(&mut self, view: &View<'_>) -> ControlFlow<()> {
        let before = self.sinks.len();
        self.sinks.retain_mut(|sink| match sink.put(view) {
            Ok(()) => true,
            Err(e) => {
                self.unwritten.push(e);
                false
            }
        });
        if before > 0 && self.sinks.is_empty() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    }

    /// Finishes the sinks, each whatever became of the others; or drops them.
    fn end(mut self, finish: bool) -> Vec<Error> {
        if finish {
            self.unwritten.extend(self.sinks.into_iter().filter_map(|sink| sink.finish().err()));
        }
        self.unwritten
    }
}

#[derive(Default)]
struct Counts {
    confirmed: BTreeSet<u64>,
    nis_sum: f64,
    nis_n: u64,
    /// Scans that the tracker refused, and why the first.
    refused: Option<(u64, Error)>,
}

impl Counts {
    fn into_summary(self, summary: &mut Summary) {
        summary.confirmed_tracks = self.confirmed.len() as u64;
        summary.mean_nis = (self.nis_n > 0).then(|| (self.nis_sum / self.nis_n as f64, self.nis_n));
    }
}

/// What comes after a frame.
#[derive(PartialEq)]
enum Next {
    GoOn,
    /// The caller has enough.
    Stop,
    /// Nothing that is computed would be kept.
    NoOutput,
}

fn drive(
    n_threads: usize,
    input: Input,
    tracking: &mut Option<Box<dyn Tracking>>,
    outputs: &mut Outputs<'_>,
    go_on: &mut dyn FnMut(&Summary) -> ControlFlow<()>,
    summary: &mut Summary,
    counts: &mut Counts,
) -> Result<()> {
    let mut first = None;
    let mut one = |frame: Option<&crate::Frame>, scan: &Scan, summary: &mut Summary| -> Result<Next> {
        let started = Instant::now();
        let tracks = match tracking {
            Some(t) => match t.step(scan) {
                Ok(tracks) => tracks,
                Err(e) => {
                    counts.refused.get_or_insert((0, e)).0 += 1;
                    return Ok(if go_on(summary).is_break() { Next::Stop } else { Next::GoOn });
                }
            },
            None => &[],
        };
        let tracked = Instant::now();
        summary.times.track += tracked - started;
        let written = outputs.put(&View { frame, scan, tracks });
        summary.times.write += tracked.elapsed();
        summary.frames += 1;
        summary.detections += scan.detections.len() as u64;
        for fit in scan.detections.iter().filter_map(|d| d.fit) {
            summary.fits[usize::from(fit == PositionFit::Centroid)] += 1;
        }
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
        if written.is_break() {
            return Ok(Next::NoOutput);
        }
        Ok(if go_on(summary).is_break() { Next::Stop } else { Next::GoOn })
    };
    match input {
        Input::Scans(scans) => {
            for scan in &scans {
                match one(None, scan, summary)? {
                    Next::GoOn => {}
                    next => {
                        summary.interrupted = next == Next::Stop;
                        break;
                    }
                }
            }
            Ok(())
        }
        Input::Frames(source, mut detector) => {
            let source = primed::primed(source, &mut *detector);
            let mut scans = Scans::of(source, detector, n_threads);
            let outcome = loop {
                let made = match scans.next() {
                    Ok(Some(made)) => made,
                    Ok(None) => break Ok(()),
                    Err(e) => break Err(e),
                };
                summary.times.read += made.read;
                summary.times.detect += made.detect;
                if let Some(warnings) = &made.warnings {
                    summary.warnings.clone_from(warnings);
                }
                match one(Some(&made.frame), &made.scan, summary) {
                    Ok(Next::GoOn) => scans.recycle(made),
                    Ok(next) => {
                        summary.interrupted = next == Next::Stop;
                        break Ok(());
                    }
                    Err(e) => break Err(e),
                }
            };
            if let Some(warnings) = scans.last_warnings() {
                summary.warnings = warnings;
            }
            outcome
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Detection, ErrorKind, FrameIndex, Timestamp};
    use std::sync::{Arc, Mutex};

    /// A sink that fails at its `fails_at`th view (at `finish`: one behind the last), and writes down what it is asked.
    struct Faulty {
        name: char,
        fails_at: u64,
        seen: u64,
        log: Arc<Mutex<String>>,
    }

    impl Faulty {
        fn outcome(&mut self) -> Result<()> {
            self.seen += 1;
            if self.seen > self.fails_at {
                return Err(Error::new(ErrorKind::Output, "full").at(self.name));
            }
            Ok(())
        }
    }

    impl Sink for Faulty {
        fn put(&mut self, _: &View<'_>) -> Result<()> {
            self.log.lock().unwrap().push(self.name);
            self.outcome()
        }
        fn finish(mut self: Box<Self>) -> Result<()> {
            self.log.lock().unwrap().push(self.name.to_ascii_uppercase());
            self.outcome()
        }
    }

    /// A run of `n` scans with sinks `a`, `b`, .. that fail as said; the outcome and what the sinks were asked.
    fn run_with(n: u64, fails_at: &[u64]) -> (Outcome, String) {
        let log = Arc::new(Mutex::new(String::new()));
        let sinks = fails_at.iter().zip('a'..).map(|(&fails_at, name)| {
            Box::new(Faulty { name, fails_at, seen: 0, log: Arc::clone(&log) }) as Box<dyn Sink>
        });
        let scans = (0..n).map(|k| Scan::at(FrameIndex(k), Timestamp::from_ns(k as i64)));
        let outcome = run(Input::Scans(scans.collect()), None, sinks.collect(), &mut |_| ControlFlow::Continue(()));
        let asked = log.lock().unwrap().clone();
        (outcome, asked)
    }

    #[test]
    fn a_sink_that_fails_is_abandoned_and_the_others_are_finished() {
        let (outcome, asked) = run_with(3, &[1, 9, 3]);
        assert_eq!(asked, "abcabcbcBC", "a fails at its second view and is never finished; c fails at the end");
        let said: Vec<String> = outcome.unwritten.iter().map(ToString::to_string).collect();
        assert_eq!((said, outcome.summary.frames), (vec!["a: full".to_string(), "c: full".into()], 3));
        assert!(outcome.all_written().is_err());
    }

    #[test]
    fn a_run_ends_with_its_last_output() {
        let (outcome, asked) = run_with(9, &[2, 1]);
        assert_eq!(asked, "ababa", "nothing is computed for nobody");
        assert!(!outcome.summary.interrupted && outcome.broken.is_none() && outcome.unwritten.len() == 2);
    }

    #[test]
    fn a_run_without_frames_finishes_nothing() {
        let (outcome, asked) = run_with(0, &[9, 9]);
        assert!(asked.is_empty() && outcome.unwritten.is_empty() && outcome.summary.frames == 0);
    }

    #[test]
    fn a_scan_that_the_tracker_refuses_costs_itself() {
        let at = |x: f64| Detection::at(nalgebra::Vector2::new(x, 5.0), nalgebra::Matrix2::identity());
        let run_with =
            |wild: &[u64]| {
                let scan = |k: u64| {
                    let x = if wild.contains(&k) { 1e308 } else { k as f64 };
                    Scan::at(FrameIndex(k), Timestamp::from_ns(k as i64 * 40_000_000)).with_detections(vec![at(x)])
                };
                let tracking = crate::track::build(&crate::Config::default().tracker).unwrap();
                run(Input::Scans((0..9).map(scan).collect()), Some(tracking), Vec::new(), &mut |_| {
                    ControlFlow::Continue(())
                })
            };
        let one = run_with(&[4]);
        assert!(one.broken.is_none() && one.summary.frames == 8);
        assert!(one.summary.warnings[0].starts_with("1 frames are left out"), "{:?}", one.summary.warnings);
        let most = run_with(&[1, 2, 3, 5, 6]);
        assert!(most.broken.is_some() && most.summary.frames == 4);
    }

    #[test]
    fn a_run_without_sinks_runs_to_its_end() {
        assert_eq!(run_with(4, &[]).0.summary.frames, 4);
    }
}
