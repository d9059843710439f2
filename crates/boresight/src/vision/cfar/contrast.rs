//! Directional contrast: how far a pixel stands out of the best of four opposite pairs around it; its extremes and its noise.
//!
//! v = b(p) - max over d of [b(p + d) + b(p - d)] / 2 where that is positive (bright), b(p) - min over d where that is negative
//! (dark), else 0, d = (3, 0), (0, 3), (2, 2), (2, -2) pixels of the level, b the level smoothed by [1 2 1]/4 in both directions. A plane, a
//! straight edge and a line along a pair have v = 0, and the sides of a target have no contrast of the other sign. An extreme is a
//! pixel whose |v| no neighbour exceeds (of equals the first in raster order). The noise of a block of 8 x 8 pixels is the mean
//! |b(p) - mean of all pairs| times √(π/2). The rows that the pairs reach are held smoothed, so a level is read once.
//! Related: the patch contrasts of Y. Wei et al., *Multiscale patch-based contrast measure*, Pattern Recognition 58, 216 (2016).
//! Limits: extremes weaker than 1.2 times the quietest block above them are counted but not listed: their z is below 3.

use super::lane::{HELD, Lane, Rows};
use super::pyramid::{View, mirror};
use crate::vision::pixel::Pixel;
use fearless_simd::prelude::*;
use fearless_simd::{Level as Cpu, dispatch};

/// Side of a block, pixels of the level.
pub(super) const BLOCK: usize = 8;
/// √(π/2): the deviation of normal noise in units of its mean absolute value.
const SD_PER_MEAN_ABS: f32 = 1.253_314_1;
/// Extremes below so many times the quietest block are not listed.
const LISTED: f32 = 1.2;
/// Reach of the pairs, pixels, by which rows are mirrored at each side.
const REACH: usize = 3;

/// An extreme of the contrast.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Extreme {
    pub(super) x: u32,
    pub(super) y: u32,
    /// Contrast, counts; negative for a dark one.
    pub(super) v: f32,
}

/// The extremes and the noise of one level; keeps its memory between frames.
#[derive(Clone, Debug, Default)]
pub(super) struct Contrast {
    pub(super) extremes: Vec<Extreme>,
    /// Number of all extremes, bright and dark, listed or not.
    pub(super) n_bright: usize,
    pub(super) n_dark: usize,
    /// Blocks in a row and in a column; the last ones are up to 15 pixels wide.
    pub(super) nx: usize,
    pub(super) ny: usize,
    /// Noise of each block, counts.
    pub(super) blocks: Vec<f32>,
    rows: (Rows<i16>, Rows<f32>),
}

impl Contrast {
    /// Finds the extremes and the noise of a level.
    pub(super) fn run<P: Pixel>(&mut self, level: View<'_, P>) {
        let mut rows = std::mem::take(P::Lane::rows(&mut self.rows));
        rows.resize(level.width);
        dispatch!(Cpu::new(), simd => self.run_vectors(simd, level, &mut rows));
        *P::Lane::rows(&mut self.rows) = rows;
    }

    #[inline(always)]
    fn run_vectors<S: Simd, P: Pixel>(&mut self, simd: S, level: View<'_, P>, rows: &mut Rows<P::Lane>) {
        let (w, h) = (level.width, level.height);
        (self.nx, self.ny) = ((w / BLOCK).max(1), (h / BLOCK).max(1));
        (self.n_bright, self.n_dark) = (0, 0);
        self.extremes.clear();
        self.blocks.clear();
        let (mut quietest, mut in_block, mut smoothed) = (f32::INFINITY, 0, 0);
        for y in 0..=h {
            rows.strong.rotate_left(1);
            if y < h {
                while smoothed < h.min(y + REACH + 1) {
                    rows.smooth(level, smoothed);
                    smoothed += 1;
                }
                rows.contrast(y, w, h);
                in_block += 1;
                let block_ends = (y + 1) % BLOCK == 0 && self.blocks.len() / self.nx + 1 < self.ny || y + 1 == h;
                if block_ends {
                    let low = self.end_blocks(rows, w, in_block);
                    quietest = quietest.min(low);
                    in_block = 0;
                }
            } else {
                rows.strong[2].fill(P::Lane::default());
            }
            if y > 0 {
                let least = if quietest.is_finite() { LISTED * quietest } else { 0.0 };
                self.extremes_of_row(simd, rows, y - 1, w, least);
            }
        }
    }

    /// Ends a row of blocks of so many rows; returns the quietest of them.
    #[inline(always)]
    fn end_blocks<L: Lane>(&mut self, rows: &mut Rows<L>, w: usize, n_rows: usize) -> f32 {
        let mut low = f32::INFINITY;
        for i in 0..self.nx {
            let end = if i + 1 == self.nx { w } else { (i + 1) * BLOCK };
            let part = &rows.sums[i * BLOCK..end];
            // Eight times the deviation from the pairs' mean was added.
            let sum = part.iter().map(|s| L::sum(*s)).sum::<f32>() * (0.125 * L::COUNTS);
            let mean = sum / (part.len() * n_rows) as f32;
            low = low.min(mean * SD_PER_MEAN_ABS);
            self.blocks.push(mean * SD_PER_MEAN_ABS);
        }
        rows.sums.fill(L::Sum::default());
        low
    }

    #[inline(always)]
    fn extremes_of_row<S: Simd, L: Lane>(&mut self, simd: S, rows: &Rows<L>, y: usize, w: usize, least: f32) {
        let [above, here, below] = &rows.strong;
        let signed = &rows.signed[y % 2];
        let least = L::at_least(least * (2.0 / L::COUNTS));
        for i in 0..w.div_ceil(64) {
            let from = 64 * i;
            let (all, strong, bright) = L::extremes(simd, [above, here, below], signed, from, least);
            // Beyond the width all strengths are 0, and 0 is no extreme.
            self.n_bright += (all & bright).count_ones() as usize;
            self.n_dark += (all & !bright).count_ones() as usize;
            let mut listed = all & strong;
            while listed != 0 {
                let x = from + listed.trailing_zeros() as usize;
                listed &= listed - 1;
                let v = 0.5 * L::COUNTS * signed[x].number();
                self.extremes.push(Extreme { x: x as u32, y: y as u32, v });
            }
        }
    }
}

#[inline(always)]
fn greater<L: Lane>(a: L, b: L) -> L {
    if a > b { a } else { b }
}

#[inline(always)]
fn lesser<L: Lane>(a: L, b: L) -> L {
    if a < b { a } else { b }
}

impl<L: Lane> Rows<L> {
    fn resize(&mut self, w: usize) {
        let zero = L::default();
        for row in &mut self.strong {
            row.clear();
            row.resize(w.next_multiple_of(64) + 2, zero);
        }
        self.signed.iter_mut().for_each(|row| row.resize(w.next_multiple_of(64), zero));
        self.smooth.iter_mut().for_each(|row| row.resize(w + 2 * REACH, zero));
        self.columns.resize(w + 2, zero);
        self.sums.clear();
        self.sums.resize(w, L::Sum::default());
    }

    /// Row `y` of a level smoothed by [1 2 1]/4 in both directions.
    #[inline(always)]
    fn smooth<P: Pixel<Lane = L>>(&mut self, level: View<'_, P>, y: usize) {
        let w = level.width;
        let at = |dy: isize| level.row(mirror(y as isize + dy, level.height));
        let (above, here, below) = (at(-1), at(0), at(1));
        let columns = &mut self.columns[..w + 2];
        for (((r, a), b), c) in columns[1..=w].iter_mut().zip(above).zip(here).zip(below) {
            *r = a.lane().add(b.lane().times(2)).add(c.lane());
        }
        (columns[0], columns[w + 1]) = (columns[2], columns[w - 1]);
        let out = &mut self.smooth[y % HELD][..w + 2 * REACH];
        let (left, mid, right) = (&columns[..w], &columns[1..=w], &columns[2..]);
        for (((o, a), b), c) in out[REACH..REACH + w].iter_mut().zip(left).zip(mid).zip(right) {
            *o = a.add(b.times(2)).add(*c).sixteenth();
        }
        for i in 1..=REACH {
            out[REACH - i] = out[REACH + i];
            out[REACH + w - 1 + i] = out[REACH + w - 1 - i];
        }
    }

    /// Twice the contrast of a row, its absolute value, and eight times |b - mean of all pairs| added to the sums.
    #[inline(always)]
    fn contrast(&mut self, y: usize, w: usize, h: usize) {
        const R: usize = REACH;
        let row = |dy: isize| &self.smooth[mirror(y as isize + dy, h) % HELD][..w + 2 * R];
        let (up3, up2, mid, down2, down3) = (row(-3), row(-2), row(0), row(2), row(3));
        let c = &mid[R..R + w];
        let (left, right) = (&mid[..w], &mid[2 * R..2 * R + w]);
        let (top, bottom) = (&up3[R..R + w], &down3[R..R + w]);
        let (up_left, up_right) = (&up2[R - 2..R - 2 + w], &up2[R + 2..R + 2 + w]);
        let (down_left, down_right) = (&down2[R - 2..R - 2 + w], &down2[R + 2..R + 2 + w]);
        let (sums, strong, signed) = (&mut self.sums[..w], &mut self.strong[2][1..=w], &mut self.signed[y % 2][..w]);
        for x in 0..w {
            let p1 = left[x].add(right[x]);
            let p2 = top[x].add(bottom[x]);
            let p3 = up_left[x].add(down_right[x]);
            let p4 = up_right[x].add(down_left[x]);
            let high = greater(greater(p1, p2), greater(p3, p4));
            let low = lesser(lesser(p1, p2), lesser(p3, p4));
            let twice = c[x].times(2);
            // Inside the pairs' range there is no contrast.
            let v = twice.sub(lesser(greater(twice, low), high));
            signed[x] = v;
            strong[x] = v.magnitude();
            c[x].times(8).sub(p1.add(p2).add(p3.add(p4))).magnitude().add_to(&mut sums[x]);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Image;

    fn contrast(image: &Image<f32>) -> Contrast {
        let mut contrast = Contrast::default();
        contrast.run(View::of(image));
        contrast
    }

    #[test]
    fn planes_edges_and_lines_have_no_contrast_and_a_spot_has_no_rim() {
        let mut image = Image::filled(60, 50, 0.0f32);
        for y in 0..50 {
            for x in 0..60 {
                image.row_mut(y)[x] = 0.5 * x as f32 - 0.25 * y as f32;
            }
        }
        // A plane mirrored at the border is a roof there: only the inner part counts.
        let inner = |e: &&Extreme| (4..56).contains(&e.x) && (4..46).contains(&e.y) && e.v.abs() > 1e-4;
        assert_eq!(contrast(&image).extremes.iter().filter(inner).count(), 0);
        for image in [
            Image::from_vec(60, 50, (0..3000).map(|i| if i % 60 < 30 { 0.0 } else { 9.0 }).collect()),
            Image::from_vec(60, 50, (0..3000).map(|i| if i / 60 == 25 { 9.0 } else { 0.0 }).collect()),
        ] {
            let image: Image<f32> = image.unwrap();
            assert_eq!(contrast(&image).extremes.iter().filter(inner).count(), 0);
        }
        let mut spot = Image::filled(60, 50, 0.0f32);
        spot.row_mut(20)[30] = 16.0;
        let found = contrast(&spot);
        assert_eq!(found.extremes, [Extreme { x: 30, y: 20, v: 4.0 }]);
        assert_eq!((found.n_bright, found.n_dark), (1, 0));
    }

    #[test]
    fn every_block_has_its_noise() {
        let found = contrast(&Image::filled(63, 41, 5.0f32));
        assert_eq!((found.nx, found.ny, found.blocks.len()), (7, 5, 35));
        assert!(found.blocks.iter().all(|b| *b < 1e-5));
    }

    #[test]
    fn whole_numbers_and_single_precision_give_the_same_bits() {
        // All values of 8 bits, the extremes beside each other.
        for (w, h) in [(7, 7), (64, 9), (131, 70)] {
            let mut state = 1u32;
            let mut next = || {
                state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                match state >> 30 {
                    0 => 0,
                    1 => 255,
                    _ => (state >> 16) as u8,
                }
            };
            let short = Image::from_vec(w, h, (0..w * h).map(|_| next()).collect()).unwrap();
            let single = Image::from_vec(w, h, short.as_slice().iter().map(|v| f32::from(*v)).collect()).unwrap();
            let mut found = Contrast::default();
            found.run(View::of(&short));
            let expected = contrast(&single);
            assert_eq!((found.extremes, found.blocks), (expected.extremes, expected.blocks));
            assert_eq!((found.n_bright, found.n_dark), (expected.n_bright, expected.n_dark));
        }
    }
}
