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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{FrameIndex, Timestamp};
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use rand_distr::StandardNormal;

    #[test]
    fn noise_of_less_than_half_a_step_is_not_seen() {
        let frame = |pixels| Frame { index: FrameIndex(0), time: Timestamp::default(), pixels };
        let noisy = |sd: f32| {
            let mut rng = ChaCha8Rng::seed_from_u64(4);
            let values = (0..100 * 100).map(|_| 50.5 + sd * rng.sample::<f32, _>(StandardNormal));
            Image::from_vec(100, 100, values.collect::<Vec<f32>>()).unwrap()
        };
        let whole =
            |image: Image<f32>| Image::from_vec(100, 100, image.as_slice().iter().map(|v| *v as u8).collect()).unwrap();
        assert!(shows_noise(&frame(Pixels::Gray8(whole(noisy(1.0))))));
        assert!(!shows_noise(&frame(Pixels::Gray8(whole(noisy(0.2))))));
        assert!(shows_noise(&frame(Pixels::GrayF32(noisy(0.2)))));
        assert!(!shows_noise(&frame(Pixels::GrayF32(noisy(0.0)))));
    }
}
