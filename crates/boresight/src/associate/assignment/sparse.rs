//! Sparse linear assignment with misses, by shortest augmenting paths with prices.
//!
//! Source: R. Jonker, A. Volgenant, "A shortest augmenting path algorithm for dense and sparse linear assignment
//! problems", Computing 38, 1987 (the augmentation phase); the miss of each row is a private column of its own.
//! Symbols: u row price, v column price, reduced cost c − u − v ≥ 0 (no unit).
//! Cost: for a group of r rows and p pairs O(r p log p) at worst, near O(p) on gating graphs.
//! Limits: past [`WORK_LIMIT`] relaxations a group is finished greedily (degenerate input only).

use super::table::{CostTable, Entry, UNASSIGNED};
use std::cmp::Ordering;
use std::collections::BinaryHeap;

/// Relaxations spent on one group before it is finished greedily.
pub const WORK_LIMIT: u64 = 1_000_000_000;

/// What a row does that could take a pair or miss at the same cost.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum AtEqualCost {
    /// It takes the pair: a detection at the gate's very edge is used.
    #[default]
    Pair,
    /// It misses: a pair that gains nothing is left out.
    Miss,
}

#[derive(Clone, Copy, Debug, PartialEq)]
struct Reached {
    distance: f64,
    column: u32,
}

impl Eq for Reached {}

impl Ord for Reached {
    fn cmp(&self, other: &Self) -> Ordering {
        // The heap is a max-heap: nearest first, lower column first among equals.
        other.distance.total_cmp(&self.distance).then(other.column.cmp(&self.column))
    }
}

impl PartialOrd for Reached {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

/// The state of one column.
#[derive(Clone, Copy, Debug)]
struct Column {
    price: f64,
    /// Shortest distance in this search.
    distance: f64,
    /// The row that holds it, or [`UNASSIGNED`].
    row: u32,
    /// The row it was reached from.
    from: u32,
    /// Search in which it was last reached.
    seen: u32,
    /// Search in which it was last settled.
    settled: u32,
}

const FRESH: Column = Column { price: 0.0, distance: 0.0, row: UNASSIGNED, from: UNASSIGNED, seen: 0, settled: 0 };

/// Solves groups one after the other; keeps its memory.
#[derive(Clone, Debug, Default)]
pub struct SparseSolver {
    columns: Vec<Column>,
    heap: BinaryHeap<Reached>,
    settled: Vec<u32>,
    search: u32,
    at_equal_cost: AtEqualCost,
}

impl SparseSolver {
    /// Builds a solver that treats pairs and misses of the same cost like this.
    pub fn new(at_equal_cost: AtEqualCost) -> Self {
        Self { at_equal_cost, ..Self::default() }
    }

    /// Solves the group of rows `group` and writes each row's column into `choice` (indexed by row).
    pub fn solve(&mut self, table: &impl CostTable, group: &[u32], choice: &mut [u32]) {
        self.solve_within(table, group, choice, WORK_LIMIT);
    }

    /// The same with a limit of its own.
    pub fn solve_within(&mut self, table: &impl CostTable, group: &[u32], choice: &mut [u32], work_limit: u64) {
        if self.columns.len() < table.n_columns() {
            self.columns.resize(table.n_columns(), FRESH);
        }
        for row in group {
            for p in table.row(*row as usize) {
                self.columns[p.column() as usize] = FRESH;
            }
            choice[*row as usize] = UNASSIGNED;
        }
        self.search = 0;
        let mut work = 0u64;
        for (done, row) in group.iter().enumerate() {
            if work > work_limit {
                self.finish_greedily(table, &group[done..], choice);
                return;
            }
            work += self.augment(table, *row, choice);
        }
    }

    /// The row that holds a column of the rows solved last, or [`UNASSIGNED`].
    pub fn row_of(&self, column: u32) -> u32 {
        self.columns[column as usize].row
    }

    /// What a column of the rows solved last is worth to those who want it: 0 where it is free, else above 0 or 0.
    pub fn value(&self, column: u32) -> f64 {
        -self.columns[column as usize].price
    }

    /// Brings one more row into the optimum; returns the work done.
    fn augment(&mut self, table: &impl CostTable, start: u32, choice: &mut [u32]) -> u64 {
        self.search += 1;
        self.heap.clear();
        self.settled.clear();
        let mut work = 0u64;
        let takes_ties = self.at_equal_cost == AtEqualCost::Pair;
        let mut row = start;
        let mut base = 0.0; // distance at which `row` was reached
        // The best end so far: a row that gives up its column for a miss.
        let mut end_row = start;
        let mut end_distance = f64::INFINITY;
        let mut end_column = UNASSIGNED;
        loop {
            // Rows need no stored price: on a tight tree the price of a matched row is its pair's cost minus the price.
            let price = self.row_price(table, row, choice);
            let miss = base + table.miss_cost(row as usize) - price;
            if miss < end_distance {
                end_distance = miss;
                end_row = row;
            }
            for p in table.row(row as usize) {
                work += 1;
                let c = &mut self.columns[p.column() as usize];
                if c.settled == self.search {
                    continue;
                }
                let d = base + p.cost() - price - c.price;
                if (d < end_distance || (takes_ties && d == end_distance)) && (c.seen != self.search || d < c.distance)
                {
                    c.distance = d;
                    c.from = row;
                    c.seen = self.search;
                    self.heap.push(Reached { distance: d, column: p.column() });
                }
            }
            let next = loop {
                match self.heap.pop() {
                    None => break None,
                    Some(r) => {
                        let c = &self.columns[r.column as usize];
                        if c.settled != self.search && r.distance == c.distance {
                            break Some(r);
                        }
                    }
                }
            };
            let Some(r) = next else { break };
            if r.distance > end_distance || (!takes_ties && r.distance == end_distance) {
                break;
            }
            let c = &mut self.columns[r.column as usize];
            if c.row == UNASSIGNED {
                end_distance = r.distance;
                end_column = r.column;
                break;
            }
            c.settled = self.search;
            self.settled.push(r.column);
            row = c.row;
            base = r.distance;
        }
        // Prices: settled columns become cheaper by what the path's end lay beyond them.
        for column in &self.settled {
            let c = &mut self.columns[*column as usize];
            c.price -= end_distance - c.distance;
        }
        let mut column = end_column;
        if column == UNASSIGNED {
            if end_row == start {
                choice[start as usize] = UNASSIGNED;
                return work;
            }
            column = choice[end_row as usize];
            choice[end_row as usize] = UNASSIGNED;
        }
        loop {
            let from = self.columns[column as usize].from;
            let before = choice[from as usize];
            self.columns[column as usize].row = from;
            choice[from as usize] = column;
            if from == start {
                return work;
            }
            column = before;
        }
    }

    /// The row's price: its matched pair is tight; the starting row counts from zero.
    fn row_price(&self, table: &impl CostTable, row: u32, choice: &[u32]) -> f64 {
        let column = choice[row as usize];
        if column == UNASSIGNED {
            return 0.0;
        }
        let pairs = table.row(row as usize);
        let at = pairs.partition_point(|p| p.column() < column);
        pairs.get(at).map_or(0.0, Entry::cost) - self.columns[column as usize].price
    }

    fn finish_greedily(&mut self, table: &impl CostTable, rest: &[u32], choice: &mut [u32]) {
        for row in rest {
            let mut best = (table.miss_cost(*row as usize), UNASSIGNED);
            for p in table.row(*row as usize) {
                if self.columns[p.column() as usize].row == UNASSIGNED && p.cost() <= best.0 {
                    best = (p.cost(), p.column());
                }
            }
            choice[*row as usize] = best.1;
            if best.1 != UNASSIGNED {
                self.columns[best.1 as usize].row = *row;
            }
        }
    }
}
