//! The U-D filter of two uncorrelated axes side by side: the fast path of [`crate::Ud`].
//!
//! Source: `docs/theory/filters.md`, each axis alone: Bierman's update with the row e_at, Thornton's update of K = N/2
//! states.
//! Differs from it: the quotients of successive α share one division (1/α_j serves λ_{j+1} and d_j); conditions are
//! selections, so that both axes stay in step; the measured row of U is multiplied by r/α instead of reduced.
//! Layout: entry (i, j) of either axis' U at the rows 2 i (x) and 2 i + 1 (y) of column j, d likewise; see
//! [`crate::linalg`]'s `pack_axes`. Symbols: u unit upper triangular; d variances; α innovation variance (px²).
//! Limits: Phi of an axis must be upper triangular ([`crate::model::Model::AXES`]).

use crate::Real;
use crate::linalg::UdFactors;
use nalgebra::{SMatrix, SVector};

/// Puts the axes of factors side by side.
#[inline(always)]
pub(crate) fn pack<T: Real, const N: usize>(f: &UdFactors<N, T>) -> UdFactors<N, T> {
    let half = N / 2;
    let mut out = UdFactors { u: SMatrix::zeros(), d: SVector::zeros() };
    for axis in 0..2 {
        for j in 0..half {
            out.d[2 * j + axis] = f.d[axis * half + j];
            for i in 0..=j {
                out.u[(2 * i + axis, j)] = f.u[(axis * half + i, axis * half + j)];
            }
        }
    }
    out
}

/// Undoes [`pack`].
#[inline(always)]
pub(crate) fn unpack<T: Real, const N: usize>(f: &UdFactors<N, T>) -> UdFactors<N, T> {
    let half = N / 2;
    let mut out = UdFactors { u: SMatrix::identity(), d: SVector::zeros() };
    for axis in 0..2 {
        for j in 0..half {
            out.d[axis * half + j] = f.d[2 * j + axis];
            for i in 0..=j {
                out.u[(axis * half + i, axis * half + j)] = f.u[(2 * i + axis, j)];
            }
        }
    }
    out
}

/// The mean with its axes side by side.
#[inline(always)]
pub(crate) fn pack_mean<T: Real, const N: usize>(x: &SVector<T, N>) -> SVector<T, N> {
    SVector::from_fn(|k, _| if k < 2 * (N / 2) { x[(k % 2) * (N / 2) + k / 2] } else { T::zero() })
}

/// Undoes [`pack_mean`].
#[inline(always)]
pub(crate) fn unpack_mean<T: Real, const N: usize>(x: &SVector<T, N>) -> SVector<T, N> {
    let half = N / 2;
    SVector::from_fn(|k, _| if k < 2 * half { x[2 * (k % half.max(1)) + k / half.max(1)] } else { T::zero() })
}

/// Thornton's update: the factors of Phi P Phiᵀ + G diag(q) Gᵀ, from `noise` columns of G for each axis.
#[inline(always)]
pub(crate) fn propagate<T: Real, const N: usize, const W: usize>(
    f: &UdFactors<N, T>,
    phi: &SMatrix<T, N, N>,
    g: &SMatrix<T, N, W>,
    q: &SVector<T, W>,
) -> UdFactors<N, T> {
    let (half, noise) = (N / 2, W / 2);
    let mut out = UdFactors { u: SMatrix::zeros(), d: SVector::zeros() };
    // Rows of [Phi U | G], an axis a lane.
    let mut wa = [[[T::zero(); 2]; N]; N];
    let mut wb = [[[T::zero(); 2]; W]; N];
    for i in 0..half {
        for j in i..half {
            for k in i..=j {
                for axis in 0..2 {
                    wa[i][j][axis] += phi[(i, k)] * f.u[(2 * k + axis, j)];
                }
            }
        }
        for w in 0..noise {
            wb[i][w] = [g[(i, w)]; 2];
        }
    }
    for j in (0..half).rev() {
        let (row_a, row_b) = (wa[j], wb[j]);
        let mut va = [[T::zero(); 2]; N];
        let mut vb = [[T::zero(); 2]; W];
        let mut dj = [T::zero(); 2];
        for l in 0..half {
            for axis in 0..2 {
                va[l][axis] = f.d[2 * l + axis] * row_a[l][axis];
                dj[axis] += va[l][axis] * row_a[l][axis];
            }
        }
        for l in 0..noise {
            for axis in 0..2 {
                vb[l][axis] = q[l] * row_b[l][axis];
                dj[axis] += vb[l][axis] * row_b[l][axis];
            }
        }
        let mut inv = [T::zero(); 2];
        for axis in 0..2 {
            let quotient = T::one() / dj[axis];
            inv[axis] = if dj[axis] > T::zero() { quotient } else { T::zero() };
            out.d[2 * j + axis] = dj[axis];
            out.u[(2 * j + axis, j)] = T::one();
        }
        for k in 0..j {
            for axis in 0..2 {
                let mut dot = T::zero();
                for l in 0..half {
                    dot += va[l][axis] * wa[k][l][axis];
                }
                for l in 0..noise {
                    dot += vb[l][axis] * wb[k][l][axis];
                }
                let ukj = dot * inv[axis];
                out.u[(2 * k + axis, j)] = ukj;
                for l in 0..half {
                    wa[k][l][axis] -= ukj * row_a[l][axis];
                }
                for l in 0..noise {
                    wb[k][l][axis] -= ukj * row_b[l][axis];
                }
            }
        }
    }
    out
}

/// Bierman's update by positions with variances r; returns the gains, or `None` where α = 0.
#[inline(always)]
pub(crate) fn correct<T: Real, const N: usize>(f: &mut UdFactors<N, T>, at: usize, r: [T; 2]) -> Option<[[T; 2]; N]> {
    let half = N / 2;
    let mut gain = [[T::zero(); 2]; N];
    let (mut alpha, mut inv) = (r, [T::zero(); 2]);
    for j in at..half {
        for axis in 0..2 {
            let fj = f.u[(2 * at + axis, j)];
            let gj = f.d[2 * j + axis] * fj;
            let before = alpha[axis];
            alpha[axis] += gj * fj;
            let inv_before = inv[axis];
            let lambda = -fj * inv_before;
            let quotient = T::one() / alpha[axis];
            // Only r = 0 and a direction that is known exactly leave 0.
            inv[axis] = if alpha[axis] > T::zero() { quotient } else { T::zero() };
            let keep = if alpha[axis] > T::zero() { before * inv[axis] } else { T::one() };
            f.d[2 * j + axis] *= keep;
            for i in 0..j {
                let t = f.u[(2 * i + axis, j)];
                f.u[(2 * i + axis, j)] = t + lambda * gain[i][axis];
                gain[i][axis] += gj * t;
            }
            // t + λ K = t (1 - (α - r)/α) of the measured row: a product has no cancellation.
            if j > at {
                let share = r[axis] * inv_before;
                f.u[(2 * at + axis, j)] = if inv_before > T::zero() { fj * share } else { fj };
            }
            gain[j][axis] = gj;
        }
    }
    for g in gain.iter_mut().take(half) {
        for axis in 0..2 {
            g[axis] *= inv[axis];
        }
    }
    (alpha[0] > T::zero() && alpha[1] > T::zero()).then_some(gain)
}
