//! Sums over a disc that the border of the frame cuts: of its pixels those count whose mirror image about the middle is in the frame as well.
//!
//! Source: our own. Of a spot at the border only what lies inside is seen, and the centroid of that lies too far in by the first moment of what is not. A window that is symmetric about the middle has no such part: where the
//! frame ends m px from the middle the window reaches m px to both sides, by parts of a pixel. What it costs is information, which the variance says: as the middle moves by 1 px, the far side moves by 2, so the centroid
//! follows the window more than in the whole disc. Symbols: m distance of the frame's end, px; w weight of a pixel.
//! Limits: the response near the border is not that of the whole spot (`spot/unseen.rs`). Plain loops, since few spots lie there.

use super::disc::{Moments, moments as whole_moments};
use crate::Image;
use nalgebra::Vector2;

/// Whether pixels of the disc of that radius around `c` would lie outside.
pub(super) fn cuts(response: &Image<f32>, radius: usize, c: Vector2<f64>) -> bool {
    let reach = radius as f64 + 0.5;
    let inside = |v: f64, size: usize| v >= reach && v + reach <= size as f64 - 1.0;
    !(inside(c.x, response.width()) && inside(c.y, response.height()))
}

/// The sums over the disc around `c`, where the border cuts it over the part that is symmetric about `c`.
pub(super) fn moments(response: &Image<f32>, radius: usize, c: Vector2<f64>) -> Moments {
    if !cuts(response, radius, c) {
        return whole_moments(response, radius, c);
    }
    let reach = radius as f64 + 0.5;
    let columns = Strip::new(c.x, reach, response.width());
    let rows = Strip::new(c.y, reach, response.height());
    let mut of = Moments { sum: 0.0, moment: Vector2::zeros(), edge: Vector2::zeros() };
    for y in rows.pixels.clone() {
        let (wy, growth_y, pixels) = (rows.weight(y), rows.growth(y), response.row(y));
        let py = y as f64 - c.y;
        for x in columns.pixels.clone() {
            let (wx, px) = (columns.weight(x), x as f64 - c.x);
            let r = px.hypot(py);
            let disc = (reach - r).clamp(0.0, 1.0);
            let d = f64::from(pixels[x].max(0.0));
            of.sum += wx * wy * disc * d;
            of.moment += wx * wy * disc * d * Vector2::new(px, py);
            of.edge += disc * d * Vector2::new(wy * columns.growth(x) * px, wx * growth_y * py);
            if disc > 0.0 && disc < 1.0 {
                of.edge += wx * wy * d / r * Vector2::new(px * px, py * py);
            }
        }
    }
    of
}

/// The rows or columns of a window that is symmetric about `c`.
struct Strip {
    c: f64,
    /// Half its width, px.
    m: f64,
    /// 1 where the frame's nearer end lies before `c`, -1 where behind.
    side: f64,
    pixels: std::ops::Range<usize>,
}

impl Strip {
    fn new(c: f64, reach: f64, size: usize) -> Self {
        let (before, behind) = (c + 0.5, size as f64 - 0.5 - c);
        // Farther out nothing is in the disc, whatever its part in the strip.
        let m = before.min(behind).min(reach + 0.5);
        let side = if before < behind { 1.0 } else { -1.0 };
        let first = (c - m - 0.5).ceil().max(0.0) as usize;
        let end = ((c + m + 0.5).floor() + 1.0).clamp(0.0, size as f64) as usize;
        Self { c, m, side, pixels: first..end }
    }

    /// Part of pixel i in the strip.
    fn weight(&self, i: usize) -> f64 {
        (self.m + 0.5 - (i as f64 - self.c).abs()).clamp(0.0, 1.0)
    }

    /// By how much that part grows as the middle moves by 1 px.
    fn growth(&self, i: usize) -> f64 {
        let weight = self.weight(i);
        if weight > 0.0 && weight < 1.0 { 2.0 * self.side } else { 0.0 }
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    /// A Gaussian of the deviation 2.3 px.
    pub fn light(side: usize, at: Vector2<f64>) -> impl Fn(usize) -> f64 {
        move |i| {
            (-0.5 * (Vector2::new((i % side) as f64, (i / side) as f64) - at).norm_squared() / 2.3f64.powi(2)).exp()
        }
    }

    #[test]
    fn a_spot_that_the_border_cuts_has_its_centroid_in_its_middle() {
        for at in [[1.4, 20.0], [2.0, 20.3], [4.3, 37.9], [37.6, 2.2], [20.2, 38.1]].map(Vector2::from) {
            let response = Image::from_vec(40, 40, (0..1600).map(light(40, at)).map(|v| v as f32).collect()).unwrap();
            let of = |m: Moments| (m.moment / m.sum).norm();
            let (ours, whole) = (of(moments(&response, 7, at)), of(whole_moments(&response, 7, at)));
            assert!(ours < 0.02 && whole > 0.1, "{at} {ours} {whole}");
        }
    }

    #[test]
    fn what_enters_and_leaves_as_the_middle_moves_is_the_derivative() {
        let response = Image::from_vec(30, 30, (0..900).map(|i| ((i * 37) % 101) as f32).collect()).unwrap();
        for c in
            [[1.23, 14.1], [14.2, 2.37], [2.61, 1.42], [27.13, 26.6], [5.32, 14.1], [14.2, 23.63]].map(Vector2::from)
        {
            let here = moments(&response, 5, c);
            for axis in 0..2 {
                let step = Vector2::ith(axis, 1e-6);
                let [after, before] = [c + step, c - step].map(|c| moments(&response, 5, c).moment[axis]);
                let expected = (after - before) / 2e-6 + here.sum;
                assert!((here.edge[axis] - expected).abs() < 1e-4 * here.sum, "{c} {} {expected}", here.edge[axis]);
            }
        }
    }
}
