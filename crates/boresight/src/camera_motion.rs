//! The camera's motion between two scans as a scan carries it: a similarity with its covariance, measured or held.
//!
//! Symbols: q = `[dx, dy, angle, ln zoom]` (px, px, rad, 1): shift of the background at `centre_px`, its turn and its growth about that
//! point; C = Cov(q). A point at d = p - centre has the Jacobian J = `[1 0 -dy dx; 0 1 dx dy]`, and J C Jᵀ is the covariance of where
//! the background lies there.
//! Limits: first order in angle and ln zoom; the errors of scans are taken as independent.

use crate::Similarity;
use nalgebra::{Matrix2, Matrix2x4, Matrix4, Vector2};

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
}

impl MotionBasis {
    /// Its word in tables and records.
    pub const fn word(self) -> &'static str {
        match self {
            Self::Measured => "measured",
            Self::Held => "held",
            Self::Resumed => "resumed",
        }
    }

    /// The basis of a word, if it is one.
    pub fn of_word(word: &str) -> Option<Self> {
        [Self::Measured, Self::Held, Self::Resumed].into_iter().find(|b| b.word() == word)
    }
}

/// How the background moved in the image since the scan before.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CameraMotion {
    /// Where the background that lay at a point in the scan before lies now.
    pub now_from_before: Similarity,
    /// The point that `cov` speaks of, px: the image's middle.
    pub centre_px: Vector2<f64>,
    /// Covariance of the background's shift at `centre_px` (px, px), of its turn (rad) and of the logarithm of its growth.
    pub cov: Matrix4<f64>,
    /// Measured or held.
    pub basis: MotionBasis,
}

impl CameraMotion {
    /// A shift (px) that is known exactly, as of a gimbal's encoder.
    pub fn exact_shift(shift_px: Vector2<f64>) -> Self {
        Self {
            now_from_before: Similarity::shift(shift_px),
            centre_px: Vector2::zeros(),
            cov: Matrix4::zeros(),
            basis: MotionBasis::Measured,
        }
    }

    /// Shift of the background at the image's middle, px.
    pub fn shift_px(&self) -> Vector2<f64> {
        self.now_from_before.shift_at(self.centre_px)
    }

    /// The shift, if it was measured in this scan.
    pub fn measured_shift_px(&self) -> Option<Vector2<f64>> {
        (self.basis != MotionBasis::Held && self.is_finite()).then(|| self.shift_px())
    }

    /// Covariance of where the background lies at a point of the image, px².
    pub fn cov_at(&self, p: Vector2<f64>) -> Matrix2<f64> {
        let d = p - self.centre_px;
        let j = Matrix2x4::new(1.0, 0.0, -d.y, d.x, 0.0, 1.0, d.x, d.y);
        j * self.cov * j.transpose()
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
            cov: Matrix4::from_diagonal(&nalgebra::Vector4::new(0.01, 0.04, 1e-6, 4e-6)),
            ..CameraMotion::exact_shift(Vector2::zeros())
        };
        assert_eq!(motion.cov_at(motion.centre_px), Matrix2::new(0.01, 0.0, 0.0, 0.04));
        let right = motion.cov_at(Vector2::new(300.0, 50.0));
        // 200 px off: 200² times 4e-6 along x, times 1e-6 along y.
        assert!((right - Matrix2::new(0.01 + 0.16, 0.0, 0.0, 0.04 + 0.04)).norm() < 1e-12);
    }
}
