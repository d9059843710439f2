//! Connected groups of a gating table: tracks that share no detection, even through others, are solved apart.
//!
//! Method: union-find over rows, linked through the first row that claimed each detection; near-linear in the pairs.
//! Groups come in the order of their first row, rows within a group ascend: the answer does not depend on anything else.

use super::Gates;
use crate::union_find::{join, root};

/// No row yet.
const NONE: u32 = u32::MAX;

/// Finds connected groups; keeps its memory between scans.
#[derive(Clone, Debug, Default)]
pub struct Groups {
    parent: Vec<u32>,
    /// First row that gates each detection.
    claimed_by: Vec<u32>,
    /// Where the next row of each root goes.
    ends: Vec<u32>,
    starts: Vec<u32>,
    rows: Vec<u32>,
}

impl Groups {
    /// Finds the groups of `gates` among rows with at least one pair.
    pub fn find(&mut self, gates: &Gates) {
        let n = gates.n_tracks();
        self.parent.clear();
        self.parent.extend(0..n as u32);
        self.claimed_by.clear();
        self.claimed_by.resize(gates.n_detections(), NONE);
        for i in 0..n {
            for pair in gates.row(i) {
                let claim = &mut self.claimed_by[pair.detection as usize];
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
            if !gates.row(i as usize).is_empty() {
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
            if !gates.row(i as usize).is_empty() {
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
