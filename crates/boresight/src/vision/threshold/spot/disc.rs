//! Sums of a response over a disc with a soft edge, many pixels side by side; the discs that a centroid may be taken in, and what each makes of noise and of light.
//!
//! Symbols: K the kernel of the response, p a place in the disc, px; r distance from the disc's middle, px; the weight of a pixel is 1 up to radius - 1/2, falls to 0 at radius + 1/2 and does so evenly, so that what enters and leaves as
//! the disc moves does so steadily.

use crate::Image;
use crate::vision::gaussian::WIDTH_PER_DEVIATION;
use crate::vision::threshold::boxes::Boxes;
use crate::vision::threshold::lanes::around;
use fearless_simd::prelude::*;
use fearless_simd::{Level, dispatch, f64x4};
use nalgebra::Vector2;

/// Sums of the positive response over a disc.
pub(super) struct Moments {
    pub(super) sum: f64,
    pub(super) moment: Vector2<f64>,
    /// What the moment gains as the disc moves by 1 px, by what enters and leaves: of half the response times the distance, where the disc's edge is soft.
    pub(super) edge: Vector2<f64>,
}

/// The pixels of row `y` from column `from` to `to`, both included, as far as they are in the image, and the column of the first.
#[inline(always)]
pub(super) fn part<T: Copy>(image: &Image<T>, y: i64, from: i64, to: i64) -> (i64, &[T]) {
    if !(0..image.height() as i64).contains(&y) {
        return (from, &[]);
    }
    let first = from.max(0);
    let end = (to + 1).min(image.width() as i64).max(first);
    (first, image.row(y as usize).get(first as usize..end as usize).unwrap_or(&[]))
}

/// The sums over the disc around `c`, about `c`.
pub(super) fn moments(response: &Image<f32>, radius: usize, c: Vector2<f64>) -> Moments {
    dispatch!(Level::new(), simd => moments_vectors(simd, response, radius, c))
}

#[inline(always)]
fn moments_vectors<S: Simd>(simd: S, response: &Image<f32>, radius: usize, c: Vector2<f64>) -> Moments {
    let reach = radius as f64 + 0.5;
    let splat = |v| f64x4::splat(simd, v);
    let (zero, one, half, outer) = (splat(0.0), splat(1.0), splat(0.5), splat(reach));
    let [mut sum, mut x, mut y, mut edge] = [zero; 4];
    around(simd, response, reach, c, |d, px, py| {
        let r = (px * px + py * py).sqrt();
        let window = (outer - r).max(zero).min(one);
        // Neither outside nor inside.
        let soft = window.simd_lt(one).select(d * r, zero);
        edge += window.simd_gt(zero).select(half * soft, zero);
        let d = window * d;
        sum += d;
        x += d * px;
        y += d * py;
    });
    let moment = Vector2::new(x.reduce_sum(), y.reduce_sum());
    Moments { sum: sum.reduce_sum(), moment, edge: Vector2::repeat(edge.reduce_sum()) }
}

/// Diameter of a spot with its soft edge in units of its width at half height: 2.45 holds 98 % of a Gaussian's light.
pub const DIAMETER_PER_WIDTH: f64 = 2.45;

/// Least radius of a disc, px: in one of a pixel the centroid depends on where in its pixel a spot lies, by 0.02 to 0.2 px for deviations of 0.6 to 3 px, in one of two by 0.03 at most.
const LEAST_RADIUS: usize = 2;

/// Radii of the discs in units of the size.
const PARTS: [f64; 3] = [0.3, 0.4, 0.5];

/// A disc that a spot's centroid may be taken in.
#[derive(Clone, Copy, Debug)]
pub(super) struct Disc {
    /// Radius, px.
    pub(super) radius: usize,
    /// Σ_j (K * p_x)_j², px².
    pub(super) noise_gain: f64,
    /// Part that it holds of a spot's mass in the largest one.
    pub(super) share: f64,
}

/// The discs for spots of a size: half of it, and smaller ones for spots whose neighbour is near, down to 0.3 of it.
pub(super) fn discs(size_px: f64, smooth: usize, surround: usize) -> Vec<Disc> {
    let mut radii = PARTS.map(|part| ((part * size_px).floor() as usize).max(LEAST_RADIUS)).to_vec();
    radii.dedup();
    let share = shares(size_px, radii[radii.len() - 1], smooth, surround);
    let disc = |radius| Disc { radius, noise_gain: noise_gain(radius, smooth, surround), share: share(radius) };
    radii.into_iter().map(disc).collect()
}

/// Σ_j (K * p_x)_j² over all pixels j that the weights of a disc see.
fn noise_gain(radius: usize, smooth: usize, surround: usize) -> f64 {
    let reach = radius + 1 + (smooth - 1).max(surround / 2) + 1;
    let n = 2 * reach + 1;
    let mut weight = Image::filled(n, n, 0.0f32);
    let r = radius as i64 + 1;
    for (dx, dy) in (-r..=r).flat_map(|y| (-r..=r).map(move |x| (x, y))) {
        let (x, y) = (reach as i64 + dx, reach as i64 + dy);
        let window = (radius as f64 + 0.5 - (dx as f64).hypot(dy as f64)).clamp(0.0, 1.0);
        weight.row_mut(y as usize)[x as usize] = dx as f32 * window as f32;
    }
    // The kernel is symmetric, so filtering the weights is the transposed filter.
    let mut seen = Image::default();
    Boxes::new(smooth, surround).run(&weight, &mut seen);
    seen.as_slice().iter().map(|v| f64::from(*v).powi(2)).sum()
}

/// Light that is the product of its profiles along a row and along a column.
pub(super) fn fill_light(light: &mut Image<f32>, row: &[f64], column: &[f64]) {
    for (y, v) in column.iter().enumerate() {
        light.row_mut(y).iter_mut().zip(row).for_each(|(p, u)| *p = (u * v) as f32);
    }
}

/// Part of the positive response to a Gaussian spot that has this size with its soft edge, in the disc of radius `largest`, that lies in that of a radius. Of one whose size is its width at half height it is less.
fn shares(size_px: f64, largest: usize, smooth: usize, surround: usize) -> impl Fn(usize) -> f64 {
    let reach = largest + 1 + (smooth - 1).max(surround / 2) + 1;
    let scale = -0.5 * (DIAMETER_PER_WIDTH * WIDTH_PER_DEVIATION / size_px).powi(2);
    let profile: Vec<f64> = (0..=2 * reach).map(|i| (scale * (i as f64 - reach as f64).powi(2)).exp()).collect();
    let mut light = Image::filled(profile.len(), profile.len(), 0.0f32);
    fill_light(&mut light, &profile, &profile);
    let mut response = Image::default();
    Boxes::new(smooth, surround).run(&light, &mut response);
    let mass = move |radius| moments(&response, radius, Vector2::new(reach as f64, reach as f64)).sum;
    move |radius| {
        let share = mass(radius) / mass(largest);
        if share.is_finite() && share > 0.0 { share } else { 1.0 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The sums pixel by pixel.
    fn plain(response: &Image<f32>, radius: usize, c: Vector2<f64>) -> [f64; 4] {
        let mut sums = [0.0; 4];
        for (y, x) in (0..response.height()).flat_map(|y| (0..response.width()).map(move |x| (y, x))) {
            let from = Vector2::new(x as f64, y as f64) - c;
            let within = radius as f64 + 0.5 - from.norm();
            let d = f64::from(response.row(y)[x].max(0.0));
            let weight = within.clamp(0.0, 1.0);
            let edge = if weight > 0.0 && weight < 1.0 { 0.5 * d * from.norm() } else { 0.0 };
            for (sum, v) in sums.iter_mut().zip([weight * d, weight * d * from.x, weight * d * from.y, edge]) {
                *sum += v;
            }
        }
        sums
    }

    #[test]
    fn the_sums_are_those_over_the_whole_image_wherever_the_disc_lies() {
        let response = Image::from_vec(31, 20, (0..620).map(|i| ((i * 37) % 101) as f32 - 30.0).collect()).unwrap();
        for radius in [1, 2, 3, 7, 12] {
            for c in [[15.2, 9.7], [0.0, 0.0], [30.0, 19.0], [29.51, 0.49], [1.5, 18.5]] {
                let c = Vector2::from(c);
                let m = moments(&response, radius, c);
                let of = [m.sum, m.moment.x, m.moment.y, m.edge.x];
                for (ours, expected) in of.iter().zip(plain(&response, radius, c)) {
                    assert!((ours - expected).abs() < 1e-9 * (1.0 + expected.abs()), "{radius} {c} {ours} {expected}");
                }
            }
        }
    }
}
