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

    /// Where the deviation of the contrast is read in a row of the level's pixels.
    pub(super) fn row(&self, y: u32) -> NoiseRow<'_> {
        let (y0, y1, part) = between(y, self.ny);
        let blocks = |y: usize| &self.sd[y * self.nx..][..self.nx];
        NoiseRow { above: blocks(y0), below: blocks(y1), part }
    }
}

/// The blocks above and below a row of pixels, and how far it is between their centres.
#[derive(Clone, Copy, Debug)]
pub(super) struct NoiseRow<'a> {
    above: &'a [f32],
    below: &'a [f32],
    part: f32,
}

impl NoiseRow<'_> {
    /// Deviation of the contrast at a pixel of the level, counts.
    #[inline]
    pub(super) fn at(self, x: u32) -> f32 {
        let (x0, x1, part) = between(x, self.above.len());
        let along = |blocks: &[f32]| blocks[x0] + part * (blocks[x1] - blocks[x0]);
        let above = along(self.above);
        above + self.part * (along(self.below) - above)
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
        assert!((noise.row(0).at(0) - 5f32.sqrt()).abs() < 1e-5);
    }
}
