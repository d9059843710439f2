//! JPEG, baseline and progressive, grey, YCbCr, RGB and CMYK, 8 bits.
//!
//! The decoder runs in its strict mode: a picture that breaks off is an error instead of a half-grey frame.

use crate::io::guard::{backed, damaged};
use crate::io::options::Colour;
use crate::io::pixels::check_size;
use crate::io::samples::Samples;
use crate::memory_budget::afford;
use crate::{Pixels, Result};
use zune_core::bytestream::ZCursor;
use zune_core::colorspace::ColorSpace;
use zune_core::options::DecoderOptions;
use zune_jpeg::JpegDecoder;

/// A JPEG's sides have 16 bits.
const MAX_SIDE: usize = 65_535;

pub(super) fn decode(bytes: &[u8], colour: Colour, max_pixels: u64) -> Result<Pixels> {
    let options = DecoderOptions::new_fast().set_max_width(MAX_SIDE).set_max_height(MAX_SIDE).set_strict_mode(true);
    let mut decoder = JpegDecoder::new_with_options(ZCursor::new(bytes), options);
    decoder.decode_headers().map_err(|e| damaged("not a whole JPEG", e))?;
    let (w, h) = decoder.dimensions().ok_or_else(|| damaged("not a whole JPEG", "it has no size"))?;
    let (width, height) = check_size(w as u64, h as u64, max_pixels)?;
    // Each block of 8 x 8 takes one bit at least.
    backed((width.div_ceil(8) as u64).saturating_mul(height.div_ceil(8) as u64) / 8, bytes.len(), (width, height))?;
    let (channels, space) = match decoder.input_colorspace() {
        Some(ColorSpace::Luma) => (1, ColorSpace::Luma),
        _ => (3, ColorSpace::RGB),
    };
    // Coefficients of two bytes (progressive ones are all kept), the samples, the pixels.
    afford(width, height, 4 * channels as u64)?;
    decoder.set_options(options.jpeg_set_out_colorspace(space));
    let data = decoder.decode().map_err(|e| damaged("not a whole JPEG", e))?;
    Samples { width, height, channels, data }.into_pixels(colour)
}
