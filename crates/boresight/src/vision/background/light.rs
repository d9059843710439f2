//! How the light of a frame differs from the background's: a gain and an offset, robust against moving targets.
//!
//! On a grid of pixels the differences from the model's mean are split into two groups, for the darker and the brighter
//! half of the grid; the medians of both, taken again near the first line, give the line difference = offset + (gain - 1) * mean. Up to half of each
//! group may be covered by targets. Limits: gain 0.5 to 1.9; where dark and bright differ by less than 16 deviations the
//! gain stays 1 (the offset alone is well known). Our own method; cost: one pixel in 64.

use super::model::BackgroundPixel;
use crate::Image;
use crate::vision::middle::upper_middle;

/// The grid on which the light is estimated takes one pixel in 8 both ways.
pub(super) const GRID_PX: usize = 8;

/// Light of a frame against the model: v = gain * m + offset.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Light {
    pub(super) gain: f32,
    pub(super) offset: f32,
}

/// No change of light.
pub(super) const SAME: Light = Light { gain: 1.0, offset: 0.0 };

/// Pairs (mean, difference) of the grid, with memory kept.
#[derive(Clone, Debug, Default)]
pub(super) struct Grid {
    pairs: Vec<(f32, f32)>,
    work: Vec<f32>,
    /// Means and differences of the pairs near the line, and the same of the dark ones with the bright ones behind them.
    near: [Vec<f32>; 2],
    sides: [Vec<f32>; 2],
}

impl Grid {
    pub(super) fn clear(&mut self) {
        self.pairs.clear();
    }

    pub(super) fn push(&mut self, mean: f32, difference: f32) {
        if mean.is_finite() && difference.is_finite() {
            self.pairs.push((mean, difference));
        }
    }

    /// The light; `deviation` is the typical deviation of a pixel, counts.
    pub(super) fn light(&mut self, deviation: f32) -> Light {
        // Too few pixels to tell light from targets.
        if self.pairs.len() < 64 {
            return SAME;
        }
        let mut light = self.fit(f32::INFINITY, SAME, deviation);
        // Covered pixels on one side shift a median: fit again without those far from the line.
        for _ in 0..2 {
            let residual = |p: &(f32, f32)| (p.1 - line(light, p.0)).abs();
            self.work.clear();
            self.work.extend(self.pairs.iter().map(residual));
            let Some(mad) = upper_middle(&self.work) else { return light };
            light = self.fit(2.0 * 1.4826 * mad.max(deviation), light, deviation);
        }
        light
    }

    /// The line through the medians of the dark and the bright pairs within `reach` of the line before.
    fn fit(&mut self, reach: f32, before: Light, deviation: f32) -> Light {
        let Self { pairs, near: [near_means, near_differences], sides: [means, differences], .. } = self;
        for v in [&mut *near_means, &mut *near_differences, &mut *means, &mut *differences] {
            v.resize(pairs.len(), 0.0);
        }
        // Places are computed and not branched to: which pairs are near, and which bright, cannot be foreseen.
        let mut n = 0;
        for &(m, d) in pairs.iter() {
            (near_means[n], near_differences[n]) = (m, d);
            n += usize::from((d - line(before, m)).abs() <= reach);
        }
        let Some(split) = upper_middle(&near_means[..n]) else { return before };
        let mut n_dark = 0;
        for (i, (m, d)) in near_means[..n].iter().zip(&near_differences[..n]).enumerate() {
            let is_dark = *m <= split;
            let at = if is_dark { n_dark } else { n - 1 - (i - n_dark) };
            (means[at], differences[at]) = (*m, *d);
            n_dark += usize::from(is_dark);
        }
        let side =
            |of: std::ops::Range<usize>| Some((upper_middle(&means[of.clone()])?, upper_middle(&differences[of])?));
        let (dark, bright) = (side(0..n_dark), side(n_dark..n));
        let Some((m0, d0)) = dark else { return before };
        let Some((m1, d1)) = bright else { return Light { gain: 1.0, offset: d0 } };
        if m1 - m0 < 16.0 * deviation.max(f32::MIN_POSITIVE) {
            return Light { gain: 1.0, offset: 0.5 * (d0 + d1) };
        }
        let slope = ((d1 - d0) / (m1 - m0)).clamp(-0.5, 0.9);
        Light { gain: 1.0 + slope, offset: d0 - slope * m0 }
    }
}

/// The difference that the light gives at a mean.
fn line(light: Light, mean: f32) -> f32 {
    (light.gain - 1.0) * mean + light.offset
}

/// Least change of light that is taken off frames which a background is learnt from, deviations of a pixel: less widens its noise by little.
const LEAST_CHANGE: f32 = 3.0;
/// Mean absolute deviation of normal noise over the third quartile of the absolute difference of two values with it: 0.7979 / (1.1503 · √2).
const NOISE_OF_PAIRS: f32 = 0.4905;

/// The frames in the light of the one that is brighter than half of them, where that changes among them; `None` where it hardly does.
///
/// The grid has one pixel in `step` both ways; a change by less than `least`, counts, is none.
pub(crate) fn in_one_light<T: BackgroundPixel>(frames: &[&Image<T>], step: usize, least: f32) -> Option<Vec<Image<T>>> {
    let first = frames.first().filter(|_| frames.len() > 1)?;
    let at = |i: &Image<T>, x: usize, y: usize| i.row(y)[x].to_f32();
    let places = || {
        let (w, h) = (first.width(), first.height());
        (step / 2..h).step_by(step).flat_map(move |y| (step / 2..w).step_by(step).map(move |x| (x, y)))
    };
    let mut grid = Grid::default();
    let mut by_light: Vec<(f32, usize)> = Vec::with_capacity(frames.len());
    for (k, frame) in frames.iter().enumerate() {
        grid.work.clear();
        grid.work.extend(places().map(|(x, y)| at(frame, x, y)).filter(|v| v.is_finite()));
        by_light.push((upper_middle(&grid.work)?, k));
    }
    by_light.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    let reference = frames[by_light[frames.len() / 2].1];
    let mut values: Vec<f32> = places().map(|(x, y)| at(reference, x, y)).filter(|v| v.is_finite()).collect();
    let quartiles = [values.len() / 4, 3 * values.len() / 4].map(|k| {
        let k = k.min(values.len().saturating_sub(1));
        if values.is_empty() { 0.0 } else { *values.select_nth_unstable_by(k, f32::total_cmp).1 }
    });
    // The noise is what the light leaves of the differences, in three of four frames, so that none that happens to be like the reference says it.
    let mut lights_of = |noise: f32| -> (Vec<Light>, Vec<f32>) {
        let of_frame = |frame: &&Image<T>| {
            grid.clear();
            places().for_each(|(x, y)| {
                let m = at(reference, x, y);
                grid.push(m, at(frame, x, y) - m);
            });
            let light = grid.light(noise);
            let Grid { pairs, work, .. } = &mut grid;
            work.clear();
            work.extend(pairs.iter().map(|p| (p.1 - line(light, p.0)).abs()));
            let third = 3 * work.len() / 4;
            let left = if third < work.len() { *work.select_nth_unstable_by(third, f32::total_cmp).1 } else { 0.0 };
            (light, NOISE_OF_PAIRS * left)
        };
        frames.iter().map(of_frame).unzip()
    };
    let (_, mut noises) = lights_of(T::NOISE_FLOOR);
    let (_, noise, _) = noises.select_nth_unstable_by(3 * frames.len() / 4, f32::total_cmp);
    let noise = noise.max(T::NOISE_FLOOR);
    let (lights, _) = lights_of(noise);
    let change = |light: &Light| quartiles.map(|m| line(*light, m).abs()).into_iter().fold(0.0, f32::max);
    if !lights.iter().any(|l| change(l) > least.max(LEAST_CHANGE * noise)) {
        return None;
    }
    let lit = |(frame, light): (&&Image<T>, &Light)| {
        let mut out = (*frame).clone();
        let back = |v: &mut T| *v = T::from_f32((v.to_f32() - light.offset) / light.gain);
        out.as_mut_slice().iter_mut().for_each(back);
        out
    };
    Some(frames.iter().zip(&lights).map(lit).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_of_a_light_that_falls_are_brought_to_one_and_others_are_left() {
        use rand::{RngExt, SeedableRng};
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(2);
        let ground: Vec<f32> = (0..128 * 96).map(|i| 40.0 + 150.0 * ((i * 7919 % 128) as f32 / 128.0)).collect();
        let mut frames = |falls_by: f32| -> Vec<Image<u8>> {
            (0..9)
                .map(|k| {
                    let light = 1.0 - falls_by * k as f32;
                    let pixels = ground.iter().map(|g| (light * g + 4.0 * rng.random::<f32>()) as u8);
                    Image::from_vec(128, 96, pixels.collect()).unwrap()
                })
                .collect()
        };
        let (steady, falling) = (frames(0.0), frames(0.05));
        assert!(in_one_light(&steady.iter().collect::<Vec<_>>(), 8, 0.0).is_none());
        let lit = in_one_light(&falling.iter().collect::<Vec<_>>(), 8, 0.0).unwrap();
        for k in 0..9 {
            let differences = lit[k].as_slice().iter().zip(falling[4].as_slice()).map(|(a, b)| a.abs_diff(*b));
            let mean = differences.map(f64::from).sum::<f64>() / (128.0 * 96.0);
            // Uniform noise of 4 counts in both: 4 / 3, and rounding.
            assert!(mean < 2.5, "frame {k}: {mean}");
        }
        assert!(in_one_light::<u8>(&[], 8, 0.0).is_none() && in_one_light(&[&falling[0]], 8, 0.0).is_none());
    }

    #[test]
    fn gain_and_offset_are_found_though_four_in_ten_pixels_are_covered() {
        let mut grid = Grid::default();
        for i in 0..4000u32 {
            let mean = (i * 37 % 200) as f32 + 20.0;
            let lit = 1.1 * mean - 4.0;
            // Covered pixels have any value; the rest have noise of +-1.
            let v = if i * 7919 % 10 < 4 { (i * 131 % 256) as f32 } else { lit + (i % 3) as f32 - 1.0 };
            grid.push(mean, v - mean);
        }
        let light = grid.light(1.0);
        for m in [30.0, 120.0, 210.0] {
            assert!((light.gain * m + light.offset - (1.1 * m - 4.0)).abs() < 2.0, "{light:?} at {m}");
        }
    }

    #[test]
    fn a_few_pixels_or_a_flat_scene_give_no_gain() {
        let mut grid = Grid::default();
        grid.push(10.0, 5.0);
        assert_eq!(grid.light(1.0), SAME);
        (0..100).for_each(|_| grid.push(10.0, 5.0));
        assert_eq!(grid.light(1.0), Light { gain: 1.0, offset: 5.0 });
    }
}
