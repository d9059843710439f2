//! The small dense mathematics of the filters: fixed sizes, no heap, written so that the compiler can unroll it.

mod cholesky;
mod householder;
mod inverse;
mod spectral;
mod ud;

pub use cholesky::Cholesky;
pub use householder::{eliminate, fold_rows, lower_factor, triangularize};
pub use inverse::{Inverse, invert_pair};
pub use spectral::spectral_norm;
pub use ud::{UdFactors, mwgs, ud_factorize};

use crate::{FilterError, Real};
use nalgebra::SMatrix;

/// Returns A B.
#[inline(always)]
pub(crate) fn mul<T: Real, const R: usize, const K: usize, const C: usize>(
    a: &SMatrix<T, R, K>,
    b: &SMatrix<T, K, C>,
) -> SMatrix<T, R, C> {
    let mut out = SMatrix::<T, R, C>::zeros();
    for c in 0..C {
        for k in 0..K {
            let f = b[(k, c)];
            for r in 0..R {
                out[(r, c)] += a[(r, k)] * f;
            }
        }
    }
    out
}

/// Returns A Bᵀ.
#[inline(always)]
pub(crate) fn mul_transposed<T: Real, const R: usize, const K: usize, const C: usize>(
    a: &SMatrix<T, R, K>,
    b: &SMatrix<T, C, K>,
) -> SMatrix<T, R, C> {
    let mut out = SMatrix::<T, R, C>::zeros();
    for c in 0..C {
        for k in 0..K {
            let f = b[(c, k)];
            for r in 0..R {
                out[(r, c)] += a[(r, k)] * f;
            }
        }
    }
    out
}

/// Returns A⁻¹ by elimination with row pivoting.
pub(crate) fn invert<T: Real, const N: usize>(a: &SMatrix<T, N, N>) -> Result<SMatrix<T, N, N>, FilterError> {
    let mut a = *a;
    let mut inv = SMatrix::<T, N, N>::identity();
    for j in 0..N {
        let mut best = j;
        for i in j + 1..N {
            if a[(i, j)].abs() > a[(best, j)].abs() {
                best = i;
            }
        }
        a.swap_rows(j, best);
        inv.swap_rows(j, best);
        let f = T::one() / a[(j, j)];
        if !(f.abs() <= T::MAX) {
            return Err(FilterError::NotPositiveDefinite("the transition matrix"));
        }
        for c in 0..N {
            a[(j, c)] *= f;
            inv[(j, c)] *= f;
        }
        for i in 0..N {
            if i != j {
                let less = a[(i, j)];
                for c in 0..N {
                    let (u, v) = (a[(j, c)], inv[(j, c)]);
                    a[(i, c)] -= less * u;
                    inv[(i, c)] -= less * v;
                }
            }
        }
    }
    Ok(inv)
}

/// Makes a matrix exactly symmetric by the mean of each pair.
#[inline(always)]
pub(crate) fn symmetrize<T: Real, const N: usize>(m: &mut SMatrix<T, N, N>) {
    let half = T::of(0.5);
    for c in 1..N {
        for r in 0..c {
            let mean = (m[(r, c)] + m[(c, r)]) * half;
            m[(r, c)] = mean;
            m[(c, r)] = mean;
        }
    }
}

/// Returns whether a matrix is symmetric up to rounding, relative to its diagonal.
pub(crate) fn is_symmetric<T: Real, const N: usize>(m: &SMatrix<T, N, N>) -> bool {
    // The root of the rounding error: what a caller's own products may have lost, far above one operation.
    let tolerance = T::EPSILON.sqrt();
    (0..N).all(|c| (0..c).all(|r| (m[(r, c)] - m[(c, r)]).abs() <= tolerance * (m[(r, r)].abs() + m[(c, c)].abs())))
}
