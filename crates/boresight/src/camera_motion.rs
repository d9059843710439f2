//! The camera's motion between two scans as a scan carries it: a plane's, with its covariance, measured or held.
//!
//! Symbols: q = `[dx, dy, angle, ln zoom, stretch, shear, g, h]` (px, px, rad, 1, 1, 1, 1/px, 1/px): shift of the background at `centre_px`, its turn and its growth about that
//! point, what else is affine, and the perspective; C = Cov(q). A point at d = p - centre has the Jacobian
//! J = `[1 0 -dy dx dx dy dx² dx dy; 0 1 dx dy -dy dx dx dy dy²]`, and J C Jᵀ is the covariance of where the background lies there.
//! Limits: first order in all of them; the errors of scans are taken as independent.

use crate::Homography;
use nalgebra::{Matrix2, SMatrix, Vector2};

/// Covariance of the eight numbers of a plane's motion.
pub type MotionCov = SMatrix<f64, 8, 8>;

/// What each of the eight numbers moves at a point `d` from the middle, px.
pub(crate) fn motion_jacobian(d: Vector2<f64>) -> SMatrix<f64, 2, 8> {
    let (x, y) = (d.x, d.y);
    SMatrix::from_row_slice(&[1.0, 0.0, -y, x, x, y, x * x, x * y, 0.0, 1.0, x, y, -y, x, x * y, y * y])
}

/// Where a motion is known from.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum MotionBasis {
    /// Seen in this scan.
    #[default]
    Measured,
    /// Not seen in this scan: what went before goes on, less and less surely.
    Held,
    /// Seen again, but only against the scan before, which was held: what was not known of the place there is never made up for.
    Resumed,
    /// Another view has begun: nothing of before is seen any more, and nothing is known of how far it lies from it.
    Cut,
}

impl MotionBasis {
    /// Its word in tables and records.
    pub const fn word(self) -> &'static str {
        match self {
            Self::Measured => "measured",
            Self::Held => "held",
            Self::Resumed => "resumed",
            Self::Cut => "cut",
        }
    }

    /// The basis of a word, if it is one.
    pub fn of_word(word: &str) -> Option<Self> {
        [Self::Measured, Self::Held, Self::Resumed, Self::Cut].into_iter().find(|b| b.word() == word)
    }
}

/// How the background moved in the image since the scan before.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CameraMotion {
    /// Where the background that lay at a point in the scan before lies now.
    pub now_from_before: Homography,
    /// The point that `cov` speaks of, px: the image's middle.
    pub centre_px: Vector2<f64>,
    /// Covariance of the background's shift at `centre_px` (px, px), of its turn (rad), of the logarithm of its growth, of stretch and shear, and of the
    /// perspective (1/px); zero where the motion has no such number.
    pub cov: MotionCov,
    /// Measured or held.
    pub basis: MotionBasis,
}

impl CameraMotion {
    /// A shift (px) that is known exactly, as of a gimbal's encoder.
    pub fn exact_shift(shift_px: Vector2<f64>) -> Self {
        Self {
            now_from_before: Homography::shift(shift_px),
            centre_px: Vector2::zeros(),
            cov: MotionCov::zeros(),
            basis: MotionBasis::Measured,
        }
    }

    /// Shift of the background at the image's middle, px.
    pub fn shift_px(&self) -> Vector2<f64> {
        self.now_from_before.shift_at(self.centre_px)
    }

    /// The shift, if it was measured in this scan.
    pub fn measured_shift_px(&self) -> Option<Vector2<f64>> {
        (matches!(self.basis, MotionBasis::Measured | MotionBasis::Resumed) && self.is_finite())
            .then(|| self.shift_px())
    }

    /// Whether another view has begun.
    pub fn is_cut(&self) -> bool {
        self.basis == MotionBasis::Cut
    }

    /// Covariance of where the background lies at a point of the image, px².
    pub fn cov_at(&self, p: Vector2<f64>) -> Matrix2<f64> {
        let j = motion_jacobian(p - self.centre_px);
        let c = j * self.cov * j.transpose();
        0.5 * (c + c.transpose())
    }

    /// Whether all of it is finite and the motion has a way back.
    pub fn is_finite(&self) -> bool {
        self.now_from_before.is_sound() && (self.cov.sum() + self.centre_px.sum()).is_finite()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn far_from_the_middle_an_uncertain_turn_counts_across_and_an_uncertain_zoom_along() {
        let motion = CameraMotion {
            centre_px: Vector2::new(100.0, 50.0),
            cov: MotionCov::from_diagonal(&[0.01, 0.04, 1e-6, 4e-6, 0.0, 0.0, 0.0, 0.0].into()),
            ..CameraMotion::exact_shift(Vector2::zeros())
        };
        assert_eq!(motion.cov_at(motion.centre_px), Matrix2::new(0.01, 0.0, 0.0, 0.04));
        let right = motion.cov_at(Vector2::new(300.0, 50.0));
        // 200 px off: 200² times 4e-6 along x, times 1e-6 along y.
        assert!((right - Matrix2::new(0.01 + 0.16, 0.0, 0.0, 0.04 + 0.04)).norm() < 1e-12);
    }
}
