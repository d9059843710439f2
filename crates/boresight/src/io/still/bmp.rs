//! BMP: palette (1, 4, 8 bits, plain or run-length coded), 16, 24 and 32 bits with or without bit masks.
//!
//! A palette that is all grey gives grey frames, for BMP knows no other 8-bit grey; alpha is dropped.
//! Why no crate: `zune-bmp` 0.5.2 decodes 1-bit files wrongly (`bit.bmp` of the tests) and takes files that break off for whole
//! (`g8.bmp`: 1232 of its 1298 beginnings). `image` 0.25.10 passes both, but brings four crates, colour management among them,
//! for these 200 lines, and cannot spare the reader of PNM. Source: Microsoft, *Bitmap
//! Storage* (BITMAPFILEHEADER, BITMAPCOREHEADER, BITMAPINFOHEADER, BITMAPV5HEADER, *Bitmap Compression*).

use crate::io::guard::damaged;
use crate::io::options::Colour;
use crate::io::pixels::check_size;
use crate::io::samples::Samples;
use crate::memory_budget::afford;
use crate::{Error, ErrorKind, Pixels, Result};

/// Values of the header's `compression` field.
const RLE8: u32 = 1;
const RLE4: u32 = 2;
const BIT_FIELDS: u32 = 3;
const ALPHA_BIT_FIELDS: u32 = 6;

struct Header {
    start: usize,
    width: usize,
    height: usize,
    top_down: bool,
    bits: usize,
    coding: u32,
    palette: Vec<[u8; 3]>,
    masks: [u32; 3],
}

fn u16_at(b: &[u8], at: usize) -> Option<u16> {
    Some(u16::from_le_bytes(*b.get(at..)?.first_chunk()?))
}

fn u32_at(b: &[u8], at: usize) -> Option<u32> {
    Some(u32::from_le_bytes(*b.get(at..)?.first_chunk()?))
}

fn header(b: &[u8], max_pixels: u64) -> Result<Header> {
    let short = || damaged("not a whole BMP", "the header breaks off");
    let start = u32_at(b, 10).ok_or_else(short)? as usize;
    let info = u32_at(b, 14).ok_or_else(short)? as usize;
    let old = info == 12;
    let fields = || {
        Some(if old {
            (i64::from(u16_at(b, 18)?), i64::from(u16_at(b, 20)?), u16_at(b, 24)?, 0, 0)
        } else {
            // A negative height means rows from the top.
            let (w, h) = (u32_at(b, 18)? as i32, u32_at(b, 22)? as i32);
            (i64::from(w), i64::from(h), u16_at(b, 28)?, u32_at(b, 30)?, u32_at(b, 46).unwrap_or(0))
        })
    };
    let (w, h, bits, coding, n_colours) = fields().ok_or_else(short)?;
    let (width, height) = check_size(w.unsigned_abs(), h.unsigned_abs(), max_pixels)?;
    // The samples and the pixels.
    afford(width, height, 6)?;
    let bits = usize::from(bits);
    let sound = match coding {
        0 => matches!(bits, 1 | 4 | 8 | 16 | 24 | 32),
        RLE8 => bits == 8,
        RLE4 => bits == 4,
        BIT_FIELDS | ALPHA_BIT_FIELDS => matches!(bits, 16 | 32),
        _ => false,
    };
    if !sound {
        return Err(Error::new(
            ErrorKind::Unsupported,
            format!("a BMP of {bits} bits with coding {coding} is not read"),
        )
        .hint("convert the images to PNG"));
    }
    let mut palette = Vec::new();
    if bits <= 8 {
        let entry = if old { 3 } else { 4 };
        let all = 1usize << bits;
        let n = if n_colours == 0 { all } else { (n_colours as usize).min(all) };
        let from = 14 + info;
        let table = b.get(from..from + n * entry).ok_or_else(short)?;
        palette.extend(table.chunks_exact(entry).map(|c| [c[2], c[1], c[0]]));
    }
    let masks = match (coding, bits) {
        // The masks stand at the same place, inside the longer headers or right behind the short one.
        (BIT_FIELDS | ALPHA_BIT_FIELDS, _) => {
            let mask = |at| u32_at(b, at).ok_or_else(short);
            [mask(54)?, mask(58)?, mask(62)?]
        }
        (_, 16) => [0x7c00, 0x03e0, 0x001f],
        _ => [0x00ff_0000, 0xff00, 0xff],
    };
    Ok(Header { start, width, height, top_down: h < 0, bits, coding, palette, masks })
}

pub(super) fn decode(bytes: &[u8], colour: Colour, max_pixels: u64) -> Result<Pixels> {
    let head = header(bytes, max_pixels)?;
    let body = bytes.get(head.start..).ok_or_else(|| damaged("not a whole BMP", "it ends before its pixels"))?;
    let (width, height) = (head.width, head.height);
    if head.bits <= 8 {
        let indices = match head.coding {
            RLE8 | RLE4 => run_lengths(body, &head)?,
            _ => {
                let bits = head.bits;
                let mask = ((1u16 << bits) - 1) as u8;
                rows(body, &head, |row, x| row[x * bits / 8] >> (8 - bits - x * bits % 8) & mask)?
            }
        };
        let n = head.palette.len();
        if let Some(bad) = indices.iter().find(|i| usize::from(**i) >= n) {
            return Err(damaged("not a whole BMP", format!("a pixel names colour {bad} of a palette of {n}")));
        }
        if head.palette.iter().all(|c| c[0] == c[1] && c[1] == c[2]) {
            let data = indices.iter().map(|i| head.palette[usize::from(*i)][0]).collect();
            return Samples::<u8> { width, height, channels: 1, data }.into_pixels(colour);
        }
        let data = indices.iter().flat_map(|i| head.palette[usize::from(*i)]).collect();
        return Samples::<u8> { width, height, channels: 3, data }.into_pixels(colour);
    }
    let n = head.bits / 8;
    let rgb = if head.bits == 24 {
        rows(body, &head, |row, x| [row[3 * x + 2], row[3 * x + 1], row[3 * x]])?
    } else {
        let scale = head.masks.map(Channel::of);
        rows(body, &head, |row, x| {
            let value = row[n * x..n * (x + 1)].iter().rev().fold(0, |acc, b| acc << 8 | u32::from(*b));
            [scale[0].of_pixel(value), scale[1].of_pixel(value), scale[2].of_pixel(value)]
        })?
    };
    Samples { width, height, channels: 3, data: rgb.into_flattened() }.into_pixels(colour)
}

/// A bit mask and how to bring its value to 0..=255.
struct Channel {
    mask: u32,
    shift: u32,
    max: u64,
}

impl Channel {
    fn of(mask: u32) -> Self {
        let shift = mask.trailing_zeros().min(31);
        Self { mask, shift, max: u64::from(mask >> shift) }
    }

    fn of_pixel(&self, pixel: u32) -> u8 {
        if self.max == 0 {
            return 0;
        }
        let value = u64::from((pixel & self.mask) >> self.shift);
        ((value * 255 + self.max / 2) / self.max) as u8
    }
}

/// Reads uncompressed rows (each padded to 4 bytes) into an image from the top.
fn rows<T>(body: &[u8], head: &Header, pixel: impl Fn(&[u8], usize) -> T) -> Result<Vec<T>> {
    let stride = (head.width * head.bits).div_ceil(32) * 4;
    // Some writers leave out the padding behind the last row.
    let needed = stride * (head.height - 1) + (head.width * head.bits).div_ceil(8);
    if body.len() < needed {
        return Err(damaged("not a whole BMP", format!("{} bytes of pixels, expected {needed}", body.len())));
    }
    let mut out = Vec::with_capacity(head.width * head.height);
    for y in 0..head.height {
        let y = if head.top_down { y } else { head.height - 1 - y };
        let row = &body[y * stride..body.len().min((y + 1) * stride)];
        out.extend((0..head.width).map(|x| pixel(row, x)));
    }
    Ok(out)
}

/// Decodes run lengths; what they skip has index 0. A stream without its end mark is broken off.
fn run_lengths(body: &[u8], head: &Header) -> Result<Vec<u8>> {
    let (width, height) = (head.width, head.height);
    let mut out = vec![0u8; width * height];
    let mut next = body.iter().copied();
    let broken = || damaged("not a whole BMP", "its run lengths break off");
    let (mut x, mut y) = (0usize, 0usize);
    let mut put = |x: &mut usize, y: usize, value: u8| {
        if *x < width && y < height {
            let row = if head.top_down { y } else { height - 1 - y };
            out[row * width + *x] = value;
        }
        *x += 1;
    };
    loop {
        let (count, value) = (next.next().ok_or_else(broken)?, next.next().ok_or_else(broken)?);
        match (count, value) {
            (0, 0) => (x, y) = (0, y + 1),
            (0, 1) => return Ok(out),
            (0, 2) => {
                x += usize::from(next.next().ok_or_else(broken)?);
                y += usize::from(next.next().ok_or_else(broken)?);
            }
            (0, n) if head.coding == RLE8 => {
                for _ in 0..n {
                    put(&mut x, y, next.next().ok_or_else(broken)?);
                }
                if n % 2 == 1 {
                    next.next();
                }
            }
            (0, n) => {
                let n_bytes = n.div_ceil(2);
                for i in 0..n_bytes {
                    let pair = next.next().ok_or_else(broken)?;
                    put(&mut x, y, pair >> 4);
                    if 2 * i + 1 < n {
                        put(&mut x, y, pair & 15);
                    }
                }
                if n_bytes % 2 == 1 {
                    next.next();
                }
            }
            (n, value) if head.coding == RLE8 => (0..n).for_each(|_| put(&mut x, y, value)),
            (n, pair) => (0..n).for_each(|i| put(&mut x, y, if i % 2 == 0 { pair >> 4 } else { pair & 15 })),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Image;

    fn file(bits: u16, coding: u32, (w, h): (i32, i32), palette: &[u8], body: &[u8]) -> Vec<u8> {
        let start = 54 + palette.len() as u32;
        let mut f = b"BM".to_vec();
        f.extend((start + body.len() as u32).to_le_bytes());
        f.extend([0; 4]);
        f.extend(start.to_le_bytes());
        f.extend(40u32.to_le_bytes());
        f.extend(w.to_le_bytes());
        f.extend(h.to_le_bytes());
        f.extend(1u16.to_le_bytes());
        f.extend(bits.to_le_bytes());
        f.extend(coding.to_le_bytes());
        f.extend([0; 12]);
        f.extend((palette.len() as u32 / 4).to_le_bytes());
        f.extend([0; 4]);
        f.extend_from_slice(palette);
        f.extend_from_slice(body);
        f
    }

    const RED_BLUE_GREEN: [u8; 12] = [0, 0, 255, 0, 255, 0, 0, 0, 0, 255, 0, 0];

    #[test]
    fn run_lengths_with_a_literal_a_skip_and_an_end_of_line_give_the_picture() {
        // Rows from the bottom: two of colour 1, literal 2 1 2 (padded); then one skipped, four of colour 2.
        let body = [2, 1, 0, 3, 2, 1, 2, 0, 0, 0, 0, 2, 1, 0, 4, 2, 0, 1];
        let image = decode(&file(8, RLE8, (5, 2), &RED_BLUE_GREEN, &body), Colour::Native, 100).unwrap();
        let (r, b, g) = ([255, 0, 0], [0, 0, 255], [0, 255, 0]);
        let want = vec![r, g, g, g, g, b, b, g, b, g];
        assert_eq!(image, Pixels::Rgb8(Image::from_vec(5, 2, want).unwrap()));
        let body = [3, 0x12, 0, 3, 0x20, 0x10, 0, 1];
        let image = decode(&file(4, RLE4, (6, 1), &RED_BLUE_GREEN, &body), Colour::Native, 100).unwrap();
        assert_eq!(image, Pixels::Rgb8(Image::from_vec(6, 1, vec![b, g, b, g, r, b]).unwrap()));
    }

    #[test]
    fn five_bit_channels_reach_255_and_a_negative_height_starts_at_the_top() {
        let body = [0xff, 0x7f, 0x00, 0x7c, 0x1f, 0x00, 0, 0];
        let image = decode(&file(16, 0, (2, -2), &[], &body), Colour::Native, 100).unwrap();
        let want = vec![[255; 3], [255, 0, 0], [0, 0, 255], [0; 3]];
        assert_eq!(image, Pixels::Rgb8(Image::from_vec(2, 2, want).unwrap()));
    }

    #[test]
    fn a_file_that_breaks_off_is_an_error_at_every_length() {
        for whole in [
            file(8, RLE8, (5, 2), &RED_BLUE_GREEN, &[2, 1, 0, 3, 2, 1, 2, 0, 0, 0, 0, 2, 1, 0, 4, 2, 0, 1]),
            file(24, 0, (1, 1), &[], &[1, 2, 3]),
            file(1, 0, (9, 1), &[0, 0, 0, 0, 255, 255, 255, 0], &[0xaa, 0x80]),
        ] {
            assert!(decode(&whole, Colour::Native, 100).is_ok());
            for n in 0..whole.len() {
                assert!(decode(&whole[..n], Colour::Native, 100).is_err());
            }
        }
    }
}
