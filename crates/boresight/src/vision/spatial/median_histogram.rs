//! Median of a large window of 8-bit pixels from column histograms: a cost that does not grow with the window.
//!
//! Source: S. Perreault, P. Hebert, "Median Filtering in Constant Time", IEEE Trans. Image Processing 16(9), 2007: one
//! histogram a column, moved down by one pixel in and one out; the window's histogram adds the column that enters and
//! takes off the one that leaves; two levels (16 coarse bins of 16 fine ones), the fine bins brought up to date only
//! where the median lies. Limits: n <= 255, so that a column's count fits 8 bits and the window's 16.

use super::pixel::Key;

/// Histograms of all padded columns.
#[derive(Clone, Debug, Default)]
pub(super) struct Histograms {
    /// `[column][coarse bin]`.
    coarse: Vec<[u8; 16]>,
    /// `[coarse bin][column][fine bin]`: neighbours of one coarse bin lie together.
    fine: Vec<[u8; 16]>,
}

fn level<K: Key>(key: K) -> usize {
    key.level()
}

impl Histograms {
    /// Clears the histograms for padded rows of `stride` pixels.
    pub(super) fn begin(&mut self, stride: usize) {
        self.coarse.clear();
        self.coarse.resize(stride, [0; 16]);
        self.fine.clear();
        self.fine.resize(16 * stride, [0; 16]);
    }

    /// Adds a padded row to the columns.
    pub(super) fn add<K: Key>(&mut self, row: &[K]) {
        self.update(row, 1);
    }

    /// Takes a padded row off the columns.
    pub(super) fn remove<K: Key>(&mut self, row: &[K]) {
        self.update(row, 255);
    }

    fn update<K: Key>(&mut self, row: &[K], by: u8) {
        let stride = self.coarse.len();
        for (x, (&key, coarse)) in row.iter().zip(&mut self.coarse).enumerate() {
            let v = level(key) & 255;
            coarse[v >> 4] = coarse[v >> 4].wrapping_add(by);
            let fine = &mut self.fine[(v >> 4) * stride + x][v & 15];
            *fine = fine.wrapping_add(by);
        }
    }

    /// Writes the medians of one row of windows, each `n` columns wide.
    pub(super) fn row<K: Key>(&self, n: usize, out: &mut [K]) {
        medians(&self.coarse, &self.fine, n, out);
    }
}

widest! {
    fn medians<K: Key>(columns: &[[u8; 16]], fine_columns: &[[u8; 16]], n: usize, out: &mut [K]) {
        let stride = columns.len();
        let half = (n * n / 2) as u16;
        let mut coarse = [0u16; 16];
        let mut fine = [[0u16; 16]; 16];
        // fine[c] covers the columns ahead[c] - n .. ahead[c].
        let mut ahead = [0usize; 16];
        for column in &columns[..n - 1] {
            add(&mut coarse, column);
        }
        for (x, o) in out.iter_mut().enumerate() {
            add(&mut coarse, &columns[x + n - 1]);
            let (c, before) = bin(&coarse, half);
            let part = &fine_columns[c * stride..(c + 1) * stride];
            let (sum, done) = (&mut fine[c], &mut ahead[c]);
            if *done <= x {
                // Nothing of the old window is left.
                *sum = [0; 16];
                *done = x;
            } else {
                for column in &part[*done - n.min(*done)..x] {
                    subtract(sum, column);
                }
            }
            for column in &part[*done..x + n] {
                add(sum, column);
            }
            *done = x + n;
            let (f, _) = bin(sum, half - before);
            *o = K::from_level(c * 16 + f);
            subtract(&mut coarse, &columns[x]);
        }
    }
}

#[inline(always)]
fn add(sum: &mut [u16; 16], column: &[u8; 16]) {
    for (s, &c) in sum.iter_mut().zip(column) {
        *s = s.wrapping_add(u16::from(c));
    }
}

#[inline(always)]
fn subtract(sum: &mut [u16; 16], column: &[u8; 16]) {
    for (s, &c) in sum.iter_mut().zip(column) {
        *s = s.wrapping_sub(u16::from(c));
    }
}

/// The bin that holds rank `rank` (from 0) and the count below it.
#[inline(always)]
fn bin(counts: &[u16; 16], rank: u16) -> (usize, u16) {
    let mut below = 0u16;
    for (i, &c) in counts.iter().enumerate() {
        let next = below.wrapping_add(c);
        if next > rank {
            return (i, below);
        }
        below = next;
    }
    (15, below)
}
