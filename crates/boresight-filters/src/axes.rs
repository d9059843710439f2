//! Two uncorrelated axes side by side in memory, so that one instruction serves both.

use crate::{Gaussian, Real};
use nalgebra::{SMatrix, SVector};

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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_entry_in_either_off_diagonal_block_couples_the_halves() {
        assert!(halves_apart(&SMatrix::<f64, 4, 4>::from_fn(|r, c| f64::from(u8::from(r / 2 == c / 2)))));
        for (r, c) in [(0, 2), (1, 3), (2, 0), (3, 0), (3, 1)] {
            let mut m = SMatrix::<f64, 4, 4>::identity();
            m[(r, c)] = 1e-300;
            assert!(!halves_apart(&m), "{r} {c}");
        }
    }
}
