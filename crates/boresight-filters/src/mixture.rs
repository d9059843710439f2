//! The PDA update on any Gaussian filter: several weighted measurements and the chance that none is the target's own.
//!
//! Source: `docs/theory/association.md`: P^ = p0 P~ + (1 - p0)(P~ - K S Kᵀ) + K (Σ p_i ν_i ν_iᵀ - ν νᵀ) Kᵀ.
//! Differs from it: each hypothesis may have a covariance of its own, then each has its own gain and the result is the
//! exact moment match of the mixture Σ p_i N(x_i, P_i); with one covariance for all it is the PDA update. The spread
//! is summed about its own mean, so it cannot lose positive definiteness to cancellation.
//! Symbols: p_i weights; p0 = 1 - Σ p_i; K_i N x 2; S_i 2 x 2 (px²). Cost: about 2 m N² + N² flops for m hypotheses.
//! Limits: the mixture's shape is lost: two far hypotheses of equal weight give a wide Gaussian between them.

use crate::check::check_weighted;
use crate::gaussian::position_of;
use crate::linalg::{invert_pair, symmetrize};
use crate::{FilterError, Gaussian, Real, Weighted};
use nalgebra::{Matrix2, SMatrix, SVector, Vector2};

/// A gain and the measurement covariance that it belongs to.
type Known<const N: usize, T> = Option<(Matrix2<T>, SMatrix<T, N, 2>)>;

fn gain<const N: usize, T: Real>(
    b: &Gaussian<N, T>,
    at: [usize; 2],
    r: &Matrix2<T>,
) -> Result<SMatrix<T, N, 2>, FilterError> {
    let pair = invert_pair(&(position_of(b, at).cov + r), "the innovation covariance")?;
    let mut k = SMatrix::<T, N, 2>::zeros();
    for i in 0..N {
        let (p0, p1) = (b.cov[(i, at[0])], b.cov[(i, at[1])]);
        k[(i, 0)] = p0 * pair.inverse[(0, 0)] + p1 * pair.inverse[(1, 0)];
        k[(i, 1)] = p0 * pair.inverse[(0, 1)] + p1 * pair.inverse[(1, 1)];
    }
    Ok(k)
}

/// Returns the moment-matched belief after the hypotheses.
/// # Errors
/// [`FilterError`] as [`crate::GaussianFilter::correct_weighted`].
pub fn mixture_update<T: Real, const N: usize>(
    prior: &Gaussian<N, T>,
    at: [usize; 2],
    hypotheses: impl Iterator<Item = Weighted<T>> + Clone,
) -> Result<Gaussian<N, T>, FilterError> {
    let (sum, n) = check_weighted(hypotheses.clone())?;
    if n == 0 {
        return Ok(*prior);
    }
    let p0 = (T::one() - sum).max(T::zero());
    let position = Vector2::new(prior.mean[at[0]], prior.mean[at[1]]);
    // Pass 1: the mean shift and the mean of the components' covariances.
    let mut shift = SVector::<T, N>::zeros();
    let mut cov = prior.cov * p0;
    let mut last: Known<N, T> = None;
    for h in hypotheses.clone().filter(|h| h.weight > T::zero()) {
        let g = cached(&mut last, prior, at, &h.measurement.cov)?;
        shift += g * (h.measurement.position - position) * h.weight;
        // Joseph form of P~ - K S Kᵀ: each component stays positive semi-definite by itself.
        cov += joseph(&prior.cov, at, g, &h.measurement.cov) * h.weight;
    }
    // Pass 2: the spread of the components' means about the common mean.
    let mut spread = shift * shift.transpose() * p0;
    for h in hypotheses.filter(|h| h.weight > T::zero()) {
        let g = cached(&mut last, prior, at, &h.measurement.cov)?;
        let off = g * (h.measurement.position - position) - shift;
        spread += off * off.transpose() * h.weight;
    }
    cov += spread;
    symmetrize(&mut cov);
    Ok(Gaussian { mean: prior.mean + shift, cov })
}

fn cached<'a, T: Real, const N: usize>(
    last: &'a mut Known<N, T>,
    prior: &Gaussian<N, T>,
    at: [usize; 2],
    r: &Matrix2<T>,
) -> Result<&'a SMatrix<T, N, 2>, FilterError> {
    let fresh = match last.take() {
        Some((of, g)) if of == *r => (of, g),
        _ => (*r, gain(prior, at, r)?),
    };
    Ok(&last.insert(fresh).1)
}

/// Returns (I - K H) P (I - K H)ᵀ + K R Kᵀ for the position rows `at`.
#[inline(always)]
pub(crate) fn joseph<T: Real, const N: usize>(
    p: &SMatrix<T, N, N>,
    at: [usize; 2],
    k: &SMatrix<T, N, 2>,
    r: &Matrix2<T>,
) -> SMatrix<T, N, N> {
    // A = (I - K H) P, then A (I - K H)ᵀ = A - (A Hᵀ) Kᵀ.
    let mut a = *p;
    for c in 0..N {
        let (h0, h1) = (p[(at[0], c)], p[(at[1], c)]);
        for i in 0..N {
            a[(i, c)] -= k[(i, 0)] * h0 + k[(i, 1)] * h1;
        }
    }
    let mut b = SMatrix::<T, N, 2>::zeros();
    for i in 0..N {
        // A Hᵀ - K R, so that out = A - (A Hᵀ - K R) Kᵀ.
        b[(i, 0)] = a[(i, at[0])] - (k[(i, 0)] * r[(0, 0)] + k[(i, 1)] * r[(1, 0)]);
        b[(i, 1)] = a[(i, at[1])] - (k[(i, 0)] * r[(0, 1)] + k[(i, 1)] * r[(1, 1)]);
    }
    // All of it, then the mean of both halves: whole columns are quicker than a triangle.
    for c in 0..N {
        for i in 0..N {
            a[(i, c)] -= b[(i, 0)] * k[(c, 0)] + b[(i, 1)] * k[(c, 1)];
        }
    }
    symmetrize(&mut a);
    a
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::ConstantVelocity;
    use crate::{GaussianFilter, Measurement, Start, Ud};

    fn half_way<T: Real>() {
        let first = Measurement::isotropic(T::zero(), T::zero(), T::one());
        let cv = ConstantVelocity::<T>::continuous(T::one()).unwrap();
        for n in [100, 10_000, 100_000] {
            let mut f = Ud::<_, 4, T>::from_point(cv, &first, T::one()).unwrap();
            let measurement = Measurement::isotropic(T::one(), T::zero(), T::one());
            let one = Weighted { measurement, weight: T::of(1.0 / n as f64) };
            f.correct_weighted(core::iter::repeat_n(one, n)).unwrap();
            // All are one measurement with R = P.
            let x = f.predicted().mean[0].as_f64();
            assert!((x - 0.5).abs() < 2e-3, "{n}: {x}");
        }
    }

    #[test]
    fn weights_that_sum_to_one_are_taken_however_many_they_are() {
        half_way::<f64>();
        half_way::<f32>();
    }
}
