//! The pages of a TIFF or BigTIFF file, one after the other: strips or tiles, uncompressed, LZW, deflate, PackBits, JPEG.
//!
//! 8 and 16 bit grey and 32-bit float stay what they are. Signed and 32-bit integers, half and double floats become
//! 32-bit float (exact for 16 bits and half; a warning says so for the others). Separate colour planes are joined.
//! Reduced-size pages (previews, NewSubfileType bit 0) are passed over. Where zero stands for white, samples are turned
//! round so that bright is large. Of a hyperstack one channel and plane is read: see `hyperstack`. Palettes and 10, 12 and 14 bit samples: see `packed`. Not read: zstd, WebP.

use super::failure::failed;
use super::{hyperstack, lzw, packed};
use crate::io::guard::{damaged, guarded};
use crate::io::options::Colour;
use crate::io::pixels::check_size;
use crate::io::samples::Samples;
use crate::memory_budget::afford;
use crate::{Error, ErrorKind, Pixels, Result};
use std::io::{Read, Seek};
use tiff::ColorType;
use tiff::decoder::{Decoder, DecodingResult, Limits};
use tiff::tags::Tag;

/// Reads pages in file order.
pub(crate) struct TiffPages<R: Read + Seek> {
    decoder: Decoder<R>,
    max_pixels: u64,
    colour: Colour,
    started: bool,
    /// Full-size pages met so far, those passed over included.
    n_met: u64,
    /// Number of the page being read, from 1.
    at: u64,
    /// Every how many-th of them is given, and the first; `None` until the first page's description is read.
    step: Option<u64>,
    first: u64,
    /// Pages that ImageJ's description claims.
    n_claimed: Option<u64>,
    notes: Vec<String>,
}

impl<R: Read + Seek> TiffPages<R> {
    /// Opens the file at its first page.
    pub fn new(reader: R, colour: Colour, max_pixels: u64) -> Result<Self> {
        let mut limits = Limits::default();
        limits.decoding_buffer_size = usize::try_from(max_pixels.saturating_mul(12)).unwrap_or(usize::MAX);
        limits.intermediate_buffer_size = limits.decoding_buffer_size;
        limits.ifd_value_size = 16 << 20; // offsets of a million strips
        let decoder = guarded(|| Decoder::new(reader).map_err(failed))?.with_limits(limits);
        Ok(Self {
            decoder,
            max_pixels,
            colour,
            started: false,
            n_met: 0,
            at: 1,
            step: None,
            first: 0,
            n_claimed: None,
            notes: Vec::new(),
        })
    }

    /// Gives every `step`-th page from number `first` on; `None` takes the step from ImageJ's or OME's description.
    pub fn every(mut self, step: Option<u64>, first: u64) -> Self {
        (self.step, self.first) = (step, first);
        self
    }

    /// How many of `n` pages are given.
    pub fn n_given_of(&self, n: u64) -> u64 {
        n.saturating_sub(self.first).div_ceil(self.step.unwrap_or(1).max(1))
    }

    /// Number of the page being read, from 1.
    pub fn at(&self) -> u64 {
        self.at
    }

    /// What was changed on the way from the file to the pixels, said once.
    pub fn notes(&self) -> &[String] {
        &self.notes
    }

    /// Returns the next full-size page, or `None` behind the last.
    pub fn next_page(&mut self) -> Result<Option<Pixels>> {
        loop {
            self.at = self.n_met + 1;
            if self.started {
                if !self.decoder.more_images() {
                    self.note_missing();
                    return Ok(None);
                }
                guarded(|| self.decoder.next_image().map_err(failed))?;
            }
            self.started = true;
            let subfile: Option<u32> = self.decoder.find_tag_unsigned(Tag::NewSubfileType).map_err(failed)?;
            if self.n_met > 0 && subfile.is_some_and(|t| t & 1 == 1) {
                continue;
            }
            let step = self.settled_step();
            let at = self.n_met;
            self.n_met += 1;
            if at < self.first || !(at - self.first).is_multiple_of(step) {
                continue;
            }
            let page = guarded(|| self.read_page())?;
            return Ok(Some(page));
        }
    }

    /// Pages from one frame to the next; looks into the first page's description once.
    fn settled_step(&mut self) -> u64 {
        if self.n_met == 0 {
            let text = self.decoder.find_tag(Tag::ImageDescription).ok().flatten().and_then(|t| t.into_string().ok());
            let stack = text.as_deref().and_then(hyperstack::of_description);
            self.n_claimed = stack.and_then(|s| s.n_pages);
            if let (None, Some(stack)) = (self.step, stack.filter(|s| s.step() > 1)) {
                self.step = Some(stack.step());
                self.note(&format!(
                    "its pages are {} channels x {} slices x {} times, one in {} is taken, from number {} on (others: --set input.first-page=N; every page: --set input.page-step=1)",
                    stack.channels, stack.slices, stack.frames, stack.step(), self.first
                ));
            }
        }
        self.step.unwrap_or(1).max(1)
    }

    /// ImageJ writes stacks of more than 4 GiB with one directory; the other pages have none.
    fn note_missing(&mut self) {
        if let Some(claimed) = self.n_claimed.filter(|n| *n > self.n_met) {
            let met = self.n_met;
            self.note(&format!(
                "ImageJ's description claims {claimed} pages, {met} are in the file's directories and were read; save it as BigTIFF or OME-TIFF"
            ));
        }
    }

    fn read_page(&mut self) -> Result<Pixels> {
        let (w, h) = self.decoder.dimensions().map_err(failed)?;
        let (width, height) = check_size(w.into(), h.into(), self.max_pixels)?;
        if let Some(pixels) = packed::read(&mut self.decoder, self.colour, self.max_pixels)? {
            return Ok(pixels);
        }
        let colour_type = self.decoder.colortype().map_err(failed)?;
        // The decoder's samples and the pixels.
        let sample = u64::from(colour_type.bit_depth().div_ceil(8));
        afford(width, height, 2 * sample * u64::from(colour_type.num_samples()))?;
        let mut buffer = DecodingResult::U8(Vec::new());
        let planes = match lzw::read(&mut self.decoder, width, height)? {
            Some(samples) => {
                buffer = samples;
                1
            }
            None => self.decoder.read_image_to_buffer(&mut buffer).map_err(failed)?.planes,
        };
        let channels = match colour_type {
            ColorType::Gray(_) => 1,
            ColorType::GrayA(_) => 2,
            ColorType::RGB(_) | ColorType::YCbCr(_) => 3,
            ColorType::RGBA(_) => 4,
            ColorType::Multiband { num_samples, .. } => usize::from(num_samples),
            other => {
                return Err(Error::new(ErrorKind::Unsupported, format!("TIFF colours {other:?} are not read"))
                    .hint("convert the images to grey or RGB"));
            }
        };
        if channels > 4 {
            return Err(Error::new(ErrorKind::Unsupported, format!("{channels} samples in a pixel: expected 1 to 4"))
                .hint("write the channel to be tracked as grey pages"));
        }
        // Two-sample "multiband" data are two channels, not grey and alpha: which one is meant is not ours to guess.
        if matches!(colour_type, ColorType::Multiband { .. }) && channels > 1 {
            return Err(Error::new(ErrorKind::Unsupported, format!("{channels} unnamed channels in a pixel"))
                .hint("write the channel to be tracked as grey pages"));
        }
        let expect = width * height * channels;
        let depth = colour_type.bit_depth();
        let pixels = match buffer {
            DecodingResult::U8(data) if depth < 8 => {
                // One sample to a byte is promised only for 8 bits: smaller depths come packed.
                let data = unpack(&data, width, height, channels, depth)?;
                Samples { width, height, channels, data }.into_pixels(self.colour)?
            }
            DecodingResult::U8(data) => {
                let data = interleaved(data, planes, expect)?;
                Samples { width, height, channels, data }.into_pixels(self.colour)?
            }
            DecodingResult::U16(data) => {
                if channels > 2 && self.colour != Colour::Gray {
                    self.note("16-bit colour was rounded to 8 bits; in grey it keeps its 16 bits");
                }
                let data = interleaved(data, planes, expect)?;
                Samples { width, height, channels, data }.into_pixels(self.colour)?
            }
            other => {
                let data = interleaved(self.floats(other)?, planes, expect)?;
                Samples { width, height, channels, data }.into_pixels(self.colour)?
            }
        };
        Ok(pixels)
    }

    fn floats(&mut self, buffer: DecodingResult) -> Result<Vec<f32>> {
        const ROUNDED: &str = "samples wider than 24 bits were rounded to 32-bit float";
        Ok(match buffer {
            DecodingResult::F32(data) => data,
            DecodingResult::F16(data) => data.into_iter().map(|v| v.to_f32()).collect(),
            DecodingResult::F64(data) => {
                self.note(ROUNDED);
                data.into_iter().map(|v| v as f32).collect()
            }
            DecodingResult::I8(data) => data.into_iter().map(f32::from).collect(),
            DecodingResult::I16(data) => data.into_iter().map(f32::from).collect(),
            DecodingResult::U32(data) => {
                self.note(ROUNDED);
                data.into_iter().map(|v| v as f32).collect()
            }
            DecodingResult::I32(data) => {
                self.note(ROUNDED);
                data.into_iter().map(|v| v as f32).collect()
            }
            _ => {
                return Err(Error::new(ErrorKind::Unsupported, "64-bit integer samples are not read")
                    .hint("convert the images to 16 bits or to float"));
            }
        })
    }

    fn note(&mut self, text: &str) {
        if !self.notes.iter().any(|n| n == text) {
            self.notes.push(text.to_string());
        }
    }
}

/// Joins separate colour planes; data of one plane pass through.
fn interleaved<T: Copy>(data: Vec<T>, planes: usize, expect: usize) -> Result<Vec<T>> {
    if data.len() != expect {
        return Err(damaged("not a whole TIFF", format!("{} samples, expected {expect}", data.len())));
    }
    if planes <= 1 {
        return Ok(data);
    }
    let n = expect / planes;
    Ok((0..n).flat_map(|i| (0..planes).map(move |p| (p, i))).map(|(p, i)| data[p * n + i]).collect())
}

/// Unpacks samples of 1, 2 or 4 bits and scales them to 0..=255.
fn unpack(packed: &[u8], width: usize, height: usize, channels: usize, depth: u8) -> Result<Vec<u8>> {
    let mut data = unpack_raw(packed, width, height, channels, depth)?;
    let scale = 255 / ((1u16 << depth) - 1) as u8;
    data.iter_mut().for_each(|v| *v *= scale);
    Ok(data)
}

fn unpack_raw(packed: &[u8], width: usize, height: usize, channels: usize, depth: u8) -> Result<Vec<u8>> {
    if !matches!(depth, 1 | 2 | 4) {
        return Err(Error::new(ErrorKind::Unsupported, format!("{depth}-bit samples are not read")));
    }
    let depth = usize::from(depth);
    let stride = (width * channels * depth).div_ceil(8);
    if packed.len() < stride * height {
        return Err(damaged("not a whole TIFF", format!("{} bytes, expected {}", packed.len(), stride * height)));
    }
    let mask = ((1u16 << depth) - 1) as u8;
    let sample = |row: &[u8], i: usize| row[i * depth / 8] >> (8 - depth - i * depth % 8) & mask;
    Ok(packed
        .chunks_exact(stride)
        .take(height)
        .flat_map(|row| (0..width * channels).map(move |i| sample(row, i)))
        .collect())
}
