//! One detection a place: of candidates nearer than 2.5 pixels of the coarser one's level the strongest stays.
//!
//! Each level has a grid with a cell a pixel; a kept candidate marks its cell on its own level and on all coarser ones, so the
//! question costs 21 cells a level, however many there are.

/// Set in a cell: a kept candidate of this level.
const OWN: u8 = 2;
/// Set in a cell: a kept candidate of this or a finer level.
const FINER: u8 = 1;
/// Square of the distance, cells: 2.5².
const REACH2: isize = 6;

/// The places kept so far; keeps its memory between frames.
#[derive(Clone, Debug, Default)]
pub(super) struct Places {
    sizes: Vec<(usize, usize)>,
    grids: Vec<Vec<u8>>,
    /// Cells set, to be cleared again.
    set: Vec<(u8, usize)>,
}

impl Places {
    /// Forgets all; the levels have these sizes.
    pub(super) fn clear(&mut self, sizes: impl Iterator<Item = (usize, usize)>) {
        for &(k, cell) in &self.set {
            self.grids[usize::from(k)][cell] = 0;
        }
        self.set.clear();
        let mut n = 0;
        for size in sizes {
            if self.sizes.len() == n {
                self.sizes.push((0, 0));
                self.grids.push(Vec::new());
            }
            if self.sizes[n] != size {
                self.sizes[n] = size;
                self.grids[n].clear();
                self.grids[n].resize(size.0 * size.1, 0);
            }
            n += 1;
        }
        self.sizes.truncate(n);
        self.grids.truncate(n);
    }

    /// Keeps a candidate at a pixel (x, y) of level `k` unless one nearby was kept; returns whether it is kept.
    pub(super) fn keep(&mut self, k: usize, x: u32, y: u32) -> bool {
        for q in k..self.grids.len() {
            let bits = if q == k { FINER } else { OWN };
            if self.near(q, (x >> (q - k)) as isize, (y >> (q - k)) as isize, bits) {
                return false;
            }
        }
        for q in k..self.grids.len() {
            let (w, h) = self.sizes[q];
            let cell = ((y >> (q - k)) as usize).min(h - 1) * w + ((x >> (q - k)) as usize).min(w - 1);
            self.grids[q][cell] |= if q == k { FINER | OWN } else { FINER };
            self.set.push((q as u8, cell));
        }
        true
    }

    fn near(&self, q: usize, x: isize, y: isize, bits: u8) -> bool {
        let (w, h) = self.sizes[q];
        for dy in -2isize..=2 {
            let row = y + dy;
            if row < 0 || row >= h as isize {
                continue;
            }
            for dx in -2isize..=2 {
                let column = x + dx;
                let inside = column >= 0 && column < w as isize && dx * dx + dy * dy <= REACH2;
                if inside && self.grids[q][row as usize * w + column as usize] & bits != 0 {
                    return true;
                }
            }
        }
        false
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_at_a_place_stays_and_the_coarser_level_sets_the_distance() {
        let mut places = Places::default();
        places.clear([(64, 64), (32, 32), (16, 16)].into_iter());
        assert!(places.keep(0, 10, 10));
        assert!(!places.keep(0, 12, 11) && places.keep(0, 14, 10));
        // A coarser candidate: 2.5 of its own pixels, 10 px.
        assert!(!places.keep(2, 4, 3) && places.keep(2, 10, 10));
        // A fine one near the coarse one.
        assert!(!places.keep(0, 44, 40) && places.keep(0, 60, 40));
        places.clear([(64, 64), (32, 32), (16, 16)].into_iter());
        assert!(places.keep(0, 12, 11));
    }
}
