//! Runs with outputs that fail, scans that are refused, pictures that break off.

use super::*;
use crate::{Detection, ErrorKind, FrameIndex};
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
    let sinks = fails_at
        .iter()
        .zip('a'..)
        .map(|(&fails_at, name)| Box::new(Faulty { name, fails_at, seen: 0, log: Arc::clone(&log) }) as Box<dyn Sink>);
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
    let run_with = |wild: &[u64]| {
        let scan = |k: u64| {
            let x = if wild.contains(&k) { 1e308 } else { k as f64 };
            Scan::at(FrameIndex(k), Timestamp::from_ns(k as i64 * 40_000_000)).with_detections(vec![at(x)])
        };
        let tracking = crate::track::build(&crate::Config::default().tracker).unwrap();
        run(Input::Scans((0..9).map(scan).collect()), Some(tracking), Vec::new(), &mut |_| ControlFlow::Continue(()))
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

/// Pictures of which the one with this index cannot be read.
struct Damaged {
    info: SourceInfo,
    next: u64,
    damaged: u64,
}

impl FrameSource for Damaged {
    fn info(&self) -> &SourceInfo {
        &self.info
    }

    fn next_frame(&mut self) -> Result<Option<Frame>> {
        if self.next == self.damaged {
            return Err(Error::new(ErrorKind::Damaged, "a picture of noise").at("picture"));
        }
        self.next += 1;
        let pixels = crate::Pixels::Gray8(crate::Image::filled(8, 4, 7));
        Ok(Some(Frame { index: FrameIndex(self.next - 1), time: Timestamp::default(), pixels }))
    }

    fn warnings(&self) -> &[String] {
        &[]
    }
}

/// Writes down the frame and the grey level of each view, and whether it was finished.
struct Levels(Arc<Mutex<Vec<(u64, u8)>>>);

impl Sink for Levels {
    fn put(&mut self, view: &View<'_>) -> Result<()> {
        let frame = view.frame.expect("every view has a picture");
        let crate::Pixels::Gray8(image) = &frame.pixels else { panic!("another kind of pixels") };
        assert_eq!((frame.index, image.width(), image.height()), (view.scan.index, 8, 4));
        self.0.lock().unwrap().push((frame.index.0, image.as_slice()[0]));
        Ok(())
    }

    fn finish(self: Box<Self>) -> Result<()> {
        self.0.lock().unwrap().push((u64::MAX, 0));
        Ok(())
    }
}

#[test]
fn a_picture_that_cannot_be_read_loses_no_scan_that_was_tracked_before() {
    let levels = Arc::new(Mutex::new(Vec::new()));
    let mut config = crate::Config::default().tracker;
    config.retrospective_s = 0.4;
    config.confirmation = crate::track::ConfirmationConfig::Existence(Default::default());
    let scan = |k: u64| {
        let at = Detection::at(nalgebra::Vector2::new(k as f64 / 4.0, 2.0), nalgebra::Matrix2::identity() * 0.1);
        Scan::at(FrameIndex(k), Timestamp::from_ns(k as i64 * 40_000_000)).with_detections(vec![at])
    };
    let info = SourceInfo {
        label: "pictures".to_string(),
        reader: "test".to_string(),
        width: 8,
        height: 4,
        kind: crate::PixelKind::Gray8,
        n_frames: Some(60),
        rate_hz: None,
        true_times: false,
    };
    let pictures = Damaged { info, next: 0, damaged: 5 };
    let input = Input::Pictured(Box::new(pictures), (0..60).map(scan).collect());
    let tracking = Some(crate::track::build(&config).unwrap());
    let outcome = run(input, tracking, vec![Box::new(Levels(Arc::clone(&levels)))], &mut |_| ControlFlow::Continue(()));
    assert!(outcome.broken.is_some_and(|e| e.to_string().contains("a picture of noise")));
    // Scan 5 is given out when it has waited for 0.4 s: those of up to 0.6 s are tracked by then.
    let n = outcome.summary.frames;
    assert_eq!(n, 16);
    let mut want: Vec<(u64, u8)> = (0..n).map(|k| (k, if k < 5 { 7 } else { 0 })).collect();
    want.push((u64::MAX, 0));
    assert_eq!(*levels.lock().unwrap(), want);
}
