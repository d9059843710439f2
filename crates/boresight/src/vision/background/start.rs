//! The first background: the median of each pixel over some frames, and its noise.
//!
//! The noise is the median absolute deviation. From eleven samples that is known to some 30 %, and a pixel in hundreds has a third of its noise by chance and moves for ever
//! after; so where samples are few, it is averaged over the pixels nearby, whose noise is alike.
//! Symbols: of a normal noise σ the median absolute deviation is 0.6745 σ, the mean absolute deviation 0.7979 σ.
//! Limits: what covers a pixel in half of the frames is its background.

use super::super::ranks::{LANES, Lanes, block};
use super::light::GRID_PX;
use super::model::BackgroundPixel;
use crate::Image;

/// Mean over median absolute deviation of normal noise: 0.7979 / 0.6745.
const MEAN_PER_MEDIAN: f32 = 1.183;

/// Sets mean and deviation to those of frames that all have their size, the deviation averaged over the pixels within `reach` columns and rows; a pixel that is never finite
/// stays as it was.
pub(super) fn learn<T: BackgroundPixel>(
    frames: &[&Image<T>],
    reach: usize,
    mean: &mut Image<T::Level>,
    deviation: &mut Image<T::Level>,
) {
    let (w, h) = (mean.width(), mean.height());
    let mut spreads = Image::filled(w, h, f32::NAN);
    let mut medians = Medians::default();
    for y in 0..h {
        let (means, spreads) = (mean.row_mut(y), spreads.row_mut(y));
        for x in (0..w).step_by(LANES) {
            medians.of(frames, (x, y));
            let values = medians.found.iter().zip(means[x..].iter_mut().zip(&mut spreads[x..]));
            for ((median, spread), (mean, spread_here)) in values.filter(|v| !v.0.0.is_nan()) {
                (*mean, *spread_here) = (T::level(*median), *spread);
            }
        }
    }
    let (mut sums, mut counts) = (vec![0.0f32; w], vec![0.0f32; w]);
    for y in 0..h {
        sums.fill(0.0);
        counts.fill(0.0);
        for near in y.saturating_sub(reach)..(y + reach + 1).min(h) {
            add_near(spreads.row(near), reach, &mut sums, &mut counts);
        }
        let own = spreads.row(y).iter().zip(sums.iter().zip(&counts));
        for (deviation, (_, (sum, n))) in deviation.row_mut(y).iter_mut().zip(own).filter(|(_, own)| !own.0.is_nan()) {
            *deviation = T::level(sum / n);
        }
    }
}

/// Median of the deviations on the grid, counts; keeps its memory in `all`.
pub(super) fn typical<T: BackgroundPixel>(deviation: &Image<T::Level>, all: &mut Vec<f32>) -> f32 {
    all.clear();
    for y in (0..deviation.height()).step_by(GRID_PX) {
        all.extend(deviation.row(y).iter().step_by(GRID_PX).map(|&d| T::counts(d)));
    }
    let middle = all.len() / 2;
    if all.is_empty() { 1.0 } else { *all.select_nth_unstable_by(middle, f32::total_cmp).1 }
}

/// Adds to each column what is finite in the columns within `reach` of a row, and how many these are.
fn add_near(row: &[f32], reach: usize, sums: &mut [f32], counts: &mut [f32]) {
    for shift in 0..=2 * reach {
        // Column x takes x + shift - reach.
        let (to, from) = (reach.saturating_sub(shift), shift.saturating_sub(reach));
        let columns = sums.iter_mut().zip(counts.iter_mut()).skip(to);
        for ((sum, n), v) in columns.zip(row.iter().skip(from)) {
            let there = !v.is_nan();
            *sum += if there { *v } else { 0.0 };
            *n += if there { 1.0 } else { 0.0 };
        }
    }
}

/// Medians over frames and the spread about them, of a block of columns.
struct Medians<T> {
    rows: Vec<Lanes<T>>,
    values: Vec<f32>,
    /// Median and spread of each column, counts; no number where no frame has one.
    found: [(f32, f32); LANES],
}

impl<T> Default for Medians<T> {
    fn default() -> Self {
        Self { rows: Vec::new(), values: Vec::new(), found: [(f32::NAN, f32::NAN); LANES] }
    }
}

impl<T: BackgroundPixel> Medians<T> {
    /// Those of the columns from a pixel on.
    fn of(&mut self, frames: &[&Image<T>], (x, y): (usize, usize)) {
        self.found = [(f32::NAN, f32::NAN); LANES];
        self.rows.clear();
        self.rows.extend(frames.iter().map(|f| block(f.row(y), x)));
        let middle = frames.len() / 2;
        let [mut medians, mut spreads] = [[T::default(); LANES]; 2];
        if T::rank(&self.rows, middle, &mut medians) {
            for row in &mut self.rows {
                row.iter_mut().zip(&medians).for_each(|(v, m)| *v = v.distance(*m));
            }
            if T::rank(&self.rows, middle, &mut spreads) {
                for ((found, median), spread) in self.found.iter_mut().zip(medians).zip(spreads) {
                    *found = (median.to_f32(), MEAN_PER_MEDIAN * spread.to_f32());
                }
                return;
            }
        }
        for (i, found) in self.found.iter_mut().enumerate() {
            self.values.clear();
            self.values.extend(self.rows.iter().map(|r| r[i].to_f32()).filter(|v| v.is_finite()));
            if self.values.is_empty() {
                continue;
            }
            let middle = self.values.len() / 2;
            let median = *self.values.select_nth_unstable_by(middle, f32::total_cmp).1;
            self.values.iter_mut().for_each(|v| *v = (*v - median).abs());
            *found = (median, MEAN_PER_MEDIAN * *self.values.select_nth_unstable_by(middle, f32::total_cmp).1);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    /// Noise found in frames of noise of deviation 2, σ: mean and spread over the pixels.
    fn found(n: usize, reach: usize) -> (f64, f64) {
        let mut rng = ChaCha8Rng::seed_from_u64(4);
        let mut pixel = || (150.0 + 2.0 * ((0..12).map(|_| rng.random::<f64>()).sum::<f64>() - 6.0)) as f32;
        let frames: Vec<Image<f32>> =
            (0..n).map(|_| Image::from_vec(60, 50, (0..60 * 50).map(|_| pixel()).collect()).unwrap()).collect();
        let (mut mean, mut deviation) = (Image::filled(60, 50, 0.0f32), Image::filled(60, 50, 0.0f32));
        learn(&frames.iter().collect::<Vec<_>>(), reach, &mut mean, &mut deviation);
        let all: Vec<f64> = deviation.as_slice().iter().map(|d| f64::from(*d) / 0.7979).collect();
        let mean = all.iter().sum::<f64>() / 3000.0;
        (mean, (all.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / 3000.0).sqrt())
    }

    #[test]
    fn noise_is_that_of_the_pixels_and_of_few_samples_known_five_times_as_well_from_25_pixels() {
        let (many, _) = found(101, 0);
        assert!((many / 2.0 - 1.0).abs() < 0.03, "{many}");
        let ((alone, wide), (near, narrow)) = (found(11, 0), found(11, 2));
        // The median of few deviations from their own median is low by a tenth.
        assert!((alone / 2.0 - 0.9).abs() < 0.1 && (near / alone - 1.0).abs() < 0.02, "{alone} {near}");
        assert!((wide / narrow / 5.0 - 1.0).abs() < 0.2, "{wide} {narrow}");
    }

    #[test]
    fn what_is_not_finite_is_not_averaged() {
        let mut frame = Image::filled(5, 5, 10.0f32);
        frame.row_mut(2)[2] = f32::NAN;
        let other = Image::filled(5, 5, 12.0f32);
        let (mut mean, mut deviation) = (Image::filled(5, 5, 0.0f32), Image::filled(5, 5, -1.0f32));
        learn(&[&frame, &frame], 2, &mut mean, &mut deviation);
        assert_eq!((mean.row(2)[2], deviation.row(2)[2]), (0.0, -1.0), "never finite: as before");
        assert_eq!((mean.row(2)[1], deviation.row(2)[1]), (10.0, 0.0));
        learn(&[&frame, &other, &other], 0, &mut mean, &mut deviation);
        assert_eq!(mean.row(2)[2], 12.0);
    }
}
