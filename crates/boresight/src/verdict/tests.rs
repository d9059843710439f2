//! Tests of `verdict`.

use super::*;
use crate::vision::background::BackgroundConfig;
use crate::vision::isolated::IsolatedConfig;
use crate::{
    Detection, Extent, Frame, FrameIndex, Image, Pixels, Scan, Timestamp, TrackId, TrackInnovation, TrackState,
};
use boresight_filters::Gaussian;
use nalgebra::{Matrix2, SMatrix, SVector};

/// A run of 100 frames of 100 x 80 px at 10 a second: `tracks` tells (id, reported, side of the box in px, NIS) of each.
fn run(config: &Config, n_detections: usize, tracks: impl Fn(u64) -> Vec<(u64, bool, f64, f64)>) -> Verdict {
    let mut seen = Observed::of_frames(100, 80);
    let mut sink = seen.sink();
    let mut confirmed = std::collections::BTreeSet::new();
    let (mut most_at_once, mut nis_sum, mut nis_n) = (0, 0.0, 0);
    for k in 0..100 {
        let (index, time) = (FrameIndex(k), Timestamp::from_secs_f64(0.1 * k as f64));
        let frame = Frame { index, time, pixels: Pixels::Gray8(Image::filled(100, 80, 0)) };
        let d = Detection::at(Vector2::new(5.0, 5.0), Matrix2::identity());
        let scan = Scan::at(index, time).with_detections(vec![d; n_detections]);
        let reported: Vec<f64> = tracks(k).iter().filter(|t| t.1).map(|t| t.3).collect();
        most_at_once = most_at_once.max(reported.len() as u64);
        (nis_sum, nis_n) = (nis_sum + reported.iter().sum::<f64>(), nis_n + reported.len() as u64);
        confirmed.extend(tracks(k).iter().filter(|t| t.1).map(|t| t.0));
        let states: Vec<TrackState> = tracks(k)
            .into_iter()
            .map(|(id, reported, side, nis)| TrackState {
                id: TrackId(id),
                status: if reported { TrackStatus::Confirmed } else { TrackStatus::Tentative },
                kinematics: Gaussian { mean: SVector::zeros(), cov: SMatrix::identity() },
                extent: Extent::around(Vector2::new(50.0, 40.0), side, side),
                detection: Some(0),
                innovation: Some(TrackInnovation { innovation: Vector2::zeros(), cov: Matrix2::identity(), nis }),
                score: 1.0,
            })
            .collect();
        sink.put(&View { frame: Some(&frame), scan: &scan, tracks: &states }).unwrap();
    }
    let summary = Summary {
        frames: 100,
        duration_s: 9.9,
        detections: 100 * n_detections as u64,
        confirmed_tracks: confirmed.len() as u64,
        most_at_once,
        mean_nis: (nis_n > 0).then(|| (nis_sum / nis_n as f64, nis_n)),
        ..Summary::default()
    };
    seen.verdict(config, &summary)
}

fn isolated(report: Report) -> Config {
    let mut config = Config::default();
    config.detector.threshold = ThresholdConfig::Isolated(IsolatedConfig::default());
    config.tracker.report = report;
    config
}

#[test]
fn each_way_to_fail_is_told_with_what_to_try() {
    let doubted = |v: Verdict, word: &str, next: &str| {
        assert!(v.is_doubtful && v.sentence.contains(word), "{v:?}");
        assert_eq!(v.next.as_deref(), Some(next), "{v:?}");
        assert_eq!(v.is_to_be_looked_at, next.starts_with("--detector"), "{v:?}");
    };
    let [all, moving] = [Report::All, Report::Moving].map(isolated);
    doubted(run(&all, 0, |_| vec![]), "nothing was detected in 100 frames", "--detector cfar");
    doubted(run(&moving, 1, |_| vec![(1, false, 5.0, 2.0)]), "1 thing could be followed", "--set tracker.report=all");
    let fast = "--set tracker.max-speed-px-per-s=300";
    doubted(run(&moving, 3, |k| vec![(k, false, 5.0, 2.0)]), "of 3.00 detections a frame none", fast);
    doubted(run(&all, 1, |_| vec![(1, true, 60.0, 2.0)]), "cover more than 25 %", "--detector moving");
    doubted(run(&all, 1, |k| vec![(k / 5, true, 5.0, 2.0)]), "20 tracks of 0.40 s", "--detector moving");
    let in_pieces = |k| if k % 5 < 3 { vec![(k / 50, true, 5.0, 2.0)] } else { vec![] };
    doubted(run(&all, 1, in_pieces), "2 tracks in 20 pieces of 0.20 s", "--detector moving");
    let scale = "--set tracker.detection-covariance-scale=14.000 --set tracker.extra-noise-px=1.122";
    doubted(run(&all, 1, |_| vec![(1, true, 5.0, 28.0)]), "too small: mean NIS 28.00", scale);
    let scale = "--set tracker.detection-covariance-scale=0.250 --set tracker.extra-noise-px=0.150";
    doubted(run(&all, 1, |_| vec![(1, true, 5.0, 0.5)]), "too large", scale);
}

#[test]
fn a_background_is_not_known_from_a_run_that_is_hardly_longer_than_its_learning() {
    let background = |start_s: f64| {
        let mut config = Config::default();
        let moving = BackgroundConfig { start_s, ..BackgroundConfig::default() };
        config.detector.threshold = ThresholdConfig::Moving(moving);
        run(&config, 1, |_| vec![(1, true, 5.0, 1.9)])
    };
    // The run lasts 9.9 s.
    let short = background(5.0);
    assert!(short.is_doubtful && short.sentence.contains("but 9.9 s show little of the ground"), "{short:?}");
    assert_eq!(short.next.as_deref(), Some("--detector isolated"));
    assert!(!background(4.9).is_doubtful && !background(0.0).is_doubtful);
}

#[test]
fn what_the_statistics_believe_is_said_in_a_sentence() {
    let v = run(&isolated(Report::All), 1, |k| if k < 50 { vec![] } else { vec![(1, true, 5.0, 1.9)] });
    assert_eq!(
        v.sentence,
        "up to 1 target at once, one or more in 50 % of the frames, followed for 4.9 s in the mean; the covariances are right (mean NIS 1.90, 2 is honest)."
    );
    assert!(!v.is_doubtful && v.next.is_none());
}

#[test]
fn innovations_that_go_on_are_no_surprise_however_large() {
    let sentence = |innovation: &dyn Fn(usize) -> f64| {
        let mut seen = Observed::default();
        for k in 0..200 {
            let state = TrackState {
                id: TrackId(1),
                status: TrackStatus::Confirmed,
                kinematics: Gaussian { mean: SVector::zeros(), cov: SMatrix::identity() },
                extent: Extent::default(),
                detection: Some(0),
                innovation: Some(TrackInnovation {
                    innovation: Vector2::new(innovation(k), -innovation(k)),
                    cov: Matrix2::identity(),
                    nis: 2.0,
                }),
                score: 1.0,
            };
            let scan = Scan::at(FrameIndex(k as u64), Timestamp::from_secs_f64(0.1 * k as f64));
            seen.put(&View { frame: None, scan: &scan, tracks: &[state] });
        }
        let summary = Summary { frames: 200, detections: 200, mean_nis: Some((2.0, 200)), ..Summary::default() };
        seen.verdict(&isolated(Report::All), &summary).sentence
    };
    // Signs of a pair in turns: + + - - + + ..., of which half of the neighbours are alike; and of four, three quarters.
    let signs = |of: usize| move |k: usize| if (k / of).is_multiple_of(2) { 1.0 } else { -1.0 };
    assert!(sentence(&signs(2)).contains("the covariances are right (mean NIS 2.00"), "{}", sentence(&signs(2)));
    assert!(sentence(&signs(4)).contains("alike from frame to frame (correlation 0.5"), "{}", sentence(&signs(4)));
}

#[test]
fn what_is_kept_does_not_grow_with_the_run() {
    let mut seen = Observed::default();
    let state = |id| TrackState {
        id: TrackId(id),
        status: TrackStatus::Confirmed,
        kinematics: Gaussian { mean: SVector::zeros(), cov: SMatrix::identity() },
        extent: Extent::default(),
        detection: None,
        innovation: None,
        score: 1.0,
    };
    for k in 0..10_000 {
        seen.put(&View { frame: None, scan: &Scan::default(), tracks: &[state(k)] });
    }
    assert_eq!((seen.lives.len(), seen.ended), (1, 9999));
}

#[test]
fn detections_too_faint_to_start_a_track_are_named_as_the_cause() {
    // They score 1 each.
    let mut config = isolated(Report::All);
    config.tracker.min_initiation_score = 6.0;
    let v = run(&config, 3, |_| vec![]);
    assert!(v.is_doubtful && v.sentence.contains("0 % have the score of 6"), "{v:?}");
    assert_eq!(v.next.as_deref(), Some("--set tracker.min-initiation-score=1.0"));
    let mut scores = Scores::default();
    (1..=100).for_each(|k| scores.put(k as f32 * 0.1));
    assert!((scores.reached_by(0.75) / 2.5 - 1.0).abs() < 0.1, "{}", scores.reached_by(0.75));
    assert!((scores.share_from(5.0) - 0.5).abs() < 0.05, "{}", scores.share_from(5.0));
}

#[test]
fn what_comes_and_goes_in_the_middle_of_the_field_is_doubted_and_what_crosses_it_is_not() {
    // Twenty things a second of 3 s each, at rest or on their way from one border to the other.
    let said = |crosses: bool| {
        let mut seen = Observed::of_frames(200, 150);
        for k in 0..600_u64 {
            let (first, last) = ((k.saturating_sub(59)).div_ceil(10), k / 10);
            let tracks: Vec<TrackState> = (first..=last)
                .map(|id| {
                    let age = (k - 10 * id) as f64;
                    let x = if crosses { 1.0 + 3.3 * age } else { 100.0 };
                    let at = Vector2::new(x, 20.0 + (id % 12) as f64 * 10.0);
                    let mut mean = SVector::zeros();
                    (mean[0], mean[2]) = (at.x, at.y);
                    TrackState {
                        id: TrackId(id),
                        status: TrackStatus::Confirmed,
                        kinematics: Gaussian { mean, cov: SMatrix::identity() },
                        extent: Extent::around(at, 4.0, 4.0),
                        detection: Some(0),
                        innovation: None,
                        score: 1.0,
                    }
                })
                .collect();
            let scan = Scan::at(FrameIndex(k), Timestamp::from_secs_f64(0.05 * k as f64));
            seen.put(&View { frame: None, scan: &scan, tracks: &tracks });
        }
        let summary = Summary { frames: 600, duration_s: 30.0, detections: 3600, ..Summary::default() };
        seen.verdict(&isolated(Report::All), &summary)
    };
    let glitter = said(false);
    assert!(glitter.is_doubtful && glitter.sentence.contains("in the middle of the field"), "{glitter:?}");
    assert_eq!(glitter.next.as_deref(), Some("--detector moving"));
    assert!(!said(true).is_doubtful, "{:?}", said(true));
}
