//! A sparse table of costs: what every sparse solver here reads.
//!
//! Row i may take one of its entries' columns, or none at the cost of a miss. Entries of a row ascend by column.

/// No column, or no row.
pub const UNASSIGNED: u32 = u32::MAX;

/// A cost that no true solution reaches: pairs and misses that must not be.
pub(super) const FORBIDDEN: f64 = 1e15;

/// A pair of a row with a column.
pub trait Entry {
    /// The column.
    fn column(&self) -> u32;
    /// What taking it costs.
    fn cost(&self) -> f64;
}

/// Costs of the pairs that are allowed, row by row.
pub trait CostTable {
    /// A pair.
    type Pair: Entry;
    /// Number of rows.
    fn n_rows(&self) -> usize;
    /// Number of columns.
    fn n_columns(&self) -> usize;
    /// The pairs of a row, columns ascending.
    fn row(&self, row: usize) -> &[Self::Pair];
    /// What leaving a row without a column costs.
    fn miss_cost(&self, row: usize) -> f64;
}

/// A column and its cost.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cell {
    /// The column.
    pub column: u32,
    /// What taking it costs.
    pub cost: f64,
}

impl Entry for Cell {
    #[inline]
    fn column(&self) -> u32 {
        self.column
    }
    #[inline]
    fn cost(&self) -> f64 {
        self.cost
    }
}

/// A compressed table of costs (CSR); built again for each problem, in the same memory.
#[derive(Clone, Debug, Default)]
pub struct SparseTable {
    n_columns: usize,
    ends: Vec<u32>,
    cells: Vec<Cell>,
    misses: Vec<f64>,
}

impl SparseTable {
    /// Empties the table.
    pub fn reset(&mut self, n_columns: usize) {
        self.n_columns = n_columns;
        self.ends.clear();
        self.cells.clear();
        self.misses.clear();
    }

    /// Adds a pair to the row under construction; columns ascend within a row.
    #[inline]
    pub fn push(&mut self, column: u32, cost: f64) {
        debug_assert!((column as usize) < self.n_columns);
        debug_assert!(self.open_row().last().is_none_or(|last| last.column < column), "columns ascend within a row");
        self.cells.push(Cell { column, cost });
    }

    /// The pairs of the row under construction.
    fn open_row(&self) -> &[Cell] {
        &self.cells[self.ends.last().map_or(0, |end| *end as usize)..]
    }

    /// Ends the row under construction.
    #[inline]
    pub fn end_row(&mut self, miss_cost: f64) {
        self.ends.push(self.cells.len() as u32);
        self.misses.push(miss_cost);
    }

    /// Place of a row's first pair among all pairs.
    pub fn start(&self, row: usize) -> usize {
        if row == 0 { 0 } else { self.ends[row - 1] as usize }
    }
}

impl CostTable for SparseTable {
    type Pair = Cell;
    fn n_rows(&self) -> usize {
        self.ends.len()
    }
    fn n_columns(&self) -> usize {
        self.n_columns
    }
    #[inline]
    fn row(&self, row: usize) -> &[Cell] {
        &self.cells[self.start(row)..self.ends[row] as usize]
    }
    #[inline]
    fn miss_cost(&self, row: usize) -> f64 {
        self.misses[row]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_hold_what_was_pushed_before_their_end_and_know_where_they_start() {
        let mut t = SparseTable::default();
        for _ in 0..2 {
            t.reset(4);
            t.push(1, 5.0);
            t.push(3, 2.0);
            t.end_row(9.0);
            t.end_row(8.0);
            t.push(0, 1.0);
            t.end_row(7.0);
            assert_eq!((t.n_rows(), t.n_columns()), (3, 4));
            assert_eq!((t.start(0), t.start(1), t.start(2)), (0, 2, 2));
            assert_eq!(t.row(0), [Cell { column: 1, cost: 5.0 }, Cell { column: 3, cost: 2.0 }]);
            assert!(t.row(1).is_empty() && t.row(2)[0].column == 0);
            assert_eq!([0, 1, 2].map(|i| t.miss_cost(i)), [9.0, 8.0, 7.0]);
        }
    }
}
