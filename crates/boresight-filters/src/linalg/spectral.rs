//! Spectral norm of a small matrix: the root of the largest eigenvalue of AᵀA by cyclic Jacobi rotations.
//!
//! Source: G. H. Golub, C. F. Van Loan, *Matrix Computations*, 8.5. Cost: about 5 sweeps of N³ flops.

use super::mul;
use crate::Real;
use nalgebra::SMatrix;

/// Returns ‖A‖₂.
pub fn spectral_norm<T: Real, const N: usize>(a: &SMatrix<T, N, N>) -> T {
    let mut m = mul(&a.transpose(), a);
    // Quadratic convergence: 12 sweeps are ample for N below 16.
    for _ in 0..12 {
        let mut off = T::zero();
        let mut on = T::zero();
        for c in 0..N {
            on += m[(c, c)] * m[(c, c)];
            for r in 0..c {
                off += m[(r, c)] * m[(r, c)];
            }
        }
        if !(off > on * T::EPSILON * T::EPSILON) {
            break;
        }
        for q in 1..N {
            for p in 0..q {
                if m[(p, q)] == T::zero() {
                    continue;
                }
                let tau = (m[(q, q)] - m[(p, p)]) / (m[(p, q)] * T::of(2.0));
                let root = (T::one() + tau * tau).sqrt();
                let t = if tau >= T::zero() { T::one() / (tau + root) } else { T::one() / (tau - root) };
                let c = T::one() / (T::one() + t * t).sqrt();
                let s = t * c;
                for k in 0..N {
                    let (u, v) = (m[(k, p)], m[(k, q)]);
                    m[(k, p)] = c * u - s * v;
                    m[(k, q)] = s * u + c * v;
                }
                for k in 0..N {
                    let (u, v) = (m[(p, k)], m[(q, k)]);
                    m[(p, k)] = c * u - s * v;
                    m[(q, k)] = s * u + c * v;
                }
            }
        }
    }
    let mut largest = T::zero();
    for i in 0..N {
        largest = largest.max(m[(i, i)]);
    }
    largest.sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Matrix2;

    #[test]
    fn the_norm_of_a_known_matrix() {
        // Singular values of [[3, 0], [4, 5]] are sqrt(45) and sqrt(5).
        assert!((spectral_norm(&Matrix2::new(3.0_f64, 0.0, 4.0, 5.0)) - 45.0_f64.sqrt()).abs() < 1e-14);
    }
}
