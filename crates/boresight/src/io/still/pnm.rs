//! PNM: PBM, PGM and PPM, plain and binary (P1 to P6), and float PFM (Pf, PF).
//!
//! Values stay what the file says (a 12-bit image with maxval 4095 holds 0..=4095); maxval up to 255 gives 8 bits, above 16 bits.
//! Why no crate: `zune-ppm` 0.5.1 reads no plain files and no PBM; `image` 0.25.10 rescales what is not 8 or 16 bits deep (1 of
//! maxval 4095 becomes 16) and reads no float PFM.
//! Source: netpbm's format pages pbm(5), pgm(5), ppm(5), pfm(5). A PBM's black (1) becomes 0, white (0) becomes 255.

use crate::io::guard::damaged;
use crate::io::options::Colour;
use crate::io::pixels::check_size;
use crate::io::samples::Samples;
use crate::memory_budget::afford;
use crate::{Error, ErrorKind, Pixels, Result};

/// Reads white-space separated words, with `#` comments.
struct Words<'a> {
    bytes: &'a [u8],
    at: usize,
}

impl Words<'_> {
    fn skip_blank(&mut self) {
        while let Some(&b) = self.bytes.get(self.at) {
            if b == b'#' {
                while self.bytes.get(self.at).is_some_and(|&b| b != b'\n') {
                    self.at += 1;
                }
            } else if b.is_ascii_whitespace() {
                self.at += 1;
            } else {
                return;
            }
        }
    }

    fn word(&mut self, what: &str) -> Result<&str> {
        self.skip_blank();
        let start = self.at;
        while self.bytes.get(self.at).is_some_and(|b| !b.is_ascii_whitespace() && *b != b'#') {
            self.at += 1;
        }
        let word = self.bytes.get(start..self.at).unwrap_or_default();
        if word.is_empty() {
            return Err(damaged("not a whole PNM", format!("it ends before {what}")));
        }
        std::str::from_utf8(word).map_err(|_| damaged("not a PNM", format!("{what} is not a number")))
    }

    fn number(&mut self, what: &str) -> Result<u64> {
        let word = self.word(what)?;
        word.parse().map_err(|_| damaged("not a PNM", format!("{what} is '{word}', expected a whole number")))
    }

    /// The bytes behind the one white space that ends a binary header.
    fn raster(&self, n: usize) -> Result<&[u8]> {
        let start = self.at + 1;
        let got = self.bytes.len().saturating_sub(start);
        self.bytes
            .get(start..start.saturating_add(n))
            .ok_or_else(|| damaged("not a whole PNM", format!("{got} bytes of pixels, expected {n}")))
    }
}

pub(super) fn decode(bytes: &[u8], colour: Colour, max_pixels: u64) -> Result<Pixels> {
    let magic: [u8; 2] = *bytes.first_chunk().ok_or_else(|| damaged("not a whole PNM", "it has no header"))?;
    let mut words = Words { bytes, at: 2 };
    let (w, h) = (words.number("the width")?, words.number("the height")?);
    let (width, height) = check_size(w, h, max_pixels)?;
    // The samples and the pixels, of up to three channels of two bytes.
    afford(width, height, 12)?;
    let n = width * height;
    let channels = if matches!(&magic, b"P3" | b"P6" | b"PF") { 3 } else { 1 };
    match &magic {
        b"P1" => {
            let data = plain_bits(&mut words, n)?;
            return Samples { width, height, channels, data }.into_pixels(colour);
        }
        b"P4" => {
            let stride = width.div_ceil(8);
            let raster = words.raster(stride * height)?;
            let bit = |row: &[u8], x: usize| if row[x / 8] >> (7 - x % 8) & 1 == 1 { 0 } else { 255 };
            let data: Vec<u8> =
                raster.chunks_exact(stride).flat_map(|row| (0..width).map(move |x| bit(row, x))).collect();
            return Samples { width, height, channels, data }.into_pixels(colour);
        }
        b"Pf" | b"PF" => return float(words, width, height, channels, colour),
        b"P2" | b"P3" | b"P5" | b"P6" => {}
        _ => {
            return Err(Error::new(
                ErrorKind::Unsupported,
                "this kind of PNM is not read: expected P1 to P6, Pf or PF",
            ));
        }
    }
    let max = words.number("the largest value")?;
    if !(1..=65535).contains(&max) {
        return Err(damaged("not a PNM", format!("the largest value is {max}, expected 1 to 65535")));
    }
    let n = n * channels;
    if matches!(&magic, b"P2" | b"P3") {
        // At least two bytes a sample: a short file cannot make us take memory for what it claims.
        if n > bytes.len() {
            return Err(damaged("not a whole PNM", format!("{} bytes cannot hold {n} samples", bytes.len())));
        }
        let mut data = Vec::with_capacity(n);
        for _ in 0..n {
            let value = words.number("the last sample")?;
            if value > max {
                return Err(damaged("not a PNM", format!("a sample is {value}, above the largest value {max}")));
            }
            data.push(value as u16);
        }
        return if max > 255 {
            Samples { width, height, channels, data }.into_pixels(colour)
        } else {
            let data = data.into_iter().map(|v| v as u8).collect();
            Samples { width, height, channels, data }.into_pixels(colour)
        };
    }
    if max > 255 {
        let data = words.raster(n * 2)?.as_chunks::<2>().0.iter().map(|&b| u16::from_be_bytes(b)).collect();
        Samples { width, height, channels, data }.into_pixels(colour)
    } else {
        Samples { width, height, channels, data: words.raster(n)?.to_vec() }.into_pixels(colour)
    }
}

/// The digits of a plain PBM, which need no white space between them.
fn plain_bits(words: &mut Words<'_>, n: usize) -> Result<Vec<u8>> {
    if n > words.bytes.len() {
        return Err(damaged("not a whole PNM", format!("{} bytes cannot hold {n} samples", words.bytes.len())));
    }
    let mut data = Vec::with_capacity(n);
    while data.len() < n {
        words.skip_blank();
        match words.bytes.get(words.at) {
            Some(b'0') => data.push(255),
            Some(b'1') => data.push(0),
            Some(_) => return Err(damaged("not a PNM", "a plain bitmap holds only 0 and 1")),
            None => return Err(damaged("not a whole PNM", format!("{} samples, expected {n}", data.len()))),
        }
        words.at += 1;
    }
    Ok(data)
}

/// PFM: rows from the bottom, byte order by the sign of the scale, which itself scales nothing here.
fn float(mut words: Words<'_>, width: usize, height: usize, channels: usize, colour: Colour) -> Result<Pixels> {
    let scale = words.word("the scale")?;
    let scale: f32 = scale.parse().map_err(|_| damaged("not a PFM", format!("the scale is '{scale}'")))?;
    let stride = width * channels;
    let raster = words.raster(stride * height * 4)?;
    let value = |b: &[u8; 4]| if scale < 0.0 { f32::from_le_bytes(*b) } else { f32::from_be_bytes(*b) };
    let mut data = Vec::with_capacity(stride * height);
    for y in (0..height).rev() {
        let row = &raster[y * stride * 4..(y + 1) * stride * 4];
        data.extend(row.as_chunks::<4>().0.iter().map(value));
    }
    Samples { width, height, channels, data }.into_pixels(colour)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Image;

    fn read(bytes: &[u8]) -> Result<Pixels> {
        decode(bytes, Colour::Native, 1 << 20)
    }

    #[test]
    fn twelve_bit_values_stay_what_the_file_says() {
        let want = Pixels::Gray16(Image::from_vec(2, 1, vec![4095, 258]).unwrap());
        assert_eq!(read(b"P5 # camera\n2 1\n4095\n\x0f\xff\x01\x02").unwrap(), want);
        assert_eq!(read(b"P2\n2 1\n4095\n4095 # c\n 258\n").unwrap(), want);
    }

    #[test]
    fn bitmaps_are_white_where_the_bit_is_not_set() {
        let want = Pixels::Gray8(Image::from_vec(3, 2, vec![0, 255, 255, 255, 255, 0]).unwrap());
        assert_eq!(read(b"P1 3 2 1 0 0\n001").unwrap(), want);
        assert_eq!(read(b"P4 3 2\n\x80\x20").unwrap(), want);
    }

    #[test]
    fn float_rows_come_from_the_bottom_in_either_byte_order() {
        let want = Pixels::GrayF32(Image::from_vec(1, 2, vec![-1.5f32, 2.0]).unwrap());
        for (scale, order) in [("-1.0", f32::to_le_bytes as fn(f32) -> [u8; 4]), ("1.0", f32::to_be_bytes)] {
            let mut file = format!("Pf\n1 2\n{scale}\n").into_bytes();
            file.extend(order(2.0));
            file.extend(order(-1.5));
            assert_eq!(read(&file).unwrap(), want);
        }
    }

    #[test]
    fn every_cut_of_a_file_is_an_error() {
        for whole in
            [&b"P5 2 2 255\n1234"[..], b"P3 1 1 9 1 2 3", b"P6 1 1 255\n123", b"P1 2 2 1011", b"Pf 1 1 -1\n1234"]
        {
            assert!(read(whole).is_ok());
            for n in 0..whole.len() {
                assert!(read(&whole[..n]).is_err(), "{:?}", std::str::from_utf8(&whole[..n]));
            }
        }
    }
}
