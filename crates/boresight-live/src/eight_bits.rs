//! Frames as a screen and a video take them: 8 bits, levels that follow the scene, reduced by whole factors to a largest size.
//!
//! 8-bit pixels keep their values; of others the 0.5 % and the 99.5 % quantile of a sample of the frame become black and white.

use boresight::{Image, Pixels};

/// Pixels looked at for the levels.
const SAMPLE: usize = 4096;

/// Brings one frame after another to 8 bits; keeps its memory between frames.
pub struct EightBits {
    /// Largest longer and shorter side, px.
    largest: (usize, usize),
    sample: Vec<f32>,
    small: Pixels,
}

impl EightBits {
    /// Frames of at most these longer and shorter sides, px.
    pub fn at_most(long: usize, short: usize) -> Self {
        Self { largest: (long, short), sample: Vec::new(), small: Pixels::Gray8(Image::default()) }
    }

    /// The frame in 8 bits, grey or RGB; `None` if it has no pixels.
    pub fn of<'a>(&'a mut self, pixels: &'a Pixels) -> Option<&'a Pixels> {
        let (w, h) = (pixels.width(), pixels.height());
        if w == 0 || h == 0 {
            return None;
        }
        let step = w.max(h).div_ceil(self.largest.0).max(w.min(h).div_ceil(self.largest.1));
        if step == 1 && matches!(pixels, Pixels::Gray8(_) | Pixels::Rgb8(_)) {
            return Some(pixels);
        }
        let size = (w.div_ceil(step), h.div_ceil(step));
        let (sample, small) = (&mut self.sample, &mut self.small);
        match pixels {
            Pixels::Gray8(i) => reduce(i, step, gray(small, size), |v| v),
            Pixels::Rgb8(i) => reduce(i, step, colour(small, size), |v| v),
            Pixels::Gray16(i) => {
                let (low, gain) = levels(sample, i.as_slice().iter().map(|v| f32::from(*v)));
                reduce(i, step, gray(small, size), |v| ((f32::from(v) - low) * gain) as u8);
            }
            Pixels::GrayF32(i) => {
                let (low, gain) = levels(sample, i.as_slice().iter().copied());
                reduce(i, step, gray(small, size), |v| ((v - low) * gain) as u8);
            }
        }
        Some(&self.small)
    }
}

/// Grey pixels of that size, columns and rows, in the memory of those before.
fn gray(small: &mut Pixels, (cols, rows): (usize, usize)) -> &mut [u8] {
    if !matches!(small, Pixels::Gray8(i) if (i.width(), i.height()) == (cols, rows)) {
        *small = Pixels::Gray8(Image::filled(cols, rows, 0));
    }
    match small {
        Pixels::Gray8(i) => i.as_mut_slice(),
        _ => &mut [],
    }
}

/// As [`gray`], in colour.
fn colour(small: &mut Pixels, (cols, rows): (usize, usize)) -> &mut [[u8; 3]] {
    if !matches!(small, Pixels::Rgb8(i) if (i.width(), i.height()) == (cols, rows)) {
        *small = Pixels::Rgb8(Image::filled(cols, rows, [0; 3]));
    }
    match small {
        Pixels::Rgb8(i) => i.as_mut_slice(),
        _ => &mut [],
    }
}

/// Every `step`-th pixel of every `step`-th row.
fn reduce<T: Copy, U>(image: &Image<T>, step: usize, into: &mut [U], of: impl Fn(T) -> U) {
    let rows = image.as_slice().chunks_exact(image.width()).step_by(step);
    let pixels = rows.flat_map(|row| row.iter().step_by(step));
    into.iter_mut().zip(pixels).for_each(|(out, v)| *out = of(*v));
}

/// Black, and the gain to 255: the 0.5 % and 99.5 % quantiles of a sample.
fn levels(sample: &mut Vec<f32>, pixels: impl ExactSizeIterator<Item = f32>) -> (f32, f32) {
    // Odd, so that the sample is spread over columns.
    let stride = (pixels.len() / SAMPLE).max(1) | 1;
    sample.clear();
    sample.extend(pixels.step_by(stride).filter(|v| v.is_finite()));
    sample.sort_unstable_by(f32::total_cmp);
    let at = |share: f64| sample.get((sample.len() as f64 * share) as usize).copied().unwrap_or(0.0);
    let (low, high) = (at(0.005), at(0.995));
    (low, 255.0 / (high - low).max(1e-6))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn eight_bits_stay_and_others_are_spread_over_the_scene() {
        let mut eight = EightBits::at_most(1280, 1280);
        let plain = Pixels::Gray8(Image::filled(64, 48, 9));
        assert!(eight.of(&plain).is_some_and(|p| std::ptr::eq(p, &plain)));
        let ramp = Pixels::Gray16(Image::from_vec(100, 1, (0..100).map(|v| 1000 + 10 * v).collect()).unwrap());
        let Some(Pixels::Gray8(ramp)) = eight.of(&ramp) else { panic!("grey") };
        assert!(ramp.as_slice().is_sorted() && ramp.as_slice()[0] == 0 && ramp.as_slice()[99] == 255);
        let large = Pixels::Rgb8(Image::filled(2561, 10, [1, 2, 3]));
        let large = eight.of(&large).unwrap();
        assert_eq!((large.width(), large.height()), (854, 4));
        let Pixels::Rgb8(large) = large else { panic!("colour") };
        assert!(large.as_slice().iter().all(|p| *p == [1, 2, 3]));
    }
}
