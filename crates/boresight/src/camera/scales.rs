//! One motion in the pixels of the frame, of the reduced frame and of the fine one: a mean over a block has the block's middle.

use crate::{CameraMotion, Homography, MotionBasis, MotionCov};
use nalgebra::{Matrix3, Matrix4, Vector2};

/// The frame's sizes.
#[derive(Clone, Copy, Debug)]
pub(super) struct Scales {
    /// The reduced frame's middle, reduced px.
    pub middle: Vector2<f64>,
    /// Side of a block of the frame that becomes a reduced pixel, and a fine one.
    pub factor: usize,
    pub fine: usize,
}

/// A similarity's covariance among the eight numbers.
pub(super) fn of_similarity(cov: &Matrix4<f64>) -> MotionCov {
    let mut out = MotionCov::zeros();
    out.fixed_view_mut::<4, 4>(0, 0).copy_from(cov);
    out
}

/// A motion of an image in means of blocks of `from` px as that of one in blocks of `to` px: a mean's middle is that of its block.
pub(super) fn scaled(motion: &Homography, from: usize, to: usize) -> Homography {
    let scale = from as f64 / to as f64;
    if motion.is_shift() {
        return Homography::shift(scale * motion.shift_at(Vector2::zeros()));
    }
    let first = 0.5 * (scale - 1.0);
    let grow = Homography::of_matrix(Matrix3::new(scale, 0.0, first, 0.0, scale, first, 0.0, 0.0, 1.0));
    grow.map_or(*motion, |grow| grow.inverse().then(motion).then(&grow))
}

/// The covariance of the eight numbers where lengths are `scale` times as many pixels.
pub(super) fn scaled_cov(cov: &MotionCov, scale: f64) -> MotionCov {
    let unit = |i: usize| [scale, 1.0, 1.0, 1.0 / scale][i / 2];
    MotionCov::from_fn(|i, j| cov[(i, j)] * unit(i) * unit(j))
}

/// A motion of the reduced frame as that of the frame.
pub(super) fn full_size(step: &Homography, cov: &MotionCov, basis: MotionBasis, scales: &Scales) -> CameraMotion {
    let f = scales.factor as f64;
    let centre_px = f * scales.middle + Vector2::repeat(0.5 * (f - 1.0));
    CameraMotion { now_from_before: scaled(step, scales.factor, 1), centre_px, cov: scaled_cov(cov, f), basis }
}
