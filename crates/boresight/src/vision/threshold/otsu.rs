//! Otsu's level: the one that splits the histogram into two classes with the largest variance between them.
//!
//! Source: N. Otsu, "A threshold selection method from gray-level histograms", IEEE Trans. SMC 9(1), 1979.
//! 8-bit pixels use their 256 levels; other types use 1024 equal bins between the smallest and the largest finite value.

use super::grid::BackgroundGrid;
use super::level::{one_side, weight_of};
use super::{LevelConfig, OtsuConfig, Side};
use crate::vision::pixel::Pixel;
use crate::vision::segmenter::{PixelWeight, Regions, Segmenter};
use crate::vision::target_finder::TypedFrame;
use crate::{Image, Result};

/// Bins of the histogram, for 8 bits a level each.
const BINS: usize = 1024;

/// Returns the level between two pixel values that splits the image best, counts, or `None` if all values are the same.
///
/// Values below the level are the dark class, values above it the bright one; no value lies on it for 8 and 16 bit pixels.
pub fn otsu_level<T: Pixel>(image: &Image<T>) -> Option<f64> {
    let (mut min, mut max) = (f64::INFINITY, f64::NEG_INFINITY);
    for v in image.as_slice().iter().map(|p| p.value()).filter(|v| v.is_finite()) {
        min = min.min(v);
        max = max.max(v);
    }
    if max <= min || !(max - min).is_finite() {
        return None;
    }
    let whole = image.as_slice().iter().all(|p| p.value().fract() == 0.0);
    // Whole values that fit the bins get one bin each, so the split is exact.
    let width = if whole { ((max - min + 1.0) / BINS as f64).ceil() } else { (max - min) / BINS as f64 };
    let mut histogram = [0u64; BINS];
    for v in image.as_slice().iter().map(|p| p.value()).filter(|v| v.is_finite()) {
        histogram[(((v - min) / width) as usize).min(BINS - 1)] += 1;
    }
    let split = best_split(&histogram)?;
    let edge = min + (split + 1) as f64 * width;
    Some(if whole { edge - 0.5 } else { edge })
}

/// A level found anew in every frame.
#[derive(Clone, Debug)]
pub(crate) struct OtsuThreshold {
    side: Side,
}

impl OtsuThreshold {
    pub(crate) fn new(config: &OtsuConfig) -> Self {
        Self { side: config.side }
    }
}

impl<T: Pixel> Segmenter<T> for OtsuThreshold {
    fn weight(&self) -> PixelWeight {
        weight_of(self.side)
    }

    fn segment(&mut self, frame: &TypedFrame<T>, _: &BackgroundGrid, regions: &mut Regions) -> Result<Option<f64>> {
        Ok(otsu_level(frame.image).and_then(|level| {
            let config = LevelConfig { level, side: self.side, exclusive: false };
            one_side(frame.image, &config, regions)
        }))
    }
}

/// The last bin of the lower class; the middle one of several that are equally good.
fn best_split(histogram: &[u64]) -> Option<usize> {
    let total: f64 = histogram.iter().map(|&n| n as f64).sum();
    let moment: f64 = histogram.iter().enumerate().map(|(i, &n)| i as f64 * n as f64).sum();
    let (mut n0, mut m0) = (0.0, 0.0);
    let (mut best, mut first, mut last) = (0.0, None, 0);
    for (i, &n) in histogram.iter().enumerate() {
        n0 += n as f64;
        m0 += i as f64 * n as f64;
        let n1 = total - n0;
        if n0 == 0.0 || n1 == 0.0 {
            continue;
        }
        let apart = m0 / n0 - (moment - m0) / n1;
        let between = n0 * n1 * apart * apart;
        if between > best {
            (best, first, last) = (between, Some(i), i);
        } else if between == best && n == 0 {
            last = i;
        }
    }
    first.map(|f| f + (last - f) / 2)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_levels_are_split_in_the_middle() {
        let image = Image::from_vec(4, 1, vec![10u8, 10, 200, 10]).unwrap();
        let level = otsu_level(&image).unwrap();
        assert!((level - 105.0).abs() <= 1.0, "{level}");
        let deep = Image::from_vec(4, 1, vec![10u16, 10, 60000, 10]).unwrap();
        let level = otsu_level(&deep).unwrap();
        assert!((10.0..60000.0).contains(&level), "{level}");
    }

    #[test]
    fn a_flat_image_has_no_level() {
        assert_eq!(otsu_level(&Image::filled(3, 3, 7u8)), None);
        assert_eq!(otsu_level(&Image::filled(3, 3, f32::NAN)), None);
        assert_eq!(otsu_level(&Image::<u8>::filled(0, 0, 0)), None);
    }

    #[test]
    fn the_level_maximises_the_variance_between_the_classes() {
        // Brute force over all levels of an uneven histogram.
        let values: Vec<u8> = (0..200u32).map(|i| ((i * i) % 97 + if i % 3 == 0 { 90 } else { 0 }) as u8).collect();
        let image = Image::from_vec(20, 10, values.clone()).unwrap();
        let between = |t: f64| {
            let (a, b): (Vec<f64>, Vec<f64>) = values.iter().map(|&v| f64::from(v)).partition(|v| *v < t);
            if a.is_empty() || b.is_empty() {
                return 0.0;
            }
            let mean = |s: &[f64]| s.iter().sum::<f64>() / s.len() as f64;
            (mean(&a) - mean(&b)).powi(2) * a.len() as f64 * b.len() as f64
        };
        let best = (1..256).map(|t| between(f64::from(t) - 0.5)).fold(0.0, f64::max);
        let ours = between(otsu_level(&image).unwrap());
        assert!(ours >= best * (1.0 - 1e-12), "{ours} {best}");
    }
}
