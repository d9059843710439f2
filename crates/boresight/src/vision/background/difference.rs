//! Moving pixels by the difference of two or three frames: needs no learning, sees only what changes from frame to frame.
//!
//! Two frames: |f(t) - f(t-1)| > T marks a target where it is and where it was. Three frames: |f(t) - f(t-1)| > T and
//! |f(t) - f(t-2)| > T marks only where it is now (a target that moves by less than itself leaves a hollow shape).
//! T is `threshold-sd` times the noise of a difference, 1.4826 * the median of |f(t) - f(t-1)| on a grid, which targets
//! hardly move, and never below `min-difference`.

use super::light::GRID_PX;
use super::morphology::{self, BitImage, CleanUp};
use super::{pack, size_changed};
use crate::vision::spatial::SpatialPixel;
use crate::{Error, ErrorKind, Image, Result};
use fearless_simd::{Level, dispatch};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Parameters of the frame difference.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct DifferenceConfig {
    /// Frames compared: 2, or 3 to see a target only where it is now.
    pub frames: u8,
    /// Standard deviations of the difference that make a pixel moving, 1 to 50.
    pub threshold_sd: f32,
    /// Smallest difference that counts, counts, 0... .
    pub min_difference: f32,
    /// How the moving pixels are cleaned.
    pub clean_up: CleanUp,
}

impl Default for DifferenceConfig {
    fn default() -> Self {
        Self { frames: 3, threshold_sd: 6.0, min_difference: 0.0, clean_up: CleanUp::Majority }
    }
}

impl DifferenceConfig {
    /// Checks the parameters; `at` is the key of this part, for messages.
    /// # Errors
    /// The first parameter out of its range.
    pub fn validate(&self, at: &str) -> Result<()> {
        let wrong = |key: &str, value: f64, expected: &str, hint: &str| {
            Err(crate::validate::wrong(at, key, value, expected, hint))
        };
        if !(2..=3).contains(&self.frames) {
            return wrong("frames", self.frames.into(), "2 or 3", "3 marks a target only where it is now");
        }
        if !(1.0..=50.0).contains(&self.threshold_sd) {
            let hint = "6 leaves few noisy pixels";
            return wrong("threshold-sd", self.threshold_sd.into(), "a number from 1 to 50", hint);
        }
        if !(self.min_difference >= 0.0 && self.min_difference.is_finite()) {
            let hint = "0 leaves it to the noise";
            return wrong("min-difference", self.min_difference.into(), "0 or more counts", hint);
        }
        Ok(())
    }
}

/// The last frames and the pixels that changed.
#[derive(Clone, Debug)]
pub struct FrameDifference<T: SpatialPixel> {
    config: DifferenceConfig,
    /// The last frame and the one before it.
    before: [Image<T>; 2],
    n_frames: u64,
    grid: Vec<f32>,
    states: Vec<u8>,
    bits: BitImage,
    work: BitImage,
}

impl<T: SpatialPixel> FrameDifference<T> {
    /// Builds it; nothing moves until enough frames are known.
    /// # Errors
    /// As [`DifferenceConfig::validate`].
    pub fn new(config: DifferenceConfig) -> Result<Self> {
        config.validate("difference")?;
        Ok(Self {
            config,
            before: [Image::default(), Image::default()],
            n_frames: 0,
            grid: Vec::new(),
            states: Vec::new(),
            bits: BitImage::default(),
            work: BitImage::default(),
        })
    }

    /// Takes the next frame.
    /// # Errors
    /// A frame of another size than before.
    pub fn update(&mut self, frame: &Image<T>) -> Result<()> {
        let (w, h) = (frame.width(), frame.height());
        let [last, older] = &mut self.before;
        if self.n_frames > 0 && (w, h) != (last.width(), last.height()) {
            return Err(size_changed(last.width(), last.height(), w, h));
        }
        self.bits.reset(w, h);
        if self.n_frames + 1 >= u64::from(self.config.frames) {
            let threshold = threshold(&self.config, frame, last, &mut self.grid)?;
            self.states.clear();
            self.states.resize(w.next_multiple_of(64), 0);
            for y in 0..h {
                let other = if self.config.frames == 3 { older.row(y) } else { last.row(y) };
                changed(frame.row(y), last.row(y), other, threshold, &mut self.states[..w]);
                let (states, bits) = (&self.states, self.bits.row_mut(y));
                dispatch!(Level::new(), simd => pack(simd, states, bits));
            }
            morphology::clean(&mut self.bits, self.config.clean_up, &mut self.work);
        }
        std::mem::swap(last, older);
        last.clone_from(frame);
        self.n_frames += 1;
        Ok(())
    }

    /// The moving pixels of row `y`, 64 a word.
    pub fn row(&self, y: usize) -> &[u64] {
        self.bits.row(y)
    }

    /// The moving pixels of the last frame.
    pub fn moving(&self) -> &BitImage {
        &self.bits
    }
}

fn threshold<T: SpatialPixel>(c: &DifferenceConfig, a: &Image<T>, b: &Image<T>, grid: &mut Vec<f32>) -> Result<f32> {
    grid.clear();
    for y in (GRID_PX / 2..a.height()).step_by(GRID_PX) {
        for (p, q) in a.row(y).iter().zip(b.row(y)).step_by(GRID_PX) {
            grid.push((p.to_f64() - q.to_f64()).abs() as f32);
        }
    }
    let middle = grid.len() / 2;
    let median = if grid.is_empty() { 0.0 } else { *grid.select_nth_unstable_by(middle, f32::total_cmp).1 };
    if median.is_nan() {
        return Err(Error::new(ErrorKind::Damaged, "more than half of the frame's pixels are NaN"));
    }
    // Integer pixels have at least the noise of rounding, also where the median of the differences is 0.
    let noise = (1.4826 * median).max(if T::INTEGER { 0.41 } else { f32::MIN_POSITIVE });
    Ok((c.threshold_sd * noise).max(c.min_difference))
}

widest! {
    fn changed<T: SpatialPixel>(now: &[T], last: &[T], other: &[T], threshold: f32, states: &mut [u8]) {
        let n = states.len();
        let (now, last, other) = (&now[..n], &last[..n], &other[..n]);
        for x in 0..n {
            let v = now[x].to_f32();
            states[x] = u8::from(((v - last[x].to_f32()).abs() > threshold) & ((v - other[x].to_f32()).abs() > threshold));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A bright 6x6 square at column `x` on ground with noise of a count.
    fn scene(x: usize, t: usize) -> Image<u8> {
        let mut f = Image::filled(100, 40, 0u8);
        for (i, v) in f.as_mut_slice().iter_mut().enumerate() {
            *v = 50 + ((i * 7919 + t * 104_729) % 3) as u8;
        }
        for y in 10..16 {
            f.row_mut(y)[x..x + 6].fill(120);
        }
        f
    }

    #[test]
    fn two_frames_mark_both_places_and_three_only_the_present_one() {
        for (frames, pixels) in [(2u8, 72), (3, 36)] {
            let config = DifferenceConfig { frames, clean_up: CleanUp::None, ..DifferenceConfig::default() };
            let mut difference = FrameDifference::new(config).unwrap();
            for t in 0..4 {
                difference.update(&scene(10 + 10 * t, t)).unwrap();
            }
            assert_eq!(difference.moving().count(), pixels);
            assert!(difference.moving().get(40, 10) && difference.moving().get(45, 15));
            assert!(difference.update(&Image::filled(3, 3, 0)).is_err());
        }
    }
}
