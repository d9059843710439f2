//! Sparse assignment of every row, given as a compressed matrix (CSR): the shape other tools speak.
//!
//! Method: a column that only one row can use is that row's private end (a miss); the rest is solved group
//! by group ([`super::group_wise`]).
//! Cost: near O(entries) on gating problems.

use super::group_wise::GroupWise;
use super::table::{FORBIDDEN, SparseTable, UNASSIGNED};
use crate::{Error, ErrorKind, Result};

/// Solves compressed problems one after the other; keeps its memory.
#[derive(Clone, Debug, Default)]
pub struct Csr {
    table: SparseTable,
    solver: GroupWise,
    degree: Vec<u32>,
    private: Vec<u32>,
    columns: Vec<u32>,
}

impl Csr {
    /// Returns the column of each row with the least total cost. Row i holds `indices[k]`, `costs[k]` for k in
    /// `starts[i]..starts[i + 1]`, columns ascending.
    /// # Errors
    /// Tables that do not fit together; a row that cannot be assigned.
    pub fn solve(&mut self, n_columns: usize, starts: &[u32], indices: &[u32], costs: &[f64]) -> Result<&[u32]> {
        let n = starts.len().saturating_sub(1);
        let sound = starts.windows(2).all(|w| w[0] <= w[1])
            && starts.last().is_none_or(|s| *s as usize == indices.len())
            && indices.len() == costs.len()
            && indices.iter().all(|j| (*j as usize) < n_columns);
        if !sound {
            return Err(Error::new(ErrorKind::Config, "starts, indices and costs do not make a sparse matrix"));
        }
        self.degree.clear();
        self.degree.resize(n_columns, 0);
        for j in indices {
            self.degree[*j as usize] += 1;
        }
        self.table.reset(n_columns);
        self.private.clear();
        for i in 0..n {
            let mut miss = (FORBIDDEN, UNASSIGNED);
            for k in starts[i] as usize..starts[i + 1] as usize {
                let (column, cost) = (indices[k], costs[k]);
                if self.degree[column as usize] > 1 {
                    self.table.push(column, cost);
                } else if cost < miss.0 {
                    miss = (cost, column);
                }
            }
            self.private.push(miss.1);
            self.table.end_row(miss.0);
        }
        self.columns.clear();
        for (i, &chosen) in self.solver.solve(&self.table).iter().enumerate() {
            let column = if chosen == UNASSIGNED { self.private[i] } else { chosen };
            if column == UNASSIGNED {
                return Err(Error::new(
                    ErrorKind::Numeric,
                    format!("row {i} cannot be assigned: all its columns are taken"),
                ));
            }
            self.columns.push(column);
        }
        Ok(&self.columns)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_row_gets_a_column_at_the_least_total() {
        // Costs 4 1 .; 2 . 3; . 5 6 on columns 0 to 2, column 3 only row 2 may use, for 9: 1 + 2 + 6 = 9 beats 1 + 2 + 9.
        let (starts, columns) = ([0, 2, 4, 7], [0, 1, 0, 2, 1, 2, 3]);
        let costs = [4.0, 1.0, 2.0, 3.0, 5.0, 6.0, 9.0];
        assert_eq!(Csr::default().solve(4, &starts, &columns, &costs).unwrap(), [1, 0, 2]);
        // At 5 the private column is the better end.
        let costs = [4.0, 1.0, 2.0, 3.0, 5.0, 6.0, 5.0];
        assert_eq!(Csr::default().solve(4, &starts, &columns, &costs).unwrap(), [1, 0, 3]);
    }

    #[test]
    fn rows_that_cannot_all_be_served_and_broken_tables_are_refused() {
        let refused = |n, starts: &[u32], columns: &[u32], costs: &[f64]| {
            Csr::default().solve(n, starts, columns, costs).unwrap_err().to_string()
        };
        assert!(refused(1, &[0, 1, 2], &[0, 0], &[1.0, 2.0]).contains("row 1 cannot be assigned"));
        assert!(refused(1, &[0, 0], &[], &[]).contains("row 0 cannot be assigned"));
        for (n, starts, columns, costs) in [
            (2, &[0, 2][..], &[0][..], &[1.0][..]),
            (1, &[0, 1][..], &[1][..], &[1.0][..]),
            (2, &[0, 1][..], &[0][..], &[1.0, 2.0][..]),
            (2, &[0, 2, 1][..], &[0, 1][..], &[1.0, 2.0][..]),
        ] {
            assert!(refused(n, starts, columns, costs).contains("do not make a sparse matrix"));
        }
        assert!(Csr::default().solve(3, &[], &[], &[]).unwrap().is_empty());
    }
}
