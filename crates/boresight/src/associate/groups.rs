//! Connected groups of a table of costs: rows that share no column, even through others, are solved apart.
//!
//! Method: union-find over rows, linked through the first row that claimed each column; near-linear in the pairs.
//! Groups come in the order of their first row, rows within a group ascend: the answer does not depend on anything else.

use super::assignment::table::{CostTable, Entry};
use crate::union_find::{join, root};

/// No row yet.
const NONE: u32 = u32::MAX;

/// Finds connected groups; keeps its memory between tables.
#[derive(Clone, Debug, Default)]
pub struct Groups {
    parent: Vec<u32>,
    /// First row that may take each column.
    claimed_by: Vec<u32>,
    /// Where the next row of each root goes.
    ends: Vec<u32>,
    starts: Vec<u32>,
    rows: Vec<u32>,
}

impl Groups {
    /// Finds the groups of `table` among rows with at least one pair.
    pub fn find(&mut self, table: &impl CostTable) {
        let n = table.n_rows();
        self.parent.clear();
        self.parent.extend(0..n as u32);
        self.claimed_by.clear();
        self.claimed_by.resize(table.n_columns(), NONE);
        for i in 0..n {
            for pair in table.row(i) {
                let claim = &mut self.claimed_by[pair.column() as usize];
                if *claim == NONE {
                    *claim = i as u32;
                } else {
                    join(&mut self.parent, *claim, i as u32);
                }
            }
        }
        // Counting sort of the rows by root.
        self.ends.clear();
        self.ends.resize(n + 1, 0);
        for i in 0..n as u32 {
            if !table.row(i as usize).is_empty() {
                let r = root(&mut self.parent, i);
                self.ends[r as usize + 1] += 1;
            }
        }
        for i in 0..n {
            self.ends[i + 1] += self.ends[i];
        }
        self.starts.clear();
        self.starts.extend_from_slice(&self.ends);
        self.rows.clear();
        self.rows.resize(self.starts[n] as usize, 0);
        for i in 0..n as u32 {
            if !table.row(i as usize).is_empty() {
                let r = root(&mut self.parent, i) as usize;
                self.rows[self.ends[r] as usize] = i;
                self.ends[r] += 1;
            }
        }
    }

    /// The groups found, each the ascending list of its rows.
    pub fn iter(&self) -> impl Iterator<Item = &[u32]> {
        self.starts.windows(2).filter(|w| w[1] > w[0]).map(|w| &self.rows[w[0] as usize..w[1] as usize])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::associate::assignment::table::SparseTable;

    fn groups(rows: &[&[u32]]) -> Vec<Vec<u32>> {
        let mut table = SparseTable::default();
        table.reset(8);
        for row in rows {
            row.iter().for_each(|c| table.push(*c, 1.0));
            table.end_row(2.0);
        }
        let mut g = Groups::default();
        g.find(&table);
        g.iter().map(<[u32]>::to_vec).collect()
    }

    #[test]
    fn rows_that_share_columns_through_others_are_one_group_in_the_order_of_its_first_row() {
        assert_eq!(groups(&[&[0, 1], &[4], &[2], &[1, 2], &[], &[4, 5]]), [vec![0, 2, 3], vec![1, 5]]);
        assert_eq!(groups(&[&[3], &[2], &[1]]), [vec![0], vec![1], vec![2]]);
        assert!(groups(&[&[], &[]]).is_empty());
    }
}
