//! JPDA*: joint events that differ only in who got which of the same detections are cut to the best one.
//!
//! Source: H. A. P. Blom, E. A. Bloem, "Probabilistic data association avoiding track coalescence", IEEE Trans. Automatic
//! Control 45, 2000: for each set of detected tracks and each set of used detections only the likeliest permutation is kept.
//! Method: all joint events are listed, sorted by the two sets, and the best of each kept.
//! Limits: at most 64 rows, 128 columns and `max_events` events; else `false` is returned.

use super::problem::Problem;

#[derive(Clone, Copy, Debug)]
struct Event {
    tracks: u64,
    detections: u128,
    /// ln of the joint weight: the weight itself of many misses in thin clutter is too small for f64.
    ln_weight: f64,
    /// Place of its choices.
    at: u32,
}

/// No pair taken.
const MISSED: u32 = u32::MAX;

/// Solves groups; keeps its memory.
#[derive(Clone, Debug, Default)]
pub struct Star {
    events: Vec<Event>,
    choices: Vec<u32>,
    path: Vec<u32>,
}

impl Star {
    /// Fills the probabilities, or returns `false` if the group is too large.
    pub fn solve(&mut self, p: &mut Problem, max_events: usize) -> bool {
        let n = p.n_rows();
        if n > 64 || p.n_columns > 128 {
            return false;
        }
        self.events.clear();
        self.choices.clear();
        self.path.clear();
        if !self.list(p, 0, 0, 0, 0.0, max_events) {
            return false;
        }
        // Best first within each pair of sets; the order of listing breaks ties.
        self.events.sort_by(|a, b| {
            (a.tracks, a.detections)
                .cmp(&(b.tracks, b.detections))
                .then(b.ln_weight.total_cmp(&a.ln_weight))
                .then(a.at.cmp(&b.at))
        });
        self.events.dedup_by_key(|e| (e.tracks, e.detections));
        let top = self.events.iter().map(|e| e.ln_weight).fold(f64::NEG_INFINITY, f64::max);
        if !top.is_finite() {
            return false;
        }
        let total: f64 = self.events.iter().map(|e| (e.ln_weight - top).exp()).sum();
        p.probability.fill(0.0);
        for e in &self.events {
            let share = (e.ln_weight - top).exp() / total;
            for k in &self.choices[e.at as usize..e.at as usize + n] {
                if *k != MISSED {
                    p.probability[*k as usize] += share;
                }
            }
        }
        true
    }

    fn list(
        &mut self,
        p: &Problem,
        row: usize,
        tracks: u64,
        detections: u128,
        ln_weight: f64,
        max_events: usize,
    ) -> bool {
        if row == p.n_rows() {
            if self.events.len() == max_events {
                return false;
            }
            self.events.push(Event { tracks, detections, ln_weight, at: self.choices.len() as u32 });
            self.choices.extend_from_slice(&self.path);
            return true;
        }
        self.path.push(MISSED);
        let mut fits = self.list(p, row + 1, tracks, detections, ln_weight + p.ln_miss[row], max_events);
        self.path.pop();
        for k in p.row(row) {
            let bit = 1 << p.column[k];
            if fits && detections & bit == 0 {
                self.path.push(k as u32);
                let (t, d) = (tracks | 1 << row, detections | bit);
                fits = self.list(p, row + 1, t, d, ln_weight + p.ln_weight[k], max_events);
                self.path.pop();
            }
        }
        fits
    }
}
