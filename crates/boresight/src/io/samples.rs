//! From a decoder's samples to [`Pixels`]: channels chosen, alpha dropped, grey made where it is asked for.
//!
//! 16-bit RGB has no pixel type of its own: in colour it becomes 8-bit RGB (rounded), in grey it keeps its 16 bits (the weights of
//! `pixels`).

use super::options::Colour;
use super::pixels::gray_of_rgb8;
use crate::{Error, ErrorKind, Image, Pixels, Result};

/// Decoded samples of one image, interleaved, 1 (grey), 2 (grey, alpha), 3 (RGB) or 4 (RGB, alpha) to a pixel.
pub(crate) struct Samples<T> {
    pub width: usize,
    pub height: usize,
    pub channels: usize,
    pub data: Vec<T>,
}

/// Grey of a 16-bit RGB pixel, BT.601 in integers. The weights sum to 2¹⁵, so u32 holds the sum.
#[inline]
fn gray_of_rgb16(r: u16, g: u16, b: u16) -> u16 {
    ((9798 * u32::from(r) + 19235 * u32::from(g) + 3735 * u32::from(b) + 16384) >> 15) as u16
}

/// 16 to 8 bits, rounded: 65535 is 255 exactly.
#[inline]
fn high8(v: u16) -> u8 {
    ((u32::from(v) * 255 + 32767) / 65535) as u8
}

fn image<T: Copy>(width: usize, height: usize, data: Vec<T>) -> Result<Image<T>> {
    Image::from_vec(width, height, data).ok_or_else(|| {
        Error::new(ErrorKind::Damaged, format!("the decoded data do not fill {width} x {height} pixels"))
    })
}

impl Samples<u8> {
    /// Makes pixels of 8-bit samples.
    pub fn into_pixels(self, colour: Colour) -> Result<Pixels> {
        let Self { width, height, channels, data } = self;
        Ok(match (channels, colour) {
            (1, _) => Pixels::Gray8(image(width, height, data)?),
            (2, _) => Pixels::Gray8(image(width, height, data.chunks_exact(2).map(|p| p[0]).collect())?),
            (3, Colour::Gray) => {
                let gray = data.as_chunks::<3>().0.iter().map(|&p| gray_of_rgb8(p)).collect();
                Pixels::Gray8(image(width, height, gray)?)
            }
            (4, Colour::Gray) => {
                let gray = data.as_chunks::<4>().0.iter().map(|&[r, g, b, _]| gray_of_rgb8([r, g, b])).collect();
                Pixels::Gray8(image(width, height, gray)?)
            }
            (3, _) => Pixels::Rgb8(image(width, height, data.as_chunks::<3>().0.to_vec())?),
            (4, _) => {
                let rgb = data.as_chunks::<4>().0.iter().map(|&[r, g, b, _]| [r, g, b]).collect();
                Pixels::Rgb8(image(width, height, rgb)?)
            }
            _ => return Err(unsupported_channels(channels)),
        })
    }
}

impl Samples<u16> {
    /// Makes pixels of 16-bit samples.
    pub fn into_pixels(self, colour: Colour) -> Result<Pixels> {
        let Self { width, height, channels, data } = self;
        Ok(match (channels, colour) {
            (1, _) => Pixels::Gray16(image(width, height, data)?),
            (2, _) => Pixels::Gray16(image(width, height, data.chunks_exact(2).map(|p| p[0]).collect())?),
            (3 | 4, Colour::Gray) => {
                let gray = data.chunks_exact(channels).map(|p| gray_of_rgb16(p[0], p[1], p[2])).collect();
                Pixels::Gray16(image(width, height, gray)?)
            }
            (3 | 4, _) => {
                let rgb = data.chunks_exact(channels).map(|p| [high8(p[0]), high8(p[1]), high8(p[2])]).collect();
                Pixels::Rgb8(image(width, height, rgb)?)
            }
            _ => return Err(unsupported_channels(channels)),
        })
    }
}

impl Samples<f32> {
    /// Makes pixels of float samples; colour always becomes grey (same weights), for there is no float RGB.
    pub fn into_pixels(self, _colour: Colour) -> Result<Pixels> {
        let Self { width, height, channels, data } = self;
        Ok(Pixels::GrayF32(match channels {
            1 => image(width, height, data)?,
            2 => image(width, height, data.chunks_exact(2).map(|p| p[0]).collect())?,
            3 | 4 => {
                let gray = |p: &[f32]| (9798.0 * p[0] + 19235.0 * p[1] + 3735.0 * p[2]) / 32768.0;
                image(width, height, data.chunks_exact(channels).map(gray).collect())?
            }
            _ => return Err(unsupported_channels(channels)),
        }))
    }
}

fn unsupported_channels(channels: usize) -> Error {
    Error::new(ErrorKind::Unsupported, format!("{channels} channels in a pixel: expected 1 (grey) to 4 (RGB, alpha)"))
        .hint("write the channel to be tracked as grey images")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn white_of_16_bits_stays_white() {
        assert_eq!(gray_of_rgb16(65535, 65535, 65535), 65535);
    }

    #[test]
    fn sixteen_bit_colour_keeps_its_depth_in_grey_and_is_rounded_in_rgb() {
        let rgb = || Samples { width: 1, height: 1, channels: 4, data: vec![65535u16, 0, 129, 7] };
        assert_eq!(
            rgb().into_pixels(Colour::Native).unwrap(),
            Pixels::Rgb8(Image::from_vec(1, 1, vec![[255, 0, 1]]).unwrap())
        );
        let Pixels::Gray16(gray) = rgb().into_pixels(Colour::Gray).unwrap() else { panic!("expected 16-bit grey") };
        assert_eq!(gray.as_slice(), [19610]); // 642610129 >> 15
    }
}
