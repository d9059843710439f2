//! The first background: the median of each pixel over some frames, and its noise.
//!
//! The noise is the median absolute deviation. From eleven samples that is known to some 30 %, and a pixel in hundreds has a third of its noise by chance and moves for ever
//! after; so where samples are few, it is averaged over the pixels nearby, whose noise is alike.
//! Symbols: of a normal noise σ the median absolute deviation is 0.6745 σ, the mean absolute deviation 0.7979 σ.
//! Limits: what covers a pixel in half of the frames is its background.

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
    let mut values = Vec::with_capacity(frames.len());
    let mut spreads = Image::filled(w, h, f32::NAN);
    for y in 0..h {
        let rows: Vec<&[T]> = frames.iter().map(|f| f.row(y)).collect();
        let (means, spreads) = (mean.row_mut(y), spreads.row_mut(y));
        for x in 0..w {
            values.clear();
            values.extend(rows.iter().map(|r| r[x].to_f32()).filter(|v| v.is_finite()));
            if values.is_empty() {
                continue;
            }
            let middle = values.len() / 2;
            let median = *values.select_nth_unstable_by(middle, f32::total_cmp).1;
            values.iter_mut().for_each(|v| *v = (*v - median).abs());
            means[x] = T::level(median);
            spreads[x] = MEAN_PER_MEDIAN * *values.select_nth_unstable_by(middle, f32::total_cmp).1;
        }
    }
    for y in 0..h {
        let rows = y.saturating_sub(reach)..(y + reach + 1).min(h);
        for (x, deviation) in deviation.row_mut(y).iter_mut().enumerate() {
            if spreads.row(y)[x].is_nan() {
                continue;
            }
            let columns = x.saturating_sub(reach)..(x + reach + 1).min(w);
            let near = rows.clone().flat_map(|y| &spreads.row(y)[columns.clone()]).filter(|v| !v.is_nan());
            let (n, sum) = near.fold((0.0f32, 0.0f32), |(n, sum), v| (n + 1.0, sum + v));
            *deviation = T::level(sum / n);
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
