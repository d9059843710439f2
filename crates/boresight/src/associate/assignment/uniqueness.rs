//! Whether the best assignment of a sparse table is the only one.
//!
//! Source: linear programming duality (see R. Burkard, M. Dell'Amico, S. Martello, *Assignment Problems*, SIAM 2009, ch. 4).
//! Dual values u of rows and v of columns are ≥ 0, u_i + v_j ≥ w_ij with the gain w_ij = miss cost − cost, with equality on
//! chosen pairs, and 0 where nothing is chosen: that proves the optimum. Another one exists exactly if along pairs without
//! slack there is a cycle of exchanges, or a chain that begins where a row can move for nothing (to a free column, or to a
//! miss) and ends where nobody needs what it leaves.
//! Symbols: slack s_ij = u_i + v_j − w_ij.
//! Cost: near O(pairs) where few columns are worth nothing.

use super::sparse::SparseSolver;
use super::table::{CostTable, Entry, UNASSIGNED};

/// Tells whether an optimum is unique; keeps its memory.
#[derive(Clone, Debug, Default)]
pub struct Uniqueness {
    /// Dual values of the rows.
    u: Vec<f64>,
    mark: Vec<u8>,
    stack: Vec<(u32, u32)>,
}

/// A table with its best assignment.
struct Solved<'a, T> {
    table: &'a T,
    choice: &'a [u32],
    solver: &'a SparseSolver,
    tolerance: f64,
}

impl<T: CostTable> Solved<'_, T> {
    /// Whether row i could take the column of `pair` for nothing, and does not hold it.
    fn is_open(&self, u: &[f64], i: usize, pair: &T::Pair) -> bool {
        let gain = self.table.miss_cost(i) - pair.cost();
        pair.column() != self.choice[i] && u[i] + self.solver.value(pair.column()) - gain <= self.tolerance
    }
}

impl Uniqueness {
    /// Whether `choice`, which `solver` has just found for all rows of `table`, is the only one within `tolerance` of the
    /// least cost.
    pub fn check(&mut self, table: &impl CostTable, choice: &[u32], solver: &SparseSolver, tolerance: f64) -> bool {
        let n = table.n_rows();
        self.u.clear();
        for (i, &column) in choice[..n].iter().enumerate() {
            let row = table.row(i);
            let held = row.get(row.partition_point(|p| p.column() < column)).filter(|_| column != UNASSIGNED);
            self.u.push(held.map_or(0.0, |p| table.miss_cost(i) - p.cost() - solver.value(column)));
        }
        let solved = Solved { table, choice, solver, tolerance };
        self.mark.clear();
        self.mark.resize(n, 0);
        for (i, &column) in choice[..n].iter().enumerate() {
            // A free row that pushes somebody out for nothing, or finds a free column for nothing.
            let free = column == UNASSIGNED;
            // Nobody needs this column: its row leaving it for nothing would be another optimum.
            let unneeded = !free && solver.value(column) <= tolerance;
            if unneeded && self.u[i] <= tolerance {
                return false;
            }
            if (free || unneeded) && !self.chain_is_harmless(&solved, i) {
                return false;
            }
        }
        self.mark.fill(0);
        (0..n).all(|i| self.mark[i] != 0 || self.no_cycle(&solved, i))
    }

    /// From row `start` (free, or holding a column that may be left): can it push along open pairs to a loose end?
    fn chain_is_harmless<T: CostTable>(&mut self, s: &Solved<'_, T>, start: usize) -> bool {
        self.stack.clear();
        self.stack.push((start as u32, 0));
        self.mark.fill(0);
        self.mark[start] = 1;
        while let Some((i, _)) = self.stack.pop() {
            let i = i as usize;
            for pair in s.table.row(i).iter().filter(|p| s.is_open(&self.u, i, p)) {
                let k = s.solver.row_of(pair.column());
                if k == UNASSIGNED || self.u[k as usize] <= s.tolerance {
                    return false;
                }
                if self.mark[k as usize] == 0 {
                    self.mark[k as usize] = 1;
                    self.stack.push((k, 0));
                }
            }
        }
        true
    }

    /// Depth-first search along "i pushes k out"; marks 1 = on the path, 2 = done.
    fn no_cycle<T: CostTable>(&mut self, s: &Solved<'_, T>, start: usize) -> bool {
        self.stack.clear();
        self.stack.push((start as u32, 0));
        self.mark[start] = 1;
        while let Some((i, next)) = self.stack.last_mut() {
            let row = *i as usize;
            let Some(pair) = s.table.row(row).get(*next as usize) else {
                self.mark[row] = 2;
                self.stack.pop();
                continue;
            };
            *next += 1;
            let k = s.solver.row_of(pair.column());
            if k == UNASSIGNED || !s.is_open(&self.u, row, pair) {
                continue;
            }
            match self.mark[k as usize] {
                0 => {
                    self.mark[k as usize] = 1;
                    self.stack.push((k, 0));
                }
                1 => return false,
                _ => {}
            }
        }
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::associate::assignment::sparse::AtEqualCost;
    use crate::associate::assignment::table::SparseTable;
    use proptest::prelude::*;
    use std::cmp::Ordering;

    fn table(n: usize, m: usize, cells: &[u8]) -> SparseTable {
        let mut t = SparseTable::default();
        t.reset(m);
        for r in 0..n {
            for c in 0..m {
                let w = cells[(r * m + c) % cells.len()];
                if w > 120 {
                    t.push(c as u32, -f64::from(w - 120));
                }
            }
            t.end_row(0.0);
        }
        t
    }

    /// Least cost and how many assignments reach it, by trying all.
    fn try_all(t: &SparseTable, row: usize, used: &mut Vec<bool>) -> (f64, u64) {
        if row == t.n_rows() {
            return (0.0, 1);
        }
        let mut best = try_all(t, row + 1, used);
        for p in t.row(row) {
            let j = p.column as usize;
            if used[j] {
                continue;
            }
            used[j] = true;
            let (cost, n) = try_all(t, row + 1, used);
            used[j] = false;
            match (cost + p.cost).total_cmp(&best.0) {
                Ordering::Less => best = (cost + p.cost, n),
                Ordering::Equal => best.1 += n,
                Ordering::Greater => {}
            }
        }
        best
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(2000))]
        #[test]
        fn the_cost_is_the_least_and_uniqueness_is_told_right(
            n in 1_usize..6, m in 1_usize..6, coarse in any::<bool>(), cells in prop::collection::vec(any::<u8>(), 1..26),
        ) {
            let cells: Vec<u8> = cells.iter().map(|&c| if coarse { c / 32 * 32 } else { c }).collect();
            let t = table(n, m, &cells);
            let rows: Vec<u32> = (0..n as u32).collect();
            let (best, count) = try_all(&t, 0, &mut vec![false; m]);
            for rule in [AtEqualCost::Miss, AtEqualCost::Pair] {
                let mut solver = SparseSolver::new(rule);
                let mut choice = vec![UNASSIGNED; n];
                solver.solve(&t, &rows, &mut choice);
                let cost: f64 =
                    (0..n).flat_map(|i| t.row(i).iter().filter(|p| p.column == choice[i]).map(|p| p.cost).collect::<Vec<_>>()).sum();
                prop_assert_eq!(cost, best);
                prop_assert_eq!(Uniqueness::default().check(&t, &choice, &solver, 1e-9), count == 1);
            }
        }
    }

    #[test]
    fn a_contest_closer_than_the_tolerance_is_no_unique_optimum() {
        let mut t = SparseTable::default();
        t.reset(1);
        for gain in [1.0, 1.0 + 1e-6] {
            t.push(0, -gain);
            t.end_row(0.0);
        }
        let mut solver = SparseSolver::new(AtEqualCost::Miss);
        let mut choice = [UNASSIGNED; 2];
        solver.solve(&t, &[0, 1], &mut choice);
        assert_eq!(choice, [UNASSIGNED, 0]);
        assert!(Uniqueness::default().check(&t, &choice, &solver, 1e-7));
        assert!(!Uniqueness::default().check(&t, &choice, &solver, 1e-5));
    }
}
