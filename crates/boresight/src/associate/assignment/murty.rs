//! The k best assignments of a sparse problem with misses, in order.
//!
//! Source: K. G. Murty, "An algorithm for ranking all the assignments in order of increasing cost", Operations Research 16,
//! 1968: the best solution splits what is left into parts that exclude it, each solved for its own best.
//! Cost: at most k · rows solutions of the sparse problem. Limits: memory grows with k · rows parts.

use super::sparse::SparseSolver;
use super::table::{CostTable, Entry, FORBIDDEN, SparseTable, UNASSIGNED};
use std::cmp::Ordering;
use std::collections::BinaryHeap;

/// One assignment and its cost.
#[derive(Clone, Debug, PartialEq)]
pub struct Ranked {
    /// Total cost, misses included.
    pub cost: f64,
    /// Column of each row, or [`UNASSIGNED`].
    pub choice: Vec<u32>,
}

/// A part of the space: rows before `fixed` are as in the solution, the exclusions hold for row `fixed`.
#[derive(Clone, Debug, PartialEq)]
struct Part {
    solution: Ranked,
    fixed: usize,
    excluded: Vec<u32>,
    number: u64,
}

impl Eq for Part {}

impl Ord for Part {
    fn cmp(&self, other: &Self) -> Ordering {
        // A max-heap: the cheapest first, the older first among equals.
        other.solution.cost.total_cmp(&self.solution.cost).then(other.number.cmp(&self.number))
    }
}

impl PartialOrd for Part {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

/// Returns the `k` cheapest assignments of all rows of `table`, cheapest first (fewer if there are no more).
pub fn k_best(table: &impl CostTable, k: usize) -> Vec<Ranked> {
    let n = table.n_rows();
    let mut solver = SparseSolver::default();
    let mut work = SparseTable::default();
    let mut heap = BinaryHeap::new();
    let mut number = 0;
    let mut out = Vec::new();
    let solved = solve(table, &vec![UNASSIGNED; n], 0, &[], &mut work, &mut solver);
    if let Some(solution) = solved {
        heap.push(Part { solution, fixed: 0, excluded: Vec::new(), number });
    }
    while out.len() < k {
        let Some(part) = heap.pop() else { break };
        let best = &part.solution.choice;
        for row in part.fixed..n {
            let mut excluded = if row == part.fixed { part.excluded.clone() } else { Vec::new() };
            excluded.push(best[row]);
            if let Some(solution) = solve(table, best, row, &excluded, &mut work, &mut solver) {
                number += 1;
                heap.push(Part { solution, fixed: row, excluded, number });
            }
        }
        out.push(part.solution);
    }
    out
}

/// The best solution with rows before `fixed` as in `choice` and row `fixed` not as in `excluded`.
fn solve(
    table: &impl CostTable,
    choice: &[u32],
    fixed: usize,
    excluded: &[u32],
    work: &mut SparseTable,
    solver: &mut SparseSolver,
) -> Option<Ranked> {
    let n = table.n_rows();
    work.reset(table.n_columns());
    for i in 0..n {
        let mut miss_cost = table.miss_cost(i);
        for p in table.row(i) {
            let wanted = i >= fixed || choice[i] == p.column();
            if wanted && !(i == fixed && excluded.contains(&p.column())) {
                work.push(p.column(), p.cost());
            }
        }
        if (i < fixed && choice[i] != UNASSIGNED) || (i == fixed && excluded.contains(&UNASSIGNED)) {
            miss_cost = FORBIDDEN;
        }
        work.end_row(miss_cost);
    }
    let rows: Vec<u32> = (0..n as u32).collect();
    let mut found = vec![UNASSIGNED; n];
    solver.solve(work, &rows, &mut found);
    let mut cost = 0.0;
    for (i, j) in found.iter().enumerate() {
        cost += if *j == UNASSIGNED {
            work.miss_cost(i)
        } else {
            work.row(i).iter().find(|p| p.column == *j).map_or(FORBIDDEN, |p| p.cost)
        };
    }
    (cost < 0.5 * FORBIDDEN).then_some(Ranked { cost, choice: found })
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn all(table: &SparseTable, row: usize, used: u64, cost: f64, out: &mut Vec<f64>) {
        if row == table.n_rows() {
            out.push(cost);
            return;
        }
        all(table, row + 1, used, cost + table.miss_cost(row), out);
        for p in table.row(row) {
            if used & (1 << p.column) == 0 {
                all(table, row + 1, used | 1 << p.column, cost + p.cost, out);
            }
        }
    }

    proptest! {
        #[test]
        fn the_ranking_is_that_of_all_assignments_sorted(
            rows in prop::collection::vec((0.0..10.0f64, prop::collection::btree_map(0u32..4, 0.0..10.0f64, 0..4)), 0..5),
            k in 1usize..30,
        ) {
            let mut table = SparseTable::default();
            table.reset(4);
            for (miss_cost, pairs) in &rows {
                for (column, cost) in pairs {
                    table.push(*column, *cost);
                }
                table.end_row(*miss_cost);
            }
            let mut brute = Vec::new();
            all(&table, 0, 0, 0.0, &mut brute);
            brute.sort_by(f64::total_cmp);
            let ranked = k_best(&table, k);
            prop_assert_eq!(ranked.len(), k.min(brute.len()));
            for (r, b) in ranked.iter().zip(&brute) {
                prop_assert!((r.cost - b).abs() < 1e-9);
            }
            for pair in ranked.windows(2) {
                prop_assert!(pair[0].choice != pair[1].choice);
            }
        }
    }
}
