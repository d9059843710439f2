//! Sparse assignment of every row, given as a compressed matrix (CSR): the shape other tools speak.
//!
//! Method: a column that only one row can use is that row's private end (a miss); the rest is the sparse problem of
//! [`super::super::global_nearest`], solved group by group.
//! Cost: near O(entries) on gating problems.

use super::super::global_nearest::{GlobalNearest, GlobalNearestConfig};
use super::super::{Assignment, Associator, Gates, Pair, Prior};
use super::sparse::{FORBIDDEN, UNASSIGNED};
use crate::{Error, ErrorKind, Result};

/// Solves compressed problems one after the other; keeps its memory.
#[derive(Clone, Debug)]
pub struct Csr {
    gates: Gates,
    answer: Assignment,
    solver: GlobalNearest,
    degree: Vec<u32>,
    private: Vec<u32>,
    columns: Vec<u32>,
}

impl Default for Csr {
    fn default() -> Self {
        Self {
            gates: Gates::new(),
            answer: Assignment::new(),
            solver: GlobalNearest::new(&GlobalNearestConfig::default()),
            degree: Vec::new(),
            private: Vec::new(),
            columns: Vec::new(),
        }
    }
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
        self.gates.reset(n_columns, 1.0);
        self.private.clear();
        for i in 0..n {
            let mut miss = (FORBIDDEN, UNASSIGNED);
            for k in starts[i] as usize..starts[i + 1] as usize {
                let (detection, cost) = (indices[k], costs[k]);
                if self.degree[detection as usize] > 1 {
                    self.gates.push(Pair { detection, cost, log_likelihood: 0.0 });
                } else if cost < miss.0 {
                    miss = (cost, detection);
                }
            }
            self.private.push(miss.1);
            self.gates.end_row(Prior { p_detection: 1.0, p_gate: 1.0, existence: 1.0, miss_cost: miss.0 });
        }
        self.solver.associate(&self.gates, &mut self.answer);
        self.columns.clear();
        for i in 0..n {
            let column = self.answer.row(i).first().map_or(self.private[i], |s| s.detection);
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
