//! The highest values of a frame, place by place: which parts of a row a level can reach, and what a blob cannot exceed.
//!
//! Symbols: for dark targets all values are negated. Units: counts; cells of 8 x 8 px, words of 64 px.

use crate::Image;
use crate::vision::pixel::Pixel;

/// Side of a cell, px, and width of a word of bits.
const CELL: usize = 8;
const WORD: usize = 64;

/// The highest values of a frame; keeps its memory.
#[derive(Debug, Default)]
pub struct Highest {
    columns: usize,
    words: usize,
    of_cell: Vec<f32>,
    /// Of the eight cells of each word.
    of_word: Vec<f32>,
}

impl Highest {
    /// Reads a frame; `sign` is -1 for dark targets. What is not finite is left out.
    pub fn read<T: Pixel>(&mut self, image: &Image<T>, sign: f32) {
        self.columns = image.width().div_ceil(CELL);
        self.words = image.width().div_ceil(WORD);
        let rows = image.height().div_ceil(CELL);
        self.of_cell.clear();
        self.of_cell.resize(self.columns * rows, f32::NEG_INFINITY);
        self.of_word.clear();
        for (r, cells) in self.of_cell.chunks_exact_mut(self.columns.max(1)).enumerate() {
            for y in r * CELL..((r + 1) * CELL).min(image.height()) {
                let (whole, rest) = image.row(y).as_chunks::<CELL>();
                for (most, line) in cells.iter_mut().zip(whole) {
                    // Folded by halves, which is done in vectors.
                    let [a, b, c, d, e, f, g, h] = line.map(|p| finite(sign * p.value_f32()));
                    *most =
                        larger(*most, larger(larger(larger(a, e), larger(c, g)), larger(larger(b, f), larger(d, h))));
                }
                if let Some(most) = cells.get_mut(whole.len()) {
                    *most = rest.iter().fold(*most, |a, p| larger(a, finite(sign * p.value_f32())));
                }
            }
            let words = cells.chunks(WORD / CELL);
            self.of_word.extend(words.map(|cells| cells.iter().copied().fold(f32::NEG_INFINITY, larger)));
        }
    }

    /// The highest value of all; minus infinity if none is finite.
    pub fn most(&self) -> f32 {
        self.of_word.iter().copied().fold(f32::NEG_INFINITY, larger)
    }

    /// The words of image row `y` from the first to the last in which a pixel can be at or above `level`.
    pub fn reached(&self, y: usize, level: f32) -> std::ops::Range<usize> {
        let row = y / CELL * self.words..(y / CELL + 1) * self.words;
        let of_word = self.of_word.get(row).unwrap_or_default();
        let first = of_word.iter().position(|most| *most >= level).unwrap_or(of_word.len());
        let end = of_word.iter().rposition(|most| *most >= level).map_or(first, |last| last + 1);
        first..end
    }

    /// The highest value in the cells that a box touches; `[left, top, right, bottom]`, px.
    pub fn near(&self, [left, top, right, bottom]: [u32; 4]) -> f32 {
        let cell = |v: u32| v as usize / CELL;
        let columns = cell(left)..=cell(right);
        let rows = cell(top)..=cell(bottom);
        let cells = rows.flat_map(|r| &self.of_cell[r * self.columns..][columns.clone()]);
        cells.copied().fold(f32::NEG_INFINITY, larger)
    }
}

/// The larger one; the first if they cannot be compared.
#[inline(always)]
fn larger(a: f32, b: f32) -> f32 {
    if b > a { b } else { a }
}

/// The value, or minus infinity if it is not finite.
#[inline(always)]
fn finite(v: f32) -> f32 {
    if v < f32::INFINITY { v } else { f32::NEG_INFINITY }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_words_of_a_level_hold_all_its_pixels_and_no_blob_exceeds_what_is_near() {
        for (w, h) in [(200, 37), (64, 8), (5, 3)] {
            let pixels = (0..w * h).map(|i| (i * i % 9973) as u16).collect();
            let image = Image::from_vec(w, h, pixels).unwrap();
            for sign in [1.0, -1.0] {
                let mut highest = Highest::default();
                highest.read(&image, sign);
                let all = image.as_slice().iter().map(|p| sign * f32::from(*p));
                assert_eq!(highest.most(), all.fold(f32::NEG_INFINITY, f32::max));
                for y in 0..h {
                    let row = |x: usize| sign * f32::from(image.row(y)[x]);
                    for level in [sign * 5000.0, sign * 9000.0, sign * 40.0] {
                        let words = highest.reached(y, level);
                        assert!((0..w).all(|x| row(x) < level || words.contains(&(x / 64))), "{w} {y} {level}");
                    }
                    for x in 0..w {
                        let (px, py) = (x as u32, y as u32);
                        assert!(highest.near([px, py, px, py]) >= row(x));
                    }
                }
            }
        }
    }

    #[test]
    fn a_word_without_a_high_pixel_is_left_out_and_what_is_not_finite_counts_for_nothing() {
        let mut image = Image::filled(256, 24, 10.0f32);
        image.row_mut(12)[100] = 90.0;
        image.row_mut(12)[200] = f32::NAN;
        image.row_mut(12)[201] = f32::INFINITY;
        let mut highest = Highest::default();
        highest.read(&image, 1.0);
        assert_eq!(highest.reached(12, 80.0), 1..2);
        assert_eq!(highest.reached(12, 10.0), 0..4);
        assert!(highest.reached(12, 91.0).is_empty() && highest.reached(3, 80.0).is_empty());
        assert_eq!(highest.most(), 90.0);
        highest.read(&Image::filled(0, 0, 1u8), 1.0);
        assert!(highest.reached(0, 0.0).is_empty() && highest.most() == f32::NEG_INFINITY);
    }
}
