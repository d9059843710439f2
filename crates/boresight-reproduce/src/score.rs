//! The papers' four numbers of a run, and what a Monte Carlo study says of them.
//!
//! Source: `docs/theory/measures.md`: PFE = 100 |x - x̂|₂ / |x|₂ (x = truth), RMSPE = sqrt(mean(e_x² + e_y²)), RMSVE
//! the same of the velocities, without "/2". Percentile: share of runs at or below the paper's value (half of the
//! ties).
//! Units: per cent, px, px/scan.

use nalgebra::Vector4;

/// Names of the four numbers, in order.
pub const MEASURES: [&str; 4] = ["PFE_x", "PFE_y", "RMSPE", "RMSVE"];

/// PFE_x (%), PFE_y (%), RMSPE (px), RMSVE (px/scan) of a run.
pub fn four_numbers(truth: &[Vector4<f64>], estimates: &[Vector4<f64>]) -> [f64; 4] {
    let n = truth.len().min(estimates.len()).max(1) as f64;
    let sum = |i: usize, f: &dyn Fn(f64, f64) -> f64| -> f64 {
        truth.iter().zip(estimates).map(|(t, e)| f(t[i], e[i])).sum()
    };
    let error = |i| sum(i, &|t, e| (t - e).powi(2));
    let size = |i| sum(i, &|t, _| t * t);
    let pfe = |i| 100.0 * (error(i) / size(i)).sqrt();
    [pfe(0), pfe(2), ((error(0) + error(2)) / n).sqrt(), ((error(1) + error(3)) / n).sqrt()]
}

/// Whether a run ended more than `limit_px` from the truth.
pub fn lost(truth: &[Vector4<f64>], estimates: &[Vector4<f64>], limit_px: f64) -> bool {
    match (truth.last(), estimates.last()) {
        (Some(t), Some(e)) => {
            let off = (t[0] - e[0]).hypot(t[2] - e[2]);
            off.is_nan() || off > limit_px
        }
        _ => true,
    }
}

/// Mean, standard deviation and percentile of the paper's value over the runs.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Spread {
    /// Mean.
    pub mean: f64,
    /// Standard deviation (n - 1).
    pub std: f64,
    /// Share of the runs below the paper's value, per cent; none where the paper prints nothing.
    pub percentile: Option<f64>,
    /// Number of runs counted.
    pub n: usize,
}

impl Spread {
    /// Itself, unless every run was left out.
    pub fn kept(&self) -> Option<&Self> {
        (self.n > 0).then_some(self)
    }
}

/// Summarises the values of the runs.
pub fn spread(values: &[f64], paper: Option<f64>) -> Spread {
    let n = values.len();
    let mean = values.iter().sum::<f64>() / n.max(1) as f64;
    let std = (values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / (n.saturating_sub(1)).max(1) as f64).sqrt();
    let percentile = paper.map(|p| {
        let below = values.iter().filter(|v| **v < p).count() as f64;
        let equal = values.iter().filter(|v| **v == p).count() as f64;
        100.0 * (below + 0.5 * equal) / n.max(1) as f64
    });
    Spread { mean, std, percentile, n }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_worked_example_of_the_chapter_on_measures() {
        // The worked example of docs/theory/measures.md.
        let truth = [[11.0, 1.0, 11.0, 1.0], [12.0, 1.0, 12.0, 1.0], [13.0, 1.0, 13.0, 1.0]].map(Vector4::from);
        let estimates = [[11.2, 1.1, 10.9, 1.0], [12.1, 0.9, 12.3, 1.05], [12.8, 1.0, 13.1, 0.95]].map(Vector4::from);
        let golden = [1.440046082212, 1.5920308451728, 0.25819888974716, 0.091287092917528];
        for (ours, golden) in four_numbers(&truth, &estimates).into_iter().zip(golden) {
            assert!((ours - golden).abs() < 1e-12, "{ours} {golden}");
        }
    }

    #[test]
    fn percentiles_count_half_of_the_ties() {
        assert_eq!(spread(&[0.0; 10], Some(0.0)).percentile, Some(50.0));
        assert_eq!(spread(&[1.0, 2.0, 3.0, 4.0], Some(2.5)).percentile, Some(50.0));
    }
}
