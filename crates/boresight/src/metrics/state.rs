//! Errors of state estimates over the scans: PFE, RMSPE, RMSVE, root-sum-square errors, errors against their bounds.
//!
//! Source: `docs/theory/measures.md` (the papers' equations, corrected: the denominator of PFE is the norm of the
//! truth; the printed "/2" under the root was not used for the tables, so it is the `halved` variant).
//! Symbols: rows `[x, vx, y, vy]` (px, px/s); e = truth − estimate; PFE_x = 100 ‖e_x‖ / ‖x‖ (percent; depends on where the
//! coordinates begin: the papers count pixels from 1); RMSPE = √mean(e_x² + e_y²), px; RMSVE with velocities, px/s.

use crate::{Error, ErrorKind, Result};
use serde::Serialize;

/// Errors over the scans of a run.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct StateErrors {
    /// Percentage fit error in x.
    pub pfe_x: f64,
    /// Percentage fit error in y.
    pub pfe_y: f64,
    /// Root mean square position error, px.
    pub rmspe: f64,
    /// Root mean square velocity error, px/s.
    pub rmsve: f64,
    /// RMSPE with the papers' printed "/2": the mean over both axes, px.
    pub rmspe_halved: f64,
    /// RMSVE with the papers' printed "/2", px/s.
    pub rmsve_halved: f64,
}

fn same_length(truth: &[[f64; 4]], estimate: &[[f64; 4]]) -> Result<()> {
    if truth.is_empty() || truth.len() != estimate.len() {
        let what =
            format!("{} truths and {} estimates: expected as many, and at least one", truth.len(), estimate.len());
        return Err(Error::new(ErrorKind::Config, what));
    }
    Ok(())
}

/// Computes the errors of a run; rows are `[x, vx, y, vy]`.
///
/// ```
/// // The worked example of docs/theory/measures.md.
/// let truth = [[11.0, 1.0, 11.0, 1.0], [12.0, 1.0, 12.0, 1.0], [13.0, 1.0, 13.0, 1.0]];
/// let estimate = [[11.2, 1.1, 10.9, 1.0], [12.1, 0.9, 12.3, 1.05], [12.8, 1.0, 13.1, 0.95]];
/// let e = boresight::metrics::state::state_errors(&truth, &estimate)?;
/// assert!((e.pfe_x - 1.440046082212).abs() < 1e-12 && (e.rmspe - 0.25819888974716).abs() < 1e-14);
/// # Ok::<(), boresight::Error>(())
/// ```
/// # Errors
/// No rows, or not as many truths as estimates.
pub fn state_errors(truth: &[[f64; 4]], estimate: &[[f64; 4]]) -> Result<StateErrors> {
    same_length(truth, estimate)?;
    let (mut error2, mut norm2) = ([0.0; 4], [0.0; 4]);
    for (t, e) in truth.iter().zip(estimate) {
        for k in 0..4 {
            error2[k] += (t[k] - e[k]).powi(2);
            norm2[k] += t[k].powi(2);
        }
    }
    let n = truth.len() as f64;
    let pfe = |k: usize| 100.0 * error2[k].sqrt() / norm2[k].sqrt();
    let (position2, velocity2) = ((error2[0] + error2[2]) / n, (error2[1] + error2[3]) / n);
    Ok(StateErrors {
        pfe_x: pfe(0),
        pfe_y: pfe(2),
        rmspe: position2.sqrt(),
        rmsve: velocity2.sqrt(),
        rmspe_halved: (position2 / 2.0).sqrt(),
        rmsve_halved: (velocity2 / 2.0).sqrt(),
    })
}

/// Root-sum-square position and velocity error of each scan (px, px/s).
/// # Errors
/// As [`state_errors`].
pub fn root_sum_square(truth: &[[f64; 4]], estimate: &[[f64; 4]]) -> Result<Vec<[f64; 2]>> {
    same_length(truth, estimate)?;
    let rss = |t: &[f64; 4], e: &[f64; 4], k: usize| (t[k] - e[k]).hypot(t[k + 2] - e[k + 2]);
    Ok(truth.iter().zip(estimate).map(|(t, e)| [rss(t, e, 0), rss(t, e, 1)]).collect())
}

/// A state error beside the bound that its own covariance claims.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct BoundedError {
    /// Truth − estimate of `[x, vx, y, vy]`.
    pub error: [f64; 4],
    /// `n_sigma` standard deviations of the estimate.
    pub bound: [f64; 4],
}

/// State errors of each scan with their bounds ± `n_sigma` √variance.
/// # Errors
/// As [`state_errors`]; also if the variances are not as many.
pub fn bounded_errors(
    truth: &[[f64; 4]],
    estimate: &[[f64; 4]],
    variance: &[[f64; 4]],
    n_sigma: f64,
) -> Result<Vec<BoundedError>> {
    same_length(truth, estimate)?;
    same_length(truth, variance)?;
    let one = |((t, e), v): ((&[f64; 4], &[f64; 4]), &[f64; 4])| BoundedError {
        error: std::array::from_fn(|k| t[k] - e[k]),
        bound: std::array::from_fn(|k| n_sigma * v[k].max(0.0).sqrt()),
    };
    Ok(truth.iter().zip(estimate).zip(variance).map(one).collect())
}

/// Share of the scans in which each error lies within its bound.
pub fn share_within(errors: &[BoundedError]) -> [f64; 4] {
    let n = errors.len().max(1) as f64;
    std::array::from_fn(|k| errors.iter().filter(|e| e.error[k].abs() <= e.bound[k]).count() as f64 / n)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn errors_of_three_four_five_triangles() {
        let rss = root_sum_square(&[[3.0, 0.0, 4.0, 0.0]], &[[0.0, 5.0, 0.0, 12.0]]).unwrap();
        assert_eq!(rss, [[5.0, 13.0]]);
        let b = bounded_errors(&[[3.0, 0.0, 4.0, 0.0]], &[[0.0; 4]], &[[4.0; 4]], 1.9).unwrap();
        assert_eq!((b[0].bound[0], share_within(&b)), (3.8, [1.0, 1.0, 0.0, 1.0]));
    }

    #[test]
    fn unequal_lengths_are_refused() {
        assert!(state_errors(&[[0.0; 4]], &[]).unwrap_err().to_string().contains("1 truths and 0 estimates"));
    }
}
