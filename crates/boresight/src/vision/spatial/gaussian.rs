//! Gaussian filter: two one-dimensional passes, down the columns and along the row.
//!
//! Source: `docs/theory/image.md`, with the sampled Gaussian h(i) ∝ exp(-i² / (2 sigma²)), |i| <= r = floor(4
//! sigma + 1/2), summing to 1 (the same truncation as SciPy's `gaussian_filter`). Single precision inside: against the
//! exact result, u8 may differ by one count where that lies within 1e-4 of a tie, u16 within 0.05; f32 within 1e-6 of
//! the window's maximum. Symmetric pixels are added first, so a window of n costs (n + 1) / 2 products a pass.

use super::border::{Border, RowRing};
use super::pixel::SpatialPixel;
use crate::Image;

/// Radius of the kernel, px.
pub(super) fn radius_px(sigma_px: f64) -> usize {
    (4.0 * sigma_px + 0.5) as usize
}

/// The weights h(0), h(1), ..., h(r) of a Gaussian, summing to 1 over -r..=r.
pub(super) fn weights(sigma_px: f64) -> Vec<f64> {
    let r = radius_px(sigma_px);
    let raw: Vec<f64> = (0..=r).map(|i| (-0.5 * (i as f64 / sigma_px).powi(2)).exp()).collect();
    let sum = raw.iter().skip(1).fold(raw.first().copied().unwrap_or(1.0), |s, v| s + 2.0 * v);
    raw.into_iter().map(|v| v / sum).collect()
}

/// The weights and the rows of the window.
#[derive(Clone, Debug)]
pub(super) struct Gaussian {
    weights: Vec<f32>,
    ring: RowRing<f32>,
    columns: Vec<f32>,
    sum: Vec<f32>,
}

impl Gaussian {
    pub(super) fn new(sigma_px: f64) -> Self {
        let weights = weights(sigma_px).into_iter().map(|v| v as f32).collect();
        Self { weights, ring: RowRing::default(), columns: Vec::new(), sum: Vec::new() }
    }

    pub(super) fn begin(&mut self, width: usize, height: usize, border: Border) {
        let r = self.weights.len() - 1;
        self.ring.begin(width, height, r, border, 0.0);
        self.columns.clear();
        self.columns.resize(self.ring.stride(), 0.0);
        self.sum.clear();
        self.sum.resize(width, 0.0);
    }

    pub(super) fn row<T: SpatialPixel>(&mut self, src: &Image<T>, y: usize, out: &mut [T]) {
        self.ring.read(y, |i, keys| T::to_f32_row(src.row(i), keys));
        let (w, r, y) = (out.len(), self.weights.len() - 1, y as isize);
        let (first, rest) = (self.weights[0], &self.weights[1..]);
        scale(self.ring.row(y), first, &mut self.columns);
        for (i, &h) in (1isize..).zip(rest) {
            add_pair(self.ring.row(y - i), self.ring.row(y + i), h, &mut self.columns);
        }
        scale(&self.columns[r..r + w], first, &mut self.sum);
        for (i, &h) in (1usize..).zip(rest) {
            add_pair(&self.columns[r - i..r - i + w], &self.columns[r + i..r + i + w], h, &mut self.sum);
        }
        round(&self.sum, out);
    }
}

widest! {
    fn scale(from: &[f32], h: f32, to: &mut [f32]) {
        for (t, &f) in to.iter_mut().zip(from) {
            *t = f * h;
        }
    }
}

widest! {
    fn add_pair(a: &[f32], b: &[f32], h: f32, to: &mut [f32]) {
        for ((t, &a), &b) in to.iter_mut().zip(a).zip(b) {
            *t += (a + b) * h;
        }
    }
}

widest! {
    fn round<T: SpatialPixel>(from: &[f32], to: &mut [T]) {
        for (t, &f) in to.iter_mut().zip(from) {
            *t = T::from_f32(f);
        }
    }
}
