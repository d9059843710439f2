//! The noise of one pixel, estimated from a single frame: the robust spread of differences between neighbours.
//!
//! The median of |I(x+1) - I(x)| over sampled pixels, times 1.4826 / √2, is the standard deviation of white normal noise;
//! slow shading cancels, edges and targets are a minority that the median does not see. Whole-number pixels are taken as
//! spread evenly over their step, and at least the rounding noise step/√12 is returned.
//! Limits: noise that is correlated between neighbours (codecs, interpolation) is seen too small.

use super::pixel::Pixel;
use super::threshold::grid::median_and_deviation;
use crate::Image;

/// Pixels looked at, at most: the error of a MAD from so many is below 2 %.
const MAX_SAMPLES: usize = 8192;

/// Returns the standard deviation of one pixel's noise, counts; `samples` is scratch.
pub fn noise_level<T: Pixel>(image: &Image<T>, samples: &mut Vec<f32>) -> f64 {
    samples.clear();
    let pixels = image.width() * image.height();
    let step = (pixels / MAX_SAMPLES).max(1);
    // An odd step does not fall into the rhythm of even widths.
    let step = step | 1;
    let data = image.as_slice();
    for i in (0..pixels.saturating_sub(1)).step_by(step) {
        if (i + 1) % image.width() == 0 {
            continue;
        }
        let d = data[i + 1].value_f32() - data[i].value_f32();
        if d.is_finite() {
            samples.push(d);
        }
    }
    let (_, deviation) = median_and_deviation(samples, T::STEP);
    let rounding = f64::from(T::STEP) / 12f64.sqrt();
    (f64::from(deviation) / std::f64::consts::SQRT_2).max(rounding)
}
