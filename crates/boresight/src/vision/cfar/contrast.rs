//! Directional contrast: how far a pixel stands out of the best of four opposite pairs around it; its extremes and its noise.
//!
//! v = b(p) - max over d of [b(p + d) + b(p - d)] / 2 where that is positive (bright), b(p) - min over d where that is negative
//! (dark), else 0, d = (3, 0), (0, 3), (2, 2), (2, -2) pixels of the level. A plane, a straight edge and a line along a pair have v = 0,
//! and the sides of a target have no contrast of the other sign. An extreme is a pixel whose |v| no neighbour exceeds (of equals the
//! first in raster order). The noise of a block of 8 x 8 pixels is the mean |b(p) - mean of all pairs| times √(π/2).
//! Related: the patch contrasts of Y. Wei et al., *Multiscale patch-based contrast measure*, Pattern Recognition 58, 216 (2016).
//! Limits: extremes weaker than 1.2 times the quietest block above them are counted but not listed: their z is below 3.

use super::pyramid::{Level, PAD};
use fearless_simd::prelude::*;
use fearless_simd::{Level as Cpu, dispatch};

/// Side of a block, pixels of the level.
pub(super) const BLOCK: usize = 8;
/// √(π/2): the deviation of normal noise in units of its mean absolute value.
const SD_PER_MEAN_ABS: f32 = 1.253_314_1;
/// Extremes below so many times the quietest block are not listed.
const LISTED: f32 = 1.2;

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
    /// Strength |v| of three rows, one pixel of 0 before them and zeros up to a whole word of bits after.
    strong: [Vec<f32>; 3],
    /// Contrast of the last two rows, up to a whole word of bits.
    signed: [Vec<f32>; 2],
    sums: Vec<f32>,
}

impl Contrast {
    /// Finds the extremes and the noise of a level.
    pub(super) fn run(&mut self, level: &Level) {
        dispatch!(Cpu::new(), simd => self.run_vectors(simd, level));
    }

    #[inline(always)]
    fn run_vectors<S: Simd>(&mut self, simd: S, level: &Level) {
        let (w, h) = (level.width, level.height);
        (self.nx, self.ny) = ((w / BLOCK).max(1), (h / BLOCK).max(1));
        (self.n_bright, self.n_dark) = (0, 0);
        self.extremes.clear();
        self.blocks.clear();
        for row in &mut self.strong {
            row.clear();
            row.resize(w.next_multiple_of(64) + 2, 0.0);
        }
        self.signed.iter_mut().for_each(|row| row.resize(w.next_multiple_of(64), 0.0));
        self.sums.clear();
        self.sums.resize(w, 0.0);
        let (mut quietest, mut in_block) = (f32::INFINITY, 0);
        for y in 0..=h {
            self.strong.rotate_left(1);
            if y < h {
                contrast_row(level, y, &mut self.signed[y % 2][..w], &mut self.strong[2][1..=w], &mut self.sums);
                in_block += 1;
                let block_ends = (y + 1) % BLOCK == 0 && self.blocks.len() / self.nx + 1 < self.ny || y + 1 == h;
                if block_ends {
                    let low = self.end_blocks(w, in_block);
                    quietest = quietest.min(low);
                    in_block = 0;
                }
            } else {
                self.strong[2].fill(0.0);
            }
            if y > 0 {
                let least = if quietest.is_finite() { LISTED * quietest } else { 0.0 };
                self.extremes_of_row(simd, y - 1, w, least);
            }
        }
    }

    /// Ends a row of blocks of so many rows; returns the quietest of them.
    #[inline(always)]
    fn end_blocks(&mut self, w: usize, rows: usize) -> f32 {
        let mut low = f32::INFINITY;
        for i in 0..self.nx {
            let end = if i + 1 == self.nx { w } else { (i + 1) * BLOCK };
            let part = &self.sums[i * BLOCK..end];
            let mean = part.iter().sum::<f32>() / (part.len() * rows) as f32;
            low = low.min(mean * SD_PER_MEAN_ABS);
            self.blocks.push(mean * SD_PER_MEAN_ABS);
        }
        self.sums.fill(0.0);
        low
    }

    #[inline(always)]
    fn extremes_of_row<S: Simd>(&mut self, simd: S, y: usize, w: usize, least: f32) {
        let [above, here, below] = &self.strong;
        for i in 0..w.div_ceil(64) {
            let from = 64 * i;
            let (all, strong, bright) = word(simd, [above, here, below], &self.signed[y % 2], from, least);
            // Beyond the width all strengths are 0, and 0 is no extreme.
            self.n_bright += (all & bright).count_ones() as usize;
            self.n_dark += (all & !bright).count_ones() as usize;
            let mut listed = all & strong;
            while listed != 0 {
                let x = from + listed.trailing_zeros() as usize;
                listed &= listed - 1;
                self.extremes.push(Extreme { x: x as u32, y: y as u32, v: self.signed[y % 2][x] });
            }
        }
    }
}

/// The extremes among 64 pixels, which of these are at least `least` strong, and which are bright; rows of strengths have one pixel of margin.
#[inline(always)]
fn word<S: Simd>(
    simd: S,
    [above, here, below]: [&[f32]; 3],
    signed: &[f32],
    from: usize,
    least: f32,
) -> (u64, u64, u64) {
    let n = S::f32s::LEN;
    let (least, zero) = (S::f32s::splat(simd, least), S::f32s::splat(simd, 0.0));
    let (mut all, mut listed, mut bright) = (0, 0, 0);
    for k in (0..64).step_by(n) {
        let load = |row: &[f32], shift: usize| S::f32s::from_slice(simd, &row[from + k + shift..from + k + shift + n]);
        let c = load(here, 1);
        // Strictly above what comes before it in raster order, not below what comes after.
        let before = load(above, 0).max(load(above, 1)).max(load(above, 2).max(load(here, 0)));
        let after = load(below, 0).max(load(below, 1)).max(load(below, 2).max(load(here, 2)));
        let extreme = c.simd_gt(before) & c.simd_ge(after);
        all |= extreme.to_bitmask() << k;
        listed |= c.simd_ge(least).to_bitmask() << k;
        let v = S::f32s::from_slice(simd, &signed[from + k..from + k + n]);
        bright |= v.simd_gt(zero).to_bitmask() << k;
    }
    (all, listed, bright)
}

#[inline(always)]
fn greater(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}

#[inline(always)]
fn lesser(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}

/// The contrast of a row, its absolute value, and |b - mean of all pairs| added to `sums`.
#[inline(always)]
fn contrast_row(level: &Level, y: usize, out: &mut [f32], strong: &mut [f32], sums: &mut [f32]) {
    let w = out.len();
    let row = |dy: isize| level.smooth_row(y as isize + dy);
    let (up3, up2, mid, down2, down3) = (row(-3), row(-2), row(0), row(2), row(3));
    let c = &mid[PAD..PAD + w];
    let (left, right) = (&mid[PAD - 3..PAD - 3 + w], &mid[PAD + 3..PAD + 3 + w]);
    let (top, bottom) = (&up3[PAD..PAD + w], &down3[PAD..PAD + w]);
    let (up_left, up_right) = (&up2[PAD - 2..PAD - 2 + w], &up2[PAD + 2..PAD + 2 + w]);
    let (down_left, down_right) = (&down2[PAD - 2..PAD - 2 + w], &down2[PAD + 2..PAD + 2 + w]);
    let (sums, strong) = (&mut sums[..w], &mut strong[..w]);
    for x in 0..w {
        let p1 = left[x] + right[x];
        let p2 = top[x] + bottom[x];
        let p3 = up_left[x] + down_right[x];
        let p4 = up_right[x] + down_left[x];
        let high = greater(greater(p1, p2), greater(p3, p4));
        let low = lesser(lesser(p1, p2), lesser(p3, p4));
        let twice = 2.0 * c[x];
        // Inside the pairs' range there is no contrast.
        let v = 0.5 * (twice - lesser(greater(twice, low), high));
        out[x] = v;
        strong[x] = v.abs();
        sums[x] += (c[x] - 0.125 * ((p1 + p2) + (p3 + p4))).abs();
    }
}

#[cfg(test)]
mod tests {
    use super::super::pyramid::Pyramid;
    use super::*;
    use crate::Image;

    fn contrast(image: &Image<f32>) -> Contrast {
        let mut pyramid = Pyramid::default();
        let mut contrast = Contrast::default();
        contrast.run(&pyramid.fill(image, 1)[0]);
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
}
