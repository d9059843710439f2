//! The mean and the variance of each pixel over frames.

use super::grey::{range, values};
use crate::{Error, ErrorKind, Image, Pixels, Result};

/// Over 32 frames the ratio of white noise is 1 ± 0.18, and half of the pixels have to be above this. Light that drifts counts as well.
const DRIFTS: f64 = 2.0;

/// Running mean and variance of each pixel.
#[derive(Clone, Debug, Default)]
pub struct MeanMap {
    width: usize,
    height: usize,
    n: u32,
    mean: Vec<f64>,
    /// Sum of squares about the mean.
    spread: Vec<f64>,
    now: Vec<f32>,
    before: Vec<f32>,
    /// Frames in which a pixel was not what it was in the one before.
    changes: Vec<u16>,
    /// Sums of the magnitudes and of the squares of these changes.
    moved: Vec<[f32; 2]>,
    step: f32,
}

impl MeanMap {
    /// Takes a frame (B. P. Welford's sums).
    /// # Errors
    /// A colour frame, or one of another size than the first.
    pub fn push(&mut self, pixels: &Pixels) -> Result<()> {
        let (w, h) = (pixels.width(), pixels.height());
        let wrong = |what: String| {
            Err(Error::new(ErrorKind::Damaged, what).hint("frames of one sensor are grey and have one size"))
        };
        if !values(pixels, &mut self.now) {
            return wrong(format!("expected grey frames, found {:?} of {w} x {h} px", pixels.kind()));
        }
        if self.n == 0 {
            (self.width, self.height) = (w, h);
            self.mean.resize(w * h, 0.0);
            self.spread.resize(w * h, 0.0);
            self.changes.resize(w * h, 0);
            self.moved.resize(w * h, [0.0; 2]);
        }
        if (w, h) != (self.width, self.height) {
            return wrong(format!("expected {} x {} px, found {w} x {h}", self.width, self.height));
        }
        let changed = self.changes.iter_mut().zip(&mut self.moved);
        for (((c, moved), now), before) in changed.zip(&self.now).zip(&self.before) {
            let by = (now - before).abs();
            *c = c.saturating_add(u16::from(now != before));
            *moved = [moved[0] + by, moved[1] + by * by];
        }
        self.before.clone_from(&self.now);
        self.n += 1;
        self.step = range(pixels).1;
        let n = f64::from(self.n);
        for ((m, s), v) in self.mean.iter_mut().zip(&mut self.spread).zip(&self.now) {
            let d = f64::from(*v) - *m;
            *m += d / n;
            *s += d * (f64::from(*v) - *m);
        }
        Ok(())
    }

    /// Frames taken.
    pub fn n_frames(&self) -> u32 {
        self.n
    }

    /// Distance of the values of a pixel, counts; 0 for floats.
    pub(super) fn step(&self) -> f32 {
        self.step
    }

    /// Mean of each pixel, counts.
    pub fn mean(&self) -> Image<f32> {
        self.image(&self.mean, 1.0)
    }

    /// Variance of each pixel in one frame, counts²; 0 from a single frame.
    pub fn variance(&self) -> Image<f32> {
        self.image(&self.spread, 1.0 / f64::from(self.n.max(2) - 1))
    }

    /// Share of the frames in which each pixel was not what it was in the one before.
    pub(super) fn changes(&self) -> Image<f32> {
        let frames = f32::from(u16::try_from(self.n.max(2) - 1).unwrap_or(u16::MAX));
        let shares = self.changes.iter().map(|c| f32::from(*c) / frames).collect();
        Image::from_vec(self.width, self.height, shares).unwrap_or_default()
    }

    /// Over how many of its changes, as a share of all, a pixel's unrest is spread: (Σ|d|)² / (n Σd²), 2/π of normal noise, 2/n of what came and went once.
    pub(super) fn spread_of_changes(&self, pixel: usize) -> f32 {
        let [sum, squares] = self.moved[pixel];
        sum * sum / (squares * (self.n.max(2) - 1) as f32).max(f32::MIN_POSITIVE)
    }

    /// Whether what the pixels see changes slowly, so that the scene moves over them: the variance of most is more than [`DRIFTS`] times half of their mean squared change (J. von Neumann, *Ann. Math.
    /// Stat.* 12, 367 (1941)), which it equals where only noise changes them.
    pub(super) fn is_of_a_moving_scene(&self) -> bool {
        let drifts = |(spread, [_, squares]): (&f64, &[f32; 2])| *spread > DRIFTS * 0.5 * f64::from(*squares);
        2 * self.spread.iter().zip(&self.moved).filter(|p| drifts(*p)).count() > self.spread.len()
    }

    fn image(&self, values: &[f64], scale: f64) -> Image<f32> {
        let values = values.iter().map(|v| (v * scale) as f32).collect();
        Image::from_vec(self.width, self.height, values).unwrap_or_default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn mean_and_variance_are_those_of_the_values_and_other_sizes_are_refused() {
        let mut map = MeanMap::default();
        for v in [3u8, 5, 10] {
            map.push(&Pixels::Gray8(Image::filled(3, 2, v))).unwrap();
        }
        assert_eq!((map.mean().get(1, 1), map.variance().get(1, 1)), (Some(6.0), Some(13.0)));
        let e = map.push(&Pixels::Gray8(Image::filled(2, 2, 0))).unwrap_err().to_string();
        assert!(e.contains("expected 3 x 2 px, found 2 x 2"), "{e}");
        assert!(map.push(&Pixels::Rgb8(Image::filled(3, 2, [0; 3]))).is_err());
    }
}
