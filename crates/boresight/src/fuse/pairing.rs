//! Which track of one sensor is which of the other's: least total cost over mean squared distances.
//!
//! Cost of a pair: mean over the common times of d² = Δpᵀ (P_a + P_b)⁻¹ Δp of the positions (about 2 for one target); a track may
//! stay alone at the cost of the gate / 2. Exact assignment. Symbols: Δp px. Limits: errors of tracks are correlated in time, so
//! the gate is on the mean, not a χ² of the sum; registration must be done before.

use super::timeline::{Timeline, halves};
use crate::Result;
use crate::associate::assignment::dense::Dense;
use nalgebra::Matrix2;

/// Squared distance of two beliefs' positions with independent errors (no unit).
pub fn position_distance2(a: &boresight_filters::Gaussian<4>, b: &boresight_filters::Gaussian<4>) -> Option<f64> {
    let d = halves(&a.mean).0 - halves(&b.mean).0;
    let p = a.cov + b.cov;
    let s = Matrix2::new(p[(0, 0)], p[(0, 2)], p[(2, 0)], p[(2, 2)]).try_inverse()?;
    let d2 = d.dot(&(s * d));
    (d2.is_finite() && d2 >= 0.0).then_some(d2)
}

/// Mean d² of two tracks over the first one's times, and the number of common times.
pub fn mean_distance2(a: &Timeline, b: &Timeline, density: f64, max_gap_s: f64) -> (f64, usize) {
    let (mut sum, mut n) = (0.0, 0usize);
    for (t, belief) in &a.points {
        if let Some(d2) = b.at(*t, density, max_gap_s).and_then(|other| position_distance2(belief, &other)) {
            sum += d2;
            n += 1;
        }
    }
    (if n > 0 { sum / n as f64 } else { f64::INFINITY }, n)
}

/// Pairs (index in `a`, index in `b`) whose mean d² is at most `gate` over at least `min_common` times.
/// # Errors
/// None in practice: costs are finite by construction.
pub fn pair_tracks(
    a: &[Timeline],
    b: &[Timeline],
    gate: f64,
    min_common: usize,
    density: f64,
    max_gap_s: f64,
) -> Result<Vec<(usize, usize)>> {
    let n = a.len() + b.len();
    if a.is_empty() || b.is_empty() {
        return Ok(Vec::new());
    }
    // Square problem: a real pair costs its d², a track alone half the gate, a pair of dummies nothing.
    let forbidden = 1e6 * gate.max(1.0);
    let mut cost = vec![0.0; n * n];
    for (i, row) in cost.chunks_mut(n).enumerate() {
        for (j, c) in row.iter_mut().enumerate() {
            *c = match (a.get(i), b.get(j)) {
                (Some(x), Some(y)) => {
                    let (d2, common) = mean_distance2(x, y, density, max_gap_s);
                    if d2 <= gate && common >= min_common.max(1) { d2 } else { forbidden }
                }
                (Some(_), None) | (None, Some(_)) => gate / 2.0,
                (None, None) => 0.0,
            };
        }
    }
    let mut solver = Dense::default();
    let columns = solver.solve(n, &cost)?;
    let chosen = columns.iter().take(a.len()).enumerate().map(|(i, j)| (i, *j as usize));
    Ok(chosen.filter(|(i, j)| *j < b.len() && cost[i * n + j] < forbidden).collect())
}
