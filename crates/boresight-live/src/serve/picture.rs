//! A frame as a JPEG to look at: reduced to what a screen shows, 8 bits, levels that follow the scene.

use boresight::Pixels;
use jpeg_encoder::{ColorType, Encoder};

/// Largest width and height that are sent, px; larger frames are reduced by whole factors.
const LARGEST: usize = 1280;
const QUALITY: u8 = 75;
/// Pixels looked at for the levels.
const SAMPLE: usize = 4096;

/// Encodes one frame after another.
#[derive(Default)]
pub struct Pictures {
    bytes: Vec<u8>,
    sample: Vec<f32>,
}

impl Pictures {
    /// The frame as a JPEG; `None` if it has no pixels.
    pub fn encode(&mut self, pixels: &Pixels) -> Option<Vec<u8>> {
        let (w, h) = (pixels.width(), pixels.height());
        if w == 0 || h == 0 {
            return None;
        }
        let step = w.max(h).div_ceil(LARGEST).max(1);
        let (cols, rows) = (w.div_ceil(step), h.div_ceil(step));
        self.bytes.clear();
        let mut colour = ColorType::Luma;
        match pixels {
            Pixels::Gray8(i) => reduce(i.as_slice(), w, step, |v| self.bytes.push(v)),
            Pixels::Rgb8(i) => {
                colour = ColorType::Rgb;
                reduce(i.as_slice(), w, step, |v| self.bytes.extend(v));
            }
            Pixels::Gray16(i) => {
                let (low, gain) = levels(&mut self.sample, i.as_slice().iter().map(|v| f32::from(*v)));
                reduce(i.as_slice(), w, step, |v| self.bytes.push(((f32::from(v) - low) * gain) as u8));
            }
            Pixels::GrayF32(i) => {
                let (low, gain) = levels(&mut self.sample, i.as_slice().iter().copied());
                reduce(i.as_slice(), w, step, |v| self.bytes.push(((v - low) * gain) as u8));
            }
        }
        let mut jpeg = Vec::with_capacity(self.bytes.len() / 4);
        let (cols, rows) = (u16::try_from(cols).ok()?, u16::try_from(rows).ok()?);
        Encoder::new(&mut jpeg, QUALITY).encode(&self.bytes, cols, rows, colour).ok()?;
        Some(jpeg)
    }
}

/// Every `step`-th pixel of every `step`-th row.
fn reduce<T: Copy>(pixels: &[T], width: usize, step: usize, mut put: impl FnMut(T)) {
    pixels.chunks_exact(width).step_by(step).for_each(|row| row.iter().step_by(step).for_each(|v| put(*v)));
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
    use boresight::Image;

    #[test]
    fn every_kind_becomes_a_picture_of_at_most_the_largest_size() {
        let size = |jpeg: &[u8]| {
            let frame = jpeg.windows(2).position(|w| w == [0xff, 0xc0]).unwrap();
            (
                u16::from_be_bytes([jpeg[frame + 7], jpeg[frame + 8]]),
                u16::from_be_bytes([jpeg[frame + 5], jpeg[frame + 6]]),
            )
        };
        let mut pictures = Pictures::default();
        assert_eq!(size(&pictures.encode(&Pixels::Gray8(Image::filled(64, 48, 9))).unwrap()), (64, 48));
        assert_eq!(size(&pictures.encode(&Pixels::Rgb8(Image::filled(2561, 10, [1, 2, 3]))).unwrap()), (854, 4));
        assert_eq!(size(&pictures.encode(&Pixels::Gray16(Image::filled(10, 10, 60_000))).unwrap()), (10, 10));
        assert_eq!(size(&pictures.encode(&Pixels::GrayF32(Image::filled(10, 10, f32::NAN))).unwrap()), (10, 10));
        assert!(pictures.encode(&Pixels::Gray8(Image::filled(0, 0, 0))).is_none());
    }
}
