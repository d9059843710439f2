//! Frames matched to a spot: what the detectors that look below the noise of a frame have in common.
//!
//! How: pixels as f32, those that are not finite with their left neighbour's value; where asked for less the mean over a square around; correlated with the
//! spot, or another profile the same along both axes, P of unit energy, Σ P² = 1, so that white noise keeps its deviation.
//! Source: the matched filter, D. O. North, Proc. IEEE 51, 1016 (1963). Limits: pixels nearer than 3 σ to the border see part of the spot.

use super::pixel::Pixel;
use crate::Image;

/// Half width of the square around, in σ: a target takes 4π / 16² = 5 % of its own energy out with its surroundings.
const SURROUND: f64 = 8.0;
/// Radius of the spot's kernel in σ: 3·10⁻⁴ of the energy is beyond.
const KERNEL: f64 = 4.0;
/// Deviation over the median of |r| of normal noise.
pub(super) const MAD: f32 = 1.4826;

/// The spot along one axis, Σ P² = 1.
pub(super) fn kernel(sigma_px: f64) -> Vec<f32> {
    let radius = (KERNEL * sigma_px).ceil() as i64;
    unit_energy((-radius..=radius).map(|i| (-0.5 * (i as f64 / sigma_px).powi(2)).exp()))
}

/// A profile along one axis, scaled to Σ P² = 1.
pub(super) fn unit_energy(profile: impl Iterator<Item = f64> + Clone) -> Vec<f32> {
    let energy = profile.clone().map(|v| v * v).sum::<f64>().sqrt();
    profile.map(|v| (v / energy) as f32).collect()
}

/// Half width of the square whose mean is taken out, px.
pub(super) fn half_surround(sigma_px: f64) -> usize {
    (SURROUND * sigma_px).ceil() as usize
}

/// Pixels as they are, what is not finite with its left neighbour's value.
pub(super) fn finite<T: Pixel>(image: &Image<T>, out: &mut [f32]) {
    let w = image.width();
    for y in 0..image.height() {
        let mut last = 0.0;
        for (o, v) in out[y * w..][..w].iter_mut().zip(image.row(y)) {
            let v = v.value_f32();
            last = if v.is_finite() { v } else { last };
            *o = last;
        }
    }
}

/// The middle value; 0 of none.
pub(super) fn median(values: &mut [f32]) -> f32 {
    if values.is_empty() {
        return 0.0;
    }
    let mid = values.len() / 2;
    *values.select_nth_unstable_by(mid, f32::total_cmp).1
}

/// Correlates with a profile of an odd number of pixels in x and y; beyond the image there is nothing. `out` has rows of `stride`.
pub(super) fn filter(raw: &[f32], w: usize, h: usize, kernel: &[f32], row: &mut [f32], stride: usize, out: &mut [f32]) {
    let r = kernel.len() / 2;
    for y in 0..h {
        let row = &mut row[..w];
        row.fill(0.0);
        for (k, &weight) in kernel.iter().enumerate() {
            if let Some(at) = (y + k).checked_sub(r).filter(|at| *at < h) {
                add_scaled(&raw[at * w..][..w], weight, row);
            }
        }
        let out = &mut out[y * stride..][..w];
        out.fill(0.0);
        for (k, &weight) in kernel.iter().enumerate() {
            // out[x] += weight row[x + k - r]
            let (from, to) = (k.saturating_sub(r).min(w), r.saturating_sub(k).min(w));
            let n = w - from.max(to);
            add_scaled(&row[from..][..n], weight, &mut out[to..][..n]);
        }
    }
}

/// Takes the mean over a square of half width `half` out of an image of width `w`, in place; at the border over what of it lies inside.
/// `means` holds an image, `sums` a row and one more.
pub(super) fn subtract_surround(image: &mut [f32], w: usize, half: usize, means: &mut [f32], sums: &mut [f64]) {
    for (row, means) in image.chunks_exact(w).zip(means.chunks_exact_mut(w)) {
        sums[0] = 0.0;
        for (i, v) in row.iter().enumerate() {
            sums[i + 1] = sums[i] + f64::from(*v);
        }
        for (i, mean) in means.iter_mut().enumerate() {
            let (from, to) = (i.saturating_sub(half), (i + half + 1).min(w));
            *mean = ((sums[to] - sums[from]) / (to - from) as f64) as f32;
        }
    }
    let h = image.len() / w;
    let sums = &mut sums[..w];
    sums.fill(0.0);
    let add = |y: usize, sign: f64, sums: &mut [f64]| {
        sums.iter_mut().zip(&means[y * w..][..w]).for_each(|(s, m)| *s += sign * f64::from(*m));
    };
    (0..half.min(h)).for_each(|y| add(y, 1.0, sums));
    for y in 0..h {
        if y + half < h {
            add(y + half, 1.0, sums);
        }
        if y > half {
            add(y - half - 1, -1.0, sums);
        }
        let n = ((y + half + 1).min(h) - y.saturating_sub(half)) as f64;
        for (v, s) in image[y * w..][..w].iter_mut().zip(sums.iter()) {
            *v -= (s / n) as f32;
        }
    }
}

widest! {
    pub(super) fn add_scaled(from: &[f32], by: f32, to: &mut [f32]) {
        for (t, &f) in to.iter_mut().zip(from) {
            *t += by * f;
        }
    }
}
