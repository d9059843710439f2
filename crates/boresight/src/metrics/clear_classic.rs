//! CLEAR measures as the MATLAB kit and py-motmetrics count them.
//!
//! Source: K. Bernardin, R. Stiefelhagen (see [`super::clear`]); conventions of py-motmetrics 1.4. They differ from
//! TrackEval's: the last match of a truth is carried on however long ago it was (TrackEval: only that of the frame
//! before); as many pairs as possible are matched before the distances decide; a truth is mostly tracked from 80 % on
//! (TrackEval: above 80 %); a fragmentation is a loss between two matches; MOTP is the mean *distance* 1 − IoU.
//! Symbols: d = 1 − similarity; pairs with d > 1 − threshold never match.

use super::overlap::{Overlap, OverlapFinder, frame_boxes, frame_tracks};
use super::{MatchOptions, multi_object::refuse_doubles};
use crate::associate::assignment::matching::{Matcher, WeightedPair};
use crate::associate::assignment::table::UNASSIGNED;
use crate::{Result, TrackTable};
use serde::Serialize;

/// Counts of the classic CLEAR measures; they add up over sequences.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct ClearClassic {
    /// Matched pairs that are no switches.
    pub matches: u64,
    /// Matched pairs that switch.
    pub switches: u64,
    /// Misses.
    pub misses: u64,
    /// False alarms.
    pub false_positives: u64,
    /// Losses between two matches.
    pub fragmentations: u64,
    /// Truths tracked in at least 80 % of their frames.
    pub mostly_tracked: u64,
    /// Truths in between.
    pub partially_tracked: u64,
    /// Truths tracked in less than 20 % of their frames.
    pub mostly_lost: u64,
    /// Results that move on to another truth.
    pub transfers: u64,
    /// Switches to a result never matched before.
    pub ascends: u64,
    /// Transfers to a truth never matched before.
    pub migrates: u64,
    /// Sum of the distances of the matched pairs.
    pub distance_sum: f64,
}

impl ClearClassic {
    /// 1 − (misses + switches + false alarms) / truth rows; NaN without truth.
    pub fn mota(&self) -> f64 {
        let n = self.matches + self.switches + self.misses;
        1.0 - (self.misses + self.switches + self.false_positives) as f64 / n as f64
    }
    /// Mean distance of the matched pairs (0 is best); NaN without any.
    pub fn motp(&self) -> f64 {
        self.distance_sum / (self.matches + self.switches) as f64
    }
    /// The counts of several sequences together.
    pub fn combined<'a>(all: impl IntoIterator<Item = &'a Self>) -> Self {
        all.into_iter().fold(Self::default(), |s, c| Self {
            matches: s.matches + c.matches,
            switches: s.switches + c.switches,
            misses: s.misses + c.misses,
            false_positives: s.false_positives + c.false_positives,
            fragmentations: s.fragmentations + c.fragmentations,
            mostly_tracked: s.mostly_tracked + c.mostly_tracked,
            partially_tracked: s.partially_tracked + c.partially_tracked,
            mostly_lost: s.mostly_lost + c.mostly_lost,
            transfers: s.transfers + c.transfers,
            ascends: s.ascends + c.ascends,
            migrates: s.migrates + c.migrates,
            distance_sum: s.distance_sum + c.distance_sum,
        })
    }
}

struct Counter {
    sum: ClearClassic,
    /// Last match of each truth, last truth of each result found by assignment, and whether they ever matched.
    of_truth: Vec<u32>,
    of_result: Vec<u32>,
    result_known: Vec<bool>,
    truth_known: Vec<bool>,
    seen: Vec<u32>,
    tracked: Vec<u32>,
    /// For fragmentations: lost since the last match.
    lost: Vec<bool>,
    col_of: Vec<u32>,
    matcher: Matcher,
}

/// Computes the classic CLEAR measures.
/// # Errors
/// An id twice in a frame.
pub fn clear_classic(truth: &TrackTable, result: &TrackTable, options: &MatchOptions) -> Result<ClearClassic> {
    refuse_doubles(truth)?;
    refuse_doubles(result)?;
    let mut c = Counter {
        sum: ClearClassic::default(),
        of_truth: vec![UNASSIGNED; truth.n_tracks()],
        of_result: vec![UNASSIGNED; result.n_tracks()],
        result_known: vec![false; result.n_tracks()],
        truth_known: vec![false; truth.n_tracks()],
        seen: vec![0; truth.n_tracks()],
        tracked: vec![0; truth.n_tracks()],
        lost: vec![false; truth.n_tracks()],
        col_of: vec![UNASSIGNED; result.n_tracks()],
        matcher: Matcher::default(),
    };
    let (mut finder, mut overlaps) = (OverlapFinder::default(), Vec::new());
    let most = 1.0 - options.threshold;
    for frame in 0..truth.n_frames().max(result.n_frames()) {
        overlaps.clear();
        finder.frame(options.similarity, frame_boxes(truth, frame), frame_boxes(result, frame), &mut overlaps);
        overlaps.retain(|o: &Overlap| 1.0 - o.similarity <= most);
        c.frame(frame_tracks(truth, frame), frame_tracks(result, frame), &overlaps);
    }
    Ok(c.finish())
}

impl Counter {
    fn frame(&mut self, truth: &[u32], result: &[u32], overlaps: &[Overlap]) {
        for (col, &r) in result.iter().enumerate() {
            self.col_of[r as usize] = col as u32;
        }
        let mut row_done = vec![false; truth.len()];
        let mut col_done = vec![false; result.len()];
        let distance = |row: u32, col: u32| {
            let k = overlaps.binary_search_by_key(&(row, col), |o| (o.row, o.col)).ok()?;
            Some(1.0 - overlaps[k].similarity)
        };
        for (row, &t) in truth.iter().enumerate() {
            let before = self.of_truth[t as usize];
            if before == UNASSIGNED {
                continue;
            }
            let col = self.col_of[before as usize];
            if col == UNASSIGNED || col_done[col as usize] {
                continue;
            }
            if let Some(d) = distance(row as u32, col) {
                row_done[row] = true;
                col_done[col as usize] = true;
                self.truth_known[t as usize] = true;
                self.result_known[before as usize] = true;
                self.sum.matches += 1;
                self.sum.distance_sum += d;
            }
        }
        for (row, col, d) in self.assign(truth.len(), result.len(), overlaps, &row_done, &col_done) {
            let (t, r) = (truth[row as usize] as usize, result[col as usize] as usize);
            row_done[row as usize] = true;
            col_done[col as usize] = true;
            let switch = self.of_truth[t] != UNASSIGNED && self.of_truth[t] != r as u32;
            self.sum.ascends += u64::from(switch && !self.result_known[r]);
            let transfer = self.of_result[r] != UNASSIGNED && self.of_result[r] != t as u32;
            self.sum.transfers += u64::from(transfer);
            self.sum.migrates += u64::from(transfer && !self.truth_known[t]);
            self.result_known[r] = true;
            self.truth_known[t] = true;
            self.sum.switches += u64::from(switch);
            self.sum.matches += u64::from(!switch);
            self.sum.distance_sum += d;
            self.of_truth[t] = r as u32;
            self.of_result[r] = t as u32;
        }
        for (&t, &done) in truth.iter().zip(&row_done) {
            let t = t as usize;
            self.seen[t] += 1;
            if done {
                self.sum.fragmentations += u64::from(self.tracked[t] > 0 && self.lost[t]);
                self.tracked[t] += 1;
                self.lost[t] = false;
            } else {
                self.sum.misses += 1;
                self.lost[t] = true;
            }
        }
        self.sum.false_positives += col_done.iter().filter(|d| !**d).count() as u64;
        for &r in result {
            self.col_of[r as usize] = UNASSIGNED;
        }
    }

    /// Most pairs first, then the least sum of distances.
    fn assign(
        &mut self,
        n: usize,
        m: usize,
        overlaps: &[Overlap],
        row_done: &[bool],
        col_done: &[bool],
    ) -> Vec<(u32, u32, f64)> {
        let left: Vec<&Overlap> =
            overlaps.iter().filter(|o| !row_done[o.row as usize] && !col_done[o.col as usize]).collect();
        let worst = left.iter().map(|o| 1.0 - o.similarity).fold(f64::NAN, f64::max);
        if left.is_empty() {
            return Vec::new();
        }
        // A missing pair costs more than any difference that the others could make.
        let missing = 2.0 * n.min(m) as f64 * (worst + 1.0) + 1.0;
        let pairs: Vec<WeightedPair> = left
            .iter()
            .map(|o| WeightedPair { row: o.row, column: o.col, weight: missing - (1.0 - o.similarity) })
            .collect();
        let mut taken = Vec::new();
        if self.matcher.solve_unique(n, m, &pairs, &mut taken) || n * m > 1 << 26 {
            return taken.iter().map(|&k| left[k as usize]).map(|o| (o.row, o.col, 1.0 - o.similarity)).collect();
        }
        let mut costs = vec![missing; n * m];
        for o in &left {
            costs[o.row as usize * m + o.col as usize] = 1.0 - o.similarity;
        }
        let mut chosen = Vec::new();
        self.matcher.solve_costs(n, m, &costs, &mut chosen);
        chosen
            .into_iter()
            .map(|(i, j)| (i, j, costs[i as usize * m + j as usize]))
            .filter(|&(_, _, c)| c < missing)
            .collect()
    }

    fn finish(mut self) -> ClearClassic {
        for (&seen, &tracked) in self.seen.iter().zip(&self.tracked) {
            let share = f64::from(tracked) / f64::from(seen);
            if seen == 0 {
                continue;
            }
            if share >= 0.8 {
                self.sum.mostly_tracked += 1;
            } else if share >= 0.2 {
                self.sum.partially_tracked += 1;
            } else {
                self.sum.mostly_lost += 1;
            }
        }
        self.sum
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{PixelOrigin, TrackRow};

    fn table(rows: &[(u32, i64, f64)]) -> TrackTable {
        let row = |&(frame, id, x): &_| TrackRow { frame, id, bbox: [x, 0.0, 10.0, 10.0], ..TrackRow::default() };
        TrackTable::from_rows("t", PixelOrigin::Centre0, rows.iter().map(row)).unwrap()
    }

    #[test]
    fn the_counts_of_sequences_add() {
        let counts = |first: u64| ClearClassic {
            matches: first,
            switches: first + 1,
            misses: first + 2,
            false_positives: first + 3,
            fragmentations: first + 4,
            mostly_tracked: first + 5,
            partially_tracked: first + 6,
            mostly_lost: first + 7,
            transfers: first + 8,
            ascends: first + 9,
            migrates: first + 10,
            distance_sum: first as f64 / 4.0,
        };
        let both = ClearClassic::combined(&[counts(20), counts(30)]);
        assert_eq!((both.matches, both.switches, both.misses, both.false_positives), (50, 52, 54, 56));
        assert_eq!((both.fragmentations, both.mostly_tracked, both.partially_tracked), (58, 60, 62));
        assert_eq!((both.mostly_lost, both.transfers, both.ascends, both.migrates), (64, 66, 68, 70));
        assert_eq!(both.distance_sum, 12.5);
    }

    #[test]
    fn the_last_match_is_carried_over_a_gap() {
        // Result 7 follows the truth, is away for a frame, and comes back beside a better box 8: 7 keeps it.
        let truth = table(&[(0, 1, 0.0), (1, 1, 0.0), (2, 1, 0.0)]);
        let result = table(&[(0, 7, 0.0), (2, 7, 2.0), (2, 8, 0.0)]);
        let c = clear_classic(&truth, &result, &MatchOptions::default()).unwrap();
        assert_eq!((c.matches, c.switches, c.misses, c.false_positives, c.fragmentations), (2, 0, 1, 1, 1));
    }
}
