//! Whose a new track is: hidden, turned, stopped and stepped targets.

use super::{Field, Stay, log_ratio};
use crate::track::{ReidentificationConfig, Report, Tracker, TrackerConfig, Tracking};
use crate::{Detection, Extent, FrameIndex, Scan, Timestamp, TrackStatus};
use boresight_filters::Gaussian;
use nalgebra::{Matrix2, Matrix4, Vector2, Vector4};

fn config(max_gap_s: f64) -> TrackerConfig {
    TrackerConfig {
        reidentification: ReidentificationConfig { max_gap_s },
        field_px: Some([640.0, 512.0]),
        ..TrackerConfig::default()
    }
}

/// The ids of confirmed tracks in the last of `n` scans, 25 a second, of things at these x (px) at a time (s).
fn last_ids(config: &TrackerConfig, n: u64, x: impl Fn(f64) -> Vec<f64>) -> Vec<u64> {
    let mut tracker = Tracker::new(config).unwrap();
    let mut seen = Vec::new();
    for k in 0..n {
        let t = k as f64 * 0.04;
        let detection = |x: f64| {
            let at = Vector2::new(x, 200.0);
            Detection::at(at, Matrix2::identity() * 0.1).with_extent(Extent::around(at, 5.0, 5.0))
        };
        let all = x(t).into_iter().map(detection).collect();
        let scan = Scan::at(FrameIndex(k), Timestamp::from_secs_f64(t)).with_detections(all);
        seen = tracker.step(&scan).unwrap().to_vec();
    }
    seen.iter().filter(|s| s.status == TrackStatus::Confirmed).map(|s| s.id.0).collect()
}

/// Of a target that flies at 30 px/s, hidden between two times, and comes back displaced.
fn ids(hidden_s: [f64; 2], displaced_px: f64, max_gap_s: f64) -> Vec<u64> {
    last_ids(&config(max_gap_s), 150, |t| {
        let x = 100.0 + 30.0 * t + if t >= hidden_s[1] { displaced_px } else { 0.0 };
        if t > hidden_s[0] && t < hidden_s[1] { vec![] } else { vec![x] }
    })
}

#[test]
fn a_target_that_turns_back_out_of_sight_keeps_its_id_and_another_place_does_not() {
    // Seen to x = 160 px at 2 s at 30 px/s, then from 0.6 s later on flying back at 30 px/s from where it would have been after 0.3 s.
    let back = |from_px: f64| {
        last_ids(&config(2.0), 120, |t| match t {
            t if t <= 2.0 => vec![100.0 + 30.0 * t],
            t if t < 2.6 => vec![],
            t => vec![from_px - 30.0 * (t - 2.6)],
        })
    };
    assert_eq!(back(160.0), [1], "it turned at 169 px");
    assert_eq!(back(350.0), [2], "nothing of 30 px/s gets there");
}

#[test]
fn a_target_that_stops_at_once_keeps_its_id_and_is_still_reported() {
    // 120 px/s, then at rest within a frame: the old track runs on, and what rests would be scenery.
    let last = |max_gap_s: f64| {
        let config =
            TrackerConfig { report: Report::Moving, acceleration_density_px2_per_s3: 1.0, ..config(max_gap_s) };
        last_ids(&config, 120, |t| vec![100.0 + 120.0 * t.min(2.0)])
    };
    assert_eq!(last(2.0), [1]);
    assert!(last(0.0).is_empty(), "switched off: nothing has moved since");
}

#[test]
fn a_track_that_begins_beside_one_and_takes_its_detections_in_turns_is_the_same_target() {
    // It jumps by 6 px for good. Two detections in one scan are two targets; one now for this, now for that track is one.
    let ids = |both: bool| {
        last_ids(&config(2.0), 80, |t| {
            let x = 100.0 + 10.0 * t;
            if t < 1.6 - 1e-9 { vec![x] } else { [x + 6.0, x][..1 + usize::from(both)].to_vec() }
        })
    };
    assert_eq!(ids(false), [1]);
    assert_eq!(ids(true), [1, 2]);
}

#[test]
fn a_target_hidden_for_a_second_keeps_its_id() {
    assert_eq!(ids([2.0, 3.2], 0.0, 2.0), [1]);
    assert_eq!(ids([2.0, 3.2], 0.0, 0.0), [2], "switched off");
    assert_eq!(ids([2.0, 4.5], 0.0, 2.0), [2], "too long");
    assert_eq!(ids([2.0, 4.5], 0.0, 3600.0), [1], "it is where it must be");
    assert_eq!(ids([2.0, 4.5], 180.0, 3600.0), [2], "it cannot be there");
}

#[test]
fn after_long_what_is_only_as_slow_is_another_target() {
    // Seen at rest for two seconds; half a minute later something as slow is far from there.
    let ids = |away_px: f64| {
        let config = TrackerConfig { acceleration_density_px2_per_s3: 0.01, ..config(3600.0) };
        last_ids(&config, 875, |t| match t {
            t if t <= 2.0 => vec![100.0 + t],
            t if t < 32.0 => vec![],
            t => vec![100.0 + away_px + t],
        })
    };
    assert_eq!(ids(2.0), [1]);
    assert_eq!(ids(400.0), [2]);
}

#[test]
fn a_track_that_jumps_is_one_target_as_far_as_its_covariance_reaches_and_replaces_the_one_that_coasts() {
    // The jump is out of the gate: a new track begins while the old one coasts.
    assert_eq!(ids([2.0, 2.04], 2.5, 2.0), [1]);
    assert_eq!(ids([2.0, 2.04], 2.5, 0.0), [2], "switched off: it was out of the gate");
    assert_eq!(ids([2.0, 2.04], 250.0, 2.0), [2]);
}

#[test]
fn whose_a_track_is_does_not_depend_on_the_unit_of_length() {
    // Slow beside the largest speed, so that what is alike to the one before counts; all lengths in units of 1/`scale` px.
    let ratio = |scale: f64| {
        let belief = |mean: [f64; 4]| {
            let cov = Matrix4::from_diagonal(&Vector4::new(1.0, 0.01, 1.0, 0.02)) * (scale * scale);
            Gaussian { mean: Vector4::from(mean) * scale, cov }
        };
        let stay = Stay { survival_per_s: 0.9, new_per_s: None };
        let field = Field::new(Some([640.0 * scale, 512.0 * scale]), 30.0 * scale, stay, [2, 1]);
        let (before, now) = (belief([100.0, 0.1, 50.0, 0.0]), belief([101.0, 0.0, 50.5, 0.1]));
        log_ratio((&before, 10.0 * scale), (&now, 11.0 * scale), 1.5, &field).unwrap()
    };
    let off = [1e-3, 0.5, 1e3].map(|scale| (ratio(scale) - ratio(1.0)).abs());
    assert!(off.iter().all(|o| *o < 1e-9), "{off:?}");
}
