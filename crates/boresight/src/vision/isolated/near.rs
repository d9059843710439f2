//! Which boxes can overlap: a grid in which every box stands in each cell that it covers.
//!
//! Limits: a box of the longest side covers some tens of cells.

use super::blob::Blob;

/// Side of a cell as a power of two: 32 px, some small targets wide.
const SHIFT: u32 = 5;

/// The boxes of one frame by cell; keeps its memory.
#[derive(Debug, Default)]
pub struct Near {
    columns: usize,
    /// First entry of each cell, and one more.
    first: Vec<u32>,
    entries: Vec<u32>,
    found: Vec<u32>,
}

impl Near {
    /// Sorts boxes inside an image of that size, px, into cells.
    pub fn fill<'a>(&mut self, width: usize, height: usize, boxes: impl Iterator<Item = &'a Blob> + Clone) {
        self.columns = (width >> SHIFT) + 1;
        let n_cells = self.columns * ((height >> SHIFT) + 1);
        self.first.clear();
        self.first.resize(n_cells + 1, 0);
        let columns = self.columns;
        for b in boxes.clone() {
            cells(columns, b, |c| self.first[c + 1] += 1);
        }
        for c in 0..n_cells {
            self.first[c + 1] += self.first[c];
        }
        self.entries.clear();
        self.entries.resize(self.first[n_cells] as usize, 0);
        // `first[c]` runs to the end of its cell and is the beginning of the next one then.
        for (i, b) in boxes.enumerate() {
            cells(columns, b, |c| {
                self.entries[self.first[c] as usize] = i as u32;
                self.first[c] += 1;
            });
        }
        self.first.rotate_right(1);
        self.first[0] = 0;
    }

    /// The boxes that share a cell with `b`, in their order: all whose middle lies in it, or that hold its middle.
    pub fn of(&mut self, b: &Blob) -> &[u32] {
        self.found.clear();
        cells(self.columns, b, |c| {
            self.found.extend_from_slice(&self.entries[self.first[c] as usize..self.first[c + 1] as usize]);
        });
        self.found.sort_unstable();
        self.found.dedup();
        &self.found
    }
}

fn cells(columns: usize, b: &Blob, mut each: impl FnMut(usize)) {
    for row in b.top >> SHIFT..=b.bottom >> SHIFT {
        for column in b.left >> SHIFT..=b.right >> SHIFT {
            each(row as usize * columns + column as usize);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    #[test]
    fn no_box_that_overlaps_is_missed() {
        let mut rng = ChaCha8Rng::seed_from_u64(6);
        let boxes: Vec<Blob> = (0..400)
            .map(|i| {
                let (left, top) = (rng.random_range(0..120u32), rng.random_range(0..60u32));
                let (w, h) = if i % 9 == 0 { (29, 25) } else { (rng.random_range(0..5), rng.random_range(0..5)) };
                Blob::of_box([left, top, left + w, top + h])
            })
            .collect();
        let mut near = Near::default();
        near.fill(150, 90, boxes.iter());
        let mut pairs = 0;
        for a in &boxes {
            let found = near.of(a);
            assert!(found.is_sorted());
            for (i, b) in boxes.iter().enumerate() {
                if a.overlaps(b) {
                    pairs += 1;
                    assert!(found.binary_search(&(i as u32)).is_ok());
                }
            }
        }
        assert!(pairs > boxes.len(), "{pairs} pairs of {} boxes", boxes.len());
    }
}
