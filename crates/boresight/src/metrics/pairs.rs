//! What truth track and result track have in common over a sequence: a table of the pairs that ever overlap.
//!
//! The official kits keep a dense matrix of truths × results (and HOTA one more for each of 19 thresholds); here a pair
//! has a place only if it ever overlaps. Places are numbered in the order of first meeting, so results do not depend on
//! hashing.

/// Numbers pairs (truth, result) in the order in which they are first seen.
#[derive(Clone, Debug)]
pub struct PairIndex {
    slots: Vec<u32>,
    keys: Vec<(u32, u32)>,
}

const EMPTY: u32 = u32::MAX;

impl Default for PairIndex {
    fn default() -> Self {
        Self { slots: vec![EMPTY; 1024], keys: Vec::new() }
    }
}

impl PairIndex {
    fn home(&self, truth: u32, result: u32) -> usize {
        // Fibonacci hashing: the upper bits of a product with 2⁶⁴/φ are well mixed.
        let key = (u64::from(truth) << 32 | u64::from(result)).wrapping_mul(0x9E37_79B9_7F4A_7C15);
        let key = (key ^ (key >> 29)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        (key >> 32) as usize & (self.slots.len() - 1)
    }

    /// The number of a pair; a new pair gets the next one.
    pub fn number(&mut self, truth: u32, result: u32) -> u32 {
        let mut at = self.home(truth, result);
        loop {
            match self.slots[at] {
                EMPTY => break,
                k if self.keys[k as usize] == (truth, result) => return k,
                _ => at = (at + 1) & (self.slots.len() - 1),
            }
        }
        let k = self.keys.len() as u32;
        self.keys.push((truth, result));
        self.slots[at] = k;
        if self.keys.len() * 4 > self.slots.len() * 3 {
            self.grow();
        }
        k
    }

    fn grow(&mut self) {
        self.slots = vec![EMPTY; self.slots.len() * 2];
        for k in 0..self.keys.len() {
            let (t, r) = self.keys[k];
            let mut at = self.home(t, r);
            while self.slots[at] != EMPTY {
                at = (at + 1) & (self.slots.len() - 1);
            }
            self.slots[at] = k as u32;
        }
    }

    /// The pairs by number.
    pub fn pairs(&self) -> &[(u32, u32)] {
        &self.keys
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pairs_keep_their_numbers_while_the_table_grows() {
        let mut index = PairIndex::default();
        for k in 0..5000_u32 {
            assert_eq!(index.number(k % 70, k / 70), k);
        }
        for k in 0..5000_u32 {
            assert_eq!(index.number(k % 70, k / 70), k);
        }
        assert_eq!(index.pairs()[71], (1, 1));
    }
}
