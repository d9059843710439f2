//! Every tracker on random scans: sane tracks, each detection given away once, the order of detections without meaning.

use super::{scan, trackers};
use boresight::{TrackState, TrackStatus, track};
use proptest::prelude::*;
use std::collections::BTreeSet;

/// Scans of points in a small field, some of them twice at the same place.
fn scans() -> impl Strategy<Value = Vec<Vec<(f64, f64)>>> {
    let point = (0u32..160, 0u32..160).prop_map(|(x, y)| (f64::from(x) * 0.5, f64::from(y) * 0.5));
    prop::collection::vec(prop::collection::vec(point, 0..12), 1..14)
}

fn sane(states: &[TrackState], n_detections: usize) -> Result<(), TestCaseError> {
    let mut ids = BTreeSet::new();
    for s in states {
        prop_assert!(ids.insert(s.id), "id {} twice in a scan", s.id.0);
        prop_assert!(s.kinematics.mean.iter().chain(s.kinematics.cov.iter()).all(|v| v.is_finite()));
        prop_assert!(s.kinematics.cov.diagonal().iter().all(|v| *v > 0.0));
        prop_assert!(s.detection.is_none_or(|d| (d as usize) < n_detections));
        prop_assert!((0.0..=1.0).contains(&s.score));
    }
    Ok(())
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(40))]

    #[test]
    fn tracks_stay_sane_and_hard_trackers_give_each_detection_away_once(scans in scans()) {
        for (mut config, may_come_back) in trackers().into_iter().flat_map(|c| [(c.clone(), false), (c, true)]) {
            // A lost target that is found again has its number again.
            if !may_come_back {
                config.reidentification.max_gap_s = 0.0;
            }
            let hard = config.mht.is_some() || (!config.associator.is_soft() && !config.merged_measurements.enabled);
            let mut tracker = track::build(&config).unwrap();
            let (mut newest, mut gone) = (0u64, BTreeSet::<u64>::new());
            let mut before = BTreeSet::<u64>::new();
            for (k, points) in scans.iter().enumerate() {
                let states = tracker.step(&scan(k as u64, points)).unwrap();
                sane(states, points.len())?;
                let now: BTreeSet<u64> = states.iter().map(|s| s.id.0).collect();
                for id in &now {
                    prop_assert!(!gone.contains(id) || may_come_back || config.mht.is_some(), "id {} came back", id);
                    prop_assert!(before.contains(id) || *id > newest || gone.contains(id) || config.mht.is_some(), "id {} is not new", id);
                }
                newest = newest.max(now.last().copied().unwrap_or(0));
                gone.extend(before.difference(&now));
                before = now;
                if hard {
                    let taken: Vec<u32> = states.iter().filter_map(|s| s.detection).collect();
                    prop_assert_eq!(taken.iter().collect::<BTreeSet<_>>().len(), taken.len(), "{:?}", config);
                }
            }
        }
    }

    #[test]
    fn the_order_of_the_detections_means_nothing(
        targets in prop::collection::vec((0.0..60.0f64, 0.0..60.0f64, -20.0..20.0f64, -20.0..20.0f64), 1..6),
        others in prop::collection::vec((0.0..60.0f64, 0.0..60.0f64), 0..10),
        seed in any::<usize>(),
    ) {
        for config in trackers() {
            let (mut one, mut other) = (track::build(&config).unwrap(), track::build(&config).unwrap());
            let at = |t: &(f64, f64, f64, f64), k: u64| (t.0 + t.2 * 0.04 * k as f64, t.1 + t.3 * 0.04 * k as f64);
            for k in 0..6 {
                let points: Vec<_> = targets.iter().map(|t| at(t, k)).collect();
                let a = one.step(&scan(k, &points)).unwrap().to_vec();
                prop_assert_eq!(a, other.step(&scan(k, &points)).unwrap().to_vec());
            }
            let mut points: Vec<_> = targets.iter().map(|t| at(t, 6)).chain(others.iter().copied()).collect();
            let before = scan(6, &points);
            let n = points.len();
            points.rotate_left(seed % n);
            points.reverse();
            let place = |j: u32| (2 * n - 1 - j as usize + seed % n) % n;
            // New tracks are numbered in the order of the detections: only those that stood before are compared.
            let known = |states: &[TrackState]| -> Vec<TrackState> {
                states.iter().filter(|s| s.status != TrackStatus::Tentative).cloned().collect()
            };
            let a = known(one.step(&before).unwrap());
            let b = known(other.step(&scan(6, &points)).unwrap());
            prop_assert_eq!(a.len(), b.len());
            for (a, b) in a.iter().zip(&b) {
                prop_assert_eq!(a.id, b.id);
                let same = (a.kinematics.mean - b.kinematics.mean).amax() < 1e-6
                    && (a.kinematics.cov - b.kinematics.cov).amax() < 1e-6 * (1.0 + a.kinematics.cov.amax());
                prop_assert!(same, "{:?}:\n{:?}\n{:?}", config, a, b);
                prop_assert_eq!(a.detection.map(|j| j as usize), b.detection.map(place), "{:?}", config);
            }
        }
    }
}
