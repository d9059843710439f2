//! BMP, 1 to 32 bits, uncompressed or run-length coded; palettes that are all grey give grey.
//!
//! The decoder fills what is missing at the end of a file with zeros, so the header's own sizes are checked here first.
//! Layout: Microsoft, *Bitmap Storage* (BITMAPFILEHEADER, BITMAPCOREHEADER, BITMAPINFOHEADER).

use super::damaged;
use crate::io::pixels::{Samples, check_size};
use crate::{Pixels, Result, io::Colour};
use zune_bmp::BmpDecoder;
use zune_core::bytestream::ZCursor;
use zune_core::options::DecoderOptions;

fn u16_at(b: &[u8], at: usize) -> Option<u64> {
    Some(u64::from(u16::from_le_bytes(*b.get(at..)?.first_chunk()?)))
}

fn u32_at(b: &[u8], at: usize) -> Option<u32> {
    Some(u32::from_le_bytes(*b.get(at..)?.first_chunk()?))
}

/// Width, height, and the number of bytes that the file must at least have.
fn claimed(b: &[u8]) -> Option<(u64, u64, u64)> {
    let start = u64::from(u32_at(b, 10)?);
    let (width, height, bits, coding) = if u32_at(b, 14)? == 12 {
        (u16_at(b, 18)?, u16_at(b, 20)?, u16_at(b, 24)?, 0)
    } else {
        // A negative height means rows from the top.
        let (w, h) = (u32_at(b, 18)? as i32, u32_at(b, 22)? as i32);
        (u64::from(w.unsigned_abs()), u64::from(h.unsigned_abs()), u16_at(b, 28)?, u32_at(b, 30)?)
    };
    let needed = if coding == 1 || coding == 2 {
        u64::from(u32_at(b, 2)?) // run-length coded: the length that the file itself states
    } else {
        start + (width * bits).div_ceil(32) * 4 * height
    };
    Some((width, height, needed))
}

pub(super) fn decode(bytes: &[u8], colour: Colour, max_pixels: u64) -> Result<Pixels> {
    let (w, h, needed) = claimed(bytes).ok_or_else(|| damaged("not a whole BMP", "the header breaks off"))?;
    let (width, height) = check_size(w, h, max_pixels)?;
    if (bytes.len() as u64) < needed {
        return Err(damaged("not a whole BMP", format!("{} bytes of the {needed} its header promises", bytes.len())));
    }
    let options = DecoderOptions::new_fast().set_max_width(width).set_max_height(height);
    let mut decoder = BmpDecoder::new_with_options(ZCursor::new(bytes), options);
    let data = decoder.decode().map_err(|e| damaged("not a whole BMP", format!("{e:?}")))?;
    let channels = data.len() / (width * height);
    // BMP has no 8-bit grey: cameras write a grey ramp as palette, and those frames are grey.
    if channels == 3 && u16_at(bytes, 28).is_some_and(|bits| bits <= 8) && is_gray(&data) && gray_palette(bytes) {
        let data = data.as_chunks::<3>().0.iter().map(|p| p[0]).collect();
        return Samples { width, height, channels: 1, data }.into_pixels(colour);
    }
    Samples { width, height, channels, data }.into_pixels(colour)
}

fn is_gray(rgb: &[u8]) -> bool {
    rgb.as_chunks::<3>().0.iter().all(|p| p[0] == p[1] && p[1] == p[2])
}

/// Whether the whole palette is grey, so that every frame of a sequence decides alike.
fn gray_palette(b: &[u8]) -> bool {
    let (Some(start), Some(header)) = (u32_at(b, 10), u32_at(b, 14)) else { return false };
    let n = if header == 12 { 3 } else { 4 };
    let (from, to) = (14usize.saturating_add(header as usize), start as usize);
    b.get(from..to).is_some_and(|palette| palette.chunks_exact(n).all(|p| p[0] == p[1] && p[1] == p[2]))
}
