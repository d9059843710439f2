//! Local noise of the contrast: the mean of the 24 blocks around a block, its own left out, and read between blocks.
//!
//! s² = l² + (med / 2)² + floor²: l the mean of the blocks around (so a target does not raise its own noise), med the median of
//! all l (a spot of dead ground is not infinitely quiet), floor the rounding noise of whole-number pixels. For white noise
//! s = √1.25 l. Blocks beyond the frame are mirrored. Bilinear between the blocks' centres.

use super::contrast::{BLOCK, Contrast};

/// Blocks to each side.
const REACH: isize = 2;
/// Part of the frame's median noise that every place has at least.
const SHARED: f32 = 0.5;

/// The noise of one level.
#[derive(Clone, Debug, Default)]
pub(super) struct NoiseMap {
    nx: usize,
    ny: usize,
    sd: Vec<f32>,
    columns: Vec<f32>,
    sorted: Vec<f32>,
    /// The rows of blocks above and below a row of pixels, read for every pixel, and the index of the first.
    wide: [Vec<f32>; 2],
    wide_row: Option<usize>,
}

/// The index inside 0..n that a mirror at the edge of the blocks shows.
fn mirror(i: isize, n: usize) -> usize {
    let n = n as isize;
    let i = if i < 0 { -1 - i } else { i };
    (if i >= n { 2 * n - 1 - i } else { i }).clamp(0, n - 1) as usize
}

impl NoiseMap {
    /// Takes the blocks of a level; `floor` is the least noise, counts, above 0.
    pub(super) fn fill(&mut self, contrast: &Contrast, floor: f32) {
        (self.nx, self.ny) = (contrast.nx, contrast.ny);
        self.wide_row = None;
        let (nx, ny) = (self.nx, self.ny);
        self.sd.clear();
        self.sd.resize(nx * ny, 0.0);
        self.columns.resize(nx, 0.0);
        for y in 0..ny {
            self.columns.fill(0.0);
            for dy in -REACH..=REACH {
                let row = &contrast.blocks[mirror(y as isize + dy, ny) * nx..][..nx];
                self.columns.iter_mut().zip(row).for_each(|(c, b)| *c += b);
            }
            for x in 0..nx {
                let sum: f32 = (-REACH..=REACH).map(|dx| self.columns[mirror(x as isize + dx, nx)]).sum();
                self.sd[y * nx + x] = (sum - contrast.blocks[y * nx + x]).max(0.0) / 24.0;
            }
        }
        self.sorted.clone_from(&self.sd);
        let mid = self.sorted.len() / 2;
        let median = *self.sorted.select_nth_unstable_by(mid, f32::total_cmp).1;
        let least2 = (SHARED * median).powi(2) + floor * floor;
        self.sd.iter_mut().for_each(|s| *s = (*s * *s + least2).sqrt());
    }

    /// Where the deviation of the contrast is read in row `y` of the level's pixels, of which a row has `w`.
    pub(super) fn row(&mut self, y: u32, w: usize) -> NoiseRow<'_> {
        let (above, below, part) = between(y, self.ny);
        if self.wide_row != Some(above) {
            self.wide.rotate_left(1);
            if self.wide_row.is_none_or(|row| row + 1 != above) {
                self.widen(0, above, w);
            }
            self.widen(1, below, w);
            self.wide_row = Some(above);
        }
        NoiseRow { above: &self.wide[0], below: &self.wide[1], part }
    }

    /// Reads a row of blocks for every pixel.
    fn widen(&mut self, to: usize, row: usize, w: usize) {
        let blocks = &self.sd[row * self.nx..][..self.nx];
        let wide = &mut self.wide[to];
        // Up to the first centre and beyond the last one there is nothing to read between.
        wide.clear();
        wide.resize(w, blocks[self.nx - 1]);
        let (first, rest) = wide.split_at_mut((BLOCK / 2).min(w));
        first.fill(blocks[0]);
        for (to, pair) in rest.as_chunks_mut::<BLOCK>().0.iter_mut().zip(blocks.windows(2)) {
            for (i, v) in to.iter_mut().enumerate() {
                *v = pair[0] + (i as f32 + 0.5) / BLOCK as f32 * (pair[1] - pair[0]);
            }
        }
    }
}

/// The noise along the centres of the blocks above and below a row of pixels, and how far it is between them.
#[derive(Clone, Copy, Debug)]
pub(super) struct NoiseRow<'a> {
    above: &'a [f32],
    below: &'a [f32],
    part: f32,
}

impl NoiseRow<'_> {
    /// Deviation of the contrast at a pixel of the level, counts.
    #[inline(always)]
    pub(super) fn at(self, x: u32) -> f32 {
        let above = self.above[x as usize];
        above + self.part * (self.below[x as usize] - above)
    }
}

/// The blocks before and after a pixel, and how far it is between their centres.
#[inline]
fn between(p: u32, n: usize) -> (usize, usize, f32) {
    let b = ((p as f32 - 0.5 * (BLOCK as f32 - 1.0)) / BLOCK as f32).clamp(0.0, (n - 1) as f32);
    let i = b as usize;
    (i, (i + 1).min(n - 1), b - i as f32)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_block_does_not_count_for_itself() {
        let mut contrast = Contrast::default();
        (contrast.nx, contrast.ny, contrast.blocks) = (9, 7, vec![2.0; 63]);
        contrast.blocks[3 * 9 + 4] = 1000.0;
        let mut noise = NoiseMap::default();
        noise.fill(&contrast, 1e-6);
        let own = noise.sd[3 * 9 + 4];
        // 2 in all blocks around, and half of the median 2 beside it.
        assert!((own - 5f32.sqrt()).abs() < 1e-5, "{own}");
        assert!(noise.sd[3 * 9 + 5] > 40.0);
        // Half way between two centres.
        assert!((noise.row(0, 72).at(0) - 5f32.sqrt()).abs() < 1e-5);
    }

    #[test]
    fn the_noise_of_a_pixel_lies_between_those_of_the_four_blocks_around_it() {
        let mut state = 5u32;
        let mut next = || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            1.0 + (state >> 16) as f32 / 65_536.0
        };
        // One block, whole blocks, and last ones that are wider.
        for (w, h) in [(7, 9), (64, 40), (79, 47)] {
            let (nx, ny) = ((w / BLOCK).max(1), (h / BLOCK).max(1));
            let sd: Vec<f32> = (0..nx * ny).map(|_| next()).collect();
            let mut noise = NoiseMap { nx, ny, sd: sd.clone(), ..NoiseMap::default() };
            // Row by row, and some rows only.
            for y in (0..h).chain([0, 3, h - 1, 1]) {
                let row = noise.row(y as u32, w);
                for x in 0..w {
                    let ((x0, x1, u), (y0, y1, v)) = (between(x as u32, nx), between(y as u32, ny));
                    let along = |y: usize| sd[y * nx + x0] + u * (sd[y * nx + x1] - sd[y * nx + x0]);
                    let expected = along(y0) + v * (along(y1) - along(y0));
                    assert!((row.at(x as u32) - expected).abs() < 1e-6, "{w} x {h} at {x}, {y}");
                }
            }
        }
    }
}
