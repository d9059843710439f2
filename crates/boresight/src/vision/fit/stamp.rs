//! The pixels that a spot is fitted to: a window of a frame on the stack, with the noise of each pixel.

use super::noise::SensorNoise;
use super::profile::SIDE;
use crate::Image;
use crate::vision::pixel::Pixel;
use nalgebra::Vector2;

/// Most pixels of a window.
const AREA: usize = SIDE * SIDE;

/// A window of at most 21 x 21 pixels, row by row, cut where the frame ends.
#[derive(Clone, Copy, Debug)]
pub struct Stamp {
    pub(super) left: f64,
    pub(super) top: f64,
    pub(super) width: usize,
    pub(super) height: usize,
    /// Values, counts; 0 where there is none.
    pub(super) value: [f64; AREA],
    /// Variance of a pixel without light, counts².
    pub(super) read: [f64; AREA],
    /// 1 where a pixel counts, else 0.
    pub(super) seen: [f64; AREA],
    pub(super) gain: f64,
    pub(super) offset: f64,
}

impl Stamp {
    /// Cuts the window of `half` pixels (at most 10) to all sides of the pixel at `centre` (px) out of a frame.
    ///
    /// Pixels that are no number, beyond the largest whole number of their type, or whose variance in `variances` (counts², as large as the frame) is no
    /// number at or above 0, do not count. `None` if less than 3 columns or rows are inside.
    pub fn cut<T: Pixel>(
        image: &Image<T>,
        centre: Vector2<f64>,
        half: usize,
        noise: &SensorNoise,
        variances: Option<&Image<f32>>,
    ) -> Option<Self> {
        let (w, h) = (image.width() as f64, image.height() as f64);
        let half = half.min(SIDE / 2) as f64;
        let (cx, cy) = (centre.x.round(), centre.y.round());
        if !(noise.is_possible() && cx.abs() < 1e9 && cy.abs() < 1e9) {
            return None;
        }
        let (left, top) = ((cx - half).max(0.0), (cy - half).max(0.0));
        let (right, bottom) = ((cx + half).min(w - 1.0), (cy + half).min(h - 1.0));
        if right - left < 2.0 || bottom - top < 2.0 {
            return None;
        }
        let (width, height) = ((right - left) as usize + 1, (bottom - top) as usize + 1);
        let mut stamp = Self {
            left,
            top,
            width,
            height,
            value: [0.0; AREA],
            read: [noise.read_variance; AREA],
            seen: [0.0; AREA],
            gain: noise.gain,
            offset: noise.offset,
        };
        let (x0, y0) = (left as usize, top as usize);
        let full = T::band(0.0, f64::INFINITY).map_or(f64::INFINITY, |(_, most)| most.value());
        for y in 0..height {
            let row = image.row(y0 + y).get(x0..x0 + width)?;
            let at = y * width;
            for (x, pixel) in row.iter().enumerate() {
                let v = pixel.value();
                // A sensor has no larger values, and sums of their squares stay finite.
                if v.abs() < 1e15 && v < full {
                    stamp.value[at + x] = v;
                    stamp.seen[at + x] = 1.0;
                }
            }
            if let Some(map) = variances {
                for x in 0..width {
                    let v = map.get(x0 + x, y0 + y).map_or(f64::NAN, f64::from);
                    if v >= 0.0 && v.is_finite() {
                        stamp.read[at + x] = v;
                    } else {
                        (stamp.value[at + x], stamp.seen[at + x]) = (0.0, 0.0);
                    }
                }
            }
        }
        Some(stamp)
    }

    /// Number of pixels that count.
    pub fn n_seen(&self) -> usize {
        self.seen[..self.width * self.height].iter().filter(|s| **s > 0.0).count()
    }

    /// How much brighter than the border the 3 x 3 pixels around a place in the frame are, counts; 0 where none of them counts.
    pub(super) fn contrast_at(&self, position: Vector2<f64>) -> f64 {
        let (x, y) = ((position.x - self.left).round(), (position.y - self.top).round());
        let (mut sum, mut n) = (0.0, 0.0);
        for (dx, dy) in (-1..=1).flat_map(|dy| (-1..=1).map(move |dx| (f64::from(dx), f64::from(dy)))) {
            let (x, y) = (x + dx, y + dy);
            if x >= 0.0 && y >= 0.0 && x < self.width as f64 && y < self.height as f64 {
                let i = y as usize * self.width + x as usize;
                sum += self.value[i];
                n += self.seen[i];
            }
        }
        if n > 0.0 { sum / n - self.border_mean() } else { 0.0 }
    }

    /// Mean of the outermost pixels that count, counts.
    pub(super) fn border_mean(&self) -> f64 {
        let (mut sum, mut n) = (0.0, 0.0);
        for y in 0..self.height {
            let inner = y > 0 && y + 1 < self.height;
            let step = if inner { (self.width - 1).max(1) } else { 1 };
            for x in (0..self.width).step_by(step) {
                let i = y * self.width + x;
                sum += self.value[i];
                n += self.seen[i];
            }
        }
        if n > 0.0 { sum / n } else { 0.0 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_window_ends_where_the_frame_does_and_leaves_out_what_is_no_number() {
        let mut image = Image::filled(12, 9, 5.0f32);
        image.row_mut(1)[0] = f32::NAN;
        image.row_mut(0)[2] = f32::INFINITY;
        let noise = SensorNoise::constant(1.0);
        let stamp = Stamp::cut(&image, Vector2::new(0.4, 0.2), 4, &noise, None).unwrap();
        assert_eq!((stamp.width, stamp.height, stamp.left, stamp.top), (5, 5, 0.0, 0.0));
        assert_eq!((stamp.n_seen(), stamp.border_mean()), (23, 5.0));
        assert!(Stamp::cut(&image, Vector2::new(40.0, 2.0), 4, &noise, None).is_none());
        assert!(Stamp::cut(&image, Vector2::new(f64::NAN, 2.0), 4, &noise, None).is_none());
        assert!(Stamp::cut(&image, Vector2::new(4.0, 2.0), 4, &SensorNoise::constant(-1.0), None).is_none());
    }

    #[test]
    fn pixels_without_a_variance_and_full_ones_do_not_count() {
        let mut image = Image::filled(9, 9, 7u8);
        image.row_mut(4)[4] = 255;
        let mut map = Image::filled(9, 9, 2.0f32);
        map.row_mut(0)[0] = f32::NAN;
        let stamp = Stamp::cut(&image, Vector2::new(4.0, 4.0), 4, &SensorNoise::constant(1.0), Some(&map)).unwrap();
        assert_eq!((stamp.n_seen(), stamp.read[1]), (79, 2.0));
    }
}
