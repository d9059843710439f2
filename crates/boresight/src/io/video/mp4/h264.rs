//! The complete decoder: feeds `rust_h264` one MP4 sample at a time and says which sample each picture is of.
//!
//! It takes every kind of H.264 but 4:4:4 and lossless, and costs twice what [`super::progressive`] does.
//! It is young, so it runs behind three fences: sizes are checked in every parameter set before it may take memory, broken unit lengths are found before it sees them, and a panic inside it is an error of that one sample.
//! Limits (ITU-T H.264 A.3.1, level 6.2): 139 264 macroblocks a picture, 696 320 in all reference pictures. Wrong bits
//! inside a slice that still parses are not seen: the decoder (0.6) keeps the part of the picture decoded before them.

use super::picture::{Picture, PictureDecoder, Refusal, guarded, parts};
use crate::memory_budget::afford;
use rust_h264::decoder::{ChromaFormat, Decoder, Frame};
use rust_h264::error::DecodeError;
use rust_h264::nal::{NalUnit, NalUnitType, SpsInfo, parse_avcc, parse_avcc_config, parse_sps_info};

/// MaxFS of level 6.2, macroblocks.
const MAX_PICTURE_MBS: u64 = 139_264;
/// MaxDpbMbs of level 6.2, macroblocks.
const MAX_REFERENCE_MBS: u64 = 696_320;

impl From<DecodeError> for Refusal {
    fn from(e: DecodeError) -> Self {
        match e {
            DecodeError::Unsupported(what) => Self::Unsupported(what.to_string()),
            other => Self::Damaged(other.to_string()),
        }
    }
}

/// A decoder for the samples of one track.
pub(super) struct AccessUnits {
    decoder: Decoder,
    configurations: Vec<Vec<u8>>,
    active: Option<u16>,
    length_size: usize,
    max_pixels: u64,
    /// The newest parameter set.
    pub info: Option<SpsInfo>,
    /// Interlaced: step and period whose picture the decoder is still holding.
    held: Option<(usize, u32)>,
}

impl AccessUnits {
    pub fn new(configurations: Vec<Vec<u8>>, max_pixels: u64) -> Self {
        Self {
            decoder: Decoder::new(),
            configurations,
            active: None,
            length_size: 4,
            max_pixels,
            info: None,
            held: None,
        }
    }

    /// Reads the parameter sets of a sample description, so that the size is known.
    pub fn configure(&mut self, description: u16) -> Result<(), Refusal> {
        if self.active == Some(description) {
            return Ok(());
        }
        let bytes = self.configurations.get(usize::from(description)).cloned();
        let bytes = bytes.ok_or_else(|| Refusal::Damaged(format!("sample description {description} is missing")))?;
        let config = guarded(|| parse_avcc_config(&bytes).map_err(|e| Refusal::Damaged(e.to_string())))?;
        self.length_size = config.length_size;
        for nal in config.sps_nals.iter().chain(&config.pps_nals) {
            self.feed_parameters(nal)?;
        }
        self.active = Some(description);
        Ok(())
    }

    /// Takes parameter sets that came in samples before.
    pub fn feed<'a>(&mut self, sets: impl Iterator<Item = &'a [u8]>) -> Result<(), Refusal> {
        for set in sets {
            let nal = as_nal(set);
            guarded(|| Ok::<_, Refusal>(parse_avcc(&nal, 4)))?.iter().try_for_each(|nal| self.feed_parameters(nal))?;
        }
        Ok(())
    }

    fn feed_parameters(&mut self, nal: &NalUnit<'_>) -> Result<(), Refusal> {
        if nal.nal_unit_type == NalUnitType::Sps {
            self.info = Some(checked(nal, self.max_pixels)?);
        }
        guarded(|| self.decoder.decode_nal(nal).map_err(Refusal::from)).map(|_| ())
    }

    fn hand_out(&mut self, frame: Option<Frame>, out: &mut Vec<Picture>) {
        if let (Some(frame), Some((step, period))) = (frame, self.held) {
            out.push(picture(frame, step, period));
            self.held = None;
        }
    }
}

impl PictureDecoder for AccessUnits {
    fn decode(
        &mut self,
        data: &[u8],
        description: u16,
        at: (usize, u32),
        out: &mut Vec<Picture>,
    ) -> Result<(), Refusal> {
        self.configure(description)?;
        if parts(data, self.length_size).is_none() {
            return Err(Refusal::Damaged("the lengths of its parts do not add up".into()));
        }
        let nals = guarded(|| Ok::<_, Refusal>(parse_avcc(data, self.length_size)))?;
        for nal in &nals {
            match nal.nal_unit_type {
                NalUnitType::Sps | NalUnitType::Pps => self.feed_parameters(nal)?,
                NalUnitType::Slice | NalUnitType::SliceIdr => {
                    if self.info.is_none() {
                        return Err(Refusal::Damaged("it comes before any parameter set".into()));
                    }
                    let done = guarded(|| self.decoder.decode_nal(nal).map_err(Refusal::from))?;
                    self.hand_out(done, out);
                    self.held.get_or_insert(at);
                }
                NalUnitType::SliceDataA | NalUnitType::SliceDataB | NalUnitType::SliceDataC => {
                    return Err(Refusal::Unsupported("data partitioning".into()));
                }
                _ => {}
            }
        }
        // A sample holds a whole progressive picture: it is asked for at once, so that damage to the next one cannot
        // take it along. Fields may lie in samples of their own; there the decoder must be left to pair them.
        if self.info.is_some_and(|i| i.progressive) {
            let done = guarded(|| Ok::<_, Refusal>(self.decoder.flush()))?;
            let whole = done.is_some();
            self.hand_out(done, out);
            self.held = None;
            if !whole {
                return Err(Refusal::Damaged("it holds no picture".into()));
            }
        }
        Ok(())
    }

    fn finish(&mut self, out: &mut Vec<Picture>) {
        if let Ok(done) = guarded(|| Ok::<_, Refusal>(self.decoder.flush())) {
            self.hand_out(done, out);
        }
    }

    fn reset(&mut self) {
        self.decoder = Decoder::new();
        self.active = None;
        self.held = None;
    }
}

fn picture(frame: Frame, step: usize, period: u32) -> Picture {
    Picture {
        width: frame.width as usize,
        height: frame.height as usize,
        chroma_row_shift: u32::from(frame.chroma_format == ChromaFormat::Yuv420),
        bits: u32::from(frame.bit_depth),
        order_count: frame.pic_order_cnt,
        y: frame.y,
        u: frame.u,
        v: frame.v,
        step,
        period,
    }
}

/// A part with its length before it, four bytes.
fn as_nal(part: &[u8]) -> Vec<u8> {
    let len = u32::try_from(part.len()).unwrap_or(u32::MAX);
    [&len.to_be_bytes(), part].concat()
}

/// What a sequence parameter set (a part of a sample) says, if it claims no more than is accepted.
pub(super) fn sequence(part: &[u8], max_pixels: u64) -> Result<SpsInfo, Refusal> {
    let bytes = as_nal(part);
    let nals = guarded(|| Ok::<_, Refusal>(parse_avcc(&bytes, 4)))?;
    nals.first()
        .map_or_else(|| Err(Refusal::Damaged("a parameter set is empty".into())), |nal| checked(nal, max_pixels))
}

fn checked(nal: &NalUnit<'_>, max_pixels: u64) -> Result<SpsInfo, Refusal> {
    let info = guarded(|| parse_sps_info(nal).map_err(Refusal::from))?;
    check_size(&info, max_pixels)?;
    Ok(info)
}

fn check_size(info: &SpsInfo, max_pixels: u64) -> Result<(), Refusal> {
    let (w, h) = (u64::from(info.coded_width), u64::from(info.coded_height));
    let mbs = (w / 16) * (h / 16);
    if mbs == 0 || info.width == 0 || info.height == 0 {
        return Err(Refusal::Damaged("its header claims a picture without pixels".into()));
    }
    let shown = u64::from(info.width) * u64::from(info.height);
    // The coded size is the shown one rounded up to macroblocks (pairs of them if interlaced).
    if mbs > MAX_PICTURE_MBS || shown > max_pixels || w * h > max_pixels.saturating_add(32 * (w + h)) {
        return Err(Refusal::Damaged(format!("its header claims {w} x {h} pixels, more than is accepted")));
    }
    // The reference pictures, four more on their way, a byte and a half a pixel each.
    afford(info.coded_width as usize, info.coded_height as usize, 2 * (4 + u64::from(info.reference_frames.min(16))))
        .map_err(|e| Refusal::Damaged(e.to_string().replace('\n', "; ")))?;
    if mbs * u64::from(info.reference_frames) > MAX_REFERENCE_MBS.max(mbs * 4) || info.reference_frames > 16 {
        let n = info.reference_frames;
        return Err(Refusal::Damaged(format!("its header claims {n} reference pictures of {w} x {h} pixels")));
    }
    Ok(())
}
