//! Identity measures IDF1, IDP, IDR: one result track for each truth over the whole sequence.
//!
//! Source: E. Ristani et al., *Performance measures and a data set for multi-target, multi-camera tracking*, ECCV
//! workshops 2016. The best one-to-one map between truths and results maximises IDTP, the rows in which mapped tracks are
//! at least `threshold` alike; it is a maximum-weight matching, so the kits' square matrix with its forbidden corners is
//! not needed and ties do not matter.
//! Symbols: IDF1 = IDTP / (IDTP + ½ IDFP + ½ IDFN).

use crate::associate::assignment::sparse::{AtEqualCost, SparseSolver};
use crate::associate::assignment::table::{CostTable, SparseTable, UNASSIGNED};
use serde::Serialize;

/// Counts of the identity measures; they add up over sequences.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Identity {
    /// Rows in which mapped tracks agree.
    pub idtp: u64,
    /// Truth rows that the map misses.
    pub idfn: u64,
    /// Result rows that the map does not explain.
    pub idfp: u64,
}

impl Identity {
    /// Identity F1, 0..=1.
    pub fn idf1(&self) -> f64 {
        self.idtp as f64 / (self.idtp as f64 + 0.5 * self.idfp as f64 + 0.5 * self.idfn as f64).max(1.0)
    }
    /// Identity precision, 0..=1.
    pub fn idp(&self) -> f64 {
        self.idtp as f64 / ((self.idtp + self.idfp) as f64).max(1.0)
    }
    /// Identity recall, 0..=1.
    pub fn idr(&self) -> f64 {
        self.idtp as f64 / ((self.idtp + self.idfn) as f64).max(1.0)
    }
    /// The counts of several sequences together.
    pub fn combined<'a>(all: impl IntoIterator<Item = &'a Self>) -> Self {
        all.into_iter().fold(Self::default(), |s, i| Self {
            idtp: s.idtp + i.idtp,
            idfn: s.idfn + i.idfn,
            idfp: s.idfp + i.idfp,
        })
    }
}

/// Counts from the common rows: `pairs[k]` = (truth, result) share `common[k]` rows.
pub fn identity(
    n_truth_rows: u64,
    n_result_rows: u64,
    n_results: usize,
    pairs: &[(u32, u32)],
    common: &[u32],
) -> Identity {
    let mut rows: Vec<u32> = (0..pairs.len() as u32).filter(|&k| common[k as usize] > 0).collect();
    rows.sort_unstable_by_key(|&k| pairs[k as usize]);
    let mut table = SparseTable::default();
    table.reset(n_results);
    let (mut choice, mut order) = (Vec::new(), Vec::new());
    for chunk in rows.chunk_by(|&a, &b| pairs[a as usize].0 == pairs[b as usize].0) {
        for &k in chunk {
            table.push(pairs[k as usize].1, -f64::from(common[k as usize]));
        }
        table.end_row(0.0);
        order.push(choice.len() as u32);
        choice.push(UNASSIGNED);
    }
    SparseSolver::new(AtEqualCost::Miss).solve_within(&table, &order, &mut choice, u64::MAX);
    let gain = |i: usize| table.row(i).iter().find(|c| c.column == choice[i]).map_or(0, |c| -c.cost as u64);
    let idtp = (0..choice.len()).map(gain).sum();
    Identity { idtp, idfn: n_truth_rows - idtp, idfp: n_result_rows - idtp }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_halves_of_a_track_count_as_the_longer_one() {
        // One truth of 10 rows, followed by result 0 for 6 rows and result 1 for 4: IDTP 6, IDF1 0.6.
        let i = identity(10, 10, 2, &[(0, 0), (0, 1)], &[6, 4]);
        assert_eq!((i.idtp, i.idfn, i.idfp), (6, 4, 4));
        assert!((i.idf1() - 0.6).abs() < 1e-15);
    }

    #[test]
    fn the_map_is_the_best_over_all_not_the_greedy_one() {
        let i = identity(20, 20, 2, &[(0, 0), (0, 1), (1, 0)], &[9, 8, 8]);
        assert_eq!(i.idtp, 16);
    }

    #[test]
    fn precision_is_of_the_result_and_recall_of_the_truth() {
        // 6 rows in common of 10 in the truth and 8 in the result.
        let i = identity(10, 8, 1, &[(0, 0)], &[6]);
        assert_eq!((i.idp(), i.idr(), i.idf1()), (0.75, 0.6, 6.0 / 9.0));
        let both = Identity::combined(&[i, identity(5, 5, 1, &[(0, 0)], &[5])]);
        assert_eq!((both.idtp, both.idfn, both.idfp), (11, 4, 2));
    }
}
