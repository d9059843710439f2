//! Pictures to H.264, one after another: `openh264` at constant quality, no frame skipped, no reordering.
//!
//! Colour is BT.709 in video range; grey keeps its values (full range), so that what a reader takes as luma is what the camera gave.
//! Sequence and picture parameter sets come apart from the coded picture, whose parts have their lengths before them (ISO/IEC 14496-15).
//! Limits: 8 bits, sides of 16 to [`MAX_SIZE`] pixels.

use super::i420::I420;
use super::options::{MAX_SIZE, Mp4Options};
use crate::{Error, ErrorKind, Image, Pixels, Result};
use openh264::OpenH264API;
use openh264::encoder::{
    Complexity, Encoder, EncoderConfig, FrameType, IntraFramePeriod, QpRange, RateControlMode, VuiConfig,
};
use openh264::formats::YUVSource;
use shiguredo_mp4::Uint;
use shiguredo_mp4::boxes::{Avc1Box, AvccBox, SampleEntry, VisualSampleEntryFields};

/// Kinds of the parts of a coded picture that describe it (H.264, table 7-1): sequence and picture parameter set.
const NAL_SPS: u8 = 7;
const NAL_PPS: u8 = 8;
/// What the encoder takes where it is given no rate control, whatever range it is told. With one it holds to any other quantiser, and writes on standard error that it skips no frame.
const OWN_QUANTISER: u8 = 26;
/// Shortest side that the encoder takes, px.
const MIN_SIDE: usize = 16;

impl YUVSource for I420 {
    fn dimensions(&self) -> (usize, usize) {
        (self.width, self.height)
    }
    fn strides(&self) -> (usize, usize, usize) {
        (self.width, self.width / 2, self.width / 2)
    }
    fn y(&self) -> &[u8] {
        &self.y
    }
    fn u(&self) -> &[u8] {
        &self.u
    }
    fn v(&self) -> &[u8] {
        &self.v
    }
}

pub(super) fn failed(what: &str, e: impl std::fmt::Display) -> Error {
    Error::new(ErrorKind::Output, format!("{what}: {e}"))
}

/// A coded picture.
#[derive(Clone, Debug, Default)]
pub struct CodedPicture {
    /// Whether decoding can start with it; only then there are parameter sets.
    pub is_key: bool,
    /// The parts of the picture, each with its length before it (4 bytes, the highest first).
    pub data: Vec<u8>,
    pub(super) sps: Vec<Vec<u8>>,
    pub(super) pps: Vec<Vec<u8>>,
}

impl CodedPicture {
    /// The name of the coding as browsers know it (RFC 6381), such as `avc1.42c01f`; `None` of a picture that is no key.
    pub fn codec(&self) -> Option<String> {
        let Some([_, profile, compatibility, level, ..]) = self.sps.first().map(Vec::as_slice) else { return None };
        Some(format!("avc1.{profile:02x}{compatibility:02x}{level:02x}"))
    }

    /// Appends the picture, its parameter sets first, as a byte stream (H.264, annex B), which can be decoded without a container.
    pub fn append_byte_stream(&self, out: &mut Vec<u8>) {
        let mut put = |part: &[u8]| {
            out.extend([0, 0, 0, 1]);
            out.extend(part);
        };
        self.sps.iter().chain(&self.pps).for_each(|part| put(part));
        let mut rest = &self.data[..];
        while let Some((head, tail)) = rest.split_first_chunk::<4>() {
            let (part, after) = tail.split_at((u32::from_be_bytes(*head) as usize).min(tail.len()));
            put(part);
            rest = after;
        }
    }
}

/// Codes pictures of one size and kind.
pub struct H264Coder {
    encoder: Option<(Encoder, bool)>,
    options: Mp4Options,
    size: (usize, usize),
    planes: I420,
    coded: CodedPicture,
}

opaque_debug!(H264Coder);

impl H264Coder {
    /// Will code pictures; the first one says their size and kind.
    pub fn new(options: Mp4Options) -> Self {
        Self { encoder: None, options, size: (0, 0), planes: I420::default(), coded: CodedPicture::default() }
    }

    /// Codes a picture; `wants_key` makes it one from which decoding can start, as the first one is.
    /// # Errors
    /// [`ErrorKind::Unsupported`] for pixels other than 8-bit grey or colour, and a size beyond the encoder's; [`ErrorKind::Output`] for another size or
    /// kind than the first one's, and if the encoder fails.
    pub fn code(&mut self, pixels: &Pixels, wants_key: bool) -> Result<&CodedPicture> {
        match pixels {
            Pixels::Gray8(image) => {
                self.start((image.width(), image.height()), true)?;
                self.planes.fill_gray(image);
            }
            Pixels::Rgb8(image) => return self.code_rgb(image, wants_key),
            Pixels::Gray16(_) | Pixels::GrayF32(_) => {
                return Err(Error::new(ErrorKind::Unsupported, "a video has 8 bits a pixel")
                    .hint("bring the pixels to 8 bits first"));
            }
        }
        self.code_planes(wants_key)
    }

    /// Codes a picture in colour.
    /// # Errors
    /// As [`Self::code`].
    pub(super) fn code_rgb(&mut self, image: &Image<[u8; 3]>, wants_key: bool) -> Result<&CodedPicture> {
        self.start((image.width(), image.height()), false)?;
        self.planes.fill(image);
        self.code_planes(wants_key)
    }

    fn start(&mut self, (width, height): (usize, usize), is_gray: bool) -> Result<()> {
        if let Some((_, was_gray)) = &self.encoder {
            if (*was_gray, self.size) == (is_gray, (width, height)) {
                return Ok(());
            }
            return Err(Error::new(ErrorKind::Output, "a video holds pictures of one size and kind only"));
        }
        let (long, short) = (width.max(height), width.min(height));
        if short < MIN_SIDE || long > MAX_SIZE.0 || short > MAX_SIZE.1 {
            let what = format!("a video of {width} x {height} pixels cannot be coded");
            let hint = format!("sides of {MIN_SIDE} to {} x {} pixels can", MAX_SIZE.0, MAX_SIZE.1);
            return Err(Error::new(ErrorKind::Unsupported, what).hint(hint));
        }
        let q = self.options.quantiser.clamp(0, 51);
        let config = EncoderConfig::new()
            .skip_frames(false)
            .rate_control_mode(if q == OWN_QUANTISER { RateControlMode::Off } else { RateControlMode::Quality })
            .qp(QpRange::new(q, q))
            .complexity(Complexity::Low)
            .scene_change_detect(false)
            .adaptive_quantization(false)
            .background_detection(self.options.still_as_before)
            .intra_frame_period(IntraFramePeriod::from_num_frames(self.options.key_every.max(1)))
            .vui(VuiConfig::bt709().full_range(is_gray));
        let encoder = Encoder::with_api_config(OpenH264API::from_source(), config)
            .map_err(|e| failed("the encoder does not start", e))?;
        (self.encoder, self.size) = (Some((encoder, is_gray)), (width, height));
        Ok(())
    }

    fn code_planes(&mut self, wants_key: bool) -> Result<&CodedPicture> {
        let Some((encoder, _)) = &mut self.encoder else { return Err(failed("the encoder", "was not started")) };
        if wants_key {
            encoder.force_intra_frame();
        }
        let picture = encoder.encode(&self.planes).map_err(|e| failed("a frame cannot be encoded", e))?;
        let coded = &mut self.coded;
        coded.is_key = matches!(picture.frame_type(), FrameType::IDR);
        coded.data.clear();
        coded.sps.clear();
        coded.pps.clear();
        for layer in (0..picture.num_layers()).filter_map(|i| picture.layer(i)) {
            for nal in (0..layer.nal_count()).filter_map(|i| layer.nal_unit(i)) {
                let nal = nal.strip_prefix(&[0, 0, 0, 1]).or_else(|| nal.strip_prefix(&[0, 0, 1])).unwrap_or(nal);
                match nal.first().map(|b| b & 31) {
                    Some(NAL_SPS) => coded.sps.push(nal.to_vec()),
                    Some(NAL_PPS) => coded.pps.push(nal.to_vec()),
                    Some(_) => {
                        let len = u32::try_from(nal.len()).map_err(|e| failed("a frame is too large", e))?;
                        coded.data.extend(len.to_be_bytes());
                        coded.data.extend(nal);
                    }
                    None => {}
                }
            }
        }
        if coded.data.is_empty() {
            return Err(Error::new(ErrorKind::Output, "the encoder gave no data for a frame"));
        }
        Ok(coded)
    }
}

/// How the pictures of a file are coded, for its head.
/// # Errors
/// [`ErrorKind::Output`] for a picture without parameter sets.
pub(super) fn sample_entry((width, height): (usize, usize), key: &CodedPicture) -> Result<SampleEntry> {
    let Some([_, profile, compatibility, level, ..]) = key.sps.first().map(Vec::as_slice) else {
        return Err(Error::new(ErrorKind::Output, "the encoder gave no parameter sets"));
    };
    let high = !matches!(*profile, 66 | 77 | 88);
    let avcc_box = AvccBox {
        avc_profile_indication: *profile,
        profile_compatibility: *compatibility,
        avc_level_indication: *level,
        length_size_minus_one: Uint::new(3),
        chroma_format: high.then(|| Uint::new(1)),
        bit_depth_luma_minus8: high.then(|| Uint::new(0)),
        bit_depth_chroma_minus8: high.then(|| Uint::new(0)),
        sps_ext_list: Vec::new(),
        pps_list: key.pps.clone(),
        sps_list: key.sps.clone(),
    };
    let side = |n: usize| u16::try_from(n.next_multiple_of(2)).map_err(|e| failed("size", e));
    let visual = VisualSampleEntryFields {
        data_reference_index: VisualSampleEntryFields::DEFAULT_DATA_REFERENCE_INDEX,
        width: side(width)?,
        height: side(height)?,
        horizresolution: VisualSampleEntryFields::DEFAULT_HORIZRESOLUTION,
        vertresolution: VisualSampleEntryFields::DEFAULT_VERTRESOLUTION,
        frame_count: VisualSampleEntryFields::DEFAULT_FRAME_COUNT,
        compressorname: VisualSampleEntryFields::NULL_COMPRESSORNAME,
        depth: VisualSampleEntryFields::DEFAULT_DEPTH,
    };
    Ok(SampleEntry::Avc1(Avc1Box { visual, avcc_box, unknown_boxes: Vec::new() }))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_key_is_given_when_it_is_asked_for_and_what_cannot_be_coded_is_said() {
        let mut coder = H264Coder::new(Mp4Options::default());
        let gray = |side: usize| Pixels::Gray8(Image::filled(side, side, 77));
        let keys = [false, false, true, false].map(|key| coder.code(&gray(32), key).unwrap().is_key);
        assert_eq!(keys, [true, false, true, false]);
        let mut stream = Vec::new();
        let key = coder.code(&gray(32), true).unwrap();
        key.append_byte_stream(&mut stream);
        assert_eq!((&stream[..4], stream[4] & 31), (&[0, 0, 0, 1][..], NAL_SPS));
        // Constrained baseline (RFC 6381: profile 66).
        assert!(key.codec().unwrap().starts_with("avc1.42"), "{:?}", key.codec());
        assert!(coder.code(&gray(48), false).unwrap_err().to_string().contains("one size"));
        let code =
            |pixels: &Pixels| H264Coder::new(Mp4Options::default()).code(pixels, false).err().unwrap().to_string();
        assert!(code(&gray(8)).contains("16") && code(&Pixels::Gray16(Image::filled(32, 32, 1))).contains("8 bits"));
    }

    #[test]
    fn the_quantiser_asked_for_is_the_one_that_codes() {
        // Steps double with each six (H.264, 8.6.1): of noise that fills them, each six takes up to a bit off a pixel; a quarter of a bit is asked for.
        let noise = |k: u32| {
            let value = |i: u32| (i.wrapping_mul(2_654_435_761).wrapping_add(k * 40_503) >> 13) as u8;
            Pixels::Gray8(Image::from_vec(64, 64, (0..64 * 64).map(value).collect()).unwrap())
        };
        let bytes = [OWN_QUANTISER - 12, OWN_QUANTISER - 6, OWN_QUANTISER, OWN_QUANTISER + 6, OWN_QUANTISER + 12].map(
            |quantiser| {
                let mut coder = H264Coder::new(Mp4Options { quantiser, ..Mp4Options::default() });
                (0..4).map(|k| coder.code(&noise(k), false).unwrap().data.len()).sum::<usize>()
            },
        );
        for pair in bytes.windows(2) {
            assert!(pair[0] > pair[1] + 4 * 64 * 64 / 32, "{bytes:?}");
        }
    }
}
