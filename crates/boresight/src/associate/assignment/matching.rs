//! Maximum-weight matching of the few pairs that have a weight, with ties as scipy breaks them.
//!
//! The evaluation kits ask scipy for the best assignment of a dense score matrix in every frame. Nearly every pair there is
//! 0, so the answer is the maximum-weight matching of the few positive pairs, which [`Matcher`] finds in about linear time:
//! first the pairs that are better than anything their two partners could have instead (they belong to every best
//! matching), then the sparse solver for the rest ([`super::sparse`]; the cost of a pair is −weight, of a miss 0). If the
//! best matching is not unique ([`super::uniqueness`]), the answer depends on the order in which scipy looks; only then the
//! dense problem is solved in just that order ([`super::dense_in_order`]).
//!
//! Limits: ties in a frame with more than 2²⁶ pairs are broken by our own order (the dense matrix would not fit).

use super::dense_in_order::DenseInOrder;
use super::sparse::{AtEqualCost, SparseSolver};
use super::table::{CostTable, SparseTable, UNASSIGNED};
use super::uniqueness::Uniqueness;

/// Largest problem that is laid out in full, entries (512 MB); larger ones are solved on their positive pairs.
const DENSE_LIMIT: usize = 1 << 26;

/// A row and a column with what matching them is worth.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WeightedPair {
    /// The row.
    pub row: u32,
    /// The column.
    pub column: u32,
    /// Weight, above 0.
    pub weight: f64,
}

#[derive(Clone, Copy, Debug)]
struct Best {
    first: f64,
    second: f64,
}

impl Best {
    const NOTHING: Self = Self { first: 0.0, second: 0.0 };
    fn see(&mut self, w: f64) {
        if w > self.first {
            self.second = self.first;
            self.first = w;
        } else if w > self.second {
            self.second = w;
        }
    }
    /// The best that is left when one pair of weight `w` is taken away.
    fn without(&self, w: f64) -> f64 {
        if w == self.first { self.second } else { self.first }
    }
}

/// Finds maximum-weight matchings; keeps its memory between problems.
#[derive(Clone, Debug)]
pub struct Matcher {
    rows: Vec<Best>,
    columns: Vec<Best>,
    /// Number of each row's pair.
    row_match: Vec<u32>,
    column_taken: Vec<bool>,
    /// Numbers of the pairs that dominance leaves open.
    rest: Vec<u32>,
    /// Those pairs as a table, the rows they are of, and their columns.
    open: SparseTable,
    open_rows: Vec<u32>,
    order: Vec<u32>,
    choice: Vec<u32>,
    sparse: SparseSolver,
    uniqueness: Uniqueness,
    dense: DenseInOrder,
    costs: Vec<f64>,
}

impl Default for Matcher {
    fn default() -> Self {
        Self {
            rows: Vec::new(),
            columns: Vec::new(),
            row_match: Vec::new(),
            column_taken: Vec::new(),
            rest: Vec::new(),
            open: SparseTable::default(),
            open_rows: Vec::new(),
            order: Vec::new(),
            choice: Vec::new(),
            sparse: SparseSolver::new(AtEqualCost::Miss),
            uniqueness: Uniqueness::default(),
            dense: DenseInOrder::default(),
            costs: Vec::new(),
        }
    }
}

impl Matcher {
    /// Matches rows and columns so that the sum of the weights is greatest; ties as scipy breaks them.
    ///
    /// `pairs` holds the positive pairs, by row and within a row by column, each once. Afterwards `out[k]` is the number of the
    /// pair that the matching takes, by row; pairs of weight 0 are never among them.
    pub fn solve(&mut self, n_rows: usize, n_columns: usize, pairs: &[WeightedPair], out: &mut Vec<u32>) {
        if !self.solve_unique(n_rows, n_columns, pairs, out) && n_rows.saturating_mul(n_columns) <= DENSE_LIMIT {
            self.solve_dense(n_rows, n_columns, pairs);
            out.clear();
            out.extend(self.row_match.iter().filter(|&&k| k != UNASSIGNED));
        }
    }

    /// The same where any of several best matchings will do, as for distances between sets: never dense.
    pub fn solve_any(&mut self, n_rows: usize, n_columns: usize, pairs: &[WeightedPair], out: &mut Vec<u32>) {
        self.quick(n_rows, n_columns, pairs, false, out);
    }

    /// One of the best matchings, and whether it is the only one.
    pub fn solve_unique(
        &mut self,
        n_rows: usize,
        n_columns: usize,
        pairs: &[WeightedPair],
        out: &mut Vec<u32>,
    ) -> bool {
        self.quick(n_rows, n_columns, pairs, true, out)
    }

    /// The columns of the rows at the least sum of dense costs (row-major), as scipy finds them, also for more rows than
    /// columns; `out` holds (row, column).
    pub fn solve_costs(&mut self, n_rows: usize, n_columns: usize, costs: &[f64], out: &mut Vec<(u32, u32)>) {
        out.clear();
        if n_rows <= n_columns {
            let cols = self.dense.solve(n_rows, n_columns, costs);
            out.extend(cols.iter().enumerate().map(|(i, &j)| (i as u32, j)));
        } else {
            self.costs.clear();
            for j in 0..n_columns {
                self.costs.extend((0..n_rows).map(|i| costs[i * n_columns + j]));
            }
            let rows = self.dense.solve(n_columns, n_rows, &self.costs);
            out.extend(rows.iter().enumerate().map(|(j, &i)| (i, j as u32)));
            out.sort_unstable();
        }
    }

    fn quick(
        &mut self,
        n_rows: usize,
        n_columns: usize,
        pairs: &[WeightedPair],
        ask: bool,
        out: &mut Vec<u32>,
    ) -> bool {
        out.clear();
        if pairs.is_empty() {
            return true;
        }
        self.rows.clear();
        self.rows.resize(n_rows, Best::NOTHING);
        self.columns.clear();
        self.columns.resize(n_columns, Best::NOTHING);
        self.row_match.clear();
        self.row_match.resize(n_rows, UNASSIGNED);
        self.column_taken.clear();
        self.column_taken.resize(n_columns, false);
        let mut top = 0.0_f64;
        for p in pairs {
            self.rows[p.row as usize].see(p.weight);
            self.columns[p.column as usize].see(p.weight);
            top = top.max(p.weight);
        }
        // Sums of a few weights are rounded by less than this; closer contests count as ties.
        let tol = 1e-12 * top;
        self.rest.clear();
        for (k, p) in pairs.iter().enumerate() {
            let other = self.rows[p.row as usize].without(p.weight) + self.columns[p.column as usize].without(p.weight);
            if p.weight > other + tol {
                self.row_match[p.row as usize] = k as u32;
                self.column_taken[p.column as usize] = true;
            } else {
                self.rest.push(k as u32);
            }
        }
        let (row_match, column_taken) = (&self.row_match, &self.column_taken);
        self.rest.retain(|&k| {
            let p = &pairs[k as usize];
            row_match[p.row as usize] == UNASSIGNED && !column_taken[p.column as usize]
        });
        let unique = self.rest.is_empty() || self.solve_rest(pairs, tol, ask);
        out.extend(self.row_match.iter().filter(|&&k| k != UNASSIGNED));
        unique
    }

    /// Solves what dominance left over; false if the best matching is not unique.
    fn solve_rest(&mut self, pairs: &[WeightedPair], tol: f64, ask: bool) -> bool {
        self.open.reset(self.columns.len());
        self.open_rows.clear();
        for &k in &self.rest {
            let p = &pairs[k as usize];
            if self.open_rows.last() != Some(&p.row) {
                if !self.open_rows.is_empty() {
                    self.open.end_row(0.0);
                }
                self.open_rows.push(p.row);
            }
            self.open.push(p.column, -p.weight);
        }
        self.open.end_row(0.0);
        self.order.clear();
        self.order.extend(0..self.open_rows.len() as u32);
        self.choice.clear();
        self.choice.resize(self.open_rows.len(), UNASSIGNED);
        self.sparse.solve_within(&self.open, &self.order, &mut self.choice, u64::MAX);
        for (i, &row) in self.open_rows.iter().enumerate() {
            let at = self.open.row(i).iter().position(|c| c.column == self.choice[i]);
            if let Some(at) = at {
                self.row_match[row as usize] = self.rest[self.open.start(i) + at];
            }
        }
        !ask || self.uniqueness.check(&self.open, &self.choice, &self.sparse, tol)
    }

    fn solve_dense(&mut self, n_rows: usize, n_columns: usize, pairs: &[WeightedPair]) {
        self.costs.clear();
        self.costs.resize(n_rows * n_columns, 0.0);
        let flip = n_rows > n_columns;
        for p in pairs {
            let (r, c) = (p.row as usize, p.column as usize);
            self.costs[if flip { c * n_rows + r } else { r * n_columns + c }] = -p.weight;
        }
        let (nr, nc) = if flip { (n_columns, n_rows) } else { (n_rows, n_columns) };
        let col_of = self.dense.solve(nr, nc, &self.costs);
        self.row_match.fill(UNASSIGNED);
        for (k, p) in pairs.iter().enumerate() {
            let (i, j) = if flip { (p.column, p.row) } else { (p.row, p.column) };
            if col_of[i as usize] == j {
                self.row_match[p.row as usize] = k as u32;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn dense_answer(n: usize, m: usize, pairs: &[WeightedPair]) -> Vec<u32> {
        let mut matcher = Matcher { row_match: vec![UNASSIGNED; n], ..Matcher::default() };
        matcher.solve_dense(n, m, pairs);
        matcher.row_match.iter().copied().filter(|&k| k != UNASSIGNED).collect()
    }

    fn pairs(n: usize, m: usize, cells: &[u8], levels: f64) -> Vec<WeightedPair> {
        let mut out = Vec::new();
        for r in 0..n {
            for c in 0..m {
                let v = f64::from(cells[(r * m + c) % cells.len()] % 8);
                if v > 3.0 {
                    let weight = v / levels + 1e-3 * ((r * 31 + c * 17) % 97) as f64 * (levels - 1.0);
                    out.push(WeightedPair { row: r as u32, column: c as u32, weight });
                }
            }
        }
        out
    }

    proptest! {
        #[test]
        fn the_quick_matching_is_the_dense_one_with_and_without_ties(
            n in 1_usize..9, m in 1_usize..9, cells in proptest::collection::vec(any::<u8>(), 1..81), ties in any::<bool>(),
        ) {
            let p = pairs(n, m, &cells, if ties { 1.0 } else { 1.7 });
            let mut out = Vec::new();
            Matcher::default().solve(n, m, &p, &mut out);
            prop_assert_eq!(out, dense_answer(n, m, &p));
        }
    }

    fn taken(
        n: usize,
        m: usize,
        pairs: &[(u32, u32, f64)],
        how: impl Fn(&mut Matcher, usize, usize, &[WeightedPair], &mut Vec<u32>),
    ) -> Vec<u32> {
        let pairs: Vec<WeightedPair> =
            pairs.iter().map(|&(row, column, weight)| WeightedPair { row, column, weight }).collect();
        let mut out = Vec::new();
        how(&mut Matcher::default(), n, m, &pairs, &mut out);
        out
    }

    #[test]
    fn a_unique_best_is_told_apart_from_a_tie() {
        let unique = |pairs: &[(u32, u32, f64)]| {
            let pairs: Vec<WeightedPair> =
                pairs.iter().map(|&(row, column, weight)| WeightedPair { row, column, weight }).collect();
            Matcher::default().solve_unique(2, 2, &pairs, &mut Vec::new())
        };
        assert!(unique(&[]) && unique(&[(0, 0, 0.9), (0, 1, 0.5), (1, 0, 0.8), (1, 1, 0.1)]));
        assert!(!unique(&[(0, 0, 0.9), (0, 1, 0.5), (1, 0, 0.8), (1, 1, 0.4)]));
        assert!(!unique(&[(0, 0, 0.7), (1, 0, 0.7)]));
        // Closer than 1e-12 of the greatest weight counts as a tie, farther does not.
        assert!(!unique(&[(0, 0, 0.7), (1, 0, 0.7 + 1e-13)]));
        assert!(unique(&[(0, 0, 0.7), (1, 0, 0.7 + 1e-9)]));
    }

    #[test]
    fn a_pair_better_than_all_that_its_partners_could_have_is_taken_and_the_rest_is_searched() {
        // Rows 1 and 2 contest columns 1 and 2: 0.6 + 0.5 beats 0.7 + 0.3.
        let pairs = [(0, 0, 0.9), (0, 1, 0.1), (1, 1, 0.7), (1, 2, 0.6), (2, 1, 0.5), (2, 2, 0.3)];
        for how in [Matcher::solve, Matcher::solve_any] {
            assert_eq!(taken(3, 3, &pairs, how), [0, 3, 4]);
        }
        assert_eq!(taken(3, 3, &pairs, |m, n, k, p, out| assert!(m.solve_unique(n, k, p, out))), [0, 3, 4]);
    }

    #[test]
    fn dense_costs_are_solved_both_ways_round() {
        // scipy 1.17.1: linear_sum_assignment([[4, 1], [2, 3], [1, 5]]) -> rows [0, 2], columns [1, 0].
        let mut out = Vec::new();
        Matcher::default().solve_costs(3, 2, &[4.0, 1.0, 2.0, 3.0, 1.0, 5.0], &mut out);
        assert_eq!(out, [(0, 1), (2, 0)]);
        Matcher::default().solve_costs(2, 3, &[4.0, 2.0, 1.0, 1.0, 3.0, 5.0], &mut out);
        assert_eq!(out, [(0, 2), (1, 0)]);
    }
}
