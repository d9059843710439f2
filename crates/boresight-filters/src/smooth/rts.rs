//! Rauch-Tung-Striebel smoother in covariance form.
//!
//! Source: H. E. Rauch, F. Tung, C. T. Striebel, AIAA Journal 3(8), 1965: C = P Phiᵀ P~⁻¹, x_s = x + C (x_s⁺ - x~),
//! P_s = P + C (P_s⁺ - P~) Cᵀ.
//! Differs from it: P_s is summed as (I - C Phi) P (I - C Phi)ᵀ + C (Q + P_s⁺) Cᵀ, each part positive semi-definite.
//! Symbols: x, P filtered; x~, P~ predicted; ⁺ next scan. Cost: about 5 N³ flops a scan. A nonlinear model is
//! linearised at the filtered mean. Limits: P~ must be positive definite; [`super::rts_square_root`] otherwise.

use super::Filtered;
use crate::linalg::{Cholesky, mul, mul_transposed, symmetrize};
use crate::model::Model;
use crate::{FilterError, Gaussian, Real};
use nalgebra::SMatrix;

/// Returns the smoothed belief of a scan from its filtered one and the smoothed one of the next scan, `dt_s` later.
/// # Errors
/// [`FilterError::NotPositiveDefinite`] if the predicted covariance cannot be factored.
pub fn rts_step<M: Model<N, T>, const N: usize, T: Real>(
    model: &M,
    filtered: &Gaussian<N, T>,
    next: &Gaussian<N, T>,
    dt_s: T,
) -> Result<Gaussian<N, T>, FilterError> {
    if dt_s == T::zero() {
        return Ok(*next);
    }
    let phi = model.transition(dt_s, &filtered.mean);
    let q = model.process_noise(dt_s);
    let phi_p = mul(&phi, &filtered.cov);
    let mut predicted = mul_transposed(&phi_p, &phi) + q;
    symmetrize(&mut predicted);
    let gain = Cholesky::new(&predicted, "the predicted covariance")?.solve(&phi_p).transpose();
    let keep = SMatrix::<T, N, N>::identity() - mul(&gain, &phi);
    let mut cov =
        mul_transposed(&mul(&keep, &filtered.cov), &keep) + mul_transposed(&mul(&gain, &(q + next.cov)), &gain);
    symmetrize(&mut cov);
    let mean = filtered.mean + gain * (next.mean - model.moved(dt_s, &filtered.mean));
    Ok(Gaussian { mean, cov })
}

/// Replaces filtered beliefs by smoothed ones, newest last; the last one is already smoothed.
/// # Errors
/// [`FilterError`] as [`rts_step`]; entries after the failing one are then already smoothed.
pub fn rts<M: Model<N, T>, const N: usize, T: Real>(
    model: &M,
    scans: &mut [Filtered<N, T>],
) -> Result<(), FilterError> {
    for k in (0..scans.len().saturating_sub(1)).rev() {
        if let [now, next] = &mut scans[k..k + 2] {
            now.belief = rts_step(model, &now.belief, &next.belief, next.dt_s)?;
        }
    }
    Ok(())
}
