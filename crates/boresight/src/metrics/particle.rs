//! Particle tracking challenge: alpha, beta, JSC, JSC of tracks, RMSE.
//!
//! Source: N. Chenouard et al., *Objective comparison of particle tracking methods*, Nature Methods 11, 2014, supplementary
//! note 3. Tracks are paired so that the sum of distances is least; a track may instead be paired with an empty one.
//! Symbols: ε gate, px; the distance of two tracks is Σ over frames of min(d, ε), ε where only one exists; d(X, ∅) = ε ×
//! rows of X; α = 1 − d(X, Y) / d(X, ∅); β = (d(X, ∅) − d(X, Y)) / (d(X, ∅) + d(Y̅, ∅)), Y̅ the tracks paired with none.
//! Limits: two dimensions.

use super::near::{each_near_pair, rows_of_tracks, shared_frames};
use super::pairs::PairIndex;
use crate::associate::assignment::matching::{Matcher, WeightedPair};
use crate::{Error, ErrorKind, Result, TrackTable};
use serde::Serialize;

/// The measures of the particle tracking challenge.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct ParticleScores {
    /// Closeness of the paired tracks, 0..=1; false tracks do not count.
    pub alpha: f64,
    /// The same with a punishment of false tracks, 0..=alpha.
    pub beta: f64,
    /// Jaccard score of positions.
    pub jsc: f64,
    /// Jaccard score of tracks.
    pub jsc_tracks: f64,
    /// Root mean square distance of the matched positions, px; 0 without any.
    pub rmse_px: f64,
    /// Matched positions.
    pub n_matched: u64,
}

/// Computes the measures with the gate `gate_px` (the challenge: 5).
/// # Errors
/// A gate not above 0; a truth without rows.
pub fn particle_scores(truth: &TrackTable, result: &TrackTable, gate_px: f64) -> Result<ParticleScores> {
    if !(gate_px > 0.0 && gate_px.is_finite()) {
        return Err(Error::new(ErrorKind::Config, "expected a distance above 0 px").at(format!("gate = {gate_px}")));
    }
    if truth.n_rows() == 0 {
        return Err(Error::new(ErrorKind::Damaged, "has no rows: alpha is not defined").at(&truth.label));
    }
    let n_r = rows_of_tracks(result, 0..result.n_frames());
    let (index, gain, hits) = gains(truth, result, gate_px);
    // A frame that both share is no loss for the result track; frames it has alone cost the gate.
    let both = shared_frames(truth, result, 0..truth.n_frames(), &index);
    let mut pairs: Vec<(WeightedPair, u32)> = Vec::new();
    for (k, &(t, r)) in index.pairs().iter().enumerate() {
        let weight = gain[k] - gate_px * f64::from(n_r[r as usize] - both[k]);
        if weight > 0.0 {
            pairs.push((WeightedPair { row: t, column: r, weight }, k as u32));
        }
    }
    pairs.sort_by_key(|p| (p.0.row, p.0.column));
    let only: Vec<WeightedPair> = pairs.iter().map(|p| p.0).collect();
    let mut taken = Vec::new();
    Matcher::default().solve_any(truth.n_tracks(), result.n_tracks(), &only, &mut taken);
    let empty = gate_px * truth.n_rows() as f64;
    let mut distance = empty;
    let (mut paired_rows, mut tp, mut error2) = (0_u64, 0_u64, 0.0);
    for &k in &taken {
        let (p, pair) = pairs[k as usize];
        distance -= p.weight;
        paired_rows += u64::from(n_r[p.column as usize]);
        tp += u64::from(hits[pair as usize].0);
        error2 += hits[pair as usize].1;
    }
    let spurious = gate_px * (result.n_rows() as u64 - paired_rows) as f64;
    let n = taken.len() as f64;
    Ok(ParticleScores {
        alpha: 1.0 - distance / empty,
        beta: (empty - distance) / (empty + spurious),
        jsc: tp as f64 / (truth.n_rows() as u64 + result.n_rows() as u64 - tp) as f64,
        jsc_tracks: n / (truth.n_tracks() as f64 + result.n_tracks() as f64 - n),
        rmse_px: if tp == 0 { 0.0 } else { (error2 / tp as f64).sqrt() },
        n_matched: tp,
    })
}

type Hits = Vec<(u32, f64)>;

/// For every pair ever nearer than the gate: Σ (ε − d), and how many such frames with the sum of d².
fn gains(truth: &TrackTable, result: &TrackTable, gate: f64) -> (PairIndex, Vec<f64>, Hits) {
    let (mut index, mut gain, mut hits) = (PairIndex::default(), Vec::new(), Vec::new());
    each_near_pair(truth, result, 0..truth.n_frames(), gate, |n| {
        let k = index.number(n.truth, n.result) as usize;
        if k == gain.len() {
            gain.push(0.0);
            hits.push((0, 0.0));
        }
        gain[k] += gate - n.distance_px;
        hits[k].0 += 1;
        hits[k].1 += n.distance_px * n.distance_px;
    });
    (index, gain, hits)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{PixelOrigin, TrackRow};

    fn table(rows: &[(u32, i64, f64)]) -> TrackTable {
        let row = |&(frame, id, x): &_| TrackRow { frame, id, bbox: [x, 0.0, 0.0, 0.0], ..TrackRow::default() };
        TrackTable::from_rows("t", PixelOrigin::Centre0, rows.iter().map(row)).unwrap()
    }

    #[test]
    fn a_perfect_result_scores_one_and_a_false_track_lowers_beta_only() {
        let truth = table(&[(0, 1, 0.0), (1, 1, 1.0)]);
        let s = particle_scores(&truth, &truth, 5.0).unwrap();
        assert_eq!((s.alpha, s.beta, s.jsc, s.jsc_tracks), (1.0, 1.0, 1.0, 1.0));
        let more = table(&[(0, 1, 0.0), (1, 1, 1.0), (0, 2, 50.0), (1, 2, 50.0)]);
        let s = particle_scores(&truth, &more, 5.0).unwrap();
        assert_eq!((s.alpha, s.beta, s.jsc, s.jsc_tracks), (1.0, 0.5, 0.5, 0.5));
    }

    #[test]
    fn an_error_of_one_pixel_under_a_gate_of_five_costs_a_fifth() {
        let s = particle_scores(&table(&[(0, 1, 0.0), (1, 1, 0.0)]), &table(&[(0, 4, 1.0), (1, 4, 1.0)]), 5.0).unwrap();
        assert!((s.alpha - 0.8).abs() < 1e-12 && (s.rmse_px - 1.0).abs() < 1e-12 && s.n_matched == 2);
    }
}
