//! Access units to pictures: feeds `rust_h264` one MP4 sample at a time and says which sample each picture is of.
//!
//! The decoder is young, so it runs behind three fences: sizes are checked in every parameter set before it may take
//! memory, broken unit lengths are found before it sees them, and a panic inside it is an error of that one sample.
//! Limits (ITU-T H.264 A.3.1, level 6.2): 139 264 macroblocks a picture, 696 320 in all reference pictures. Wrong bits
//! inside a slice that still parses are not seen: the decoder (0.6) keeps the part of the picture decoded before them.

use crate::{Error, ErrorKind, Result};
use rust_h264::decoder::{Decoder, Frame};
use rust_h264::error::DecodeError;
use rust_h264::nal::{NalUnit, NalUnitType, SpsInfo, parse_avcc, parse_avcc_config, parse_sps_info};
use std::panic::{AssertUnwindSafe, catch_unwind};

/// MaxFS of level 6.2, macroblocks.
const MAX_PICTURE_MBS: u64 = 139_264;
/// MaxDpbMbs of level 6.2, macroblocks.
const MAX_REFERENCE_MBS: u64 = 696_320;

/// Why a sample gave no picture.
#[derive(Debug)]
pub(super) enum Refusal {
    /// A kind of H.264 that is not decoded here.
    Unsupported(String),
    /// Broken data.
    Damaged(String),
}

impl From<DecodeError> for Refusal {
    fn from(e: DecodeError) -> Self {
        match e {
            DecodeError::Unsupported(what) => Self::Unsupported(what.to_string()),
            other => Self::Damaged(other.to_string()),
        }
    }
}

/// A decoded picture and the step it belongs to.
pub(super) struct Picture {
    pub frame: Frame,
    /// Number of the step (in decoding order) it was decoded from.
    pub step: usize,
    /// Counts the instantaneous refreshes; picture order counts compare within one period only.
    pub period: u32,
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
    period: u32,
    /// Interlaced: step whose picture the decoder is still holding.
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
            period: 0,
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

    fn feed_parameters(&mut self, nal: &NalUnit<'_>) -> Result<(), Refusal> {
        if nal.nal_unit_type == NalUnitType::Sps {
            let info = guarded(|| parse_sps_info(nal).map_err(Refusal::from))?;
            check_size(&info, self.max_pixels)?;
            self.info = Some(info);
        }
        guarded(|| self.decoder.decode_nal(nal).map_err(Refusal::from)).map(|_| ())
    }

    /// Decodes one sample; gives the pictures that are whole now (none or one, more never for sound data).
    pub fn decode(
        &mut self,
        data: &[u8],
        description: u16,
        step: usize,
        out: &mut Vec<Picture>,
    ) -> Result<(), Refusal> {
        self.configure(description)?;
        if !lengths_fit(data, self.length_size) {
            return Err(Refusal::Damaged("the lengths of its parts do not add up".into()));
        }
        let nals = guarded(|| Ok::<_, Refusal>(parse_avcc(data, self.length_size)))?;
        let mut sliced = false;
        for nal in &nals {
            match nal.nal_unit_type {
                NalUnitType::Sps | NalUnitType::Pps => self.feed_parameters(nal)?,
                NalUnitType::Slice | NalUnitType::SliceIdr => {
                    if self.info.is_none() {
                        return Err(Refusal::Damaged("it comes before any parameter set".into()));
                    }
                    let done = guarded(|| self.decoder.decode_nal(nal).map_err(Refusal::from))?;
                    self.hand_out(done, out);
                    if nal.nal_unit_type == NalUnitType::SliceIdr && !sliced {
                        self.period += 1;
                    }
                    sliced = true;
                    self.held.get_or_insert((step, self.period));
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

    fn hand_out(&mut self, frame: Option<Frame>, out: &mut Vec<Picture>) {
        if let (Some(frame), Some((step, period))) = (frame, self.held) {
            out.push(Picture { frame, step, period });
            self.held = None;
        }
    }

    /// Ends the stream: gives the picture still held.
    pub fn finish(&mut self, out: &mut Vec<Picture>) {
        if let Ok(done) = guarded(|| Ok::<_, Refusal>(self.decoder.flush())) {
            self.hand_out(done, out);
        }
    }

    /// Forgets all pictures after damage; the next sync sample starts anew.
    pub fn reset(&mut self) {
        self.decoder = Decoder::new();
        self.active = None;
        self.held = None;
        self.period += 1;
    }
}

/// Runs third-party code; a panic in it is damage of the data at hand.
fn guarded<T>(f: impl FnOnce() -> Result<T, Refusal>) -> Result<T, Refusal> {
    catch_unwind(AssertUnwindSafe(f)).unwrap_or_else(|_| Err(Refusal::Damaged("the decoder gave up on it".into())))
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
    if mbs * u64::from(info.reference_frames) > MAX_REFERENCE_MBS.max(mbs * 4) || info.reference_frames > 16 {
        let n = info.reference_frames;
        return Err(Refusal::Damaged(format!("its header claims {n} reference pictures of {w} x {h} pixels")));
    }
    Ok(())
}

/// Whether the length-prefixed parts fill the sample exactly (a few bytes of padding are forgiven).
fn lengths_fit(data: &[u8], length_size: usize) -> bool {
    let mut rest = data;
    while let Some((head, tail)) = rest.split_at_checked(length_size).filter(|(h, _)| !h.is_empty()) {
        let len = head.iter().fold(0usize, |len, b| len << 8 | usize::from(*b));
        match tail.get(len..) {
            Some(next) => rest = next,
            None => return false,
        }
    }
    rest.iter().all(|b| *b == 0)
}

/// Turns a refusal of the stream's very start into an error.
pub(super) fn start_error(refusal: Refusal) -> Error {
    match refusal {
        Refusal::Unsupported(what) => {
            Error::new(ErrorKind::Unsupported, format!("this kind of H.264 is not decoded in process ({what})"))
        }
        Refusal::Damaged(what) => Error::new(ErrorKind::Damaged, format!("its first picture is damaged: {what}")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lengths_that_run_over_the_end_are_found() {
        assert!(lengths_fit(&[0, 0, 0, 2, 9, 9, 0, 0, 0, 1, 7], 4));
        assert!(!lengths_fit(&[0, 0, 0, 3, 9, 9], 4));
        assert!(!lengths_fit(&[255, 255, 255, 255, 1], 4));
        assert!(lengths_fit(&[0, 0, 0, 1, 7, 0, 0], 4));
    }

    #[test]
    fn a_panic_becomes_damage() {
        let r: Result<(), Refusal> = guarded(|| std::panic::resume_unwind(Box::new("x")));
        assert!(matches!(r, Err(Refusal::Damaged(_))));
    }
}
