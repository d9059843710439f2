//! The general linear Kalman step for any H of any height: what the golden vectors and nonlinear forms use.
//!
//! Source: `docs/theory/filters.md` (Joseph form, symmetrised). Symbols: x N x 1; P N x N; H M x N; R, S M x M; K N x M;
//! ν M x 1.
//! Cost: about 2 N³ flops for the Joseph product; trackers of positions use [`crate::Kf`], whose H only picks.
//! Limits: S must be positive definite; no structure is used.

use crate::linalg::{Cholesky, mul, mul_transposed, symmetrize};
use crate::{FilterError, Gaussian, Real};
use nalgebra::{SMatrix, SVector};

/// What one linear update found besides the new belief.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct LinearUpdate<const N: usize, const M: usize, T = f64> {
    /// The belief after the measurement.
    pub belief: Gaussian<N, T>,
    /// ν = z - H x.
    pub innovation: SVector<T, M>,
    /// S = H P Hᵀ + R.
    pub innovation_cov: SMatrix<T, M, M>,
    /// K = P Hᵀ S⁻¹.
    pub gain: SMatrix<T, N, M>,
    /// νᵀ S⁻¹ ν, no unit.
    pub distance2: T,
}

/// Returns Phi x and Phi P Phiᵀ + Q.
pub fn predict_linear<const N: usize, T: Real>(
    b: &Gaussian<N, T>,
    phi: &SMatrix<T, N, N>,
    process_noise: &SMatrix<T, N, N>,
) -> Gaussian<N, T> {
    let mut cov = mul_transposed(&mul(phi, &b.cov), phi) + process_noise;
    symmetrize(&mut cov);
    Gaussian { mean: mul(phi, &b.mean), cov }
}

/// Corrects a belief by an innovation ν with H and R (Joseph form).
/// # Errors
/// [`FilterError::NotPositiveDefinite`] if S cannot be factored.
pub fn correct_linear<const N: usize, const M: usize, T: Real>(
    b: &Gaussian<N, T>,
    h: &SMatrix<T, M, N>,
    innovation: &SVector<T, M>,
    r: &SMatrix<T, M, M>,
) -> Result<LinearUpdate<N, M, T>, FilterError> {
    let pht = mul_transposed(&b.cov, h);
    let mut s = mul(h, &pht) + r;
    symmetrize(&mut s);
    let chol = Cholesky::new(&s, "the innovation covariance")?;
    let gain = chol.solve(&pht.transpose()).transpose();
    let mut keep = SMatrix::<T, N, N>::identity();
    keep -= mul(&gain, h);
    let mut cov = mul_transposed(&mul(&keep, &b.cov), &keep) + mul_transposed(&mul(&gain, r), &gain);
    symmetrize(&mut cov);
    let white = chol.whiten(innovation);
    Ok(LinearUpdate {
        belief: Gaussian { mean: b.mean + mul(&gain, innovation), cov },
        innovation: *innovation,
        innovation_cov: s,
        gain,
        distance2: white.dot(&white),
    })
}
