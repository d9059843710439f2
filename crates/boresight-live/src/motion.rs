//! The camera's motion of a scan as a record's line holds it, bit for bit.

use boresight::boresight_filters::nalgebra::Matrix3;
use boresight::{CameraMotion, Homography, MotionBasis, MotionCov};
use serde::{Deserialize, Serialize};
use std::borrow::Cow;

/// A motion in numbers: the homography row by row, the point that the covariance speaks of, and the covariance's upper triangle row by row, without the rows of
/// numbers that the motion does not have.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct MotionLine {
    matrix: [f64; 9],
    centre_px: [f64; 2],
    cov: Vec<f64>,
    basis: Cow<'static, str>,
}

impl MotionLine {
    /// The motion in numbers; `None` if one of them is none.
    pub fn of(m: &CameraMotion) -> Option<Self> {
        let h = m.now_from_before.matrix();
        let n = (0..8).rev().find(|k| m.cov.row(*k).iter().any(|v| *v != 0.0)).map_or(0, |k| k + 1);
        m.is_finite().then(|| Self {
            matrix: std::array::from_fn(|k| h[(k / 3, k % 3)]),
            centre_px: m.centre_px.into(),
            cov: (0..n).flat_map(|i| (i..n).map(move |j| m.cov[(i, j)])).collect(),
            basis: m.basis.word().into(),
        })
    }

    /// The motion; `None` if the numbers are none.
    pub fn motion(&self) -> Option<CameraMotion> {
        let n = (0..=8).find(|n| n * (n + 1) / 2 == self.cov.len())?;
        let mut cov = MotionCov::zeros();
        let places = (0..n).flat_map(|i| (i..n).map(move |j| (i, j)));
        for ((i, j), v) in places.zip(&self.cov) {
            (cov[(i, j)], cov[(j, i)]) = (*v, *v);
        }
        let motion = CameraMotion {
            now_from_before: Homography::of_matrix(Matrix3::from_row_slice(&self.matrix))?,
            centre_px: self.centre_px.into(),
            cov,
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
        for basis in [MotionBasis::Measured, MotionBasis::Held, MotionBasis::Resumed, MotionBasis::Cut] {
            comes_back(basis);
        }
    }

    fn comes_back(basis: MotionBasis) {
        let there = CameraMotion {
            now_from_before: Homography::of_matrix(Matrix3::new(
                1.0 + 1e-7,
                -0.013,
                1.0 / 3.0,
                0.0131,
                0.999,
                -2.7,
                1e-6 / 3.0,
                -2e-7,
                1.0,
            ))
            .unwrap(),
            centre_px: [79.5, 59.5].into(),
            cov: MotionCov::from_fn(|i, j| 1e-3 / (1 + i + j) as f64),
            basis,
        };
        let text = serde_json::to_string(&MotionLine::of(&there).unwrap()).unwrap();
        let back: MotionLine = serde_json::from_str(&text).unwrap();
        assert_eq!(back.motion(), Some(there));
        let strange = MotionLine { basis: "guessed".into(), ..back.clone() };
        assert_eq!(strange.motion(), None);
        let odd = MotionLine { cov: vec![0.0; 5], ..back.clone() };
        assert_eq!(odd.motion(), None, "no square has five numbers in its upper triangle");
        let wild = MotionLine { matrix: [0.0; 9], ..back };
        assert_eq!(wild.motion(), None, "a zoom of 0 has no way back");
    }
}
