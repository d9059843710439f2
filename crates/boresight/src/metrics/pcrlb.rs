//! Posterior Cramér-Rao bound of a linear Gaussian model: how good any estimator can be at best.
//!
//! Source: P. Tichavský, C. Muravchik, A. Nehorai, *Posterior Cramér-Rao bounds for discrete-time nonlinear filtering*, IEEE
//! Trans. Signal Processing 46(5), 1998; missed detections by the information reduction factor (here P_D, which is exact
//! for the expected information).
//! Symbols: J information N×N; J' = (Q + F J⁻¹ Fᵀ)⁻¹ + P_D Hᵀ R⁻¹ H; the bound of the covariance is J⁻¹.
//! Limits: the model given is taken as true; with P_D < 1 the bound is that of the mean information (optimistic).

use crate::{Error, ErrorKind, Result};
use nalgebra::SMatrix;

/// A linear Gaussian model of N states and M measured quantities.
#[derive(Clone, Debug)]
pub struct LinearModel<const N: usize, const M: usize> {
    /// Transition F.
    pub transition: SMatrix<f64, N, N>,
    /// Process noise Q.
    pub process_noise: SMatrix<f64, N, N>,
    /// What is measured: H.
    pub observation: SMatrix<f64, M, N>,
    /// Measurement noise R.
    pub measurement_noise: SMatrix<f64, M, M>,
    /// Probability of detection, in (0, 1].
    pub detection_probability: f64,
}

fn singular(what: &str) -> Error {
    Error::new(ErrorKind::Numeric, format!("expected a positive definite {what}"))
}

/// Bounds of the covariance after each of `n_scans` updates, from the covariance before the first prediction.
/// # Errors
/// Matrices that are not positive definite; a probability outside (0, 1].
pub fn pcrlb<const N: usize, const M: usize>(
    model: &LinearModel<N, M>,
    start: &SMatrix<f64, N, N>,
    n_scans: usize,
) -> Result<Vec<SMatrix<f64, N, N>>> {
    let p_d = model.detection_probability;
    if !(p_d > 0.0 && p_d <= 1.0) {
        return Err(Error::new(ErrorKind::Config, "expected a probability in (0, 1]")
            .at(format!("detection-probability = {p_d}")));
    }
    let r = model.measurement_noise.cholesky().ok_or_else(|| singular("measurement noise"))?;
    let seen = model.observation.transpose() * r.solve(&model.observation) * p_d;
    let mut bound = *start;
    let mut out = Vec::with_capacity(n_scans);
    for _ in 0..n_scans {
        let predicted = model.transition * bound * model.transition.transpose() + model.process_noise;
        let information = predicted.cholesky().ok_or_else(|| singular("predicted covariance"))?.inverse() + seen;
        bound = information.cholesky().ok_or_else(|| singular("information"))?.inverse();
        out.push(bound);
    }
    Ok(out)
}

/// Bound of the RMSPE over `n_scans` scans of a constant-velocity target without prior knowledge, seen with variance
/// `r_px2` per axis: √(2 mean r (4k − 2) / (k (k + 1))), px (`docs/theory/measures.md`).
pub fn rmspe_without_prior(r_px2: f64, n_scans: usize) -> f64 {
    let variance = |k: f64| r_px2 * (4.0 * k - 2.0) / (k * (k + 1.0));
    (2.0 * (1..=n_scans).map(|k| variance(k as f64)).sum::<f64>() / n_scans.max(1) as f64).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Matrix1, Matrix1x2, Matrix2};

    #[test]
    fn a_constant_seen_n_times_is_bounded_by_r_over_n() {
        let model = LinearModel {
            transition: Matrix1::new(1.0),
            process_noise: Matrix1::new(0.0),
            observation: Matrix1::new(1.0),
            measurement_noise: Matrix1::new(2.0),
            detection_probability: 1.0,
        };
        let b = pcrlb(&model, &Matrix1::new(1e12), 10).unwrap();
        assert!((b[9][0] - 0.2).abs() < 1e-9);
    }

    #[test]
    fn missed_detections_loosen_the_bound() {
        let model = |p_d| LinearModel {
            transition: Matrix2::new(1.0, 1.0, 0.0, 1.0),
            process_noise: Matrix2::identity() * 1e-3,
            observation: Matrix1x2::new(1.0, 0.0),
            measurement_noise: Matrix1::new(1.0),
            detection_probability: p_d,
        };
        let last = |p_d| pcrlb(&model(p_d), &Matrix2::identity(), 50).unwrap()[49][(0, 0)];
        assert!(last(0.5) > last(1.0));
        assert!((rmspe_without_prior(1.0, 50) - 0.696).abs() < 5e-4);
    }
}
