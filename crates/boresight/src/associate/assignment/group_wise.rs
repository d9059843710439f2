//! The assignment of least cost of a sparse table, group by group.
//!
//! Method: connected groups are solved apart; one row, and two rows that want the same column, in closed form, the rest
//! by shortest augmenting paths ([`super::sparse`]).
//! Limits: a group so dense that its exact solution would need more than about 10⁹ steps (10⁵ columns that all rows may
//! take) is finished greedily.

use super::sparse::SparseSolver;
use super::table::{CostTable, Entry, UNASSIGNED};
use crate::associate::groups::Groups;

/// Solves tables one after the other; keeps its memory.
#[derive(Clone, Debug, Default)]
pub struct GroupWise {
    groups: Groups,
    solver: SparseSolver,
    choice: Vec<u32>,
}

impl GroupWise {
    /// Returns the column of each row, or [`UNASSIGNED`], so that the total cost with misses is least.
    pub fn solve(&mut self, table: &impl CostTable) -> &[u32] {
        self.choice.clear();
        self.choice.resize(table.n_rows(), UNASSIGNED);
        self.groups.find(table);
        for group in self.groups.iter() {
            match *group {
                [a] => self.choice[a as usize] = best_two(table, a)[0].0,
                [a, b] => {
                    let (ca, cb) = two_rows(table, a, b);
                    self.choice[a as usize] = ca;
                    self.choice[b as usize] = cb;
                }
                _ => self.solver.solve(table, group, &mut self.choice),
            }
        }
        &self.choice
    }
}

/// The two cheapest ends of a row, a miss among them.
#[inline]
fn best_two(table: &impl CostTable, row: u32) -> [(u32, f64); 2] {
    let mut best = [(UNASSIGNED, table.miss_cost(row as usize)), (UNASSIGNED, f64::INFINITY)];
    for p in table.row(row as usize) {
        // `<=` only against a miss: a pair at the very edge of the gate is taken, ties between pairs go to the first.
        if p.cost() < best[0].1 || (p.cost() == best[0].1 && best[0].0 == UNASSIGNED) {
            best[1] = best[0];
            best[0] = (p.column(), p.cost());
        } else if p.cost() < best[1].1 {
            best[1] = (p.column(), p.cost());
        }
    }
    best
}

/// Two rows in closed form: if both want the same column, the cheaper of the two ways to give in.
#[inline]
fn two_rows(table: &impl CostTable, a: u32, b: u32) -> (u32, u32) {
    let (best_a, best_b) = (best_two(table, a), best_two(table, b));
    if best_a[0].0 == UNASSIGNED || best_a[0].0 != best_b[0].0 {
        return (best_a[0].0, best_b[0].0);
    }
    if best_a[0].1 + best_b[1].1 <= best_a[1].1 + best_b[0].1 {
        (best_a[0].0, best_b[1].0)
    } else {
        (best_a[1].0, best_b[0].0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::associate::assignment::sparse::AtEqualCost;
    use crate::associate::assignment::table::SparseTable;
    use proptest::prelude::*;

    type Rows = Vec<(f64, Vec<(u32, f64)>)>;

    fn table(rows: &Rows) -> SparseTable {
        let mut t = SparseTable::default();
        t.reset(5);
        for (miss, pairs) in rows {
            pairs.iter().for_each(|(c, cost)| t.push(*c, *cost));
            t.end_row(*miss);
        }
        t
    }

    fn cost(t: &SparseTable, choice: &[u32]) -> f64 {
        let of = |(i, c): (usize, &u32)| t.row(i).iter().find(|p| p.column == *c).map_or(t.miss_cost(i), |p| p.cost);
        choice.iter().enumerate().map(of).sum()
    }

    fn least(t: &SparseTable, row: usize, used: u32) -> f64 {
        if row == t.n_rows() {
            return 0.0;
        }
        let taken = t.row(row).iter().filter(|p| used & 1 << p.column == 0);
        let best = taken.map(|p| p.cost + least(t, row + 1, used | 1 << p.column)).fold(f64::INFINITY, f64::min);
        best.min(t.miss_cost(row) + least(t, row + 1, used))
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(500))]
        #[test]
        fn the_total_is_the_least_of_all_and_no_column_is_used_twice(
            rows in prop::collection::vec((0u8..12, prop::collection::btree_map(0u32..5, 0u8..12, 0..5)), 0..7),
        ) {
            // Few different costs: ties everywhere.
            let rows: Rows = rows
                .into_iter()
                .map(|(miss, pairs)| (f64::from(miss), pairs.into_iter().map(|(c, v)| (c, f64::from(v))).collect()))
                .collect();
            let t = table(&rows);
            let best = least(&t, 0, 0);
            let by_group = GroupWise::default().solve(&t).to_vec();
            prop_assert_eq!(cost(&t, &by_group), best);
            let order: Vec<u32> = (0..rows.len() as u32).collect();
            for rule in [AtEqualCost::Pair, AtEqualCost::Miss] {
                let mut choice = vec![0; rows.len()];
                SparseSolver::new(rule).solve(&t, &order, &mut choice);
                prop_assert_eq!(cost(&t, &choice), best);
                let mut columns: Vec<u32> = choice.iter().copied().filter(|c| *c != UNASSIGNED).collect();
                columns.sort_unstable();
                prop_assert!(columns.windows(2).all(|w| w[0] < w[1]));
            }
        }
    }

    #[test]
    fn at_equal_cost_the_tracker_takes_the_pair_and_the_measures_the_miss() {
        let t = table(&vec![(4.0, vec![(0, 4.0)])]);
        assert_eq!(GroupWise::default().solve(&t), [0]);
        let solve = |rule| {
            let mut choice = [0];
            SparseSolver::new(rule).solve(&t, &[0], &mut choice);
            choice[0]
        };
        assert_eq!((solve(AtEqualCost::Pair), solve(AtEqualCost::Miss)), (0, UNASSIGNED));
    }

    #[test]
    fn two_rows_that_want_one_column_give_way_where_it_costs_least() {
        // Row 0 loses 1 by column 1, row 1 loses 3: row 0 gives way; with equal losses the first keeps it.
        assert_eq!(
            GroupWise::default().solve(&table(&vec![(9.0, vec![(0, 1.0), (1, 2.0)]), (9.0, vec![(0, 1.0), (1, 4.0)])])),
            [1, 0]
        );
        assert_eq!(
            GroupWise::default().solve(&table(&vec![(3.0, vec![(0, 1.0)]), (3.0, vec![(0, 1.0)])])),
            [0, UNASSIGNED]
        );
    }

    #[test]
    fn past_its_limit_a_group_is_finished_greedily() {
        // Greedy: row 0 first by the exact search, then each row its best open column.
        let t = table(&vec![
            (9.0, vec![(0, 1.0), (1, 2.0)]),
            (9.0, vec![(0, 1.0), (1, 8.0)]),
            (2.0, vec![(0, 1.0), (2, 2.0)]),
        ]);
        let mut choice = [UNASSIGNED; 3];
        SparseSolver::default().solve_within(&t, &[0, 1, 2], &mut choice, 0);
        assert_eq!(choice, [0, 1, 2]);
        SparseSolver::default().solve(&t, &[0, 1, 2], &mut choice);
        assert_eq!(choice, [1, 0, 2]);
    }
}
