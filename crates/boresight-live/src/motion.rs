//! The camera's motion of a scan as a record's line holds it, bit for bit.

use boresight::boresight_filters::nalgebra::{Matrix4, Vector2};
use boresight::{CameraMotion, MotionBasis, Similarity};
use serde::{Deserialize, Serialize};
use std::borrow::Cow;

/// A motion in numbers: the linear part `[cos -sin; sin cos]`, the shift, the point that the covariance speaks of, the covariance row by row.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct MotionLine {
    cos: f64,
    sin: f64,
    shift_px: [f64; 2],
    centre_px: [f64; 2],
    cov: [f64; 16],
    basis: Cow<'static, str>,
}

impl MotionLine {
    /// The motion in numbers; `None` if one of them is none.
    pub fn of(m: &CameraMotion) -> Option<Self> {
        let linear = m.now_from_before.turn(Vector2::new(1.0, 0.0));
        let shift = m.now_from_before.apply(Vector2::zeros());
        let mut cov = [0.0; 16];
        cov.iter_mut().enumerate().for_each(|(k, c)| *c = m.cov[(k / 4, k % 4)]);
        m.is_finite().then(|| Self {
            cos: linear.x,
            sin: linear.y,
            shift_px: shift.into(),
            centre_px: m.centre_px.into(),
            cov,
            basis: m.basis.word().into(),
        })
    }

    /// The motion; `None` if the numbers are none.
    pub fn motion(&self) -> Option<CameraMotion> {
        let zero = Vector2::zeros();
        let motion = CameraMotion {
            now_from_before: Similarity::with_linear(self.cos, self.sin, zero, self.shift_px.into()),
            centre_px: self.centre_px.into(),
            cov: Matrix4::from_fn(|i, j| self.cov[4 * i + j]),
            basis: MotionBasis::of_word(&self.basis)?,
        };
        motion.is_finite().then_some(motion)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_motion_comes_back_bit_by_bit() {
        for basis in [MotionBasis::Measured, MotionBasis::Held, MotionBasis::Resumed] {
            comes_back(basis);
        }
    }

    fn comes_back(basis: MotionBasis) {
        let there = CameraMotion {
            now_from_before: Similarity::about(
                Vector2::new(80.1, 60.7),
                Vector2::new(1.0 / 3.0, -2.7),
                0.013,
                1.0 + 1e-7,
            ),
            centre_px: Vector2::new(79.5, 59.5),
            cov: Matrix4::from_fn(|i, j| 1e-3 / (1 + i + j) as f64),
            basis,
        };
        let text = serde_json::to_string(&MotionLine::of(&there).unwrap()).unwrap();
        let back: MotionLine = serde_json::from_str(&text).unwrap();
        assert_eq!(back.motion(), Some(there));
        let strange = MotionLine { basis: "guessed".into(), ..back.clone() };
        assert_eq!(strange.motion(), None);
        let wild = MotionLine { cos: 0.0, sin: 0.0, ..back };
        assert_eq!(wild.motion(), None, "a zoom of 0 has no way back");
    }
}
