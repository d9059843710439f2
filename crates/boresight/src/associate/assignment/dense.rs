//! Dense linear assignment of a square cost matrix: Jonker and Volgenant's algorithm with vectorised row scans.
//!
//! Source: R. Jonker, A. Volgenant, "A shortest augmenting path algorithm for dense and sparse linear assignment
//! problems", Computing 38, 1987: column reduction, reduction transfer, augmenting row reduction twice, augmentation.
//! Departure: the shortest-path phase keeps no list of columns; scanned columns are closed by an infinite addend, so that
//! relaxation and the search for the next minimum are one pass over contiguous memory without branches.
//! Symbols: v column price; u row price is implied. Cost: O(n³) at worst. Memory: 6 n numbers beside the matrix.
//! Limits: costs must be finite.

use super::table::UNASSIGNED;
use crate::{Error, ErrorKind, Result};

/// Values handled side by side.
const LANES: usize = 8;

/// Solves dense problems one after the other; keeps its memory.
#[derive(Clone, Debug, Default)]
pub struct Dense {
    v: Vec<f64>,
    open: Vec<f64>,
    closed: Vec<f64>,
    from: Vec<u64>,
    row_of: Vec<u32>,
    column_of: Vec<u32>,
    free: Vec<u32>,
    n_columns: Vec<u32>,
    scanned: Vec<u32>,
    reached: Vec<f64>,
}

impl Dense {
    /// Returns the column of each row with the least total cost; `cost` is n x n, row by row.
    /// # Errors
    /// A length that is not n²; a cost that is not finite.
    pub fn solve(&mut self, n: usize, cost: &[f64]) -> Result<&[u32]> {
        if cost.len() != n * n || n >= UNASSIGNED as usize {
            return Err(Error::new(ErrorKind::Config, format!("{} costs: expected n x n = {n} x {n}", cost.len())));
        }
        self.v.clear();
        self.v.resize(n, f64::INFINITY);
        self.from.clear();
        self.from.resize(n, 0);
        self.row_of.clear();
        self.row_of.resize(n, UNASSIGNED);
        self.column_of.clear();
        self.column_of.resize(n, UNASSIGNED);
        self.free.clear();
        if n == 0 {
            return Ok(&self.column_of);
        }
        self.reduce(n, cost);
        if !self.v.iter().all(|v| v.is_finite()) || !cost.iter().sum::<f64>().is_finite() {
            return Err(Error::new(ErrorKind::Damaged, "a cost is not finite")
                .hint("give pairs that must not be made a large finite cost"));
        }
        self.reduce_rows(n, cost);
        self.reduce_rows(n, cost);
        let free = std::mem::take(&mut self.free);
        for row in &free {
            self.augment(n, cost, *row);
        }
        self.free = free;
        Ok(&self.column_of)
    }

    /// Column reduction and reduction transfer.
    fn reduce(&mut self, n: usize, cost: &[f64]) {
        for (i, row) in cost.chunks_exact(n).enumerate() {
            least_by_column(row, i as u64, &mut self.v, &mut self.from);
        }
        let n_columns = &mut self.n_columns;
        n_columns.clear();
        n_columns.resize(n, 0);
        for j in (0..n).rev() {
            let i = self.from[j] as usize;
            n_columns[i] += 1;
            if n_columns[i] == 1 {
                self.column_of[i] = j as u32;
                self.row_of[j] = i as u32;
            }
        }
        for (i, row) in cost.chunks_exact(n).enumerate() {
            match n_columns[i] {
                0 => self.free.push(i as u32),
                1 if n > 1 => {
                    let j = self.column_of[i] as usize;
                    // The column's own entry is put out of reach while the others are searched.
                    let price = self.v[j];
                    self.v[j] = f64::NEG_INFINITY;
                    let least = two_least(row, &self.v).0;
                    self.v[j] = price - (least - (row[j] - price));
                }
                _ => {}
            }
        }
    }

    /// Augmenting row reduction: each free row takes its best column and pays its advantage over the second best.
    fn reduce_rows(&mut self, n: usize, cost: &[f64]) {
        let rows = std::mem::take(&mut self.free);
        let mut k = 0;
        let mut queue = rows;
        // A chain of displacements may creep by rounding: it is left to the augmentation after so many.
        let mut left = 4 * n + 64;
        while k < queue.len() {
            let i = queue[k] as usize;
            k += 1;
            let (least, second, first_j, second_j) = two_least(&cost[i * n..(i + 1) * n], &self.v);
            let mut j = first_j as usize;
            let displaced = self.row_of[j];
            if least < second {
                self.v[j] -= second - least;
            } else if displaced != UNASSIGNED && n > 1 {
                j = second_j as usize;
            }
            let displaced = if least < second { displaced } else { self.row_of[j] };
            self.column_of[i] = j as u32;
            self.row_of[j] = i as u32;
            if displaced != UNASSIGNED {
                self.column_of[displaced as usize] = UNASSIGNED;
                if least < second && left > 0 {
                    left -= 1;
                    k -= 1;
                    queue[k] = displaced;
                } else {
                    self.free.push(displaced);
                }
            }
        }
        queue.clear();
    }

    /// One shortest augmenting path.
    fn augment(&mut self, n: usize, cost: &[f64], start: u32) {
        self.open.clear();
        self.open.resize(n, f64::INFINITY);
        self.closed.clear();
        self.closed.resize(n, 0.0);
        self.scanned.clear();
        self.reached.clear();
        let mut row = start;
        let mut shift = 0.0;
        let (end, distance) = loop {
            let i = row as usize;
            let costs = &cost[i * n..(i + 1) * n];
            let least = relax(costs, &self.v, shift, u64::from(row), &self.closed, &mut self.open, &mut self.from);
            let j = first_equal(&self.open, least);
            if self.row_of[j] == UNASSIGNED {
                break (j, least);
            }
            self.scanned.push(j as u32);
            self.reached.push(least);
            self.closed[j] = f64::INFINITY;
            self.open[j] = f64::INFINITY;
            row = self.row_of[j];
            // The reduced cost of the matched pair is zero: what lies behind it counts from here.
            shift = cost[row as usize * n + j] - self.v[j] - least;
        };
        for (j, reached) in self.scanned.iter().zip(&self.reached) {
            self.v[*j as usize] += reached - distance;
        }
        let mut j = end;
        loop {
            let i = self.from[j] as u32;
            self.row_of[j] = i;
            let before = std::mem::replace(&mut self.column_of[i as usize], j as u32);
            if i == start {
                return;
            }
            j = before as usize;
        }
    }
}

widest! {
    /// Lowers each column's least cost and names the row it comes from.
    fn least_by_column(row: &[f64], i: u64, v: &mut [f64], from: &mut [u64]) {
        for ((c, v), from) in row.iter().zip(v.iter_mut()).zip(from.iter_mut()) {
            let lower = *c < *v;
            *v = if lower { *c } else { *v };
            *from = if lower { i } else { *from };
        }
    }
}

widest! {
    /// Least and second least of c − v with their places.
    fn two_least(row: &[f64], v: &[f64]) -> (f64, f64, u64, u64) {
        let mut first = [f64::INFINITY; LANES];
        let mut second = [f64::INFINITY; LANES];
        let mut first_at = [0u64; LANES];
        let mut second_at = [0u64; LANES];
        let (row_blocks, row_rest) = row.as_chunks::<LANES>();
        let (v_blocks, v_rest) = v.as_chunks::<LANES>();
        for (block, (c, v)) in row_blocks.iter().zip(v_blocks).enumerate() {
            for l in 0..LANES {
                let d = c[l] - v[l];
                let at = (block * LANES + l) as u64;
                let is_first = d < first[l];
                let is_second = d < second[l];
                second_at[l] = if is_first {
                    first_at[l]
                } else if is_second {
                    at
                } else {
                    second_at[l]
                };
                second[l] = if is_first {
                    first[l]
                } else if is_second {
                    d
                } else {
                    second[l]
                };
                first_at[l] = if is_first { at } else { first_at[l] };
                first[l] = if is_first { d } else { first[l] };
            }
        }
        let mut out = (f64::INFINITY, f64::INFINITY, 0, 0);
        let mut take = |d: f64, at: u64| {
            if d < out.0 {
                out = (d, out.0, at, out.2);
            } else if d < out.1 {
                out = (out.0, d, out.2, at);
            }
        };
        for l in 0..LANES {
            take(first[l], first_at[l]);
            take(second[l], second_at[l]);
        }
        for (k, (c, v)) in row_rest.iter().zip(v_rest).enumerate() {
            take(c - v, (row.len() - row_rest.len() + k) as u64);
        }
        out
    }
}

widest! {
    /// Relaxes all open columns from one row and returns the least distance among them.
    fn relax(row: &[f64], v: &[f64], shift: f64, i: u64, closed: &[f64], open: &mut [f64], from: &mut [u64]) -> f64 {
        let mut least = [f64::INFINITY; LANES];
        let (row, row_rest) = row.as_chunks::<LANES>();
        let (v, v_rest) = v.as_chunks::<LANES>();
        let (closed, closed_rest) = closed.as_chunks::<LANES>();
        let (open, open_rest) = open.as_chunks_mut::<LANES>();
        let (from, from_rest) = from.as_chunks_mut::<LANES>();
        for ((((c, v), closed), open), from) in row.iter().zip(v).zip(closed).zip(open).zip(from) {
            for l in 0..LANES {
                let d = c[l] - v[l] - shift + closed[l];
                let nearer = d < open[l];
                open[l] = if nearer { d } else { open[l] };
                from[l] = if nearer { i } else { from[l] };
                least[l] = if open[l] < least[l] { open[l] } else { least[l] };
            }
        }
        let mut out = least.iter().copied().fold(f64::INFINITY, f64::min);
        let rest = row_rest.iter().zip(v_rest).zip(closed_rest).zip(open_rest).zip(from_rest);
        for ((((c, v), closed), open), from) in rest {
            let d = c - v - shift + closed;
            if d < *open {
                *open = d;
                *from = i;
            }
            out = out.min(*open);
        }
        out
    }
}

widest! {
    /// The first place that holds `value`.
    fn first_equal(values: &[f64], value: f64) -> usize {
        let (blocks, _) = values.as_chunks::<32>();
        let mut at = 0;
        for block in blocks {
            if block.iter().fold(false, |any, v| any | (*v == value)) {
                break;
            }
            at += 32;
        }
        at + values[at..].iter().position(|v| *v == value).unwrap_or(0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn brute_force(n: usize, cost: &[f64], row: usize, used: u32) -> f64 {
        if row == n {
            return 0.0;
        }
        let open = (0..n).filter(|j| used & (1 << j) == 0);
        open.map(|j| cost[row * n + j] + brute_force(n, cost, row + 1, used | 1 << j)).fold(f64::INFINITY, f64::min)
    }

    proptest! {
        #[test]
        fn the_total_is_that_of_the_best_permutation(n in 0usize..8, seed in prop::collection::vec(0u32..12, 64)) {
            // Few different costs: ties everywhere.
            let cost: Vec<f64> = seed.iter().take(n * n).map(|c| f64::from(*c) * 0.5).collect();
            let mut solver = Dense::default();
            let columns = solver.solve(n, &cost).unwrap().to_vec();
            let total: f64 = columns.iter().enumerate().map(|(i, j)| cost[i * n + *j as usize]).sum();
            prop_assert!((total - brute_force(n, &cost, 0, 0)).abs() < 1e-9);
            let mut sorted = columns;
            sorted.sort_unstable();
            prop_assert!(sorted.iter().enumerate().all(|(i, j)| i as u32 == *j));
        }
    }

    #[test]
    fn a_cost_that_is_not_finite_is_refused() {
        assert!(Dense::default().solve(2, &[0.0, 1.0, f64::NAN, 0.0]).is_err());
        assert!(Dense::default().solve(2, &[0.0, 1.0]).is_err());
    }
}
