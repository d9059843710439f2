//! Several targets: what the higher ones explain of a candidate's score is taken off, and what is left must stand by itself.
//!
//! Source: orthogonal matching pursuit, Y. C. Pati, R. Rezaiifar & P. S. Krishnaprasad, Asilomar Conf. 1993, over the paths' own templates.
//! Two paths whose places lie d(τ) apart have templates of correlation ρ = mean exp(−d² / 4σ²). Candidates come from the highest down. With
//! C = L Lᵀ the correlations of those kept and b = L⁻¹ z, a candidate with correlations c has y = L⁻¹ c, of its template 1 − yᵀy is its own, and its
//! own score is (z − yᵀb) / √(1 − yᵀy): what a joint fit of all amplitudes would give it.
//! A kept target is never only a model: one wider than σ, or that turns, leaves more than ρ says around it. So at least [`MISFIT`] of what is
//! explained must be left, and less than [`SAME`] of the template explained.
//! Limits: [`MOST`] targets a sum.

use super::refine::Found;

/// Most targets of a sum.
pub(super) const MOST: usize = 256;
/// Part of what is explained that the model may be wrong by.
const MISFIT: f64 = 0.25;
/// Part of a template (yᵀy) from which on a candidate is no target of its own: two of 64 frames whose ends lie 3 σ apart still differ by more.
const SAME: f64 = 0.8;

/// Those kept so far.
#[derive(Clone, Debug, Default)]
pub(super) struct Kept {
    paths: Vec<Found>,
    /// Rows of L, one after another.
    rows: Vec<f64>,
    b: Vec<f64>,
    y: Vec<f64>,
}

impl Kept {
    /// Makes room.
    pub(super) fn new() -> Self {
        Self {
            paths: Vec::with_capacity(MOST),
            rows: Vec::with_capacity(MOST * (MOST + 1) / 2),
            b: Vec::with_capacity(MOST),
            y: Vec::with_capacity(MOST + 1),
        }
    }

    /// Forgets all.
    pub(super) fn clear(&mut self) {
        self.paths.clear();
        self.rows.clear();
        self.b.clear();
    }

    /// A candidate's own score, where it has one; [`Kept::keep`] then keeps it.
    pub(super) fn own_score(&mut self, candidate: &Found, times_s: &[f64], sigma_px: f64) -> Option<f64> {
        self.y.clear();
        if self.paths.len() >= MOST {
            return None;
        }
        let mut start = 0;
        for (i, path) in self.paths.iter().enumerate() {
            let row = &self.rows[start..=start + i];
            let done: f64 = row.iter().zip(&self.y).map(|(l, y)| l * y).sum();
            self.y.push((correlation(path, candidate, times_s, sigma_px) - done) / row[i]);
            start += i + 1;
        }
        let explained: f64 = self.y.iter().map(|y| y * y).sum();
        let predicted: f64 = self.y.iter().zip(&self.b).map(|(y, b)| y * b).sum();
        let left = candidate.z - predicted;
        let own = (1.0 - explained).max(0.0).sqrt();
        (explained < SAME && left > MISFIT * predicted.abs()).then(|| left / own)
    }

    /// Keeps the candidate whose own score was asked for last.
    pub(super) fn keep(&mut self, candidate: &Found, own_score: f64) {
        let explained: f64 = self.y.iter().map(|y| y * y).sum();
        self.y.push((1.0 - explained).max(0.0).sqrt());
        self.rows.extend_from_slice(&self.y);
        self.b.push(own_score);
        self.paths.push(*candidate);
    }
}

/// Correlation of two paths' templates.
fn correlation(a: &Found, b: &Found, times_s: &[f64], sigma_px: f64) -> f64 {
    let (dp, dv) = (a.position - b.position, a.velocity - b.velocity);
    let scale = 0.25 / (sigma_px * sigma_px);
    let sum: f64 = times_s.iter().map(|t| (-scale * (dp + dv * *t).norm_squared()).exp()).sum();
    sum / times_s.len().max(1) as f64
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Matrix2, Vector2};

    fn found(x: f64, vx: f64, z: f64) -> Found {
        Found {
            position: Vector2::new(x, 0.0),
            velocity: Vector2::new(vx, 0.0),
            z,
            amplitude: z,
            moments: Matrix2::identity(),
        }
    }

    #[test]
    fn crossing_targets_are_both_kept_and_side_lobes_are_not() {
        let times: Vec<f64> = (0..64).map(|k| -0.04 * f64::from(k)).collect();
        let mut kept = Kept::new();
        let strong = found(10.0, 20.0, 30.0);
        assert_eq!(kept.own_score(&strong, &times, 1.3), Some(30.0));
        kept.keep(&strong, 30.0);
        // The same place with another velocity shares the newest frames: what a side lobe has is what the target gives it.
        let lobe = found(10.0, -20.0, 0.0);
        let shared = correlation(&strong, &lobe, &times, 1.3);
        assert!((0.01..0.2).contains(&shared), "{shared}");
        assert_eq!(kept.own_score(&found(10.0, -20.0, 30.0 * shared), &times, 1.3), None);
        // A second target there has its own score on top: the joint fit of both gives it back.
        let own = kept.own_score(&found(10.0, -20.0, 8.0 + 30.0 * shared), &times, 1.3).unwrap();
        assert!((own - 8.0 / (1.0 - shared * shared).sqrt()).abs() < 1e-9, "{own}");
        // A neighbour within the spot is the same target.
        assert_eq!(kept.own_score(&found(11.0, 20.0, 28.0), &times, 1.3), None);
    }
}
