//! The step between two values of the pixels that are looked at: one count, or what floats were made of.
//!
//! Source: our own. Frames of floats are often pictures of 8 or 16 bits that were divided by something; least contrasts that are meant in counts are so many of their steps. The step is the
//! median distance between neighbouring values of a sample: that of the whole numbers behind them, or next to nothing where there are none.
//! Units: counts. Limits: a picture of fewer than two values has the step of a count.

use crate::{Frame, Pixels};

/// Values looked at.
const SAMPLE: usize = 1 << 14;

/// The step of these frames' values, by the first one.
pub fn value_step(frames: &[Frame]) -> f64 {
    let Some(Pixels::GrayF32(image)) = frames.first().map(|f| &f.pixels) else { return 1.0 };
    let all = image.as_slice();
    let mut values: Vec<f32> =
        all.iter().step_by((all.len() / SAMPLE).max(1)).copied().filter(|v| v.is_finite()).collect();
    values.sort_unstable_by(f32::total_cmp);
    let mut steps: Vec<f32> = values.windows(2).map(|w| w[1] - w[0]).filter(|s| *s > 0.0).collect();
    if steps.is_empty() {
        return 1.0;
    }
    let middle = steps.len() / 2;
    f64::from(*steps.select_nth_unstable_by(middle, f32::total_cmp).1)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{FrameIndex, Image, Timestamp};
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    #[test]
    fn floats_have_the_step_of_what_they_were_made_of() {
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let mut of = |f: &mut dyn FnMut(&mut ChaCha8Rng) -> f32| {
            let values = (0..100 * 100).map(|_| f(&mut rng)).collect();
            let pixels = Pixels::GrayF32(Image::from_vec(100, 100, values).unwrap());
            value_step(&[Frame { index: FrameIndex(0), time: Timestamp::from_ns(0), pixels }])
        };
        let bytes = of(&mut |rng| f32::from(rng.random::<u8>()) / 255.0);
        assert!((bytes * 255.0 - 1.0).abs() < 1e-4, "{bytes}");
        let counts = of(&mut |rng| f32::from(rng.random::<u8>()));
        assert_eq!(counts, 1.0);
        let even = of(&mut |rng| rng.random::<f32>());
        assert!(even < 1e-3, "{even}");
        assert_eq!([of(&mut |_| 3.0), value_step(&[])], [1.0; 2]);
    }
}
