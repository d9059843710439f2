//! The pixels of a square, four side by side: what moments and second moments are summed over.

use crate::Image;
use fearless_simd::prelude::*;
use fearless_simd::{f32x8, f64x4};
use nalgebra::Vector2;

/// Pixels of a row that are read at once.
const LANES: usize = 8;

/// Hands over the positive response in the square of so many pixels to each side of `c`, four pixels of a row side by side, with their places from `c`, px. What it hands over beyond the square lies farther away
/// than `reach`.
#[inline(always)]
pub fn around<S: Simd>(
    simd: S,
    response: &Image<f32>,
    reach: f64,
    c: Vector2<f64>,
    mut take: impl FnMut(f64x4<S>, f64x4<S>, f64x4<S>),
) {
    let ((left, right), (top, bottom)) = (span(c.x, reach, response.width()), span(c.y, reach, response.height()));
    let splat = |v| f64x4::splat(simd, v);
    let steps = f64x4::from_slice(simd, &[0.0, 1.0, 2.0, 3.0]);
    for row in top..bottom {
        let pixels = response.row(row);
        let py = splat(row as f64 - c.y);
        for at in (left..right).step_by(LANES) {
            let read = match pixels.get(at..at + LANES) {
                Some(lanes) => f32x8::from_slice(simd, lanes),
                None => {
                    let mut lanes = [0.0f32; LANES];
                    let rest = &pixels[at..];
                    lanes[..rest.len()].copy_from_slice(rest);
                    f32x8::from_slice(simd, &lanes)
                }
            };
            let (low, high) = read.max(f32x8::splat(simd, 0.0)).widen();
            let px = steps + splat(at as f64 - c.x);
            // One place that takes, so that the compiler puts it here: called, it would be without this processor's vectors.
            for (d, px) in [(low, px), (high, px + splat(4.0))] {
                take(d, px, py);
            }
        }
    }
}

/// The pixels of a row or column of that size whose middles lie within `reach` of `c`: the first, and the one after the last.
fn span(c: f64, reach: f64, size: usize) -> (usize, usize) {
    ((c - reach).ceil().max(0.0) as usize, ((c + reach).floor() + 1.0).clamp(0.0, size as f64) as usize)
}
