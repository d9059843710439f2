//! The small dense mathematics of the filters: fixed sizes, no heap, written so that the compiler can unroll it.

mod cholesky;
mod householder;
mod pair;
mod spectral;
mod ud;

pub use cholesky::Cholesky;
pub use householder::{eliminate, fold_rows, lower_factor, triangularize};
pub use pair::{Pair, invert_pair};
pub use spectral::spectral_norm;
pub use ud::{UdFactors, mwgs, ud_factorize};

use crate::{FilterError, Gaussian, Real};
use nalgebra::{SMatrix, SVector};

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

/// Returns whether the two halves of a state (its axes) share no entry: both off-diagonal blocks are exactly 0.
#[inline(always)]
pub(crate) fn halves_apart<T: Real, const N: usize>(m: &SMatrix<T, N, N>) -> bool {
    let half = N / 2;
    let mut apart = true;
    for c in half..N {
        for r in 0..half {
            apart &= m[(r, c)] == T::zero() && m[(c, r)] == T::zero();
        }
    }
    apart
}

/// Puts two uncorrelated axes side by side: what stood at i of either axis (K = N/2 states each) stands at 2 i (x) and
/// 2 i + 1 (y) of the mean; entry (i, j), i <= j, of either block at the rows 2 i and 2 i + 1 of column j. Both axes then
/// lie in one vector register, and a step loads what the step before stored in the same width.
#[inline(always)]
pub(crate) fn pack_axes<T: Real, const N: usize>(b: &Gaussian<N, T>) -> Gaussian<N, T> {
    let half = N / 2;
    let mut out = Gaussian { mean: SVector::zeros(), cov: SMatrix::zeros() };
    for axis in 0..2 {
        for j in 0..half {
            out.mean[2 * j + axis] = b.mean[axis * half + j];
            for i in 0..=j {
                out.cov[(2 * i + axis, j)] = b.cov[(axis * half + i, axis * half + j)];
            }
        }
    }
    out
}

/// Undoes [`pack_axes`].
#[inline(always)]
pub(crate) fn unpack_axes<T: Real, const N: usize>(b: &Gaussian<N, T>) -> Gaussian<N, T> {
    let half = N / 2;
    let mut out = Gaussian { mean: SVector::zeros(), cov: SMatrix::zeros() };
    for axis in 0..2 {
        for j in 0..half {
            out.mean[axis * half + j] = b.mean[2 * j + axis];
            for i in 0..=j {
                let v = b.cov[(2 * i + axis, j)];
                out.cov[(axis * half + i, axis * half + j)] = v;
                out.cov[(axis * half + j, axis * half + i)] = v;
            }
        }
    }
    out
}

/// Returns whether a matrix is symmetric up to rounding, relative to its diagonal.
pub(crate) fn is_symmetric<T: Real, const N: usize>(m: &SMatrix<T, N, N>) -> bool {
    // The root of the rounding error: what a caller's own products may have lost, far above one operation.
    let tolerance = T::EPSILON.sqrt();
    (0..N).all(|c| (0..c).all(|r| (m[(r, c)] - m[(c, r)]).abs() <= tolerance * (m[(r, r)].abs() + m[(c, c)].abs())))
}
