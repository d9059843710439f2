//! U-D factors: P = U diag(d) Uᵀ with U unit upper triangular; factorisation and weighted Gram-Schmidt.
//!
//! Source: `docs/theory/filters.md`; G. J. Bierman, *Factorization Methods for Discrete Sequential Estimation*, 1977,
//! ch. III, VI.
//! Symbols: u N x N unit upper triangular; d N (variances, >= 0). A zero pivot gives a zero column (semi-definite P).
//! Cost: N³/3 for the factorisation, N²(N + W) for the Gram-Schmidt.

use crate::{FilterError, Real};
use nalgebra::{SMatrix, SVector};

/// P = U diag(d) Uᵀ.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct UdFactors<const N: usize, T = f64> {
    /// Unit upper triangular.
    pub u: SMatrix<T, N, N>,
    /// Diagonal, each at least 0.
    pub d: SVector<T, N>,
}

/// Factors a symmetric positive semi-definite matrix; reads its upper half.
/// # Errors
/// [`FilterError::NotPositiveDefinite`] for a negative pivot beyond rounding, or a column that a zero pivot cannot carry.
pub fn ud_factorize<T: Real, const N: usize>(p: &SMatrix<T, N, N>) -> Result<UdFactors<N, T>, FilterError> {
    let mut a = *p;
    let mut f = UdFactors { u: SMatrix::identity(), d: SVector::zeros() };
    for j in (0..N).rev() {
        // Rounding of earlier columns may leave a zero pivot slightly negative.
        let slack = T::EPSILON * T::of(16.0) * p[(j, j)].abs();
        let pivot = a[(j, j)];
        if !(pivot >= -slack) {
            return Err(FilterError::NotPositiveDefinite("covariance"));
        }
        if pivot <= slack {
            for k in 0..j {
                if a[(k, j)].abs() > T::EPSILON.sqrt() * (p[(k, k)].abs() * p[(j, j)].abs()).sqrt() {
                    return Err(FilterError::NotPositiveDefinite("covariance"));
                }
            }
            f.d[j] = if pivot > T::zero() && j == 0 { pivot } else { T::zero() };
            continue;
        }
        f.d[j] = pivot;
        for k in 0..j {
            let factor = a[(k, j)] / pivot;
            f.u[(k, j)] = factor;
            for i in 0..=k {
                let less = factor * a[(i, j)];
                a[(i, k)] -= less;
            }
        }
    }
    Ok(f)
}

impl<const N: usize, T: Real> UdFactors<N, T> {
    /// Returns U diag(d) Uᵀ, exactly symmetric.
    pub fn product(&self) -> SMatrix<T, N, N> {
        let mut p = SMatrix::zeros();
        for c in 0..N {
            for r in 0..=c {
                let mut sum = T::zero();
                for k in c..N {
                    sum += self.u[(r, k)] * self.d[k] * self.u[(c, k)];
                }
                p[(r, c)] = sum;
                p[(c, r)] = sum;
            }
        }
        p
    }
}

/// Modified weighted Gram-Schmidt: U diag(d) Uᵀ = A diag(da) Aᵀ + B diag(db) Bᵀ for any A (N x N) and B (N x W).
#[inline]
pub fn mwgs<T: Real, const N: usize, const W: usize>(
    a: &SMatrix<T, N, N>,
    da: &SVector<T, N>,
    b: &SMatrix<T, N, W>,
    db: &SVector<T, W>,
) -> UdFactors<N, T> {
    let mut f = UdFactors { u: SMatrix::identity(), d: SVector::zeros() };
    // Rows of [A | B] as columns, so that each vector lies in one piece.
    let mut wa = a.transpose();
    let mut wb = b.transpose();
    for j in (0..N).rev() {
        let mut va = [T::zero(); N];
        let mut vb = [T::zero(); W];
        let mut dj = T::zero();
        for l in 0..N {
            va[l] = da[l] * wa[(l, j)];
            dj += va[l] * wa[(l, j)];
        }
        for l in 0..W {
            vb[l] = db[l] * wb[(l, j)];
            dj += vb[l] * wb[(l, j)];
        }
        f.d[j] = dj;
        if !(dj > T::zero()) {
            continue;
        }
        let inv = T::one() / dj;
        for k in 0..j {
            let mut dot = T::zero();
            for l in 0..N {
                dot += va[l] * wa[(l, k)];
            }
            for l in 0..W {
                dot += vb[l] * wb[(l, k)];
            }
            let ukj = dot * inv;
            f.u[(k, j)] = ukj;
            for l in 0..N {
                let less = ukj * wa[(l, j)];
                wa[(l, k)] -= less;
            }
            for l in 0..W {
                let less = ukj * wb[(l, j)];
                wb[(l, k)] -= less;
            }
        }
    }
    f
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Matrix3, Vector3};

    #[test]
    fn factors_multiply_back_to_the_covariance() {
        let p = Matrix3::new(4.0, 1.0, 0.5, 1.0, 3.0, -0.4, 0.5, -0.4, 2.0);
        assert!((ud_factorize(&p).unwrap().product() - p).norm() < 1e-14);
    }

    #[test]
    fn a_semi_definite_covariance_is_factored_and_an_indefinite_one_refused() {
        let v = Vector3::new(1.0, 2.0, 3.0);
        let p = v * v.transpose();
        assert!((ud_factorize(&p).unwrap().product() - p).norm() < 1e-12);
        assert!(ud_factorize(&Matrix3::new(1.0, 2.0, 0.0, 2.0, 1.0, 0.0, 0.0, 0.0, 1.0)).is_err());
        assert!(ud_factorize(&Matrix3::<f64>::zeros()).is_ok());
    }
}
