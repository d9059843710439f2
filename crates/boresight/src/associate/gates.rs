//! The sparse table between tracks and detections, and the answer to it.
//!
//! Rows are compressed (CSR): row `i` of [`Gates`] holds the detections inside the gate of track `i`, in ascending order
//! of their numbers. Nothing here knows filters, pixels or boxes: only numbers cross this border.
//! Symbols: d² squared Mahalanobis distance (no unit); l likelihood density N(ν; 0, S) (1/px²); λ clutter density (1/px²);
//! P_D probability that a target is detected; P_G that its detection lies in the gate; ψ probability that the track exists.
//! Limits: at most 2³² − 1 detections in a scan and pairs in a table.

use super::assignment::table::{CostTable, Entry};

/// Clutter of no density would make every weight infinite.
const LEAST_DENSITY: f64 = 1e-200;

/// One gated pair: a detection as a track sees it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pair {
    /// The detection's number in the scan.
    pub detection: u32,
    /// What hard associators add up: d² and the terms beside position (no unit).
    pub cost: f64,
    /// ln l of the pair, with the terms beside position (l in 1/px²).
    pub log_likelihood: f64,
}

impl Entry for Pair {
    #[inline]
    fn column(&self) -> u32 {
        self.detection
    }
    #[inline]
    fn cost(&self) -> f64 {
        self.cost
    }
}

/// What is known of a track before its detections are looked at.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Prior {
    /// Probability that the target is detected in this scan, 0..=1.
    pub p_detection: f64,
    /// Probability that its detection falls into the gate, 0..=1.
    pub p_gate: f64,
    /// Probability that the track exists, 0..=1.
    pub existence: f64,
    /// Cost of leaving the track without a detection; hard associators never take a pair that costs more.
    pub miss_cost: f64,
}

/// The sparse table of gated pairs: a row per track.
#[derive(Clone, Debug, Default)]
pub struct Gates {
    starts: Vec<u32>,
    pairs: Vec<Pair>,
    priors: Vec<Prior>,
    /// One value for all, or one each.
    clutter: Vec<f64>,
    n_detections: usize,
}

impl Gates {
    /// Builds an empty table.
    pub fn new() -> Self {
        Self { starts: vec![0], ..Self::default() }
    }

    /// Empties the table for a scan of `n_detections`, all with clutter density `clutter_density` (1/px², above 0).
    pub fn reset(&mut self, n_detections: usize, clutter_density: f64) {
        self.starts.clear();
        self.starts.push(0);
        self.pairs.clear();
        self.priors.clear();
        self.clutter.clear();
        self.clutter.push(clutter_density.max(LEAST_DENSITY));
        self.n_detections = n_detections;
    }

    /// Gives every detection a clutter density of its own (1/px²), one per detection of the scan.
    pub fn set_clutter(&mut self, density: impl Iterator<Item = f64>) {
        self.clutter.clear();
        self.clutter.extend(density.map(|d| d.max(LEAST_DENSITY)));
        debug_assert!(self.clutter.len() == self.n_detections);
    }

    /// Adds a pair to the row under construction; detections ascend within a row.
    #[inline]
    pub fn push(&mut self, pair: Pair) {
        debug_assert!((pair.detection as usize) < self.n_detections);
        self.pairs.push(pair);
    }

    /// The pairs of the row under construction.
    pub fn open_row(&mut self) -> &mut [Pair] {
        let from = self.starts.last().map_or(0, |s| *s as usize);
        &mut self.pairs[from..]
    }

    /// Keeps only the first `n` pairs of the row under construction.
    pub fn truncate_open_row(&mut self, n: usize) {
        let from = self.starts.last().map_or(0, |s| *s as usize);
        self.pairs.truncate(from + n);
    }

    /// Ends the row under construction.
    #[inline]
    pub fn end_row(&mut self, prior: Prior) {
        self.starts.push(self.pairs.len() as u32);
        self.priors.push(prior);
    }

    /// Number of rows.
    pub fn n_tracks(&self) -> usize {
        self.priors.len()
    }

    /// Number of detections of the scan.
    pub fn n_detections(&self) -> usize {
        self.n_detections
    }

    /// Number of gated pairs.
    pub fn n_pairs(&self) -> usize {
        self.pairs.len()
    }

    /// The gated pairs of a track.
    #[inline]
    pub fn row(&self, track_idx: usize) -> &[Pair] {
        &self.pairs[self.starts[track_idx] as usize..self.starts[track_idx + 1] as usize]
    }

    /// What is known of a track beforehand.
    #[inline]
    pub fn prior(&self, track_idx: usize) -> &Prior {
        &self.priors[track_idx]
    }

    /// λ at a detection, 1/px².
    #[inline]
    pub fn clutter(&self, detection: u32) -> f64 {
        let at = if self.clutter.len() == 1 { 0 } else { detection as usize };
        self.clutter[at]
    }

    /// ln λ at a detection (λ in 1/px²).
    #[inline]
    pub fn log_clutter(&self, detection: u32) -> f64 {
        self.clutter(detection).ln()
    }

    /// ln of the weight that the pair is right, against clutter: ln(ψ P_D l / λ).
    #[inline]
    pub fn log_weight(&self, track_idx: usize, pair: &Pair) -> f64 {
        let p = &self.priors[track_idx];
        (p.existence * p.p_detection).ln() + pair.log_likelihood - self.log_clutter(pair.detection)
    }

    /// ln of the weight that none is right: ln(1 − ψ P_D P_G).
    #[inline]
    pub fn log_miss(&self, track_idx: usize) -> f64 {
        let p = &self.priors[track_idx];
        (1.0 - p.existence * p.p_detection * p.p_gate).max(0.0).ln()
    }
}

impl CostTable for Gates {
    type Pair = Pair;
    fn n_rows(&self) -> usize {
        self.n_tracks()
    }
    fn n_columns(&self) -> usize {
        self.n_detections()
    }
    #[inline]
    fn row(&self, row: usize) -> &[Pair] {
        self.row(row)
    }
    #[inline]
    fn miss_cost(&self, row: usize) -> f64 {
        self.prior(row).miss_cost
    }
}

/// One detection of a track's answer, with the probability that it is the target's own.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Share {
    /// The detection's number in the scan.
    pub detection: u32,
    /// Its weight, 0..=1; a hard choice is one share of weight 1.
    pub weight: f64,
}

/// The answer: a row of shares per track; weights of a row sum to at most 1.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Assignment {
    starts: Vec<u32>,
    shares: Vec<Share>,
}

impl Assignment {
    /// Builds an empty answer.
    pub fn new() -> Self {
        Self::default()
    }

    /// Empties the answer.
    pub fn reset(&mut self) {
        self.starts.clear();
        self.starts.push(0);
        self.shares.clear();
    }

    /// Adds a share to the row under construction.
    #[inline]
    pub fn push(&mut self, detection: u32, weight: f64) {
        self.shares.push(Share { detection, weight });
    }

    /// Ends the row under construction.
    #[inline]
    pub fn end_row(&mut self) {
        self.starts.push(self.shares.len() as u32);
    }

    /// Number of rows.
    pub fn n_tracks(&self) -> usize {
        self.starts.len().saturating_sub(1)
    }

    /// The shares of a track.
    #[inline]
    pub fn row(&self, track_idx: usize) -> &[Share] {
        &self.shares[self.starts[track_idx] as usize..self.starts[track_idx + 1] as usize]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::associate::AssociatorConfig;

    fn prior(existence: f64, p_detection: f64, p_gate: f64) -> Prior {
        Prior { p_detection, p_gate, existence, miss_cost: 9.0 }
    }

    #[test]
    fn weights_are_the_logarithms_of_the_products_in_the_header() {
        let mut gates = Gates::new();
        gates.reset(3, 1e-3);
        let pair = Pair { detection: 2, cost: 1.0, log_likelihood: 0.02_f64.ln() };
        gates.push(pair);
        gates.end_row(prior(0.5, 0.8, 0.9));
        // ψ P_D l / λ = 0.5 · 0.8 · 0.02 / 0.001 = 8; 1 − ψ P_D P_G = 0.64.
        assert!((gates.log_weight(0, &pair) - 8.0_f64.ln()).abs() < 1e-12);
        assert!((gates.log_miss(0) - 0.64_f64.ln()).abs() < 1e-12);
        gates.set_clutter([1.0, 2.0, 4e-3].into_iter());
        assert!((gates.log_weight(0, &pair) - 2.0_f64.ln()).abs() < 1e-12);
        assert_eq!((gates.clutter(0), gates.clutter(1)), (1.0, 2.0));
    }

    #[test]
    fn clutter_of_no_density_stays_finite_and_a_sure_detection_cannot_be_missed() {
        let mut gates = Gates::new();
        gates.reset(2, 0.0);
        assert_eq!(gates.clutter(1), 1e-200);
        gates.set_clutter([0.0, 3.0].into_iter());
        assert_eq!((gates.clutter(0), gates.clutter(1)), (1e-200, 3.0));
        gates.end_row(prior(1.0, 1.0, 1.0));
        assert_eq!(gates.log_miss(0), f64::NEG_INFINITY);
    }

    #[test]
    fn rows_keep_their_pairs_and_an_open_row_can_be_cut() {
        let mut gates = Gates::new();
        gates.reset(5, 1.0);
        let pair = |detection| Pair { detection, cost: f64::from(detection), log_likelihood: 0.0 };
        gates.push(pair(1));
        gates.end_row(prior(1.0, 0.9, 0.9));
        (2..5).for_each(|d| gates.push(pair(d)));
        gates.open_row()[0].cost = 7.0;
        gates.truncate_open_row(2);
        gates.end_row(prior(0.4, 0.9, 0.9));
        gates.end_row(prior(0.3, 0.9, 0.9));
        assert_eq!((gates.n_tracks(), gates.n_pairs(), gates.n_detections()), (3, 3, 5));
        assert_eq!(gates.row(1), [Pair { cost: 7.0, ..pair(2) }, pair(3)]);
        assert!(gates.row(2).is_empty() && gates.prior(1).existence == 0.4);
        gates.reset(1, 1.0);
        assert_eq!((gates.n_tracks(), gates.n_pairs()), (0, 0));
    }

    #[test]
    fn the_assignment_of_a_table_is_that_of_its_costs() {
        // All pairs of two tracks and two detections; straight 1 + 8 or crossed 2 + 5, then straight 1 + 5 or crossed 2 + 8.
        for (costs, best) in [([[1.0, 2.0], [5.0, 8.0]], [1, 0]), ([[1.0, 2.0], [8.0, 5.0]], [0, 1])] {
            let mut gates = Gates::new();
            gates.reset(2, 1.0);
            for row in costs {
                for (detection, cost) in (0..).zip(row) {
                    gates.push(Pair { detection, cost, log_likelihood: 0.0 });
                }
                gates.end_row(prior(1.0, 0.9, 0.9));
            }
            let mut answer = Assignment::new();
            AssociatorConfig::default().build().associate(&gates, &mut answer);
            assert_eq!([0, 1].map(|t| answer.row(t)[0].detection), best);
        }
    }
}
