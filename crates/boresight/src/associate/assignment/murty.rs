//! The k best assignments of a sparse problem with misses, in order.
//!
//! Source: K. G. Murty, "An algorithm for ranking all the assignments in order of increasing cost", Operations Research 16,
//! 1968: the best solution splits what is left into parts that exclude it, each solved for its own best.
//! Cost: at most k · rows solutions of the sparse problem. Limits: memory grows with k · rows parts.

use super::super::{Gates, Pair, Prior};
use super::sparse::{FORBIDDEN, SparseSolver, UNASSIGNED};
use std::cmp::Ordering;
use std::collections::BinaryHeap;

/// One assignment and its cost.
#[derive(Clone, Debug, PartialEq)]
pub struct Ranked {
    /// Total cost, misses included.
    pub cost: f64,
    /// Detection of each row, or [`UNASSIGNED`].
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

/// Returns the `k` cheapest assignments of all rows of `gates`, cheapest first (fewer if there are no more).
pub fn k_best(gates: &Gates, k: usize) -> Vec<Ranked> {
    let n = gates.n_tracks();
    let mut solver = SparseSolver::default();
    let mut work = Gates::new();
    let mut heap = BinaryHeap::new();
    let mut number = 0;
    let mut out = Vec::new();
    let solved = solve(gates, &vec![UNASSIGNED; n], 0, &[], &mut work, &mut solver);
    if let Some(solution) = solved {
        heap.push(Part { solution, fixed: 0, excluded: Vec::new(), number });
    }
    while out.len() < k {
        let Some(part) = heap.pop() else { break };
        let best = &part.solution.choice;
        for row in part.fixed..n {
            let mut excluded = if row == part.fixed { part.excluded.clone() } else { Vec::new() };
            excluded.push(best[row]);
            if let Some(solution) = solve(gates, best, row, &excluded, &mut work, &mut solver) {
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
    gates: &Gates,
    choice: &[u32],
    fixed: usize,
    excluded: &[u32],
    work: &mut Gates,
    solver: &mut SparseSolver,
) -> Option<Ranked> {
    let n = gates.n_tracks();
    work.reset(gates.n_detections(), 1.0);
    for i in 0..n {
        let mut miss_cost = gates.prior(i).miss_cost;
        for p in gates.row(i) {
            let wanted = i >= fixed || choice[i] == p.detection;
            if wanted && !(i == fixed && excluded.contains(&p.detection)) {
                work.push(Pair { ..*p });
            }
        }
        if (i < fixed && choice[i] != UNASSIGNED) || (i == fixed && excluded.contains(&UNASSIGNED)) {
            miss_cost = FORBIDDEN;
        }
        work.end_row(Prior { miss_cost, ..*gates.prior(i) });
    }
    let rows: Vec<u32> = (0..n as u32).collect();
    let mut found = vec![UNASSIGNED; n];
    solver.solve(work, &rows, &mut found);
    let mut cost = 0.0;
    for (i, j) in found.iter().enumerate() {
        cost += if *j == UNASSIGNED {
            work.prior(i).miss_cost
        } else {
            work.row(i).iter().find(|p| p.detection == *j).map_or(FORBIDDEN, |p| p.cost)
        };
    }
    (cost < 0.5 * FORBIDDEN).then_some(Ranked { cost, choice: found })
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn all(gates: &Gates, row: usize, used: u64, cost: f64, out: &mut Vec<f64>) {
        if row == gates.n_tracks() {
            out.push(cost);
            return;
        }
        all(gates, row + 1, used, cost + gates.prior(row).miss_cost, out);
        for p in gates.row(row) {
            if used & (1 << p.detection) == 0 {
                all(gates, row + 1, used | 1 << p.detection, cost + p.cost, out);
            }
        }
    }

    proptest! {
        #[test]
        fn the_ranking_is_that_of_all_assignments_sorted(
            rows in prop::collection::vec((0.0..10.0f64, prop::collection::btree_map(0u32..4, 0.0..10.0f64, 0..4)), 0..5),
            k in 1usize..30,
        ) {
            let mut gates = Gates::new();
            gates.reset(4, 1.0);
            for (miss_cost, pairs) in &rows {
                for (detection, cost) in pairs {
                    gates.push(Pair { detection: *detection, cost: *cost, log_likelihood: 0.0 });
                }
                gates.end_row(Prior { p_detection: 0.9, p_gate: 0.99, existence: 1.0, miss_cost: *miss_cost });
            }
            let mut brute = Vec::new();
            all(&gates, 0, 0, 0.0, &mut brute);
            brute.sort_by(f64::total_cmp);
            let ranked = k_best(&gates, k);
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
