//! Two independent axes of K states each: puts per-axis blocks into the state, and integrates noise over a step.
//!
//! State order: all of x, then all of y. [`noise_integral`] is q ∫ φ(s) φ(s)ᵀ ds over one step by five-point
//! Gauss-Legendre (M. Abramowitz, I. Stegun, 25.4.29): exact for polynomials to degree 9, so to rounding where the
//! closed forms of exponential models cancel. Limits: s times the model's rate at most about 1 over the step.

use crate::Real;
use nalgebra::SMatrix;

/// Puts one K x K block on both axes of a 2K-state matrix.
#[inline]
pub(crate) fn both_axes<T: Real, const K: usize, const N: usize>(block: &[[T; K]; K]) -> SMatrix<T, N, N> {
    let mut m = SMatrix::zeros();
    for axis in 0..2 {
        for r in 0..K {
            for c in 0..K {
                m[(axis * K + r, axis * K + c)] = block[r][c];
            }
        }
    }
    m
}

/// Nodes and weights on [0, 1].
const GAUSS: [(f64, f64); 5] = [
    (0.046_910_077_030_668_004, 0.118_463_442_528_094_54),
    (0.230_765_344_947_158_45, 0.239_314_335_249_683_23),
    (0.5, 0.284_444_444_444_444_44),
    (0.769_234_655_052_841_6, 0.239_314_335_249_683_23),
    (0.953_089_922_969_332, 0.118_463_442_528_094_54),
];

/// Returns q ∫₀^dt φ(s) φ(s)ᵀ ds.
pub(crate) fn noise_integral<T: Real, const K: usize>(q: T, dt: T, phi: impl Fn(T) -> [T; K]) -> [[T; K]; K] {
    let mut sum = [[T::zero(); K]; K];
    for (node, weight) in GAUSS {
        let v = phi(dt * T::of(node));
        let w = q * dt * T::of(weight);
        for r in 0..K {
            for c in 0..K {
                sum[r][c] += w * v[r] * v[c];
            }
        }
    }
    sum
}

/// Returns (1 - e^-z)/z, 1 at 0.
pub(crate) fn decay1<T: Real>(z: T) -> T {
    if z < T::of(0.5) { series(z, 1.0) } else { (T::one() - (-z).exp()) / z }
}

/// Returns (z - 1 + e^-z)/z², 1/2 at 0.
pub(crate) fn decay2<T: Real>(z: T) -> T {
    if z < T::of(0.5) { series(z, 2.0) } else { (z - T::one() + (-z).exp()) / (z * z) }
}

/// Σ (-z)^k k-th term of e^-z started at the given order: (-z)^k / (k + order)!.
fn series<T: Real>(z: T, order: f64) -> T {
    let mut term = T::of(1.0 / order);
    let mut sum = term;
    for k in 1..14 {
        term *= -z / T::of(order + f64::from(k));
        sum += term;
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_decay_functions_are_smooth_where_their_forms_meet() {
        for z in [0.499_999_999, 0.5] {
            let z: f64 = z;
            assert!((decay1(z) - (1.0 - libm::exp(-z)) / z).abs() < 1e-15);
            assert!((decay2(z) - (z - 1.0 + libm::exp(-z)) / (z * z)).abs() < 1e-15);
        }
        assert_eq!((decay1(0.0_f64), decay2(0.0_f64)), (1.0, 0.5));
    }

    #[test]
    fn the_noise_integral_is_exact_for_polynomials() {
        let q = noise_integral(3.0, 2.0_f64, |s| [s * s / 2.0, s, 1.0]);
        for (r, c, want) in [(0, 0, 3.0 * 32.0 / 20.0), (0, 1, 3.0 * 2.0), (1, 1, 8.0), (2, 2, 6.0)] {
            assert!((q[r][c] - want).abs() < 1e-13);
        }
    }
}
