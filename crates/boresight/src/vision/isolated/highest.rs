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
        self.of_word.resize(self.words * rows, f32::NEG_INFINITY);
        for r in 0..rows {
            let cells = &mut self.of_cell[r * self.columns..][..self.columns];
            for y in r * CELL..((r + 1) * CELL).min(image.height()) {
                for (most, line) in cells.iter_mut().zip(image.row(y).chunks(CELL)) {
                    for p in line {
                        let v = sign * p.value_f32();
                        *most = if v > *most && v < f32::INFINITY { v } else { *most };
                    }
                }
            }
            let words = &mut self.of_word[r * self.words..][..self.words];
            for (word, cells) in words.iter_mut().zip(cells.chunks(WORD / CELL)) {
                *word = cells.iter().fold(f32::NEG_INFINITY, |a, &b| a.max(b));
            }
        }
    }

    /// The words of image row `y` in which a pixel can be at or above `level`.
    pub fn words(&self, y: usize, level: f32) -> impl Iterator<Item = usize> {
        let row = y / CELL * self.words..(y / CELL + 1) * self.words;
        let of_word = self.of_word.get(row).unwrap_or_default().iter().enumerate();
        of_word.filter(move |(_, most)| **most >= level).map(|(w, _)| w)
    }

    /// The highest value in the cells that a box touches; `[left, top, right, bottom]`, px.
    pub fn near(&self, [left, top, right, bottom]: [u32; 4]) -> f32 {
        let cell = |v: u32| v as usize / CELL;
        let columns = cell(left)..=cell(right);
        let rows = cell(top)..=cell(bottom);
        let cells = rows.flat_map(|r| &self.of_cell[r * self.columns..][columns.clone()]);
        cells.fold(f32::NEG_INFINITY, |a, &b| a.max(b))
    }
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
                for y in 0..h {
                    let row = |x: usize| sign * f32::from(image.row(y)[x]);
                    for level in [sign * 5000.0, sign * 9000.0, sign * 40.0] {
                        let words: Vec<usize> = highest.words(y, level).collect();
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
        let words = |y, level| highest.words(y, level).collect::<Vec<_>>();
        assert_eq!((words(12, 80.0), words(12, 91.0), words(3, 80.0)), (vec![1], vec![], vec![]));
        highest.read(&Image::filled(0, 0, 1u8), 1.0);
        assert_eq!(highest.words(0, 0.0).count(), 0);
    }
}
