//! A frame as a JPEG to look at, reduced to what a screen shows.

use crate::eight_bits::EightBits;
use boresight::Pixels;
use jpeg_encoder::{ColorType, Encoder};

/// Largest width and height that are sent, px; larger frames are reduced by whole factors.
pub const LARGEST: usize = 1280;
const QUALITY: u8 = 75;

/// Encodes one frame after another.
pub struct Pictures(EightBits);

impl Default for Pictures {
    fn default() -> Self {
        Self(EightBits::at_most(LARGEST, LARGEST))
    }
}

impl Pictures {
    /// The frame as a JPEG; `None` if it has no pixels.
    pub fn encode(&mut self, pixels: &Pixels) -> Option<Vec<u8>> {
        let small = self.0.of(pixels)?;
        let (bytes, colour) = match small {
            Pixels::Gray8(i) => (i.as_slice(), ColorType::Luma),
            Pixels::Rgb8(i) => (i.as_slice().as_flattened(), ColorType::Rgb),
            Pixels::Gray16(_) | Pixels::GrayF32(_) => return None,
        };
        let mut jpeg = Vec::with_capacity(bytes.len() / 4);
        let (cols, rows) = (u16::try_from(small.width()).ok()?, u16::try_from(small.height()).ok()?);
        Encoder::new(&mut jpeg, QUALITY).encode(bytes, cols, rows, colour).ok()?;
        Some(jpeg)
    }
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
