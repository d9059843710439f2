//! What a camera did over a sequence of scans: where it came to, and how often its view was lost.
//!
//! Limits: a scan whose shift is unknown leaves the place as it is; if the background was followed before, it counts as a cut.

use crate::{CameraMotion, MotionBasis};
use nalgebra::Vector2;

/// What the camera did so far.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct CameraPath {
    /// Where the background's middle has come to in the image from where it was at first, px.
    pub place_px: Vector2<f64>,
    /// Variance of the newest step, px² per axis, mean over the image.
    pub step_variance_px2: f64,
    /// Sum of the variances that steps which were not measured but held have left for good, px² per axis, mean over the image.
    pub held_variance_px2: f64,
    /// Variance of the place at the newest of the steps that were held last, px²: it grows from one to the next.
    bridge_px2: f64,
    /// Times that a background which was followed for some scans was lost: another view, or a jerk.
    pub cuts: u32,
    followed: u32,
}

impl CameraPath {
    /// Variance of where the background lies now against where it lay at `start`, px² per axis, mean over the image.
    ///
    /// Measured steps are known against a key frame, so that only the errors of both ends count, and what was held in between is made up for. Where the key frame was not
    /// found again, another view has begun, and nothing is known of how far it lies from the last one.
    pub fn variance_since(&self, start: &Self) -> f64 {
        start.step_variance_px2 + self.step_variance_px2 + self.held_variance_px2 - start.held_variance_px2
    }

    /// Scans that a background must have been followed before its loss is a cut.
    const FOLLOWED: u32 = 10;

    /// Takes the next scan's motion in.
    pub fn step(&mut self, motion: Option<&CameraMotion>) {
        if let Some(m) = motion.filter(|m| m.is_finite()) {
            self.place_px += m.shift_px();
            // Mean of |p - centre|² over the image, whose half sides are the centre's coordinates, for one axis.
            let spread = m.centre_px.norm_squared() / 6.0;
            self.step_variance_px2 = 0.5 * (m.cov[(0, 0)] + m.cov[(1, 1)]) + spread * (m.cov[(2, 2)] + m.cov[(3, 3)]);
            match m.basis {
                MotionBasis::Held => self.bridge_px2 = self.step_variance_px2,
                // Another view: how far it lies from the last one nobody knows, anywhere in the image's size. A side's square over 12 is a half side's over 3, and that of one axis in the
                // mean is the spread.
                MotionBasis::Resumed | MotionBasis::Cut => {
                    self.held_variance_px2 += std::mem::take(&mut self.bridge_px2).max(spread)
                }
                MotionBasis::Measured => self.bridge_px2 = 0.0,
            }
        } else {
            // Nobody knows what came of it.
            self.held_variance_px2 += std::mem::take(&mut self.bridge_px2);
        }
        match motion.and_then(CameraMotion::measured_shift_px) {
            Some(_) => {
                self.followed = self.followed.saturating_add(1);
            }
            None => {
                self.cuts = self.cuts.saturating_add(u32::from(self.followed >= Self::FOLLOWED));
                self.followed = 0;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn step(path: &mut CameraPath, shift: Option<Vector2<f64>>) {
        path.step(shift.map(CameraMotion::exact_shift).as_ref());
    }

    #[test]
    fn what_was_held_is_made_up_for_where_the_key_frame_is_found_again_and_stays_where_it_is_not() {
        let motion = |basis, variance: f64| {
            let mut m = CameraMotion::exact_shift(Vector2::new(1.0, 0.0));
            (m.basis, m.cov[(0, 0)], m.cov[(1, 1)]) = (basis, variance, variance);
            m.centre_px = Vector2::new(160.0, 120.0);
            m
        };
        let variance_after = |last| {
            let mut path = CameraPath::default();
            let start = path;
            for m in [motion(MotionBasis::Held, 1.0), motion(MotionBasis::Held, 4.0), motion(MotionBasis::Held, 9.0)] {
                path.step(Some(&m));
            }
            assert_eq!(
                path.variance_since(&start),
                9.0,
                "the covariance of a held step is that of all since the last measured one"
            );
            path.step(Some(&motion(last, 0.25)));
            path.variance_since(&start)
        };
        assert_eq!(variance_after(MotionBasis::Measured), 0.25);
        // 320 x 240 px: a place anywhere in it has the variance (320² + 240²) / 24 an axis.
        assert!((variance_after(MotionBasis::Resumed) - (0.25 + 160_000.0 / 24.0)).abs() < 1e-9);
    }

    #[test]
    fn a_loss_is_a_cut_only_after_ten_scans_that_were_followed() {
        let mut path = CameraPath::default();
        (0..9).for_each(|_| step(&mut path, Some(Vector2::new(3.0, -4.0))));
        step(&mut path, None);
        assert_eq!((path.place_px, path.cuts), (Vector2::new(27.0, -36.0), 0));
        (0..10).for_each(|_| step(&mut path, Some(Vector2::zeros())));
        step(&mut path, Some(Vector2::new(f64::NAN, 0.0)));
        step(&mut path, None);
        assert_eq!((path.place_px.norm(), path.cuts), (45.0, 1), "what is not finite is unknown; a view is lost once");
    }
}
