//! Whether the noise of a frame is seen in its values.
//!
//! Source: our own. Below half a step of the values most neighbours are equal, as where a codec has flattened the ground: what is left of the noise comes and goes in blobs, and no deviation says how
//! high they are.

use crate::vision::Pixel;
use crate::vision::noise_level::noise_level;
use crate::{Frame, Image, Pixels};

/// Noise that is seen, steps of the values.
const LEAST_NOISE_STEPS: f64 = 0.5;

/// Whether the noise of a grey frame is larger than half a step of its values: below that most neighbours are equal.
pub(super) fn shows_noise(frame: &Frame) -> bool {
    fn exceeds<T: Pixel>(image: &Image<T>) -> bool {
        noise_level(image, &mut Vec::new()) > LEAST_NOISE_STEPS * f64::from(T::STEP)
    }
    match &frame.pixels {
        Pixels::Gray8(image) => exceeds(image),
        Pixels::Gray16(image) => exceeds(image),
        Pixels::GrayF32(image) => exceeds(image),
        Pixels::Rgb8(_) => false,
    }
}
