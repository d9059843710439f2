//! Local background on a grid: median and robust deviation of every cell, read between the cells by bilinear interpolation.
//!
//! Each cell is sampled on a fixed pattern (deterministic, bounded cost). Values of whole-number pixels are taken as spread
//! evenly over value +- 1/2, so median and deviation move smoothly though the levels are coarse. The deviation is
//! 1.4826 x MAD, the standard deviation if the noise is normal. A 3 x 3 median over the cells then removes cells that a
//! target fills. Limits: a target must fill less than half of a cell; detail smaller than a cell is not followed.

use crate::Image;
use crate::vision::middle::middle;
use crate::vision::pixel::Pixel;
use crate::vision::spatial::{SpatialConfig, SpatialFilter, WindowConfig};
use crate::vision::whole;
use fearless_simd::{Level, dispatch};

/// 1 / Φ⁻¹(3/4): the standard deviation of normal noise in units of its median absolute deviation.
pub const SD_PER_MAD: f64 = 1.482_602_218_505_602;

/// Samples of one frame are at most about this many.
const SAMPLE_BUDGET: usize = 1 << 17;
/// But a cell has at least so many, so that its median means something.
const MIN_SAMPLES_PER_CELL: usize = 64;

/// Median and deviation of the local background.
#[derive(Clone, Debug)]
pub struct BackgroundGrid {
    cell_px: usize,
    /// Least distance of two samples of a row or column, px.
    least_step: usize,
    width: usize,
    height: usize,
    nx: usize,
    ny: usize,
    /// Median and deviation of each cell, counts, as measured and smoothed.
    measured: [Image<f32>; 2],
    median: Image<f32>,
    deviation: Image<f32>,
    smoother: SpatialFilter<f32>,
    samples: Vec<f32>,
}

impl BackgroundGrid {
    /// Builds an empty grid with cells of `cell_px` (at least 1).
    pub fn new(cell_px: usize) -> Self {
        Self::of_smoothed(cell_px, 1)
    }

    /// The same for images that a box of `smooth_px` (at least 1) was run over: samples lie half of it and half a pixel apart. Of 3 px that is a quarter of them with 81 % of what all tell of a median
    /// (the box's correlations summed over both lattices), 86 % of 5 px.
    pub fn of_smoothed(cell_px: usize, smooth_px: usize) -> Self {
        let cell_px = cell_px.max(1);
        let fewest = (MIN_SAMPLES_PER_CELL as f64).sqrt() as usize;
        let least_step = smooth_px.div_ceil(2).min(cell_px / fewest).max(1);
        let of_nine = SpatialConfig::Median(WindowConfig::default());
        Self {
            cell_px,
            least_step,
            width: 0,
            height: 0,
            nx: 0,
            ny: 0,
            measured: Default::default(),
            median: Image::default(),
            deviation: Image::default(),
            smoother: SpatialFilter::new(of_nine).expect("the default window is one"),
            samples: Vec::new(),
        }
    }

    /// Measures the background of a frame.
    pub fn refresh<T: Pixel>(&mut self, image: &Image<T>) {
        (self.width, self.height) = (image.width(), image.height());
        self.nx = self.width.div_ceil(self.cell_px);
        self.ny = self.height.div_ceil(self.cell_px);
        let n = self.nx * self.ny;
        for image in self.measured.iter_mut().chain([&mut self.median, &mut self.deviation]) {
            image.reset(self.nx, self.ny, 0.0);
        }
        if n == 0 {
            return;
        }
        let per_cell = (SAMPLE_BUDGET / n).max(MIN_SAMPLES_PER_CELL) as f64;
        // A step in each direction so that about per_cell pixels of a full cell are seen.
        let step = ((self.cell_px as f64 / per_cell.sqrt()).round() as usize).max(self.least_step);
        for cy in 0..self.ny {
            let rows = cy * self.cell_px..((cy + 1) * self.cell_px).min(self.height);
            for cx in 0..self.nx {
                let columns = cx * self.cell_px..((cx + 1) * self.cell_px).min(self.width);
                self.samples.clear();
                for (i, y) in rows.clone().step_by(step).enumerate() {
                    let row = image.row(y);
                    // Shift every other row by half a step: no column pattern goes unseen.
                    let start = columns.start + (i % 2) * (step / 2);
                    let sampled = row[start.min(columns.end)..columns.end].iter().step_by(step).map(|v| v.value_f32());
                    self.samples.extend(sampled);
                }
                if T::STEP == 0.0 {
                    self.samples.retain(|v| v.is_finite());
                }
                let (median, deviation) = median_and_deviation(&mut self.samples, T::STEP);
                self.measured[0].row_mut(cy)[cx] = median;
                self.measured[1].row_mut(cy)[cx] = deviation;
            }
        }
        // A 3 x 3 median over the cells, those of the edge repeated.
        let [median, deviation] = &self.measured;
        self.smoother.apply(median, &mut self.median);
        self.smoother.apply(deviation, &mut self.deviation);
    }

    /// The local median and robust standard deviation at a position, counts.
    pub fn at(&self, x: f64, y: f64) -> (f64, f64) {
        if self.median.as_slice().is_empty() {
            return (0.0, 0.0);
        }
        let (x0, x1, fx) = between(x, self.cell_px, self.nx);
        let (y0, y1, fy) = between(y, self.cell_px, self.ny);
        let read = |v: &Image<f32>| {
            let at = |x: usize, y: usize| f64::from(v.row(y)[x]);
            let top = at(x0, y0) + (at(x1, y0) - at(x0, y0)) * fx;
            let bottom = at(x0, y1) + (at(x1, y1) - at(x0, y1)) * fx;
            top + (bottom - top) * fy
        };
        (read(&self.median), read(&self.deviation))
    }

    /// Writes the level `median + sign x max(k x deviation, min_contrast)` of row `y` into `level` (width entries).
    pub fn level_row(&self, y: usize, k: f32, min_contrast: f32, sign: f32, level: &mut Vec<f32>) {
        if self.median.as_slice().is_empty() {
            level.clear();
            return;
        }
        level.resize(self.width, 0.0);
        dispatch!(Level::new(), _simd => self.fill_row(y, (k, min_contrast, sign), level));
    }

    #[inline(always)]
    fn fill_row(&self, y: usize, (k, min_contrast, sign): (f32, f32, f32), level: &mut [f32]) {
        let (y0, y1, fy) = between(y as f64, self.cell_px, self.ny);
        let fy = fy as f32;
        let node = |cx: usize| {
            let mix = |v: &Image<f32>| {
                let (a, b) = (v.row(y0)[cx], v.row(y1)[cx]);
                a + (b - a) * fy
            };
            mix(&self.median) + sign * (k * mix(&self.deviation)).max(min_contrast)
        };
        let half = (self.cell_px as f32 - 1.0) / 2.0;
        let per_px = 1.0 / self.cell_px as f32;
        let mut left = node(0);
        let mut from = ((half.ceil()) as usize).min(self.width);
        level[..from].fill(left);
        for cx in 1..self.nx {
            let right = node(cx);
            // Pixels between the centres of cells cx - 1 and cx.
            let start = (cx - 1) as f32 * self.cell_px as f32 + half;
            let slope = (right - left) * per_px;
            let to = ((start + self.cell_px as f32).ceil() as usize).clamp(from, self.width);
            // Columns of an image are far fewer than i32 holds, and vectors turn i32 into f32.
            let first = from as i32;
            for (i, level) in (0..).zip(&mut level[from..to]) {
                *level = left + ((first + i) as f32 - start) * slope;
            }
            (from, left) = (to, right);
        }
        level[from..].fill(left);
    }
}

/// The two nodes around `x` and the share of the second; constant outside the outermost nodes.
fn between(x: f64, cell: usize, n: usize) -> (usize, usize, f64) {
    let u = ((x - (cell as f64 - 1.0) / 2.0) / cell as f64).clamp(0.0, (n - 1) as f64);
    let i = (u as usize).min(n - 1);
    (i, (i + 1).min(n - 1), u - i as f64)
}

/// Median and 1.4826 x MAD of values; whole-number values (`step` 1) are taken as spread evenly over +- 1/2. Changes their order.
/// No values: zeros.
pub fn median_and_deviation(values: &mut [f32], step: f32) -> (f32, f32) {
    let n = values.len();
    if n == 0 {
        return (0.0, 0.0);
    }
    if step == 0.0 {
        let median = middle(values);
        for v in values.iter_mut() {
            *v = (*v - median).abs();
        }
        return (median, middle(values) * SD_PER_MAD as f32);
    }
    whole::sort(values);
    let half = n as f32 / 2.0;
    let v = values[n / 2];
    let below = values.partition_point(|&s| s < v) as f32;
    let upto = values.partition_point(|&s| s <= v) as f32;
    let median = v + (half - below) / (upto - below) - 0.5;
    // Number of values up to x, each spread over its level.
    let rank = |x: f32| {
        let level = (x + 0.5).floor();
        let below = values.partition_point(|&s| s < level) as f32;
        let upto = values.partition_point(|&s| s <= level) as f32;
        below + (upto - below) * (x + 0.5 - level)
    };
    // The distance that holds half the values on both sides; the rank is monotone, so halving the interval finds it.
    let (mut near, mut far) = (0.0f32, (values[n - 1] - median).max(median - values[0]) + 1.0);
    for _ in 0..20 {
        let d = 0.5 * (near + far);
        if rank(median + d) - rank(median - d) < half { near = d } else { far = d }
    }
    let deviation = 0.5 * (near + far) * SD_PER_MAD as f32;
    // The even spread added a variance of 1/12; the rounding to whole counts is noise and stays, it is the least there is.
    (median, (deviation * deviation - 1.0 / 12.0).max(1.0 / 12.0).sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use rand_distr::StandardNormal;

    #[test]
    fn coarse_levels_still_give_a_smooth_median_and_deviation() {
        // Grouped data: half the values 10, half 11 -> the median lies on the border between them.
        let mut v = vec![10.0, 10.0, 11.0, 11.0];
        let (median, _) = median_and_deviation(&mut v, 1.0);
        assert_eq!(median, 10.5);
        // Normal noise of deviation 0.6 rounded to whole counts: MAD of whole numbers would be 0 or 1.
        let mut v: Vec<f32> = (0..4001)
            .map(|i| {
                let p = (f64::from(i) + 0.5) / 4001.0;
                use statrs::distribution::ContinuousCDF;
                (statrs::distribution::Normal::standard().inverse_cdf(p) * 0.6 + 20.3).round() as f32
            })
            .collect();
        let (median, deviation) = median_and_deviation(&mut v, 1.0);
        assert!((median - 20.3).abs() < 0.05, "{median}");
        // 0.6² and the rounding's 1/12.
        assert!((deviation - 0.666).abs() < 0.05, "{deviation}");
    }

    #[test]
    fn a_ramp_is_followed_between_the_cells() {
        let mut image = Image::filled(200, 120, 0.0f32);
        for y in 0..120 {
            for x in 0..200 {
                image.row_mut(y)[x] = x as f32 + 0.5 * y as f32;
            }
        }
        let mut grid = BackgroundGrid::new(20);
        grid.refresh(&image);
        let (m, _) = grid.at(100.0, 60.0);
        assert!((m - 130.0).abs() < 1.5, "{m}");
        let mut level = Vec::new();
        grid.level_row(60, 0.0, 0.0, 1.0, &mut level);
        assert_eq!(level.len(), 200);
        for x in [0, 9, 10, 50, 100, 189, 199] {
            let (m, _) = grid.at(x as f64, 60.0);
            assert!((f64::from(level[x]) - m).abs() < 1e-3, "{x}: {} {m}", level[x]);
        }
    }

    #[test]
    fn a_target_that_fills_one_cell_does_not_move_the_background() {
        let mut image = Image::filled(160, 160, 20u8);
        for y in 64..80 {
            image.row_mut(y)[64..80].fill(200);
        }
        let mut grid = BackgroundGrid::new(16);
        grid.refresh(&image);
        assert_eq!(grid.at(72.0, 72.0).0, 20.0);
    }

    #[test]
    fn samples_of_a_smoothed_image_that_lie_apart_tell_of_its_median_nearly_as_much_as_all_do() {
        let (n, cell, smooth) = (20, 44, 3usize);
        let side = n * cell;
        let mut rng = ChaCha8Rng::seed_from_u64(5);
        let noise: Vec<f32> = (0..side * side).map(|_| rng.sample(StandardNormal)).collect();
        let at = |x: usize, y: usize| noise[y.min(side - 1) * side + x.min(side - 1)];
        let boxed = |i: usize| (0..9).map(|k| at(i % side + k % 3, i / side + k / 3)).sum::<f32>() / 9.0;
        let boxed = Image::from_vec(side, side, (0..side * side).map(boxed).collect()).unwrap();
        let variance_of_medians = |mut grid: BackgroundGrid| {
            grid.refresh(&boxed);
            grid.median.as_slice().iter().map(|m| f64::from(*m).powi(2)).sum::<f64>()
        };
        // The cells' medians of both are smoothed alike. 0.81 of the information by the correlations of the box; 400 cells of which the smoothing leaves some 80 that differ tell the ratio to 10 %.
        let ratio = variance_of_medians(BackgroundGrid::new(cell))
            / variance_of_medians(BackgroundGrid::of_smoothed(cell, smooth));
        assert!(ratio > 0.65 && ratio < 1.05, "{ratio}");
    }

    #[test]
    fn an_image_smaller_than_a_cell_or_of_nan_alone_has_a_background() {
        let mut grid = BackgroundGrid::new(32);
        grid.refresh(&Image::filled(1, 1, 9u8));
        assert_eq!(grid.at(0.0, 0.0).0, 9.0);
        grid.refresh(&Image::filled(3, 50, f32::NAN));
        assert_eq!(grid.at(1.0, 20.0), (0.0, 0.0));
        grid.refresh(&Image::<u8>::filled(0, 0, 0));
        assert_eq!(grid.at(1.0, 20.0), (0.0, 0.0));
    }
}
