//! Bad input and extremes: an error that changes nothing, or a sane track, in bounded time and memory.

use super::{detection, scan, trackers};
use boresight::{ErrorKind, FrameIndex, Scan, Timestamp, TrackState, TrackStatus, track};

/// Three targets on straight lines.
fn ordinary(k: u64) -> Scan {
    let t = k as f64;
    scan(k, &[(10.0 + t, 20.0), (60.0 - t, 40.0), (30.0, 80.0 + 0.5 * t)])
}

#[test]
fn a_scan_that_is_refused_changes_nothing() {
    let spoil: [fn(&mut Scan); 8] = [
        |s| s.detections[1].position.x = f64::NAN,
        |s| s.detections[0].position.y = f64::INFINITY,
        |s| s.detections[2].cov[(0, 0)] = f64::NAN,
        |s| s.detections[2].cov[(1, 1)] = f64::INFINITY,
        |s| s.detections[1].cov[(0, 0)] = -1.0,
        |s| s.detections[1].cov = nalgebra::Matrix2::new(1.0, 2.0, 2.0, 1.0),
        |s| s.detections[0].extent.width_px = f64::NAN,
        |s| s.time = Timestamp::from_ns(0),
    ];
    for config in trackers() {
        let (mut one, mut twin) = (track::build(&config).unwrap(), track::build(&config).unwrap());
        for k in 0..12 {
            if k >= 4 && (k - 4) < spoil.len() as u64 {
                let mut bad = ordinary(k);
                spoil[(k - 4) as usize](&mut bad);
                let error = one.step(&bad).unwrap_err();
                assert_eq!(error.kind(), ErrorKind::Damaged, "{error}");
                assert!(error.to_string().contains(&format!("frame {k}")), "{error}");
            }
            assert_eq!(one.step(&ordinary(k)).unwrap(), twin.step(&ordinary(k)).unwrap(), "scan {k}: {config:?}");
        }
    }
}

#[test]
fn a_gap_of_an_hour_ends_all_tracks_and_new_ones_start() {
    for config in trackers() {
        let mut tracker = track::build(&config).unwrap();
        let mut before: Vec<TrackState> = Vec::new();
        for k in 0..8 {
            before = tracker.step(&ordinary(k)).unwrap().to_vec();
        }
        assert!(before.len() >= 3);
        let last = before.iter().map(|s| s.id.0).max().unwrap();
        let mut after = Vec::new();
        for k in 90_000..90_008 {
            let mut late = ordinary(k % 8);
            late.index = FrameIndex(k);
            late.time = Timestamp::from_ns(k as i64 * 40_000_000);
            after = tracker.step(&late).unwrap().to_vec();
        }
        assert!(after.iter().all(|s| s.id.0 > last), "{config:?}");
        assert!(after.len() >= 3, "{config:?}");
    }
}

#[test]
fn a_hundred_thousand_detections_in_one_pixel_leave_bounded_and_sane_tracks() {
    // That the search is bounded is counted beside it (`track/step/gate.rs`); without bounds this would run for hours.
    for config in trackers().into_iter().map(|c| track::TrackerConfig { max_tracks: 2000, ..c }) {
        let mut tracker = track::build(&config).unwrap();
        for k in 0..4 {
            tracker.step(&ordinary(k)).unwrap();
        }
        for k in 4..6u64 {
            let points: Vec<_> = (0..100_000u32).map(|i| (10.0 + f64::from(i % 7) * 0.1, 20.0)).collect();
            let states = tracker.step(&scan(k, &points)).unwrap();
            assert!(states.len() <= 2000);
            assert!(states.iter().all(|s| s.kinematics.mean.iter().all(|v| v.is_finite())));
        }
    }
}

#[test]
fn targets_detected_twice_are_confirmed_at_most_twice_and_nothing_else_is() {
    for config in trackers() {
        let mut tracker = track::build(&config).unwrap();
        let mut confirmed: Vec<TrackState> = Vec::new();
        for k in 0..40 {
            let mut doubled = ordinary(k);
            doubled.detections.extend(doubled.detections.clone());
            let states = tracker.step(&doubled).unwrap();
            confirmed = states.iter().filter(|s| s.status != TrackStatus::Tentative).cloned().collect();
        }
        let mut n_near = 0;
        for d in &ordinary(39).detections {
            let near = |s: &&TrackState| {
                (s.kinematics.mean[0] - d.position.x).hypot(s.kinematics.mean[2] - d.position.y) < 1.0
            };
            let n = confirmed.iter().filter(near).count();
            n_near += n;
            // One detection for each of two tracks: a tracker cannot know that they are one target's.
            assert!((1..=2).contains(&n), "{n} tracks on one target: {config:?}");
        }
        assert_eq!(n_near, confirmed.len(), "tracks where nothing is: {config:?}");
    }
}

#[test]
fn far_positions_huge_covariances_and_empty_scans_are_ordinary() {
    for config in trackers() {
        let mut tracker = track::build(&config).unwrap();
        for k in 0..10u64 {
            let mut odd = ordinary(k);
            match k % 3 {
                0 => odd.detections.push(detection(1e12, -1e12)),
                1 => odd.detections[0].cov *= 1e12,
                _ => odd.detections.clear(),
            }
            // A covariance of zero is a perfect measurement.
            if let Some(d) = odd.detections.last_mut() {
                d.cov *= 0.0;
            }
            let states = tracker.step(&odd).unwrap();
            assert!(states.iter().all(|s| s.kinematics.mean.iter().all(|v| v.is_finite())), "{config:?}");
        }
    }
}

#[test]
fn the_same_scans_give_the_same_bits_whatever_else_runs() {
    // The tracker itself runs in one thread; what it is given must not depend on how many others run beside it.
    let run = || {
        let mut bits = Vec::new();
        for config in trackers() {
            let mut tracker = track::build(&config).unwrap();
            for k in 0..20 {
                let mut busy = ordinary(k);
                busy.detections.extend(
                    (0..20).map(|i| detection(((i * 37 + k * 11) % 90) as f64, ((i * 53 + k * 29) % 90) as f64)),
                );
                for s in tracker.step(&busy).unwrap() {
                    bits.push(s.id.0);
                    bits.extend(s.kinematics.mean.iter().chain(s.kinematics.cov.iter()).map(|v| v.to_bits()));
                }
            }
        }
        bits
    };
    let alone = run();
    let threads: Vec<_> = (0..2).map(|_| std::thread::spawn(run)).collect();
    for t in threads {
        assert!(t.join().unwrap() == alone);
    }
}
