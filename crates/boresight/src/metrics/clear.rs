//! CLEAR measures: MOTA, MOTP, identity switches, fragmentations, mostly tracked and mostly lost.
//!
//! Source: K. Bernardin, R. Stiefelhagen, *Evaluating multiple object tracking performance: the CLEAR MOT metrics*, EURASIP
//! J. Image and Video Processing 2008; matching and counting as in TrackEval (J. Luiten): a pair is allowed from the
//! threshold on; pairs that continue the match of the frame before go first (they get a bonus of 1000), then the sum of
//! similarities decides. A switch is counted against the truth's last match, however long ago. Frames in which one side is
//! empty leave the memory of the frame before as it is.
//! The older convention of py-motmetrics and the MATLAB kit is [`mod@super::clear_classic`].
//! Symbols: TP, FN, FP pairs, misses, false alarms; IDSW switches; MOTA = (TP − FP − IDSW) / (TP + FN).

use super::overlap::Overlap;
use crate::associate::assignment::matching::{Matcher, WeightedPair};
use crate::associate::assignment::table::UNASSIGNED;
use serde::Serialize;

/// Counts of the CLEAR measures; they add up over sequences.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Clear {
    /// Matched pairs.
    pub tp: u64,
    /// Truth rows without a partner.
    pub fn_: u64,
    /// Result rows without a partner.
    pub fp: u64,
    /// Identity switches.
    pub idsw: u64,
    /// Truths tracked in more than 80 % of their frames.
    pub mt: u64,
    /// Truths tracked in 20 % to 80 % of their frames.
    pub pt: u64,
    /// Truths tracked in less than 20 % of their frames.
    pub ml: u64,
    /// Times a truth was found again after it had been lost.
    pub frag: u64,
    /// Frames. 0 for a sequence whose truth or result is empty: TrackEval counts it so.
    pub frames: u64,
    /// Sum of the similarities of the matched pairs.
    pub motp_sum: f64,
    /// Whether one side was empty: TrackEval then skips the formulas.
    pub empty: Empty,
}

/// Which side of a sequence was empty.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Empty {
    /// Neither, or a sum over sequences.
    #[default]
    Neither,
    /// No truth: MOTA and its kin are 0 instead of −FP.
    Truth,
    /// No result.
    Result,
}

fn ratio(a: f64, b: f64) -> f64 {
    a / b.max(1.0)
}

impl Clear {
    fn truth(&self) -> f64 {
        (self.tp + self.fn_) as f64
    }
    fn n_ids(&self) -> f64 {
        (self.mt + self.pt + self.ml) as f64
    }
    fn unless_no_truth(&self, v: f64) -> f64 {
        if self.empty == Empty::Truth { 0.0 } else { v }
    }
    /// Multi-object tracking accuracy, at most 1.
    pub fn mota(&self) -> f64 {
        self.unless_no_truth(ratio(self.tp as f64 - self.fp as f64 - self.idsw as f64, self.truth()))
    }
    /// Mean similarity of the matched pairs, 0..=1.
    pub fn motp(&self) -> f64 {
        ratio(self.motp_sum, self.tp as f64)
    }
    /// Detection accuracy: MOTA without switches.
    pub fn moda(&self) -> f64 {
        self.unless_no_truth(ratio(self.tp as f64 - self.fp as f64, self.truth()))
    }
    /// Accuracy that counts a pair by its similarity.
    pub fn smota(&self) -> f64 {
        self.unless_no_truth(ratio(self.motp_sum - self.fp as f64 - self.idsw as f64, self.truth()))
    }
    /// MOTA with the logarithm of the switches.
    pub fn motal(&self) -> f64 {
        let switches = if self.idsw > 0 { (self.idsw as f64).log10() } else { 0.0 };
        self.unless_no_truth(ratio(self.tp as f64 - self.fp as f64 - switches, self.truth()))
    }
    /// Recall, 0..=1.
    pub fn recall(&self) -> f64 {
        ratio(self.tp as f64, self.truth())
    }
    /// Precision, 0..=1.
    pub fn precision(&self) -> f64 {
        ratio(self.tp as f64, (self.tp + self.fp) as f64)
    }
    /// Harmonic mean of recall and precision.
    pub fn f1(&self) -> f64 {
        ratio(self.tp as f64, self.tp as f64 + 0.5 * self.fn_ as f64 + 0.5 * self.fp as f64)
    }
    /// False alarms per frame.
    pub fn fp_per_frame(&self) -> f64 {
        ratio(self.fp as f64, self.frames as f64)
    }
    /// Misses per frame.
    pub fn fn_per_frame(&self) -> f64 {
        ratio(self.fn_ as f64, self.frames as f64)
    }
    /// Share of mostly tracked truths.
    pub fn mtr(&self) -> f64 {
        ratio(self.mt as f64, self.n_ids())
    }
    /// Share of partly tracked truths.
    pub fn ptr(&self) -> f64 {
        ratio(self.pt as f64, self.n_ids())
    }
    /// Share of mostly lost truths; 1 for a sequence without truths, as in TrackEval.
    pub fn mlr(&self) -> f64 {
        if self.empty == Empty::Neither { ratio(self.ml as f64, self.n_ids()) } else { 1.0 }
    }
    /// The counts of several sequences together.
    pub fn combined<'a>(all: impl IntoIterator<Item = &'a Self>) -> Self {
        let mut sum = Self::default();
        for c in all {
            sum.tp += c.tp;
            sum.fn_ += c.fn_;
            sum.fp += c.fp;
            sum.idsw += c.idsw;
            sum.mt += c.mt;
            sum.pt += c.pt;
            sum.ml += c.ml;
            sum.frag += c.frag;
            sum.frames += c.frames;
            sum.motp_sum += c.motp_sum;
        }
        sum
    }
}

/// Counts frame by frame.
#[derive(Debug)]
pub struct ClearCounter {
    threshold: f64,
    sum: Clear,
    seen: Vec<u32>,
    matched: Vec<u32>,
    frags: Vec<u32>,
    last: Vec<u32>,
    before: Vec<u32>,
    before_list: Vec<u32>,
    now_list: Vec<(u32, u32)>,
    matcher: Matcher,
    pairs: Vec<WeightedPair>,
    similarity: Vec<f64>,
    taken: Vec<u32>,
}

impl ClearCounter {
    /// Begins for a truth of `n_truths` tracks; `threshold` is the similarity from which a pair may match, in (0, 1].
    pub fn new(n_truths: usize, threshold: f64) -> Self {
        Self {
            threshold: threshold - f64::EPSILON,
            sum: Clear::default(),
            seen: vec![0; n_truths],
            matched: vec![0; n_truths],
            frags: vec![0; n_truths],
            last: vec![UNASSIGNED; n_truths],
            before: vec![UNASSIGNED; n_truths],
            before_list: Vec::new(),
            now_list: Vec::new(),
            matcher: Matcher::default(),
            pairs: Vec::new(),
            similarity: Vec::new(),
            taken: Vec::new(),
        }
    }

    /// Counts a frame: the tracks of its truth rows and result rows, and the overlaps by row and column.
    pub fn frame(&mut self, truth: &[u32], result: &[u32], overlaps: &[Overlap]) {
        for &t in truth {
            self.seen[t as usize] += 1;
        }
        if truth.is_empty() || result.is_empty() {
            self.sum.fp += result.len() as u64;
            self.sum.fn_ += truth.len() as u64;
            return;
        }
        self.pairs.clear();
        self.similarity.clear();
        for o in overlaps {
            if o.similarity >= self.threshold {
                let goes_on = self.before[truth[o.row as usize] as usize] == result[o.col as usize];
                let weight = if goes_on { 1000.0 + o.similarity } else { o.similarity };
                self.pairs.push(WeightedPair { row: o.row, column: o.col, weight });
                self.similarity.push(o.similarity);
            }
        }
        self.matcher.solve(truth.len(), result.len(), &self.pairs, &mut self.taken);
        self.now_list.clear();
        let mut motp = 0.0;
        for &k in &self.taken {
            let p = self.pairs[k as usize];
            let (t, r) = (truth[p.row as usize], result[p.column as usize]);
            motp += self.similarity[k as usize];
            let last = &mut self.last[t as usize];
            self.sum.idsw += u64::from(*last != UNASSIGNED && *last != r);
            *last = r;
            self.matched[t as usize] += 1;
            self.frags[t as usize] += u32::from(self.before[t as usize] == UNASSIGNED);
            self.now_list.push((t, r));
        }
        for &t in &self.before_list {
            self.before[t as usize] = UNASSIGNED;
        }
        self.before_list.clear();
        for &(t, r) in &self.now_list {
            self.before[t as usize] = r;
            self.before_list.push(t);
        }
        let n = self.taken.len() as u64;
        self.sum.tp += n;
        self.sum.fn_ += truth.len() as u64 - n;
        self.sum.fp += result.len() as u64 - n;
        self.sum.motp_sum += motp;
    }

    /// Ends the count of a sequence of `frames` frames.
    pub fn finish(mut self, frames: u64) -> Clear {
        let s = &mut self.sum;
        let n_truth_rows: u64 = self.seen.iter().map(|&n| u64::from(n)).sum();
        if s.tp + s.fp == 0 {
            s.ml = self.seen.len() as u64;
            s.empty = Empty::Result;
            return self.sum;
        }
        if n_truth_rows == 0 {
            s.empty = Empty::Truth;
            return self.sum;
        }
        for (&seen, &matched) in self.seen.iter().zip(&self.matched) {
            if seen == 0 {
                continue;
            }
            let share = f64::from(matched) / f64::from(seen);
            if share > 0.8 {
                s.mt += 1;
            } else if share >= 0.2 {
                s.pt += 1;
            }
        }
        s.ml = self.seen.len() as u64 - s.mt - s.pt;
        s.frag = self.frags.iter().map(|&f| u64::from(f.saturating_sub(1))).sum();
        s.frames = frames;
        self.sum
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn o(row: u32, col: u32, similarity: f64) -> Overlap {
        Overlap { row, col, similarity }
    }

    #[test]
    fn a_match_that_goes_on_beats_a_better_newcomer() {
        let mut c = ClearCounter::new(1, 0.5);
        c.frame(&[0], &[0], &[o(0, 0, 0.9)]);
        c.frame(&[0], &[0, 1], &[o(0, 0, 0.6), o(0, 1, 0.9)]);
        let c = c.finish(2);
        assert_eq!((c.tp, c.fp, c.fn_, c.idsw, c.mt), (2, 1, 0, 0, 1));
        assert!((c.motp() - 0.75).abs() < 1e-15);
    }

    #[test]
    fn a_switch_counts_against_the_last_match_and_a_gap_is_a_fragmentation() {
        let mut c = ClearCounter::new(1, 0.5);
        c.frame(&[0], &[0], &[o(0, 0, 0.9)]);
        c.frame(&[0], &[1], &[]);
        c.frame(&[0], &[1], &[o(0, 0, 0.9)]);
        let c = c.finish(3);
        assert_eq!((c.tp, c.fp, c.fn_, c.idsw, c.frag, c.pt), (2, 1, 1, 1, 1, 1));
        assert_eq!(c.mota(), 0.0);
    }
}
