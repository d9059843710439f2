//! Dense rectangular assignment by shortest augmenting paths, with ties broken in scipy's order.
//!
//! Source: D. F. Crouse, *On implementing 2D rectangular assignment algorithms*, IEEE Trans. Aerospace and Electronic
//! Systems 52(4), 2016. Where several assignments cost the same, the one found depends on the order of looking; to equal
//! the official kits this file keeps the order that `scipy.optimize.linear_sum_assignment` documents by its results:
//! rows in turn; columns from the last to the first, a closed column's place taken by the last open one; among equal path
//! costs a free column first, else the one met first. The arithmetic is done in the same order as well, for ties that
//! rounding decides.
//!
//! Why there are two dense solvers: [`super::dense`] is the quicker one, but where costs tie it finds some optimum, and its
//! reductions leave no way to say which; the kits' numbers depend on the one that scipy finds. Here the order of looking is
//! the purpose, so the row is walked one column after the other.
//!
//! Limits: rows ≤ columns (the caller transposes); finite costs. Cost: O(rows² · columns) at worst.

use super::table::UNASSIGNED;

/// The solver and its memory.
#[derive(Clone, Debug, Default)]
pub struct DenseInOrder {
    u: Vec<f64>,
    v: Vec<f64>,
    path_cost: Vec<f64>,
    path: Vec<u32>,
    row_of: Vec<u32>,
    col_of: Vec<u32>,
    row_seen: Vec<bool>,
    col_seen: Vec<bool>,
    open: Vec<u32>,
}

fn reset<T: Clone>(v: &mut Vec<T>, n: usize, value: T) {
    v.clear();
    v.resize(n, value);
}

impl DenseInOrder {
    /// Returns the column of each row so that the sum of `costs` (row-major, `n_rows` ≤ `n_columns`) is least.
    pub fn solve(&mut self, n_rows: usize, n_columns: usize, costs: &[f64]) -> &[u32] {
        reset(&mut self.u, n_rows, 0.0);
        reset(&mut self.v, n_columns, 0.0);
        reset(&mut self.path, n_columns, UNASSIGNED);
        reset(&mut self.row_of, n_columns, UNASSIGNED);
        reset(&mut self.col_of, n_rows, UNASSIGNED);
        for row in 0..n_rows {
            let Some((sink, least)) = self.shortest_path(row, n_rows, n_columns, costs) else { break };
            self.u[row] += least;
            for i in 0..n_rows {
                if self.row_seen[i] && i != row {
                    self.u[i] += least - self.path_cost[self.col_of[i] as usize];
                }
            }
            for j in 0..n_columns {
                if self.col_seen[j] {
                    self.v[j] -= least - self.path_cost[j];
                }
            }
            let mut j = sink;
            loop {
                let i = self.path[j as usize];
                self.row_of[j as usize] = i;
                std::mem::swap(&mut self.col_of[i as usize], &mut j);
                if i as usize == row {
                    break;
                }
            }
        }
        &self.col_of
    }

    /// Dijkstra from a free row to the nearest free column; the column and the path's cost.
    fn shortest_path(&mut self, start: usize, n_rows: usize, n_columns: usize, costs: &[f64]) -> Option<(u32, f64)> {
        reset(&mut self.row_seen, n_rows, false);
        reset(&mut self.col_seen, n_columns, false);
        reset(&mut self.path_cost, n_columns, f64::INFINITY);
        self.open.clear();
        self.open.extend((0..n_columns as u32).rev());
        let (mut row, mut reached) = (start, 0.0);
        loop {
            self.row_seen[row] = true;
            let line = &costs[row * n_columns..(row + 1) * n_columns];
            let (mut place, mut lowest) = (usize::MAX, f64::INFINITY);
            for (it, &j) in self.open.iter().enumerate() {
                let j = j as usize;
                let r = reached + line[j] - self.u[row] - self.v[j];
                if r < self.path_cost[j] {
                    self.path[j] = row as u32;
                    self.path_cost[j] = r;
                }
                let c = self.path_cost[j];
                if c < lowest || (c == lowest && self.row_of[j] == UNASSIGNED) {
                    lowest = c;
                    place = it;
                }
            }
            if place == usize::MAX {
                return None;
            }
            reached = lowest;
            let j = self.open.swap_remove(place);
            self.col_seen[j as usize] = true;
            match self.row_of[j as usize] {
                UNASSIGNED => return Some((j, reached)),
                i => row = i as usize,
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn best_by_trying_all(n: usize, m: usize, costs: &[f64], row: usize, used: &mut Vec<bool>) -> f64 {
        if row == n {
            return 0.0;
        }
        let mut best = f64::INFINITY;
        for j in 0..m {
            if !used[j] {
                used[j] = true;
                best = best.min(costs[row * m + j] + best_by_trying_all(n, m, costs, row + 1, used));
                used[j] = false;
            }
        }
        best
    }

    #[test]
    fn the_cost_is_that_of_trying_all_assignments() {
        let mut x = 12345_u64;
        for _ in 0..200 {
            let mut next = || {
                x = x.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
                (x >> 33) as f64
            };
            let n = 1 + (next() as usize) % 4;
            let m = n + (next() as usize) % 3;
            let costs: Vec<f64> = (0..n * m).map(|_| (next() as u64 % 10) as f64 - 5.0).collect();
            let mut solver = DenseInOrder::default();
            let cols = solver.solve(n, m, &costs).to_vec();
            let total: f64 = cols.iter().enumerate().map(|(i, &j)| costs[i * m + j as usize]).sum();
            assert_eq!(total, best_by_trying_all(n, m, &costs, 0, &mut vec![false; m]));
        }
    }

    #[test]
    fn equal_costs_pair_as_scipy_pairs_them() {
        // scipy 1.17.1: linear_sum_assignment(-[[1,1],[1,1]]) -> columns [0, 1]; of [[0,-1,-1],[0,-1,-1]] -> [1, 2].
        let mut solver = DenseInOrder::default();
        assert_eq!(solver.solve(2, 2, &[-1.0; 4]), [0, 1]);
        assert_eq!(solver.solve(2, 3, &[0.0, -1.0, -1.0, 0.0, -1.0, -1.0]), [1, 2]);
    }
}
