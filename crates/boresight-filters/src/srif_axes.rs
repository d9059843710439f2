//! The square-root information filter of two uncorrelated axes side by side: the fast path of [`crate::Srif`].
//!
//! Source: `docs/theory/filters.md`; plane rotations (W. Givens, 1958; G. H. Golub, C. F. Van Loan, *Matrix
//! Computations*, 5.1) in place of reflections where one entry is removed at a time: c = head/n, s = tail/n, n =
//! sqrt(head² + tail²). The diagonal comes out positive by itself.
//! Layout: entry (i, j) of either axis' block of R (K = N/2 states) at the rows 2 i (x) and 2 i + 1 (y) of column j, y
//! likewise: both axes lie in one vector register, and a step loads what the step before stored in the same width.
//! Symbols: R upper triangular, 1/px; y no unit. Cost: N = 4, W = 2: 4 roots and 4 divisions for both axes a step.
//! Limits: Phi of an axis must be upper triangular ([`crate::model::Model::AXES`]).

use crate::Real;
use crate::information_pair::InformationPair;
use nalgebra::{SMatrix, SVector, Vector2};

/// Puts the axes of a pair side by side.
#[inline(always)]
pub(crate) fn pack<T: Real, const N: usize>(pair: &InformationPair<N, T>) -> InformationPair<N, T> {
    let half = N / 2;
    let mut out = InformationPair { r: SMatrix::zeros(), y: SVector::zeros() };
    for axis in 0..2 {
        for i in 0..half {
            out.y[2 * i + axis] = pair.y[axis * half + i];
            for j in i..half {
                out.r[(2 * i + axis, j)] = pair.r[(axis * half + i, axis * half + j)];
            }
        }
    }
    out
}

/// Undoes [`pack`].
#[inline(always)]
pub(crate) fn unpack<T: Real, const N: usize>(pair: &InformationPair<N, T>) -> InformationPair<N, T> {
    let half = N / 2;
    let mut out = InformationPair { r: SMatrix::zeros(), y: SVector::zeros() };
    for axis in 0..2 {
        for i in 0..half {
            out.y[axis * half + i] = pair.y[2 * i + axis];
            for j in i..half {
                out.r[(axis * half + i, axis * half + j)] = pair.r[(2 * i + axis, j)];
            }
        }
    }
    out
}

/// Returns (c, s, n) that rotate (head, tail) to (n, 0); the identity for a zero vector.
#[inline(always)]
fn rotation<T: Real>(head: T, tail: T) -> (T, T, T) {
    let n = (head * head + tail * tail).sqrt();
    let inv = T::one() / n;
    if n > T::zero() { (head * inv, tail * inv, n) } else { (T::one(), T::zero(), head) }
}

/// Replaces R by R Phi⁻¹ for the inverse Phi⁻¹ of one axis, upper triangular in the first half of `back`.
#[inline(always)]
pub(crate) fn move_back<T: Real, const N: usize>(r: &mut SMatrix<T, N, N>, back: &SMatrix<T, N, N>) {
    let half = N / 2;
    for j in (0..half).rev() {
        for i in 0..=j {
            for axis in 0..2 {
                let mut v = T::zero();
                for k in i..=j {
                    v += r[(2 * i + axis, k)] * back[(k, j)];
                }
                r[(2 * i + axis, j)] = v;
            }
        }
    }
}

/// Removes the noise x' = x + L w, w ~ N(0, I), with the root L of one axis (K x `noise`): the time update.
#[inline(always)]
pub(crate) fn spread<T: Real, const N: usize, const W: usize>(
    pair: &mut InformationPair<N, T>,
    root: &SMatrix<T, N, W>,
    noise: usize,
) {
    let half = N / 2;
    let InformationPair { r, y } = pair;
    let mut a = [[[T::zero(); 2]; N]; W];
    for w in 0..noise {
        for i in 0..half {
            for k in i..half {
                for axis in 0..2 {
                    a[w][i][axis] -= r[(2 * i + axis, k)] * root[(k, w)];
                }
            }
        }
    }
    for w in 0..noise {
        let u = a[w];
        // The reflection of (1, u): β = -1/(n (1 + n)) with n² = 1 + |u|².
        let mut beta = [T::zero(); 2];
        for axis in 0..2 {
            let mut n2 = T::one();
            for i in 0..half {
                n2 += u[i][axis] * u[i][axis];
            }
            let n = n2.sqrt();
            beta[axis] = -T::one() / (n * (T::one() + n));
        }
        for later in a.iter_mut().take(noise).skip(w + 1) {
            for axis in 0..2 {
                let mut dot = T::zero();
                for i in 0..half {
                    dot += u[i][axis] * later[i][axis];
                }
                let f = beta[axis] * dot;
                for i in 0..half {
                    later[i][axis] += f * u[i][axis];
                }
            }
        }
        for c in 0..half {
            for axis in 0..2 {
                let mut dot = T::zero();
                for i in 0..half {
                    dot += u[i][axis] * r[(2 * i + axis, c)];
                }
                let f = beta[axis] * dot;
                for i in 0..half {
                    r[(2 * i + axis, c)] += f * u[i][axis];
                }
            }
        }
        for axis in 0..2 {
            let mut dot = T::zero();
            for i in 0..half {
                dot += u[i][axis] * y[2 * i + axis];
            }
            let f = beta[axis] * dot;
            for i in 0..half {
                y[2 * i + axis] += f * u[i][axis];
            }
        }
    }
    for j in 0..half {
        for k in j + 1..half {
            for axis in 0..2 {
                let (jj, kk) = (2 * j + axis, 2 * k + axis);
                let (c, s, n) = rotation(r[(jj, j)], r[(kk, j)]);
                r[(jj, j)] = n;
                r[(kk, j)] = T::zero();
                for col in j + 1..half {
                    let (p, q) = (r[(jj, col)], r[(kk, col)]);
                    r[(jj, col)] = c * p + s * q;
                    r[(kk, col)] = c * q - s * p;
                }
                let (p, q) = (y[jj], y[kk]);
                y[jj] = c * p + s * q;
                y[kk] = c * q - s * p;
            }
        }
        // The last row is not rotated: its sign is free.
        for axis in 0..2 {
            let row = 2 * j + axis;
            let sign = if r[(row, j)] < T::zero() { -T::one() } else { T::one() };
            for col in j..half {
                r[(row, col)] *= sign;
            }
            y[row] *= sign;
        }
    }
}

/// Adds one measured position with independent axes; `at` is where the position stands in an axis.
#[inline(always)]
pub(crate) fn measure<T: Real, const N: usize>(
    pair: &mut InformationPair<N, T>,
    at: usize,
    z: &Vector2<T>,
    variance: [T; 2],
) {
    let half = N / 2;
    let InformationPair { r, y } = pair;
    let mut b = [[T::zero(); 2]; N];
    let mut e = [T::zero(); 2];
    for axis in 0..2 {
        b[at][axis] = T::one() / variance[axis].sqrt();
        e[axis] = z[axis] * b[at][axis];
    }
    for j in at..half {
        for axis in 0..2 {
            let row = 2 * j + axis;
            let (c, s, n) = rotation(r[(row, j)], b[j][axis]);
            r[(row, j)] = n;
            for col in j + 1..half {
                let (p, q) = (r[(row, col)], b[col][axis]);
                r[(row, col)] = c * p + s * q;
                b[col][axis] = c * q - s * p;
            }
            let (p, q) = (y[row], e[axis]);
            y[row] = c * p + s * q;
            e[axis] = c * q - s * p;
        }
    }
}
