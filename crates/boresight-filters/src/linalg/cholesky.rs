//! Cholesky factor of a small symmetric positive definite matrix, and solves with it.
//!
//! Symbols: A = L Lᵀ, L lower triangular. Limits: A positive definite in the working precision.

use crate::{FilterError, Real};
use nalgebra::SMatrix;

/// The lower triangular L of A = L Lᵀ.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cholesky<const N: usize, T = f64> {
    /// L, zeros above the diagonal.
    pub l: SMatrix<T, N, N>,
}

impl<const N: usize, T: Real> Cholesky<N, T> {
    /// Factors a matrix; reads its lower half; `what` names it in the error.
    /// # Errors
    /// [`FilterError::NotPositiveDefinite`] if a pivot is not above 0.
    pub fn new(a: &SMatrix<T, N, N>, what: &'static str) -> Result<Self, FilterError> {
        Self::factor(a, false).ok_or(FilterError::NotPositiveDefinite(what))
    }

    /// Factors a positive semi-definite matrix: a zero pivot gives a zero column.
    /// # Errors
    /// [`FilterError::NotPositiveDefinite`] if a pivot is negative beyond rounding.
    pub fn semi_definite(a: &SMatrix<T, N, N>, what: &'static str) -> Result<Self, FilterError> {
        Self::factor(a, true).ok_or(FilterError::NotPositiveDefinite(what))
    }

    fn factor(a: &SMatrix<T, N, N>, semi: bool) -> Option<Self> {
        let mut l = SMatrix::<T, N, N>::zeros();
        for j in 0..N {
            let mut pivot = a[(j, j)];
            for k in 0..j {
                pivot -= l[(j, k)] * l[(j, k)];
            }
            // What rounding of the sum above may leave of an exact zero.
            let slack = if semi { T::EPSILON * T::of(16.0) * a[(j, j)].abs() } else { T::zero() };
            if semi && pivot.abs() <= slack {
                let rest_is_zero = (j + 1..N).all(|i| {
                    let mut v = a[(i, j)];
                    for k in 0..j {
                        v -= l[(i, k)] * l[(j, k)];
                    }
                    v.abs() <= T::EPSILON.sqrt() * (a[(i, i)].abs() * a[(j, j)].abs()).sqrt()
                });
                if rest_is_zero {
                    continue;
                }
                return None;
            }
            if !(pivot > T::zero() && pivot <= T::MAX) {
                return None;
            }
            let root = pivot.sqrt();
            l[(j, j)] = root;
            let inv = T::one() / root;
            for i in j + 1..N {
                let mut v = a[(i, j)];
                for k in 0..j {
                    v -= l[(i, k)] * l[(j, k)];
                }
                l[(i, j)] = v * inv;
            }
        }
        Some(Self { l })
    }

    /// Returns L⁻¹ B.
    pub fn whiten<const C: usize>(&self, b: &SMatrix<T, N, C>) -> SMatrix<T, N, C> {
        let mut x = *b;
        for c in 0..C {
            for i in 0..N {
                let mut v = x[(i, c)];
                for k in 0..i {
                    v -= self.l[(i, k)] * x[(k, c)];
                }
                x[(i, c)] = v / self.l[(i, i)];
            }
        }
        x
    }

    /// Returns A⁻¹ B.
    pub fn solve<const C: usize>(&self, b: &SMatrix<T, N, C>) -> SMatrix<T, N, C> {
        let mut x = self.whiten(b);
        for c in 0..C {
            for i in (0..N).rev() {
                let mut v = x[(i, c)];
                for k in i + 1..N {
                    v -= self.l[(k, i)] * x[(k, c)];
                }
                x[(i, c)] = v / self.l[(i, i)];
            }
        }
        x
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Matrix3, Vector3};

    #[test]
    fn solving_undoes_multiplying() {
        let a = Matrix3::new(4.0, 1.0, 0.5, 1.0, 3.0, -0.4, 0.5, -0.4, 2.0);
        let x = Vector3::new(1.0, -2.0, 3.0);
        assert!((Cholesky::new(&a, "A").unwrap().solve(&(a * x)) - x).norm() < 1e-14);
    }

    #[test]
    fn a_singular_matrix_is_refused_unless_asked_for() {
        let v = Vector3::new(1.0, 2.0, 3.0);
        let a = v * v.transpose();
        assert!(Cholesky::new(&a, "A").is_err());
        let l = Cholesky::semi_definite(&a, "A").unwrap().l;
        assert!((l * l.transpose() - a).norm() < 1e-14);
        assert!(Cholesky::semi_definite(&(-a), "A").is_err());
    }
}
