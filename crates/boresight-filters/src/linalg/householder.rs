//! Orthogonal triangularisation by Householder reflections, on the block shapes that square-root filters have.
//!
//! Source: `docs/theory/filters.md` (column j: s = -sign(A_jj) ‖A_j..m,j‖, u = column with u_j -= s, β = 1/(s u_j)); G.
//! H. Golub, C. F. Van Loan, *Matrix Computations*, 5.1. A zero column is skipped.
//! Differs from it: the blocks' known zeros are not touched, and columns are kept as the contiguous direction.

use crate::Real;
use nalgebra::{SMatrix, SVector};

/// Reflector of (head, tail): returns s and β with u = (head - s, tail); `None` for a zero vector.
#[inline(always)]
fn reflector<T: Real, const M: usize>(head: T, tail: &[T; M]) -> Option<(T, T, T)> {
    let mut tail2 = T::zero();
    for v in tail {
        tail2 += *v * *v;
    }
    // Already in place.
    if tail2 == T::zero() {
        return None;
    }
    let norm2 = head * head + tail2;
    let norm = norm2.sqrt();
    if !(norm > T::zero()) {
        return None;
    }
    let s = if head > T::zero() { -norm } else { norm };
    let u0 = head - s;
    // 1/(s u0) overflows only where norm2 underflows: then the vector is rounding dust and is dropped.
    let beta = T::one() / (s * u0);
    (beta.abs() <= T::MAX).then_some((s, u0, beta))
}

/// Triangularises `[[R, y], [B, e]]` with R upper triangular (N x N) and B (M x N) to `[[R', y'], [0, e']]`; diagonal of
/// R' at least 0. |e'|² is what the new rows could not be fitted by.
#[inline]
pub fn fold_rows<T: Real, const N: usize, const M: usize>(
    r: &mut SMatrix<T, N, N>,
    y: &mut SVector<T, N>,
    b: &mut SMatrix<T, M, N>,
    e: &mut SVector<T, M>,
) {
    for j in 0..N {
        let tail = b.data.0[j];
        if let Some((s, u0, beta)) = reflector(r[(j, j)], &tail) {
            r[(j, j)] = s;
            for c in j + 1..N {
                let mut dot = u0 * r[(j, c)];
                for k in 0..M {
                    dot += tail[k] * b[(k, c)];
                }
                let f = beta * dot;
                r[(j, c)] += f * u0;
                for k in 0..M {
                    b[(k, c)] += f * tail[k];
                }
            }
            let mut dot = u0 * y[j];
            for k in 0..M {
                dot += tail[k] * e[k];
            }
            let f = beta * dot;
            y[j] += f * u0;
            for k in 0..M {
                e[k] += f * tail[k];
            }
        }
        if r[(j, j)] < T::zero() {
            for c in j..N {
                r[(j, c)] = -r[(j, c)];
            }
            y[j] = -y[j];
        }
    }
}

/// Removes W unknowns from `[[I, 0 | 0], [A, R | y]]` (I is W x W): what is left of `[R | y]` after the first W columns
/// are triangularised; R comes back as a full matrix.
#[inline]
pub fn eliminate<T: Real, const N: usize, const W: usize>(
    a: &mut SMatrix<T, N, W>,
    r: &mut SMatrix<T, N, N>,
    y: &mut SVector<T, N>,
) {
    for j in 0..W {
        let mut tail = [T::zero(); N];
        for k in 0..N {
            tail[k] = a[(k, j)];
        }
        // The head is 1: the unit block stays a unit block to the right of its diagonal, and row j of it is zero in
        // every later column, so the dot products are over the tail alone.
        let Some((_, _, beta)) = reflector(T::one(), &tail) else { continue };
        for c in j + 1..W {
            let mut dot = T::zero();
            for k in 0..N {
                dot += tail[k] * a[(k, c)];
            }
            let f = beta * dot;
            for k in 0..N {
                a[(k, c)] += f * tail[k];
            }
        }
        for c in 0..N {
            let mut dot = T::zero();
            for k in 0..N {
                dot += tail[k] * r[(k, c)];
            }
            let f = beta * dot;
            for k in 0..N {
                r[(k, c)] += f * tail[k];
            }
        }
        let mut dot = T::zero();
        for k in 0..N {
            dot += tail[k] * y[k];
        }
        let f = beta * dot;
        for k in 0..N {
            y[k] += f * tail[k];
        }
    }
}

/// Triangularises a full `[R | y]` to upper triangular with a diagonal of at least 0.
#[inline]
pub fn triangularize<T: Real, const N: usize>(r: &mut SMatrix<T, N, N>, y: &mut SVector<T, N>) {
    for j in 0..N {
        let mut tail = [T::zero(); N];
        for k in j + 1..N {
            tail[k] = r[(k, j)];
        }
        if let Some((s, u0, beta)) = reflector(r[(j, j)], &tail) {
            r[(j, j)] = s;
            for c in j + 1..N {
                let mut dot = u0 * r[(j, c)];
                for k in j + 1..N {
                    dot += tail[k] * r[(k, c)];
                }
                let f = beta * dot;
                r[(j, c)] += f * u0;
                for k in j + 1..N {
                    r[(k, c)] += f * tail[k];
                }
            }
            let mut dot = u0 * y[j];
            for k in j + 1..N {
                dot += tail[k] * y[k];
            }
            let f = beta * dot;
            y[j] += f * u0;
            for k in j + 1..N {
                y[k] += f * tail[k];
            }
        }
        if r[(j, j)] < T::zero() {
            for c in j..N {
                r[(j, c)] = -r[(j, c)];
            }
            y[j] = -y[j];
        }
        for k in j + 1..N {
            r[(k, j)] = T::zero();
        }
    }
}

/// Returns the lower triangular L (diagonal at least 0) with L Lᵀ = A Aᵀ + B Bᵀ.
#[inline]
pub fn lower_factor<T: Real, const N: usize, const W: usize>(
    a: &SMatrix<T, N, N>,
    b: &SMatrix<T, N, W>,
) -> SMatrix<T, N, N> {
    // Rows of [A | B] become columns: [Aᵀ; Bᵀ] = Q [Lᵀ; 0].
    let mut upper = a.transpose();
    let mut none = SVector::<T, N>::zeros();
    triangularize(&mut upper, &mut none);
    let mut rest = b.transpose();
    let mut e = SVector::<T, W>::zeros();
    fold_rows(&mut upper, &mut none, &mut rest, &mut e);
    upper.transpose()
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Matrix3, Matrix3x2};

    #[test]
    fn the_lower_factor_squares_to_the_sum() {
        let a = Matrix3::new(1.0, 2.0, 3.0, 0.0, 1.0, -1.0, 4.0, 0.5, 2.0);
        let b = Matrix3x2::new(1.0, 0.0, 2.0, 1.0, -1.0, 0.3);
        let l = lower_factor(&a, &b);
        assert!((l * l.transpose() - a * a.transpose() - b * b.transpose()).norm() < 1e-13);
        assert!(l[(0, 1)] == 0.0 && l[(0, 2)] == 0.0 && l[(1, 2)] == 0.0);
        assert!((0..3).all(|i| l[(i, i)] >= 0.0));
    }

    #[test]
    fn triangularising_keeps_the_normal_equations() {
        let full = SMatrix::<f64, 4, 4>::from_fn(|r, c| ((3 * r + 5 * c * c + 1) % 7) as f64 - 2.5);
        let right = SVector::<f64, 4>::new(1.0, -2.0, 0.5, 3.0);
        let (mut r, mut y) = (full, right);
        triangularize(&mut r, &mut y);
        assert!((r.transpose() * r - full.transpose() * full).amax() < 1e-12);
        assert!((r.transpose() * y - full.transpose() * right).amax() < 1e-12);
        assert!((y.norm() - right.norm()).abs() < 1e-12);
        for j in 0..4 {
            assert!(r[(j, j)] >= 0.0 && (j + 1..4).all(|i| r[(i, j)] == 0.0), "{r}");
        }
    }
}
