//! PNG, 1 to 16 bits, grey, palette and colour, interlaced too. 16-bit samples stay exact; 1, 2 and 4 bit grey is
//! scaled to 0..=255 as the standard says; palettes are expanded to RGB; alpha is dropped. Checksums are checked.

use crate::io::guard::{backed, damaged};
use crate::io::options::Colour;
use crate::io::pixels::check_size;
use crate::io::samples::Samples;
use crate::memory_budget::afford;
use crate::{Pixels, Result};
use png::{BitDepth, ColorType, Decoder, Limits, Transformations};
use std::io::Cursor;

/// What the decoder may take beside the pixels, bytes: a palette and a row of the interlaced.
const PALETTE: u64 = 1 << 16;

/// Deflate makes at most this many bytes of one (258 bytes of two bits).
const MOST_DEFLATED: u64 = 1032;

pub(super) fn decode(bytes: &[u8], colour: Colour, max_pixels: u64) -> Result<Pixels> {
    let limits =
        Limits { bytes: usize::try_from(max_pixels.saturating_mul(8).saturating_add(PALETTE)).unwrap_or(usize::MAX) };
    let mut decoder = Decoder::new_with_limits(Cursor::new(bytes), limits);
    decoder.set_transformations(Transformations::EXPAND);
    decoder.set_ignore_text_chunk(true);
    decoder.set_ignore_iccp_chunk(true);
    let mut reader = decoder.read_info().map_err(|e| damaged("not a whole PNG", e))?;
    // The decoder takes a palette in threes, and panics where it ends within one.
    let palette = reader.info().palette.as_ref().map_or(0, |p| p.len());
    if palette % 3 != 0 {
        return Err(damaged("not a whole PNG", format_args!("a palette of {palette} bytes, no multiple of 3")));
    }
    let (width, height) = check_size(reader.info().width.into(), reader.info().height.into(), max_pixels)?;
    let (kind, depth) = reader.output_color_type();
    let raw = (reader.info().raw_row_length() as u64).saturating_mul(height as u64);
    backed(raw / MOST_DEFLATED, bytes.len(), (width, height))?;
    let channels = match kind {
        ColorType::Grayscale => 1,
        ColorType::GrayscaleAlpha => 2,
        ColorType::Rgb | ColorType::Indexed => 3,
        ColorType::Rgba => 4,
    };
    // The decoder's bytes, the samples, the pixels.
    let sample = if depth == BitDepth::Sixteen { 2 } else { 1 };
    afford(width, height, 3 * sample * channels as u64)?;
    let n = reader.output_buffer_size().ok_or_else(|| damaged("not a whole PNG", "its size overflows"))?;
    let mut data = vec![0u8; n];
    reader.next_frame(&mut data).map_err(|e| damaged("not a whole PNG", e))?;
    if depth == BitDepth::Sixteen {
        let data = data.as_chunks::<2>().0.iter().map(|&b| u16::from_be_bytes(b)).collect();
        Samples { width, height, channels, data }.into_pixels(colour)
    } else {
        Samples { width, height, channels, data }.into_pixels(colour)
    }
}
