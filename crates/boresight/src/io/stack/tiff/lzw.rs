//! TIFF pages packed by LZW, unpacked here a whole strip or tile at a time.
//!
//! Why not the `tiff` crate alone (0.11.3, its newest): it asks its LZW decoder for a chunk row by row; on some chunks the decoder then reports that no
//! end code was found although codes are left, and the page is lost (seen on tiles of noise: 40 of 120 test files).
//! Here: samples of 8, 16, 32 or 64 bits side by side (not in planes), grey or RGB, without or with the horizontal
//! predictor. Everything else is left to the crate. Source: TIFF 6.0, sections 13, 14 and 15.

use super::chunk::chunk_bytes;
use super::failure::failed;
use crate::Result;
use crate::io::guard::damaged;
use std::io::{Read, Seek};
use tiff::decoder::{Decoder, DecodingResult};
use tiff::tags::{ByteOrder, Tag};

/// What the directory says of such a page.
struct Page {
    channels: usize,
    /// Bytes of a sample.
    size: usize,
    /// 1 unsigned, 2 signed, 3 float.
    format: u32,
    predictor: bool,
    chunk: (usize, usize),
    tiled: bool,
}

/// Reads the page's samples if it is of this kind, else returns `None`. The caller has checked width and height.
pub(super) fn read<R: Read + Seek>(
    decoder: &mut Decoder<R>,
    width: usize,
    height: usize,
) -> Result<Option<DecodingResult>> {
    let Some(page) = page(decoder, width, height)? else { return Ok(None) };
    let little = matches!(decoder.byte_order(), ByteOrder::LittleEndian);
    let (at, len) =
        if page.tiled { (Tag::TileOffsets, Tag::TileByteCounts) } else { (Tag::StripOffsets, Tag::StripByteCounts) };
    let offsets = decoder.get_tag_u64_vec(at).map_err(failed)?;
    let lengths = decoder.get_tag_u64_vec(len).map_err(failed)?;
    let across = width.div_ceil(page.chunk.0);
    let n_chunks = across * height.div_ceil(page.chunk.1);
    if offsets.len() < n_chunks || lengths.len() < n_chunks {
        let n = offsets.len().min(lengths.len());
        return Err(damaged("not a whole TIFF", format!("{n} of {n_chunks} strips or tiles")));
    }
    let pixel = page.channels * page.size;
    let (row_bytes, stride) = (width * pixel, page.chunk.0 * pixel);
    let mut out = vec![0_u8; row_bytes * height];
    for (k, (&offset, &length)) in offsets.iter().zip(&lengths).take(n_chunks).enumerate() {
        let (left, top) = (k % across * page.chunk.0, k / across * page.chunk.1);
        let shown = page.chunk.1.min(height - top);
        // The last strip ends with the image; tiles are always whole.
        let rows = if page.tiled { page.chunk.1 } else { shown };
        let mut bytes = chunk_bytes(decoder.inner(), offset, length, 5, stride * rows)?;
        if little {
            swap_to_big(&mut bytes, page.size);
        }
        for (y, row) in bytes.chunks_exact_mut(stride).take(shown).enumerate() {
            if page.predictor {
                add_up(row, page.channels, page.size);
            }
            let n = page.chunk.0.min(width - left) * pixel;
            let start = (top + y) * row_bytes + left * pixel;
            out[start..start + n].copy_from_slice(&row[..n]);
        }
    }
    Ok(Some(samples(&out, page.size, page.format)))
}

fn page<R: Read + Seek>(decoder: &mut Decoder<R>, width: usize, height: usize) -> Result<Option<Page>> {
    let mut tag = |tag: Tag| decoder.find_tag_unsigned::<u32>(tag).map_err(failed);
    let compression = tag(Tag::Compression)?.unwrap_or(1);
    let photometric = tag(Tag::PhotometricInterpretation)?.unwrap_or(0);
    let planes = tag(Tag::PlanarConfiguration)?.unwrap_or(1);
    let predictor = tag(Tag::Predictor)?.unwrap_or(1);
    let order = tag(Tag::FillOrder)?.unwrap_or(1);
    let channels = tag(Tag::SamplesPerPixel)?.unwrap_or(1) as usize;
    let tile = (tag(Tag::TileWidth)?, tag(Tag::TileLength)?);
    let strip = tag(Tag::RowsPerStrip)?.map_or(height, |r| r as usize);
    let ours = compression == 5
        && matches!(photometric, 1 | 2)
        && (planes == 1 || channels == 1)
        && matches!(predictor, 1 | 2)
        && order == 1
        && (1..=4).contains(&channels);
    if !ours {
        return Ok(None);
    }
    let bits = decoder.get_tag_u16_vec(Tag::BitsPerSample).map_err(failed)?;
    let formats = match decoder.find_tag(Tag::SampleFormat).map_err(failed)? {
        Some(v) => v.into_u16_vec().map_err(failed)?,
        None => vec![1],
    };
    let (Some(&depth), Some(&format)) = (bits.first(), formats.first()) else { return Ok(None) };
    let even = bits.iter().all(|b| *b == depth) && formats.iter().all(|f| *f == format);
    let known = matches!((format, depth), (1 | 2, 8 | 16 | 32) | (3, 32 | 64));
    let (tiled, chunk) = match tile {
        (Some(w), Some(h)) => (true, (w as usize, h as usize)),
        _ => (false, (width, strip.clamp(1, height.max(1)))),
    };
    // A tile may be larger than the image, but not absurdly so.
    let sane = chunk.0 > 0 && chunk.1 > 0 && chunk.0 <= width.max(1 << 14) && chunk.1 <= height.max(1 << 14);
    if !(even && known && sane) || (chunk.0 * chunk.1) as u64 > (1 << 26).max((width * height) as u64) {
        return Ok(None);
    }
    let size = usize::from(depth / 8);
    Ok(Some(Page { channels, size, format: format.into(), predictor: predictor == 2, chunk, tiled }))
}

fn swap_to_big(bytes: &mut [u8], size: usize) {
    if size > 1 {
        bytes.chunks_exact_mut(size).for_each(<[u8]>::reverse);
    }
}

/// Horizontal predictor: each sample is the difference from that of the pixel before; big-endian samples.
fn add_up(row: &mut [u8], channels: usize, size: usize) {
    let back = channels * size;
    for i in (back..row.len().saturating_sub(size - 1)).step_by(size) {
        let mut carry = 0_u16;
        for b in (i..i + size).rev() {
            let sum = u16::from(row[b]) + u16::from(row[b - back]) + carry;
            row[b] = sum as u8;
            carry = sum >> 8;
        }
    }
}

/// Big-endian bytes as samples.
fn samples(bytes: &[u8], size: usize, format: u32) -> DecodingResult {
    fn each<const N: usize, T>(bytes: &[u8], of: impl Fn([u8; N]) -> T) -> Vec<T> {
        bytes.as_chunks::<N>().0.iter().map(|b| of(*b)).collect()
    }
    match (format, size) {
        (1, 1) => DecodingResult::U8(bytes.to_vec()),
        (1, 2) => DecodingResult::U16(each(bytes, u16::from_be_bytes)),
        (1, _) => DecodingResult::U32(each(bytes, u32::from_be_bytes)),
        (2, 1) => DecodingResult::I8(each(bytes, i8::from_be_bytes)),
        (2, 2) => DecodingResult::I16(each(bytes, i16::from_be_bytes)),
        (2, _) => DecodingResult::I32(each(bytes, i32::from_be_bytes)),
        (_, 4) => DecodingResult::F32(each(bytes, f32::from_be_bytes)),
        _ => DecodingResult::F64(each(bytes, f64::from_be_bytes)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_predictor_adds_samples_with_their_carries() {
        let mut row = [0x00, 0xff, 0x00, 0x02, 0xff, 0xff];
        add_up(&mut row, 1, 2);
        assert_eq!(row, [0x00, 0xff, 0x01, 0x01, 0x01, 0x00]);
        let mut rgb = [1, 2, 3, 1, 1, 255];
        add_up(&mut rgb, 3, 1);
        assert_eq!(rgb, [1, 2, 3, 2, 3, 2]);
    }
}
