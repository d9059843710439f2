//! One-to-one matching for the measures: the matching that the official kits find, without their dense matrices.
//!
//! TrackEval asks scipy for the best assignment of a dense score matrix in every frame. Nearly every pair there is 0, so
//! the answer is the maximum-weight matching of the few positive pairs, which [`Matcher`] finds in about linear time:
//! first the pairs that are better than anything their two partners could have instead (they belong to every best
//! matching), then shortest augmenting paths for the rest ([`sparse`]). If the best matching is not unique (ties), the
//! answer depends on the order in which scipy looks; only then the dense problem is solved in just that order ([`dense`]).
//!
//! Limits: ties in a frame with more than 2²⁶ pairs are broken by our own order (the dense matrix would not fit).

pub mod dense;
pub mod sparse;

use sparse::{Edges, SparseMatcher};

/// No partner.
pub const NONE: u32 = u32::MAX;
/// Largest problem that is laid out in full, entries (512 MB); larger ones are solved on their positive pairs.
const DENSE_LIMIT: usize = 1 << 26;

/// A positive pair of a frame: row (truth), column (result), weight.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pair {
    /// Row in the frame.
    pub row: u32,
    /// Column in the frame.
    pub col: u32,
    /// Weight, above 0.
    pub weight: f64,
}

#[derive(Clone, Copy, Debug)]
struct Best {
    first: f64,
    second: f64,
}

impl Best {
    const NONE: Self = Self { first: 0.0, second: 0.0 };
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

/// Finds maximum-weight matchings; keeps its memory between frames.
#[derive(Debug, Default)]
pub struct Matcher {
    rows: Vec<Best>,
    cols: Vec<Best>,
    row_match: Vec<u32>,
    col_taken: Vec<bool>,
    rest: Vec<u32>,
    sub: Edges,
    sub_of_row: Vec<u32>,
    sub_rows: Vec<u32>,
    sparse: SparseMatcher,
    lsap: dense::Lsap,
    costs: Vec<f64>,
    /// How many frames needed the dense twin because of ties (for tests and the curious).
    pub n_dense: u64,
}

impl Matcher {
    /// Matches rows and columns so that the sum of the weights is greatest; ties as scipy breaks them.
    ///
    /// `pairs` holds the positive pairs, by row and within a row by column. Afterwards `out[k]` is the number of the
    /// pair that the matching takes, by row; pairs of weight 0 are never among them.
    pub fn solve(&mut self, n_rows: usize, n_cols: usize, pairs: &[Pair], out: &mut Vec<u32>) {
        if !self.solve_unique(n_rows, n_cols, pairs, out) && n_rows.saturating_mul(n_cols) <= DENSE_LIMIT {
            self.n_dense += 1;
            self.solve_dense(n_rows, n_cols, pairs);
            out.clear();
            out.extend(self.row_match.iter().filter(|&&k| k != NONE));
        }
    }

    /// The same where any of several best matchings will do, as for distances between sets: never dense.
    pub fn solve_any(&mut self, n_rows: usize, n_cols: usize, pairs: &[Pair], out: &mut Vec<u32>) {
        self.quick(n_rows, n_cols, pairs, false, out);
    }

    /// One of the best matchings, and whether it is the only one.
    pub fn solve_unique(&mut self, n_rows: usize, n_cols: usize, pairs: &[Pair], out: &mut Vec<u32>) -> bool {
        self.quick(n_rows, n_cols, pairs, true, out)
    }

    /// The columns of the rows at the least sum of dense costs (row-major), as scipy finds them, also for more rows than
    /// columns; `out` holds (row, column).
    pub fn solve_costs(&mut self, n_rows: usize, n_cols: usize, costs: &[f64], out: &mut Vec<(u32, u32)>) {
        out.clear();
        if n_rows <= n_cols {
            let cols = self.lsap.solve(n_rows, n_cols, costs);
            out.extend(cols.iter().enumerate().map(|(i, &j)| (i as u32, j)));
        } else {
            self.costs.clear();
            for j in 0..n_cols {
                self.costs.extend((0..n_rows).map(|i| costs[i * n_cols + j]));
            }
            let rows = self.lsap.solve(n_cols, n_rows, &self.costs);
            out.extend(rows.iter().enumerate().map(|(j, &i)| (i, j as u32)));
            out.sort_unstable();
        }
    }

    fn quick(&mut self, n_rows: usize, n_cols: usize, pairs: &[Pair], ask: bool, out: &mut Vec<u32>) -> bool {
        out.clear();
        if pairs.is_empty() {
            return true;
        }
        self.rows.clear();
        self.rows.resize(n_rows, Best::NONE);
        self.cols.clear();
        self.cols.resize(n_cols, Best::NONE);
        self.row_match.clear();
        self.row_match.resize(n_rows, NONE);
        self.col_taken.clear();
        self.col_taken.resize(n_cols, false);
        let mut top = 0.0_f64;
        for p in pairs {
            self.rows[p.row as usize].see(p.weight);
            self.cols[p.col as usize].see(p.weight);
            top = top.max(p.weight);
        }
        // Sums of a few weights are rounded by less than this; closer contests count as ties.
        let tol = 1e-12 * top;
        self.rest.clear();
        for (k, p) in pairs.iter().enumerate() {
            let other = self.rows[p.row as usize].without(p.weight) + self.cols[p.col as usize].without(p.weight);
            if p.weight > other + tol {
                self.row_match[p.row as usize] = k as u32;
                self.col_taken[p.col as usize] = true;
            } else {
                self.rest.push(k as u32);
            }
        }
        let (row_match, col_taken) = (&self.row_match, &self.col_taken);
        self.rest.retain(|&k| {
            let p = &pairs[k as usize];
            row_match[p.row as usize] == NONE && !col_taken[p.col as usize]
        });
        let unique = self.rest.is_empty() || self.solve_rest(pairs, tol, ask);
        out.extend(self.row_match.iter().filter(|&&k| k != NONE));
        unique
    }

    /// Solves what dominance left over; false if the best matching is not unique.
    fn solve_rest(&mut self, pairs: &[Pair], tol: f64, ask: bool) -> bool {
        self.sub.clear();
        self.sub_rows.clear();
        self.sub_of_row.clear();
        let mut last = NONE;
        for &k in &self.rest {
            let p = &pairs[k as usize];
            if p.row != last {
                self.sub.next_row();
                self.sub_rows.push(p.row);
                last = p.row;
            }
            self.sub.push(p.col, p.weight);
        }
        self.sub.close();
        self.sparse.solve(&self.sub, self.cols.len());
        self.take_sparse();
        !ask || self.sparse.is_unique(&self.sub, tol)
    }

    fn take_sparse(&mut self) {
        for (i, &row) in self.sub_rows.iter().enumerate() {
            let e = self.sparse.row_edge[i];
            if e != NONE {
                self.row_match[row as usize] = self.rest[e as usize];
            }
        }
    }

    fn solve_dense(&mut self, n_rows: usize, n_cols: usize, pairs: &[Pair]) {
        self.costs.clear();
        self.costs.resize(n_rows * n_cols, 0.0);
        let flip = n_rows > n_cols;
        for p in pairs {
            let (r, c) = (p.row as usize, p.col as usize);
            self.costs[if flip { c * n_rows + r } else { r * n_cols + c }] = -p.weight;
        }
        let (nr, nc) = if flip { (n_cols, n_rows) } else { (n_rows, n_cols) };
        let col_of = self.lsap.solve(nr, nc, &self.costs);
        self.row_match.fill(NONE);
        for (k, p) in pairs.iter().enumerate() {
            let (i, j) = if flip { (p.col, p.row) } else { (p.row, p.col) };
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

    fn dense_answer(n: usize, m: usize, pairs: &[Pair]) -> Vec<u32> {
        let mut matcher = Matcher { row_match: vec![NONE; n], ..Matcher::default() };
        matcher.solve_dense(n, m, pairs);
        matcher.row_match.iter().copied().filter(|&k| k != NONE).collect()
    }

    fn pairs(n: usize, m: usize, cells: &[u8], levels: f64) -> Vec<Pair> {
        let mut out = Vec::new();
        for r in 0..n {
            for c in 0..m {
                let v = f64::from(cells[(r * m + c) % cells.len()] % 8);
                if v > 3.0 {
                    let weight = v / levels + 1e-3 * ((r * 31 + c * 17) % 97) as f64 * (levels - 1.0);
                    out.push(Pair { row: r as u32, col: c as u32, weight });
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
}
