//! Is the stated covariance true: NEES, NIS, their averages with bounds, and the credibility of the filter.
//!
//! Source: Y. Bar-Shalom, X. R. Li, T. Kirubarajan, *Estimation with Applications to Tracking and Navigation*, 2001,
//! section 5.4; credibility: X. R. Li, Z. Zhao, *Measuring estimator's credibility: noncredibility index*, FUSION 2006.
//! Symbols: ε = eᵀ P⁻¹ e, χ² with n degrees of freedom if the filter is consistent; over N independent values the sum is χ²
//! with N n degrees of freedom, which gives the bounds of the average. Values of one run lean on each other: bounds are for
//! values of different runs at one scan.

use crate::{Error, ErrorKind, Result};
use nalgebra::{SMatrix, SVector};
use serde::Serialize;
use statrs::distribution::{ChiSquared, ContinuousCDF};

/// Normalised squared error eᵀ P⁻¹ e (no unit).
/// # Errors
/// [`ErrorKind::Numeric`] if P is not positive definite.
pub fn normalised_square<const N: usize>(error: &SVector<f64, N>, cov: &SMatrix<f64, N, N>) -> Result<f64> {
    let factor = cov.cholesky().ok_or_else(|| {
        Error::new(ErrorKind::Numeric, "expected a positive definite covariance").at(format!("P = {cov}"))
    })?;
    Ok(error.dot(&factor.solve(error)))
}

/// NIS of an update from what it left behind: the measurement's residual z − H x⁺ against the state after the update.
///
/// For a linear update with the whole gain, z − H x⁺ = R S⁻¹ ν and H P⁺ Hᵀ = R − R S⁻¹ R, so that the residual's normalised
/// square by R − H P⁺ Hᵀ is νᵀ S⁻¹ ν: tables that keep only states and detections still tell the NIS.
/// ```
/// use nalgebra::{Matrix2, Vector2};
/// // One axis of each kind: P = 3 and 1 before, R = 1, innovation (2, −1): NIS = 4/4 + 1/2.
/// let (p, r, v) = ([3.0, 1.0], 1.0, [2.0, -1.0]);
/// let gain = p.map(|p| p / (p + r));
/// let residual = Vector2::new((1.0 - gain[0]) * v[0], (1.0 - gain[1]) * v[1]);
/// let after = Matrix2::new((1.0 - gain[0]) * p[0], 0.0, 0.0, (1.0 - gain[1]) * p[1]);
/// let nis = boresight::metrics::consistency::nis_of_residual(&residual, &(Matrix2::identity() * r), &after)?;
/// assert!((nis - 1.5).abs() < 1e-12);
/// # Ok::<(), boresight::Error>(())
/// ```
/// # Errors
/// [`ErrorKind::Numeric`] if the state is not better known than the measurement: it was not the update of this measurement.
pub fn nis_of_residual<const N: usize>(
    residual: &SVector<f64, N>,
    measurement_cov: &SMatrix<f64, N, N>,
    posterior_cov: &SMatrix<f64, N, N>,
) -> Result<f64> {
    normalised_square(residual, &(measurement_cov - posterior_cov))
}

/// An average of normalised squares beside what a consistent filter would give.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Consistency {
    /// Average of ε.
    pub average: f64,
    /// Its expectation n.
    pub expected: f64,
    /// Lower bound of the average.
    pub lower: f64,
    /// Upper bound of the average.
    pub upper: f64,
    /// Number of values.
    pub n: u64,
}

impl Consistency {
    /// Whether the average lies within its bounds.
    pub fn is_credible(&self) -> bool {
        (self.lower..=self.upper).contains(&self.average)
    }
    /// What the average says in a word.
    pub fn verdict(&self) -> &'static str {
        if self.average > self.upper {
            "optimistic: the covariance is too small"
        } else if self.average < self.lower {
            "pessimistic: the covariance is too large"
        } else {
            "consistent"
        }
    }
}

/// Averages values of `dimension` degrees of freedom; the bounds hold a consistent filter with `probability`.
/// # Errors
/// No values, or one that is not a number; a probability outside (0, 1).
pub fn average(values: &[f64], dimension: usize, probability: f64) -> Result<Consistency> {
    if !(probability > 0.0 && probability < 1.0) {
        return Err(Error::new(ErrorKind::Config, "expected a probability in (0, 1)")
            .at(format!("probability = {probability}")));
    }
    if values.is_empty() || dimension == 0 {
        return Err(Error::new(ErrorKind::Config, "expected at least one value of at least one dimension"));
    }
    if values.iter().any(|v| v.is_nan()) {
        // Neither above nor below any bound, it would pass for consistent.
        return Err(Error::new(ErrorKind::Numeric, "a normalised square is not a number"));
    }
    let n = values.len() as f64;
    let [lower, upper] = bounds(n, dimension, probability)?;
    Ok(Consistency {
        average: values.iter().sum::<f64>() / n,
        expected: dimension as f64,
        lower,
        upper,
        n: values.len() as u64,
    })
}

/// Bounds that hold the average of `n` values of `dimension` degrees of freedom with `probability`.
pub(super) fn bounds(n: f64, dimension: usize, probability: f64) -> Result<[f64; 2]> {
    let chi = ChiSquared::new(n * dimension as f64).map_err(|e| Error::new(ErrorKind::Numeric, e.to_string()))?;
    let tail = (1.0 - probability) / 2.0;
    Ok([tail, 1.0 - tail].map(|p| chi.inverse_cdf(p) / n))
}

/// Noncredibility index: 10 times the mean of |log10(ε / ε*)|, with ε* from the true mean square error; 0 is credible.
/// The second number, the inclination indicator, has the sign kept: above 0 the filter is optimistic.
/// # Errors
/// Lists of different lengths or empty.
pub fn noncredibility(values: &[f64], with_true_error: &[f64]) -> Result<(f64, f64)> {
    if values.is_empty() || values.len() != with_true_error.len() {
        return Err(Error::new(ErrorKind::Config, "expected two lists of the same length, not empty"));
    }
    let logs: Vec<f64> = values.iter().zip(with_true_error).map(|(a, b)| 10.0 * (a / b).log10()).collect();
    let n = logs.len() as f64;
    Ok((logs.iter().map(|l| l.abs()).sum::<f64>() / n, logs.iter().sum::<f64>() / n))
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Matrix2, Vector2};

    #[test]
    fn fifty_runs_of_two_dimensions_have_the_textbook_bounds() {
        // Bar-Shalom et al. 2001, section 5.4.2: χ²₁₀₀ at 2.5 % and 97.5 % is 74.22 and 129.56; 50 runs: [1.5, 2.6].
        let c = average(&[2.0; 50], 2, 0.95).unwrap();
        assert!((c.lower - 74.222 / 50.0).abs() < 1e-4 && (c.upper - 129.561 / 50.0).abs() < 1e-4, "{c:?}");
        assert!(c.is_credible());
        assert_eq!(average(&[4.0; 50], 2, 0.95).unwrap().verdict(), "optimistic: the covariance is too small");
    }

    #[test]
    fn what_is_not_a_number_is_never_called_consistent() {
        assert!(average(&[2.0, f64::NAN], 2, 0.95).unwrap_err().to_string().contains("not a number"));
        assert_eq!(
            average(&[2.0, f64::INFINITY], 2, 0.95).unwrap().verdict(),
            "optimistic: the covariance is too small"
        );
    }

    #[test]
    fn a_normalised_square_is_that_of_the_whitened_error() {
        let p = Matrix2::new(4.0, 0.0, 0.0, 9.0);
        assert!((normalised_square(&Vector2::new(2.0, 3.0), &p).unwrap() - 2.0).abs() < 1e-15);
        assert!(normalised_square(&Vector2::new(2.0, 3.0), &-p).is_err());
    }

    #[test]
    fn errors_ten_times_too_large_incline_by_ten() {
        let (index, inclination) = noncredibility(&[10.0, 20.0], &[1.0, 2.0]).unwrap();
        assert!((index - 10.0).abs() < 1e-12 && (inclination - 10.0).abs() < 1e-12);
    }
}
