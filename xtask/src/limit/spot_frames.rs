//! Frames of pixel-integrated spots with light's and read noise: the shares of the pixels by Simpson's rule, so that they share nothing with the fit.

use anyhow::Result;
use boresight::Image;
use boresight::vision::fit::SensorNoise;
use nalgebra::Vector2;
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, Poisson, StandardNormal};

pub const SIGMA: f64 = 1.3;

/// Noise and the height of a peak that stands `snr` deviations of it high.
pub fn noise_and_height(light: bool, snr: f64) -> (SensorNoise, f64) {
    if !light {
        return (SensorNoise::constant(16.0), 4.0 * snr);
    }
    // Gain 2, 10 electrons of ground, read noise of 1 electron: A² = snr² (A + 11).
    let noise = SensorNoise { read_variance: 4.0, gain: 2.0, offset: 100.0 };
    let (s, rest) = (snr * snr, 11.0);
    (noise, 2.0 * 0.5 * (s + (s * s + 4.0 * s * rest).sqrt()))
}

/// Share of a Gaussian of deviation [`SIGMA`] at `c` that falls on pixel `i`.
fn share(i: f64, c: f64) -> f64 {
    const STEPS: usize = 16;
    let h = 1.0 / STEPS as f64;
    let density = |k: usize| (-0.5 * ((i - 0.5 + h * k as f64 - c) / SIGMA).powi(2)).exp();
    let weight = |k: usize| if k == 0 || k == STEPS { 1.0 } else { 2.0 + 2.0 * (k % 2) as f64 };
    (0..=STEPS).map(|k| weight(k) * density(k)).sum::<f64>() * h / 3.0
}

/// Means of the pixels: a ground and spots of this peak height.
pub fn frame_of([w, h]: [usize; 2], spots: &[Vector2<f64>], height: f64, ground: f64) -> Vec<f64> {
    let mut out = vec![ground; w * h];
    for p in spots {
        let near = |c: f64, n: usize| ((c - 9.0).max(0.0) as usize)..((c + 10.0).max(0.0) as usize).min(n);
        let columns: Vec<(usize, f64)> = near(p.x, w).map(|x| (x, share(x as f64, p.x))).collect();
        for y in near(p.y, h) {
            let row = height * share(y as f64, p.y);
            columns.iter().for_each(|(x, s)| out[y * w + x] += row * s);
        }
    }
    out
}

/// A frame of these means with its noise.
pub fn image_of([w, h]: [usize; 2], mean: &[f64], noise: &SensorNoise, rng: &mut ChaCha8Rng) -> Result<Image<f32>> {
    let read = noise.read_variance.sqrt();
    let values = mean
        .iter()
        .map(|&m| {
            let light = if noise.gain > 0.0 {
                noise.offset + noise.gain * Poisson::new((m - noise.offset) / noise.gain)?.sample(rng)
            } else {
                m
            };
            Ok((light + read * rng.sample::<f64, _>(StandardNormal)) as f32)
        })
        .collect::<Result<Vec<f32>>>()?;
    Ok(Image::from_vec(w, h, values).unwrap_or_default())
}
