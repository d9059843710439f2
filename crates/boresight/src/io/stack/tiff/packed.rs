//! TIFF pages that the `tiff` crate (0.11.3, its newest) does not read: palettes of 1 to 8 bits, and grey packed to 10, 12 or 14 bits.
//!
//! Strips or tiles; uncompressed, LZW, deflate or PackBits; horizontal predictor for 8-bit palettes. Samples are packed
//! from the high bit on, each row starts at a byte. Source: TIFF 6.0, sections 3 to 5, 9, 14, 15 and 8 (palette colour).

use super::chunk::chunk_bytes;
use super::failure::failed;
use crate::io::guard::damaged;
use crate::io::options::Colour;
use crate::io::pixels::check_size;
use crate::io::samples::Samples;
use crate::memory_budget::afford;
use crate::{Error, ErrorKind, Pixels, Result};
use std::io::{Read, Seek};
use tiff::decoder::Decoder;
use tiff::tags::Tag;

/// What the directory says of such a page.
struct Page {
    width: usize,
    height: usize,
    bits: usize,
    palette: bool,
    white_is_zero: bool,
    compression: u32,
    predictor: bool,
    /// Width and height of a strip or tile, px.
    chunk: (usize, usize),
    tiled: bool,
    offsets: Vec<u64>,
    lengths: Vec<u64>,
}

/// Reads the page if it is one of these kinds, else returns `None`.
pub(super) fn read<R: Read + Seek>(
    decoder: &mut Decoder<R>,
    colour: Colour,
    max_pixels: u64,
) -> Result<Option<Pixels>> {
    let Some(page) = page(decoder, max_pixels)? else { return Ok(None) };
    let samples = unpacked(decoder, &page)?;
    let (width, height) = (page.width, page.height);
    if !page.palette {
        let max = (1u16 << page.bits) - 1;
        let data = samples.into_iter().map(|v| if page.white_is_zero { max - v } else { v }).collect();
        return Samples::<u16> { width, height, channels: 1, data }.into_pixels(colour).map(Some);
    }
    let table = decoder.get_tag_u16_vec(Tag::ColorMap).map_err(failed)?;
    let n = table.len() / 3;
    let mut data = Vec::with_capacity(width * height * 3);
    for index in samples {
        let i = usize::from(index);
        if i >= n {
            return Err(damaged("not a whole TIFF", format!("a pixel names colour {i} of a palette of {n}")));
        }
        // Three tables, one behind the other, of 16 bits each.
        data.extend([table[i], table[n + i], table[2 * n + i]].map(|v| (v >> 8) as u8));
    }
    // A grey palette is a grey image.
    if table[..n] == table[n..2 * n] && table[..n] == table[2 * n..3 * n] {
        let data = data.into_iter().step_by(3).collect();
        return Samples::<u8> { width, height, channels: 1, data }.into_pixels(colour).map(Some);
    }
    Samples { width, height, channels: 3, data }.into_pixels(colour).map(Some)
}

fn page<R: Read + Seek>(decoder: &mut Decoder<R>, max_pixels: u64) -> Result<Option<Page>> {
    let (w, h) = decoder.dimensions().map_err(failed)?;
    let mut tag = |tag: Tag| decoder.find_tag_unsigned::<u32>(tag).map_err(failed);
    let photometric = tag(Tag::PhotometricInterpretation)?.unwrap_or(1);
    let per_pixel = tag(Tag::SamplesPerPixel)?.unwrap_or(1);
    let format = tag(Tag::SampleFormat)?.unwrap_or(1);
    // One sample to a pixel: one value here too.
    let bits = if per_pixel == 1 { tag(Tag::BitsPerSample)?.unwrap_or(1) } else { 0 };
    let palette = photometric == 3;
    let ours = per_pixel == 1
        && format == 1
        && if palette { matches!(bits, 1 | 2 | 4 | 8) } else { photometric <= 1 && matches!(bits, 10 | 12 | 14) };
    if !ours {
        return Ok(None);
    }
    let (width, height) = check_size(w.into(), h.into(), max_pixels)?;
    // The unpacked samples, those of a strip, the pixels.
    afford(width, height, 8)?;
    let predictor = tag(Tag::Predictor)?.unwrap_or(1);
    let compression = tag(Tag::Compression)?.unwrap_or(1);
    let order = tag(Tag::FillOrder)?.unwrap_or(1);
    if predictor > 2 || (predictor == 2 && bits != 8) || order != 1 {
        return Err(Error::new(
            ErrorKind::Unsupported,
            format!("TIFF with {bits} bits, predictor {predictor}, bit order {order}"),
        )
        .hint("rewrite it uncompressed with 8 or 16 bits a sample"));
    }
    let tile = (tag(Tag::TileWidth)?, tag(Tag::TileLength)?);
    let (tiled, chunk) = match tile {
        (Some(tw), Some(th)) => (true, check_size(tw.into(), th.into(), max_pixels)?),
        _ => {
            let rows = tag(Tag::RowsPerStrip)?.map_or(height, |r| (r as usize).min(height));
            (false, (width, rows.max(1)))
        }
    };
    let (at, len) =
        if tiled { (Tag::TileOffsets, Tag::TileByteCounts) } else { (Tag::StripOffsets, Tag::StripByteCounts) };
    let offsets = decoder.get_tag_u64_vec(at).map_err(failed)?;
    let lengths = decoder.get_tag_u64_vec(len).map_err(failed)?;
    let n_chunks = width.div_ceil(chunk.0) * height.div_ceil(chunk.1);
    if offsets.len() < n_chunks || lengths.len() < n_chunks {
        return Err(damaged(
            "not a whole TIFF",
            format!("{} of {n_chunks} strips or tiles", offsets.len().min(lengths.len())),
        ));
    }
    let white_is_zero = photometric == 0;
    let (bits, predictor) = (bits as usize, predictor == 2);
    Ok(Some(Page {
        width,
        height,
        bits,
        palette,
        white_is_zero,
        compression,
        predictor,
        chunk,
        tiled,
        offsets,
        lengths,
    }))
}

/// All samples of the page, row by row.
fn unpacked<R: Read + Seek>(decoder: &mut Decoder<R>, page: &Page) -> Result<Vec<u16>> {
    let mut out = vec![0u16; page.width * page.height];
    let across = page.width.div_ceil(page.chunk.0);
    let stride = (page.chunk.0 * page.bits).div_ceil(8);
    for (k, (&offset, &length)) in page.offsets.iter().zip(&page.lengths).enumerate() {
        let (left, top) = (k % across * page.chunk.0, k / across * page.chunk.1);
        if top >= page.height {
            break;
        }
        let shown = page.chunk.1.min(page.height - top);
        // The last strip ends with the image; tiles are always whole.
        let rows = if page.tiled { page.chunk.1 } else { shown };
        let mut bytes = chunk_bytes(decoder.inner(), offset, length, page.compression, stride * rows)?;
        for (y, row) in bytes.chunks_exact_mut(stride).take(shown).enumerate() {
            if page.predictor {
                for x in 1..row.len() {
                    row[x] = row[x].wrapping_add(row[x - 1]);
                }
            }
            let n = page.chunk.0.min(page.width - left);
            let start = (top + y) * page.width + left;
            for (x, value) in out[start..start + n].iter_mut().enumerate() {
                *value = sample(row, x * page.bits, page.bits);
            }
        }
    }
    Ok(out)
}

/// `n` bits (at most 14) from bit `at` on, high bit first.
fn sample(row: &[u8], at: usize, n: usize) -> u16 {
    let byte = |i: usize| row.get(at / 8 + i).copied().map_or(0, u32::from);
    let three = byte(0) << 16 | byte(1) << 8 | byte(2);
    (three >> (24 - at % 8 - n)) as u16 & ((1u16 << n) - 1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn packed_samples_start_at_the_high_bit() {
        assert_eq!([0, 12].map(|at| sample(&[0xab, 0xcd, 0xef], at, 12)), [0xabc, 0xdef]);
        assert_eq!([0, 14].map(|at| sample(&[0xff, 0xfc, 0, 0x01], at, 14)), [0x3fff, 0]);
    }
}
