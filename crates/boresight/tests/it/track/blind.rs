//! A detector that gathers frames and reports later: its silence is no miss, and the velocity that it measures starts a track.

use super::{detection, scan, trackers};
use boresight::{DetectedVelocity, Scan, track};
use nalgebra::{Matrix2, Vector2};

/// Scans from one report to the next.
const EVERY: u64 = 8;

/// A target of 12.5 px/s; between reports nothing could be detected.
fn gathered(k: u64) -> Scan {
    let x = 20.0 + 0.5 * k as f64;
    if k.is_multiple_of(EVERY) { scan(k, &[(x, 40.0)]) } else { scan(k, &[]).with_blind(true) }
}

#[test]
fn every_tracker_keeps_a_target_that_is_reported_now_and_then() {
    for config in trackers() {
        let mut tracker = track::build(&config).unwrap();
        let mut id = None;
        for k in 0..160 {
            let states = tracker.step(&gathered(k)).unwrap();
            if k < 8 * EVERY {
                continue;
            }
            assert_eq!(states.len(), 1, "scan {k}: {config:?}");
            let s = &states[0];
            assert_eq!(*id.get_or_insert(s.id), s.id, "scan {k}: {config:?}");
            let off = s.position() - Vector2::new(20.0 + 0.5 * k as f64, 40.0);
            assert!(off.norm() < 1.5, "scan {k}: {off} {config:?}");
        }
    }
}

#[test]
fn every_tracker_starts_with_the_velocity_that_comes_with_a_detection() {
    let velocity = DetectedVelocity {
        mean: Vector2::new(12.5, -30.0),
        cov: Matrix2::identity() * 0.04,
        with_position: Matrix2::identity() * 0.01,
    };
    for config in trackers() {
        let mut tracker = track::build(&config).unwrap();
        let mut first = scan(0, &[]);
        first.detections.push(detection(50.0, 60.0).with_velocity(Some(velocity)));
        tracker.step(&first).unwrap();
        // Seen where that velocity leads in one scan: MHT takes a target for one from the second scan on.
        let states = tracker.step(&scan(1, &[(50.5, 58.8)])).unwrap();
        assert_eq!(states.len(), 1, "{config:?}");
        let off = states[0].velocity() - velocity.mean;
        assert!(off.norm() < 0.01, "{off} {config:?}");
    }
}
