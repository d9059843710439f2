//! What lies outside an image: border rules and a ring of padded rows for filters that walk down an image.
//!
//! Source: `docs/theory/image.md`. `zero`: 0 outside; `replicate`: the nearest edge pixel; `reflect`: mirrored with the
//! edge pixel repeated (d c b a | a b c d | d c b a), as often as the window needs.
//! Symbols: r radius of the window, px; n = 2r + 1. Limits: any image size from 1x1 on, any radius. No allocation once
//! the ring has seen an image of the size.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// What a filter sees outside the image.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Border {
    /// Zeros: darkens the border of a bright image (MATLAB's `conv2` and `medfilt2`).
    Zero,
    /// The nearest pixel of the image.
    #[default]
    Replicate,
    /// The image mirrored, edge pixel repeated.
    Reflect,
}

impl Border {
    /// Maps a row or column number that may lie outside `0..len` to the pixel it stands for; `None` means zero.
    pub fn index(self, i: isize, len: usize) -> Option<usize> {
        let n = len as isize;
        if n == 0 {
            return None;
        }
        if (0..n).contains(&i) {
            return Some(i as usize);
        }
        match self {
            Self::Zero => None,
            Self::Replicate => Some(i.clamp(0, n - 1) as usize),
            Self::Reflect => {
                let k = i.rem_euclid(2 * n);
                Some(if k < n { k } else { 2 * n - 1 - k } as usize)
            }
        }
    }

    /// Fills the `r` values left and right of `row[r..r + width]`.
    pub(super) fn pad<V: Copy>(self, row: &mut [V], r: usize, width: usize, zero: V) {
        for i in 0..r {
            row[i] = self.index(i as isize - r as isize, width).map_or(zero, |x| row[r + x]);
            row[r + width + i] = self.index((width + i) as isize, width).map_or(zero, |x| row[r + x]);
        }
    }
}

/// The rows that a window of radius `r` needs, padded left and right, in the keys `K` a filter calculates with.
#[derive(Clone, Debug, Default)]
pub(super) struct RowRing<K> {
    radius: usize,
    width: usize,
    height: usize,
    border: Border,
    /// Rows kept: `min(height, 2r + 1)`; one more slot holds the zero row.
    n_slots: usize,
    stride: usize,
    /// Rows read so far.
    n_read: usize,
    keys: Vec<K>,
}

impl<K: Copy> RowRing<K> {
    /// Starts a new image; `zero` is the key of the pixel value 0.
    pub(super) fn begin(&mut self, width: usize, height: usize, radius: usize, border: Border, zero: K) {
        self.n_slots = height.min(2 * radius + 1);
        self.stride = width + 2 * radius;
        (self.width, self.height, self.radius, self.border) = (width, height, radius, border);
        self.n_read = 0;
        self.keys.clear();
        self.keys.resize(self.stride * (self.n_slots + 1), zero);
    }

    /// Width of a padded row, `width + 2r`.
    pub(super) fn stride(&self) -> usize {
        self.stride
    }

    pub(super) fn border(&self) -> Border {
        self.border
    }

    pub(super) fn radius(&self) -> usize {
        self.radius
    }

    /// Reads the rows that a window centred on row `y` still lacks; `fill` writes the `width` keys of a row.
    pub(super) fn read(&mut self, y: usize, mut fill: impl FnMut(usize, &mut [K])) {
        let (w, r) = (self.width, self.radius);
        while self.n_read < self.height && self.n_read <= y + r {
            let at = (self.n_read % self.n_slots) * self.stride;
            // The zero row lies behind the slots and gives the key of 0.
            let zero = self.keys.last().copied();
            let row = &mut self.keys[at..at + self.stride];
            fill(self.n_read, &mut row[r..r + w]);
            if let Some(zero) = zero {
                self.border.pad(row, r, w, zero);
            }
            self.n_read += 1;
        }
    }

    /// The padded row that row `y` (also outside the image) stands for; column `x` of the image is at `x + r`.
    pub(super) fn row(&self, y: isize) -> &[K] {
        let slot = self.border.index(y, self.height).map_or(self.n_slots, |i| i % self.n_slots);
        &self.keys[slot * self.stride..(slot + 1) * self.stride]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn borders_continue_the_row_as_their_names_say() {
        let row = *b"abcd";
        let see = |border: Border, from: isize, to: isize| -> String {
            (from..to).map(|i| border.index(i, 4).map_or('0', |x| row[x] as char)).collect()
        };
        assert_eq!(see(Border::Zero, -2, 6), "00abcd00");
        assert_eq!(see(Border::Replicate, -2, 6), "aaabcddd");
        assert_eq!(see(Border::Reflect, -6, 10), "cddcbaabcddcbaab");
        assert_eq!(Border::Reflect.index(-7, 1), Some(0));
        assert_eq!(Border::Replicate.index(3, 0), None);
    }
}
