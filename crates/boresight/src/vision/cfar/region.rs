//! The region of a detection: the pixels connected to its peak that reach half of its height.
//!
//! The pixels beyond half of the peak's height over the ground, 8-connected within a disc, on the next finer level smoothed (so that
//! noise does not fray the region of a dim target), for detections of the finest level on the pixels themselves.
//! Limits: a target that touches another as bright is cut by the disc only.

use super::pyramid::View;
use crate::vision::pixel::Pixel;

/// Radius of the disc, pixels of the detection's level, and what is added to it, pixels of the region's.
const RADIUS: i32 = 3;
const MARGIN: i32 = 2;
/// Part of the peak's height that a pixel of the region has at least.
const HALF: f32 = 0.5;

/// What a region is grown from.
#[derive(Clone, Copy, Debug)]
pub(super) struct Seed {
    /// Peak, pixels of the region's level.
    pub(super) x: i32,
    pub(super) y: i32,
    /// Pixels of the region's level in one of the detection's.
    pub(super) zoom: i32,
    /// Whether the level is taken smoothed.
    pub(super) smooth: bool,
    /// +1 for a bright target, -1 for a dark one.
    pub(super) sign: f32,
    /// Value of the ground, counts.
    pub(super) ground: f32,
}

/// A region; keeps its memory.
#[derive(Clone, Debug, Default)]
pub(super) struct Region {
    /// Its pixels, of the region's level, in the order they were found.
    pub(super) pixels: Vec<(i32, i32)>,
    seen: Vec<bool>,
    /// The largest value (the smallest of a dark target), counts.
    pub(super) peak: f32,
    /// Sum of the contrasts to the ground, counts.
    pub(super) sum: f64,
    /// Mean place weighed by the contrast to the ground, pixels of the region's level.
    pub(super) centre: (f64, f64),
}

impl Region {
    /// Grows the region on a level.
    pub(super) fn grow<P: Pixel>(&mut self, on: View<'_, P>, seed: &Seed) {
        let radius = RADIUS * seed.zoom + MARGIN;
        let side = 2 * radius + 1;
        self.seen.clear();
        self.seen.resize((side * side) as usize, false);
        self.pixels.clear();
        let value = |x: i32, y: i32| on.value(x, y, seed.smooth);
        // The strongest pixel near the peak.
        let (mut best, mut start) = (f32::NEG_INFINITY, (seed.x, seed.y));
        for y in seed.y - seed.zoom..=seed.y + seed.zoom {
            for x in seed.x - seed.zoom..=seed.x + seed.zoom {
                if let Some(v) = value(x, y).filter(|v| seed.sign * v > best) {
                    (best, start) = (seed.sign * v, (x, y));
                }
            }
        }
        let least = HALF * (best - seed.sign * seed.ground);
        self.pixels.push(start);
        let index = |x: i32, y: i32| ((y - seed.y + radius) * side + x - seed.x + radius) as usize;
        self.seen[index(start.0, start.1)] = true;
        let mut next = 0;
        while let Some(&(px, py)) = self.pixels.get(next) {
            next += 1;
            for (x, y) in (-1..=1).flat_map(|dy| (-1..=1).map(move |dx| (px + dx, py + dy))) {
                let (dx, dy) = (x - seed.x, y - seed.y);
                if dx * dx + dy * dy > radius * radius || self.seen[index(x, y)] {
                    continue;
                }
                self.seen[index(x, y)] = true;
                if value(x, y).is_some_and(|v| seed.sign * (v - seed.ground) > least) {
                    self.pixels.push((x, y));
                }
            }
        }
        let (mut sum, mut sx, mut sy) = (0.0f64, 0.0, 0.0);
        for &(x, y) in &self.pixels {
            let w = f64::from(seed.sign * (value(x, y).unwrap_or(0.0) - seed.ground)).max(1e-12);
            sum += w;
            sx += w * f64::from(x);
            sy += w * f64::from(y);
        }
        self.sum = sum;
        self.centre = (sx / sum, sy / sum);
        self.peak = seed.sign * best;
    }

    /// Left, top, right and bottom pixel.
    pub(super) fn bounds(&self) -> [i32; 4] {
        self.pixels.iter().fold([i32::MAX, i32::MAX, i32::MIN, i32::MIN], |[l, t, r, b], &(x, y)| {
            [l.min(x), t.min(y), r.max(x), b.max(y)]
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Image;

    #[test]
    fn a_block_of_pixels_is_its_own_region_up_to_the_border() {
        let mut image = Image::filled(20, 20, 10u8);
        for y in 0..3 {
            image.row_mut(y)[4..8].fill(50);
        }
        image.row_mut(10)[4] = 60;
        let mut region = Region::default();
        region.grow(View::of(&image), &Seed { x: 5, y: 1, zoom: 1, smooth: false, sign: 1.0, ground: 10.0 });
        assert_eq!((region.pixels.len(), region.bounds()), (12, [4, 0, 7, 2]));
        assert!((region.centre.0 - 5.5).abs() < 1e-9 && (region.centre.1 - 1.0).abs() < 1e-9);
        assert_eq!(region.peak, 50.0);
        assert!((region.sum - 480.0).abs() < 1e-6);
    }
}
