//! Rauch-Tung-Striebel smoother in square roots: no covariance is ever a difference.
//!
//! Source: P. Park, T. Kailath, "New square-root smoothing algorithms", IEEE Trans. AC 41(5), 1996; the form is
//! (I - C Phi) S, C G L and C S_s⁺ side by side, made triangular by Householder: P_s = their products summed. The gain
//! C = P Phiᵀ P~⁻¹ is solved in roots as well: S~ = root of [Phi S | G L], C = (S (Phi S)ᵀ S~⁻ᵀ) S~⁻¹.
//! Cost: about 12 N³ flops a scan. Limits: P~ must be positive definite in the precision of its root (half the digits).
//! Symbols: x, P, S filtered; ~ predicted; ⁺ next scan; G, L process-noise root.

use super::Filtered;
use crate::linalg::{Cholesky, lower_factor, mul, mul_transposed};
use crate::model::{Model, NoiseVisitor};
use crate::{FilterError, Gaussian, Real};
use nalgebra::{SMatrix, SVector};

struct Roots<const N: usize, T> {
    phi: SMatrix<T, N, N>,
    s: SMatrix<T, N, N>,
    next: SMatrix<T, N, N>,
}

impl<const N: usize, T: Real> NoiseVisitor<N, T> for Roots<N, T> {
    type Out = Result<(SMatrix<T, N, N>, SMatrix<T, N, N>), FilterError>;
    fn visit<const W: usize>(self, g: &SMatrix<T, N, W>, q: &SVector<T, W>) -> Self::Out {
        let mut noise = *g;
        for c in 0..W {
            let s = q[c].sqrt();
            for i in 0..N {
                noise[(i, c)] *= s;
            }
        }
        let phi_s = mul(&self.phi, &self.s);
        let l = lower_factor(&phi_s, &noise);
        if !(0..N).all(|i| l[(i, i)] > T::zero()) {
            return Err(FilterError::NotPositiveDefinite("the predicted covariance"));
        }
        let gain = Cholesky { l }.solve(&mul_transposed(&phi_s, &self.s)).transpose();
        let keep = SMatrix::<T, N, N>::identity() - mul(&gain, &self.phi);
        let first = lower_factor(&mul(&keep, &self.s), &mul(&gain, &noise));
        Ok((gain, lower_factor(&first, &mul(&gain, &self.next))))
    }
}

/// Replaces filtered beliefs by smoothed ones, newest last, carrying square roots from scan to scan.
/// # Errors
/// [`FilterError`] if a covariance cannot be factored; entries after the failing one are then already smoothed.
pub fn rts_square_root<M: Model<N, T>, const N: usize, T: Real>(
    model: &M,
    scans: &mut [Filtered<N, T>],
) -> Result<(), FilterError> {
    let Some(last) = scans.last() else { return Ok(()) };
    let mut root = Cholesky::semi_definite(&last.belief.cov, "the state covariance")?.l;
    for k in (0..scans.len() - 1).rev() {
        let [now, next] = &mut scans[k..k + 2] else { continue };
        if next.dt_s == T::zero() {
            now.belief = next.belief;
            continue;
        }
        let b = now.belief;
        let s = Cholesky::semi_definite(&b.cov, "the state covariance")?.l;
        let phi = model.transition(next.dt_s, &b.mean);
        let (gain, smoothed) = model.with_noise_factor(next.dt_s, Roots { phi, s, next: root })??;
        root = smoothed;
        now.belief = Gaussian {
            mean: b.mean + gain * (next.belief.mean - model.moved(next.dt_s, &b.mean)),
            cov: mul_transposed(&root, &root),
        };
    }
    Ok(())
}
