//! Errors of measurements that last: what they leave in a track is added to the covariance that is stated of it.
//!
//! Source: S. R. Rogers, *IEEE Trans. AES* 23(4), 1987 (a tracking filter with correlated measurement noise); S. F. Schmidt, *Advances in Control Systems* 3, 1966 (what is not estimated is considered in
//! the covariance). A filter takes the errors of its measurements for independent from scan to scan. Those of a codec, which carries a displaced picture of a target on from frame to frame, are not:
//! the mean of n of them is not √n times surer than one, and no innovation shows it.
//! Departures: one number for the position of a track that has been followed for a while, instead of a cross covariance carried in each filter: gains, gates and innovations stay as they are.
//! [`crate::auto`] learns it from the likelihood of a first pass; the velocity needs none, for such errors make it learn a larger q.
//! Symbols: e standard deviation per axis, px (`tracker.correlated-error-px`).
//! Limits: a track of some scans, whose own variance holds most of such an error already, is stated too wide by no more than it.

use boresight_filters::Gaussian;
use nalgebra::Matrix4;

/// Adds it to the covariance of `[x, vx, y, vy]` (px, px/s).
#[inline]
pub(in crate::track) fn add_to(belief: &mut Gaussian<4>, error_px: f64) {
    belief.cov[(0, 0)] += error_px * error_px;
    belief.cov[(2, 2)] += error_px * error_px;
}

/// Takes it out of all rows of a track, and returns whether they hold it: those of a table that was made without stay as they are.
pub(in crate::track) fn take_from(beliefs: &mut [Gaussian<4>], error_px: f64) -> bool {
    let without = |b: &Gaussian<4>| {
        let e2 = error_px * error_px;
        b.cov - Matrix4::from_diagonal(&[e2, 0.0, e2, 0.0].into())
    };
    let held = error_px > 0.0 && beliefs.iter().all(|b| without(b).cholesky().is_some());
    if held {
        beliefs.iter_mut().for_each(|b| b.cov = without(b));
    }
    held
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::track::smooth::{SmoothConfig, smooth_track};
    use crate::track::{TrackerConfig, build};
    use crate::{Detection, FrameIndex, Scan, Timestamp, TrackState};

    /// The states of a target that goes straight, known to 0.2 px, with that error in the configuration.
    fn states(correlated_error_px: f64) -> (Vec<Timestamp>, Vec<TrackState>) {
        let config = TrackerConfig { correlated_error_px, extra_noise_px: 0.0, ..TrackerConfig::default() };
        let mut tracker = build(&config).unwrap();
        let scan = |k: u64| {
            let wobble = 0.2 * f64::from((k * 7 % 5) as u8) - 0.4;
            let d = Detection::at([10.0 + k as f64, 20.0 + wobble].into(), nalgebra::Matrix2::identity() * 0.04);
            let time = Timestamp::from_secs_f64(k as f64 * 0.04);
            Scan { detections: vec![d], ..Scan::at(FrameIndex(k), time) }
        };
        let step = |k| {
            let scan = scan(k);
            Some((scan.time, tracker.step(&scan).unwrap().first()?.clone()))
        };
        (0..40).filter_map(step).unzip()
    }

    #[test]
    fn positions_innovations_and_gates_stay_and_covariances_are_wider_by_it() {
        let ((_, plain), (_, wide)) = (states(0.0), states(0.3));
        assert!(plain.len() > 30 && plain.len() == wide.len());
        for (p, w) in plain.iter().zip(&wide) {
            assert_eq!((p.kinematics.mean, p.innovation, p.status), (w.kinematics.mean, w.innovation, w.status));
            let more = w.kinematics.cov - p.kinematics.cov;
            let expected = Matrix4::from_diagonal(&[0.09, 0.0, 0.09, 0.0].into());
            assert!((more - expected).abs().max() < 1e-12, "{more}");
        }
    }

    #[test]
    fn rows_are_smoothed_as_without_it_and_hold_it_again() {
        let config = |correlated_error_px| SmoothConfig { correlated_error_px, ..SmoothConfig::default() };
        let smoothed = |of: f64, config| {
            let (times, states) = states(of);
            let mut beliefs: Vec<_> = states.iter().map(|s| s.kinematics).collect();
            smooth_track(&times, &mut beliefs, &config).unwrap();
            beliefs
        };
        let (plain, wide) = (smoothed(0.0, config(0.0)), smoothed(0.3, config(0.3)));
        for (p, w) in plain.iter().zip(&wide) {
            assert!((p.mean - w.mean).abs().max() < 1e-9, "{} {}", p.mean, w.mean);
            assert!((w.cov[(0, 0)] - p.cov[(0, 0)] - 0.09).abs() < 1e-9);
        }
        // A table that was made without, surer than that: nothing is taken out, and nothing added.
        let without = smoothed(0.0, config(0.3));
        assert_eq!(without, plain);
    }
}
