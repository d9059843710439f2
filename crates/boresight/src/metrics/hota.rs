//! HOTA: higher order tracking accuracy, the balance of detection and association over 19 similarity thresholds.
//!
//! Source: J. Luiten et al., *HOTA: a higher order metric for evaluating multi-object tracking*, IJCV 129, 2021; counting
//! and arithmetic as in TrackEval. Matching in a frame maximises the sum of (global alignment of the two tracks) ×
//! (similarity of the two boxes); the alignment is a Jaccard score of the tracks gathered in a first pass.
//! Symbols: α threshold 0.05, 0.10 .. 0.95; DetA = TP / (TP + FN + FP); AssA mean over TP of TPA / (TPA + FNA + FPA);
//! HOTA_α = √(DetA_α AssA_α); LocA mean similarity of the TP; the final numbers are means over α.
//! Departure: sums over the sparse pairs instead of dense matrices; row sums add in numpy's order, since their rounding
//! decides ties.

use super::overlap::Overlap;
use crate::associate::assignment::matching::{Matcher, WeightedPair};
use crate::associate::assignment::table::UNASSIGNED;
use serde::Serialize;

/// Number of thresholds.
pub const N_ALPHA: usize = 19;

/// The thresholds 0.05, 0.10 .. 0.95.
pub fn alphas() -> [f64; N_ALPHA] {
    // k · 0.05 + 0.05 is how numpy's arange makes them.
    std::array::from_fn(|k| 0.05 + k as f64 * 0.05)
}

type Curve = [f64; N_ALPHA];

/// HOTA and its parts for each threshold.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Hota {
    /// Matched pairs.
    pub tp: Curve,
    /// Misses.
    pub fn_: Curve,
    /// False alarms.
    pub fp: Curve,
    /// Association accuracy.
    pub ass_a: Curve,
    /// Association recall.
    pub ass_re: Curve,
    /// Association precision.
    pub ass_pr: Curve,
    /// Mean similarity of the matched pairs.
    pub loc_a: Curve,
}

/// Mean over the thresholds: the number that stands in tables.
pub fn mean(curve: &Curve) -> f64 {
    curve.iter().sum::<f64>() / N_ALPHA as f64
}

impl Hota {
    fn curve(&self, f: impl Fn(usize) -> f64) -> Curve {
        std::array::from_fn(f)
    }
    /// Detection accuracy.
    pub fn det_a(&self) -> Curve {
        self.curve(|a| self.tp[a] / (self.tp[a] + self.fn_[a] + self.fp[a]).max(1.0))
    }
    /// Detection recall.
    pub fn det_re(&self) -> Curve {
        self.curve(|a| self.tp[a] / (self.tp[a] + self.fn_[a]).max(1.0))
    }
    /// Detection precision.
    pub fn det_pr(&self) -> Curve {
        self.curve(|a| self.tp[a] / (self.tp[a] + self.fp[a]).max(1.0))
    }
    /// HOTA.
    pub fn hota(&self) -> Curve {
        let d = self.det_a();
        self.curve(|a| (d[a] * self.ass_a[a]).sqrt())
    }
    /// Open-world accuracy: √(DetRe AssA).
    pub fn owta(&self) -> Curve {
        let d = self.det_re();
        self.curve(|a| (d[a] * self.ass_a[a]).sqrt())
    }
    /// Several sequences together: counts add, association and localisation weigh by TP.
    pub fn combined<'a>(all: impl IntoIterator<Item = &'a Self>) -> Self {
        let mut s = Self::default();
        for h in all {
            for a in 0..N_ALPHA {
                s.tp[a] += h.tp[a];
                s.fn_[a] += h.fn_[a];
                s.fp[a] += h.fp[a];
                s.ass_a[a] += h.ass_a[a] * h.tp[a];
                s.ass_re[a] += h.ass_re[a] * h.tp[a];
                s.ass_pr[a] += h.ass_pr[a] * h.tp[a];
                s.loc_a[a] += h.loc_a[a] * h.tp[a];
            }
        }
        for a in 0..N_ALPHA {
            let n = s.tp[a].max(1.0);
            s.ass_a[a] /= n;
            s.ass_re[a] /= n;
            s.ass_pr[a] /= n;
            s.loc_a[a] = s.loc_a[a].max(1e-10) / s.tp[a].max(1e-10);
        }
        s
    }
    /// A sequence whose truth or result is empty.
    pub fn of_empty(n_truth_rows: u64, n_result_rows: u64) -> Self {
        Self {
            fn_: [n_truth_rows as f64; N_ALPHA],
            fp: [n_result_rows as f64; N_ALPHA],
            loc_a: [1.0; N_ALPHA],
            ..Self::default()
        }
    }
}

/// First pass: adds a frame's share of the alignment of each pair. `number[k]` is the number of the pair of overlap k.
#[derive(Debug, Default)]
pub(crate) struct Alignment {
    /// Sum of the normalised similarities of each pair.
    pub potential: Vec<f64>,
    row_sum: Vec<f64>,
    col_sum: Vec<f64>,
    entries: Vec<(u32, f64)>,
    count: Vec<u32>,
}

impl Alignment {
    /// Adds a frame of `n_rows` truths and `n_cols` results; overlaps by row and column.
    pub fn frame(&mut self, n_rows: usize, n_cols: usize, overlaps: &[Overlap], number: &[u32]) {
        self.row_sums(n_rows, n_cols, overlaps);
        for (o, &k) in overlaps.iter().zip(number) {
            let denominator = self.col_sum[o.col as usize] + self.row_sum[o.row as usize] - o.similarity;
            if self.potential.len() <= k as usize {
                self.potential.resize(k as usize + 1, 0.0);
            }
            if denominator > f64::EPSILON {
                self.potential[k as usize] += o.similarity / denominator;
            }
        }
    }

    fn row_sums(&mut self, n_rows: usize, n_cols: usize, overlaps: &[Overlap]) {
        self.row_sum.clear();
        self.row_sum.resize(n_rows, 0.0);
        self.col_sum.clear();
        self.col_sum.resize(n_cols, 0.0);
        for o in overlaps {
            self.col_sum[o.col as usize] += o.similarity;
        }
        if n_cols == 1 {
            // A matrix of one column is summed along its memory, in blocks.
            self.entries.clear();
            self.entries.extend(overlaps.iter().map(|o| (o.row, o.similarity)));
            self.col_sum[0] = blocked_sum(0, n_rows as u32, &self.entries);
        }
        let mut k = 0;
        while k < overlaps.len() {
            let row = overlaps[k].row;
            let end = k + overlaps[k..].iter().take_while(|o| o.row == row).count();
            self.row_sum[row as usize] = if end - k <= 2 || n_cols < 8 {
                overlaps[k..end].iter().map(|o| o.similarity).sum()
            } else {
                self.entries.clear();
                self.entries.extend(overlaps[k..end].iter().map(|o| (o.col, o.similarity)));
                blocked_sum(0, n_cols as u32, &self.entries)
            };
            k = end;
        }
    }

    /// Ends the first pass: the global alignment score of each pair.
    pub fn scores(mut self, pairs: &[(u32, u32)], truth_rows: &[u32], result_rows: &[u32]) -> Vec<f64> {
        self.count.clear();
        self.potential.resize(pairs.len(), 0.0);
        for (p, &(t, r)) in self.potential.iter_mut().zip(pairs) {
            let sum = f64::from(truth_rows[t as usize]) + f64::from(result_rows[r as usize]);
            *p /= sum - *p;
        }
        self.potential
    }
}

/// Sum of a line of `n` numbers from `first` on, all 0 but the entries, in the order numpy adds: eight sums side by side
/// in blocks of up to 128, longer lines in halves.
fn blocked_sum(first: u32, n: u32, entries: &[(u32, f64)]) -> f64 {
    if n < 8 {
        return entries.iter().map(|e| e.1).sum();
    }
    if n > 128 {
        let half = n / 2 - n / 2 % 8;
        let cut = entries.partition_point(|e| e.0 < first + half);
        return blocked_sum(first, half, &entries[..cut]) + blocked_sum(first + half, n - half, &entries[cut..]);
    }
    let mut r = [0.0; 8];
    let whole = n - n % 8;
    let cut = entries.partition_point(|e| e.0 < first + whole);
    for &(i, v) in &entries[..cut] {
        r[((i - first) % 8) as usize] += v;
    }
    let mut sum = ((r[0] + r[1]) + (r[2] + r[3])) + ((r[4] + r[5]) + (r[6] + r[7]));
    for e in &entries[cut..] {
        sum += e.1;
    }
    sum
}

/// Second pass: matches frame by frame.
#[derive(Debug)]
pub(crate) struct HotaCounter {
    levels: [f64; N_ALPHA],
    loc: Curve,
    /// For each pair its place in `reached`, or UNASSIGNED.
    place: Vec<u32>,
    /// For each pair that ever matched: how many of its matches reach exactly threshold k.
    reached: Vec<[u32; N_ALPHA]>,
    place_pair: Vec<u32>,
    tp: [u64; N_ALPHA],
    matcher: Matcher,
    pairs: Vec<WeightedPair>,
    taken: Vec<u32>,
    source: Vec<u32>,
}

impl HotaCounter {
    /// Begins for `n_pairs` pairs.
    pub fn new(n_pairs: usize) -> Self {
        Self {
            levels: alphas().map(|a| a - f64::EPSILON),
            loc: [0.0; N_ALPHA],
            place: vec![UNASSIGNED; n_pairs],
            reached: Vec::new(),
            place_pair: Vec::new(),
            tp: [0; N_ALPHA],
            matcher: Matcher::default(),
            pairs: Vec::new(),
            taken: Vec::new(),
            source: Vec::new(),
        }
    }

    /// Matches a frame.
    pub fn frame(&mut self, n_rows: usize, n_cols: usize, overlaps: &[Overlap], number: &[u32], scores: &[f64]) {
        self.pairs.clear();
        self.source.clear();
        for (i, (o, &k)) in overlaps.iter().zip(number).enumerate() {
            let weight = scores[k as usize] * o.similarity;
            if weight > 0.0 {
                self.pairs.push(WeightedPair { row: o.row, column: o.col, weight });
                self.source.push(i as u32);
            }
        }
        self.matcher.solve(n_rows, n_cols, &self.pairs, &mut self.taken);
        let mut frame_loc = [0.0; N_ALPHA];
        for &t in &self.taken {
            let i = self.source[t as usize] as usize;
            let s = overlaps[i].similarity;
            let n = self.levels.partition_point(|&l| l <= s);
            if n == 0 {
                continue;
            }
            for sum in &mut frame_loc[..n] {
                *sum += s;
            }
            self.tp[n - 1] += 1;
            let pair = number[i] as usize;
            if self.place[pair] == UNASSIGNED {
                self.place[pair] = self.reached.len() as u32;
                self.reached.push([0; N_ALPHA]);
                self.place_pair.push(pair as u32);
            }
            self.reached[self.place[pair] as usize][n - 1] += 1;
        }
        for (sum, f) in self.loc.iter_mut().zip(frame_loc) {
            *sum += f;
        }
    }

    /// Ends the count.
    pub fn finish(mut self, pairs: &[(u32, u32)], truth_rows: &[u32], result_rows: &[u32]) -> Hota {
        let (n_truth, n_result): (f64, f64) =
            (truth_rows.iter().map(|&n| f64::from(n)).sum(), result_rows.iter().map(|&n| f64::from(n)).sum());
        let mut h = Hota::default();
        let mut tp = 0;
        for a in (0..N_ALPHA).rev() {
            tp += self.tp[a];
            h.tp[a] = tp as f64;
            h.fn_[a] = n_truth - tp as f64;
            h.fp[a] = n_result - tp as f64;
        }
        for (reached, &pair) in self.reached.iter_mut().zip(&self.place_pair) {
            let (t, r) = pairs[pair as usize];
            let (nt, nr) = (f64::from(truth_rows[t as usize]), f64::from(result_rows[r as usize]));
            let mut m = 0.0;
            for a in (0..N_ALPHA).rev() {
                m += f64::from(reached[a]);
                h.ass_a[a] += m * (m / (nt + nr - m).max(1.0));
                h.ass_re[a] += m * (m / nt.max(1.0));
                h.ass_pr[a] += m * (m / nr.max(1.0));
            }
        }
        for a in 0..N_ALPHA {
            let n = h.tp[a].max(1.0);
            h.ass_a[a] /= n;
            h.ass_re[a] /= n;
            h.ass_pr[a] /= n;
            h.loc_a[a] = self.loc[a].max(1e-10) / h.tp[a].max(1e-10);
        }
        h
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_are_summed_in_blocks_of_eight() {
        // The order matters: 1 + 1e-16 + 1e-16 is 1 added in turn, but more than 1 if the small ones meet first.
        let line = [(0, 1.0), (1, 1e-16), (2, 1e-16), (3, 1e-16)];
        assert_eq!(blocked_sum(0, 7, &line), 1.0);
        assert!(blocked_sum(0, 8, &line) > 1.0);
        let many: Vec<(u32, f64)> = (0..1000).map(|i| (i, 1.0)).collect();
        assert_eq!(blocked_sum(0, 1000, &many), 1000.0);
    }

    #[test]
    fn thresholds_are_those_of_numpys_arange() {
        assert_eq!(alphas()[2], 0.15000000000000002);
        assert_eq!(alphas()[18], 0.9500000000000001);
    }

    #[test]
    fn sequences_together_weigh_association_and_place_by_their_matches() {
        let one = |tp: f64, missed: f64, x: f64| Hota {
            tp: [tp; N_ALPHA],
            fn_: [missed; N_ALPHA],
            fp: [2.0 * missed; N_ALPHA],
            ass_a: [x; N_ALPHA],
            ass_re: [x / 2.0; N_ALPHA],
            ass_pr: [x / 4.0; N_ALPHA],
            loc_a: [x / 8.0; N_ALPHA],
        };
        // 30 matches at 0.4 and 10 at 0.8: 0.5.
        let h = Hota::combined(&[one(30.0, 5.0, 0.4), one(10.0, 7.0, 0.8)]);
        let last = |c: Curve| c[N_ALPHA - 1];
        assert_eq!((last(h.tp), last(h.fn_), last(h.fp)), (40.0, 12.0, 24.0));
        for (got, want) in [(h.ass_a, 0.5), (h.ass_re, 0.25), (h.ass_pr, 0.125), (h.loc_a, 0.0625)] {
            assert!((last(got) - want).abs() < 1e-15, "{} {want}", last(got));
        }
        assert!((last(h.hota()) - (40.0 / 76.0 * 0.5_f64).sqrt()).abs() < 1e-15);
        assert!((last(h.owta()) - (40.0 / 52.0 * 0.5_f64).sqrt()).abs() < 1e-15);
    }
}
