//! The discs that the centroid of a spot may be taken in, and what each makes of noise and of light.
//!
//! Symbols: K the kernel of the response, p a place in the disc, px; its weights as in [`super::disc`].

use super::disc::moments;
use crate::Image;
use crate::vision::threshold::boxes::Boxes;
use nalgebra::Vector2;

/// Diameter of a spot with its soft edge in units of its width at half height: 2.45 holds 98 % of a Gaussian's light.
pub const DIAMETER_PER_WIDTH: f64 = 2.45;
/// Width at half height of a Gaussian in units of its deviation.
const WIDTH_PER_DEVIATION: f64 = 2.354_82;

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

/// The discs for spots of a size: from half of the width at half height, 0.2 of the size, to the whole spot. In white noise the centroid of a Gaussian is known best in one of 0.3, three
/// quarters of the width, where its error is some 1.0 of the Cramér-Rao bound, 1.8 in that of half the size; one with a flat top needs its edges.
pub(super) fn discs(size_px: f64, largest: usize, smooth: usize, surround: usize) -> Vec<Disc> {
    let mut discs: Vec<Disc> = Vec::new();
    for part in [0.2, 0.25, 0.3, 0.4, 0.5] {
        let radius = ((part * size_px).round() as usize).clamp(1, largest);
        if discs.last().is_none_or(|d| d.radius < radius) {
            let noise_gain = noise_gain(radius, smooth, surround);
            discs.push(Disc { radius, noise_gain, share: share(size_px, radius, largest, smooth, surround) });
        }
    }
    discs
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

/// Part of the positive response to a Gaussian spot of this size in the disc of radius `largest` that lies in that of `radius`.
fn share(size_px: f64, radius: usize, largest: usize, smooth: usize, surround: usize) -> f64 {
    let reach = largest + 1 + (smooth - 1).max(surround / 2) + 1;
    let scale = -0.5 * (DIAMETER_PER_WIDTH * WIDTH_PER_DEVIATION / size_px).powi(2);
    let profile: Vec<f64> = (0..=2 * reach).map(|i| (scale * (i as f64 - reach as f64).powi(2)).exp()).collect();
    let light = profile.iter().flat_map(|y| profile.iter().map(move |x| (x * y) as f32)).collect();
    let Some(light) = Image::from_vec(profile.len(), profile.len(), light) else { return 1.0 };
    let mut response = Image::default();
    Boxes::new(smooth, surround).run(&light, &mut response);
    let mass = |radius| moments(&response, radius, Vector2::new(reach as f64, reach as f64)).sum;
    let share = mass(radius) / mass(largest);
    if share.is_finite() && share > 0.0 { share } else { 1.0 }
}
