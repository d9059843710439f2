//! The 2 x 2 covariance of a measurement or innovation: inverse, determinant, Cholesky factor.
//!
//! Symbols: S = [[a, b], [b, c]] (px²); its Cholesky factor L = [[l00, 0], [l10, l11]] (px). Limits: S must be positive
//! definite in the working precision; a zero or negative pivot is refused.

use crate::{FilterError, Real};
use nalgebra::{Matrix2, Vector2};

/// The inverse and determinant of a symmetric positive definite 2 x 2 matrix.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Inverse<T = f64> {
    /// The inverse, px⁻².
    pub inverse: Matrix2<T>,
    /// The determinant, px⁴.
    pub det: T,
}

/// Inverts a symmetric positive definite 2 x 2 matrix; `what` names it in the error.
/// # Errors
/// [`FilterError::NotPositiveDefinite`] if it cannot be factored.
#[inline(always)]
pub fn invert_pair<T: Real>(s: &Matrix2<T>, what: &'static str) -> Result<Inverse<T>, FilterError> {
    let (a, b, c) = (s[(0, 0)], s[(1, 0)], s[(1, 1)]);
    let det = a * c - b * b;
    // NaN fails these comparisons, so it is refused here as well.
    if !(a > T::zero() && c > T::zero() && det > T::zero() && det <= T::MAX) {
        return Err(FilterError::NotPositiveDefinite(what));
    }
    let inv = T::one() / det;
    if !(inv <= T::MAX) {
        return Err(FilterError::NotPositiveDefinite(what));
    }
    Ok(Inverse { inverse: Matrix2::new(c * inv, -b * inv, -b * inv, a * inv), det })
}

impl<T: Real> Inverse<T> {
    /// Returns νᵀ S⁻¹ ν, the squared Mahalanobis distance (no unit; χ² with 2 degrees of freedom).
    #[inline(always)]
    pub fn distance2(&self, innovation: &Vector2<T>) -> T {
        let (u, v) = (innovation[0], innovation[1]);
        let m = &self.inverse;
        u * u * m[(0, 0)] + T::of(2.0) * (u * v * m[(1, 0)]) + v * v * m[(1, 1)]
    }

    /// Returns ln N(ν; 0, S), the log-likelihood of an innovation (density per px²).
    pub fn log_likelihood(&self, innovation: &Vector2<T>) -> T {
        // ln(2 pi)
        -T::of(0.5) * (self.distance2(innovation) + self.det.ln()) - T::of(1.837_877_066_409_345_5)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_inverse_times_the_matrix_is_one() {
        let s = Matrix2::<f64>::new(3.0, 1.0, 1.0, 2.0);
        let p = invert_pair(&s, "S").unwrap();
        assert!((s * p.inverse - Matrix2::identity()).norm() < 1e-15);
        assert!((p.det - 5.0).abs() < 1e-15);
    }

    #[test]
    fn a_singular_or_negative_or_nan_matrix_is_refused() {
        for s in [Matrix2::new(1.0, 1.0, 1.0, 1.0), Matrix2::new(-1.0, 0.0, 0.0, -1.0), Matrix2::repeat(f64::NAN)] {
            assert!(invert_pair(&s, "S").is_err());
        }
    }
}
