//! The fast decoder: `rusty_h264-decoder` for what it decodes exactly, progressive 4:2:0 of 8 bits; everything else it refuses.
//!
//! Half the time of the complete decoder ([`super::h264`]). It is as young, so the same fences stand before it: sizes are checked in every
//! parameter set, unit lengths before anything, a panic is a refusal. What it is known not to do (0.17) is refused before it sees it:
//! picture order counts of type 1, a crop at the left or top, a parameter set that changes between refreshes. Of 28 kinds of streams that
//! x264 writes and 42 public clips every picture was that of `rust_h264`; of 1 350 with a damaged sample it took none that the other refused.
//! Source of the syntax read here: ITU-T H.264 7.3.2.1.1 (sequence parameter set), 7.3.1 (unit header); ISO/IEC 14496-15 5.2.4.1 (`avcC`).

use super::h264::sequence;
use super::picture::{Picture, PictureDecoder, Refusal, guarded, parts};
use rust_h264::nal::SpsInfo;
use rusty_h264_decoder::{DecodeError, Decoder};

/// Kinds of units (ITU-T H.264 Table 7-1).
const SLICE: u8 = 1;
const SLICE_IDR: u8 = 5;
const SPS: u8 = 7;
const PPS: u8 = 8;
/// Most parameter sets that are remembered.
const MAX_SETS: usize = 64;

impl From<DecodeError> for Refusal {
    fn from(e: DecodeError) -> Self {
        match e {
            DecodeError::Unsupported(what) => Self::Unsupported(what.to_string()),
            other => Self::Damaged(other.to_string()),
        }
    }
}

/// A decoder for the samples of one track.
pub(super) struct Progressive {
    decoder: Decoder,
    configurations: Vec<Vec<u8>>,
    active: Option<u16>,
    length_size: usize,
    max_pixels: u64,
    /// The parameter sets taken, in their order, those of the description among them.
    sets: Vec<Vec<u8>>,
    /// The newest sequence parameter set.
    pub info: Option<SpsInfo>,
    /// Whether the stream is of a kind that is not decoded here.
    pub unfit: bool,
    annex_b: Vec<u8>,
}

impl Progressive {
    pub fn new(configurations: Vec<Vec<u8>>, max_pixels: u64) -> Self {
        let length_size = configurations.first().and_then(|c| avc_c(c)).map_or(4, |(size, _)| size);
        Self {
            decoder: Decoder::new(),
            configurations,
            active: None,
            length_size,
            max_pixels,
            sets: Vec::new(),
            info: None,
            unfit: false,
            annex_b: Vec::new(),
        }
    }

    /// The parameter sets taken since the start.
    pub fn sets(&self) -> impl Iterator<Item = &[u8]> {
        self.sets.iter().map(Vec::as_slice)
    }

    /// Whether a sample refreshes instantly: nothing after it depends on what was before.
    pub fn refreshes(&self, data: &[u8]) -> bool {
        parts(data, self.length_size).is_some_and(|parts| parts.iter().any(|p| kind(p) == Some(SLICE_IDR)))
    }

    /// Whether a sample holds nothing but slices that no other picture refers to (`nal_ref_idc` 0).
    pub fn is_needed_by_none(&self, data: &[u8]) -> bool {
        let part = |p: &&[u8]| p.first().is_some_and(|b| matches!(b & 0x1f, SLICE | 6 | 9) && b & 0x60 == 0);
        parts(data, self.length_size).is_some_and(|parts| !parts.is_empty() && parts.iter().all(part))
    }

    fn configure(&mut self, description: u16) -> Result<(), Refusal> {
        if self.active == Some(description) {
            return Ok(());
        }
        let bytes = self.configurations.get(usize::from(description)).cloned().unwrap_or_default();
        let (length_size, sets) = avc_c(&bytes).ok_or_else(|| Refusal::Damaged("its description is damaged".into()))?;
        self.length_size = length_size;
        for set in sets {
            self.take(set)?;
        }
        self.active = Some(description);
        Ok(())
    }

    /// Takes a parameter set, if it is new.
    fn take(&mut self, set: &[u8]) -> Result<(), Refusal> {
        if self.sets.iter().any(|s| s == set) {
            return Ok(());
        }
        if kind(set) == Some(SPS) {
            let info = sequence(set, self.max_pixels)?;
            if !is_fit(&info, set) {
                self.unfit = true;
                return Err(Refusal::Unsupported("other than progressive 4:2:0 of 8 bits".into()));
            }
            self.info = Some(info);
        }
        if self.sets.len() == MAX_SETS {
            return Err(Refusal::Unsupported("more parameter sets than are remembered".into()));
        }
        self.sets.push(set.to_vec());
        self.annex_b.clear();
        push_unit(&mut self.annex_b, set);
        let (decoder, bytes) = (&mut self.decoder, &self.annex_b);
        guarded(|| decoder.decode(bytes).map_err(Refusal::from)).map(|_| ())
    }
}

impl PictureDecoder for Progressive {
    fn decode(
        &mut self,
        data: &[u8],
        description: u16,
        (step, period): (usize, u32),
        out: &mut Vec<Picture>,
    ) -> Result<(), Refusal> {
        let changes = self.active.is_some_and(|a| a != description);
        self.configure(description)?;
        let parts =
            parts(data, self.length_size).ok_or_else(|| Refusal::Damaged("its lengths do not add up".into()))?;
        let refreshes = parts.iter().any(|p| kind(p) == Some(SLICE_IDR));
        let new_set = |p: &&[u8]| matches!(kind(p), Some(SPS | PPS)) && !self.sets.iter().any(|s| s == p);
        if !refreshes && !self.sets.is_empty() && (changes || (self.info.is_some() && parts.iter().any(new_set))) {
            return Err(Refusal::Unsupported("parameters that change between refreshes".into()));
        }
        let mut pictures = 0;
        for part in &parts {
            match kind(part) {
                Some(SPS | PPS) => self.take(part)?,
                // A slice whose first macroblock is number 0, written as a single 1 bit, begins a picture.
                Some(SLICE | SLICE_IDR) => pictures += u32::from(part.get(1).is_some_and(|b| b & 0x80 != 0)),
                Some(2..=4) => return Err(Refusal::Unsupported("data partitioning".into())),
                _ => {}
            }
        }
        let Some(info) = self.info else { return Err(Refusal::Damaged("it comes before any parameter set".into())) };
        if pictures != 1 {
            return Err(Refusal::Damaged("it does not hold one picture".into()));
        }
        self.annex_b.clear();
        for part in parts.iter().filter(|p| matches!(kind(p), Some(SLICE | SLICE_IDR))) {
            push_unit(&mut self.annex_b, part);
        }
        let (decoder, bytes) = (&mut self.decoder, &self.annex_b);
        let frame = guarded(|| decoder.decode(bytes).map_err(Refusal::from))?;
        // It crops at the right and at the bottom only: any other crop gives another size.
        let frame = frame
            .filter(|f| (f.width, f.height) == (info.width as usize, info.height as usize))
            .ok_or_else(|| Refusal::Damaged("it holds no picture of the size its header claims".into()))?;
        out.push(Picture {
            width: frame.width,
            height: frame.height,
            y: frame.y,
            u: frame.u,
            v: frame.v,
            chroma_row_shift: 1,
            bits: 8,
            order_count: self.decoder.last_poc(),
            step,
            period,
        });
        Ok(())
    }

    fn finish(&mut self, _: &mut Vec<Picture>) {}

    fn reset(&mut self) {
        self.decoder = Decoder::new();
        self.active = None;
        self.sets.clear();
    }
}

/// Kind of a unit.
fn kind(part: &[u8]) -> Option<u8> {
    part.first().map(|b| b & 0x1f)
}

fn push_unit(annex_b: &mut Vec<u8>, part: &[u8]) {
    annex_b.extend_from_slice(&[0, 0, 0, 1]);
    annex_b.extend_from_slice(part);
}

/// Length of the lengths and the parameter sets of a decoder configuration record.
fn avc_c(bytes: &[u8]) -> Option<(usize, Vec<&[u8]>)> {
    let length_size = usize::from(bytes.get(4)? & 3) + 1;
    let (mut rest, mut sets) = (bytes.get(5..)?, Vec::new());
    for mask in [0x1f, 0xff] {
        let (n, tail) = rest.split_first()?;
        rest = tail;
        for _ in 0..n & mask {
            let (len, tail) = rest.split_first_chunk::<2>()?;
            let (set, tail) = tail.split_at_checked(usize::from(u16::from_be_bytes(*len)))?;
            sets.push(set);
            rest = tail;
        }
    }
    Some((length_size, sets))
}

/// Whether a stream with this sequence parameter set is decoded here exactly.
fn is_fit(info: &SpsInfo, set: &[u8]) -> bool {
    matches!(info.profile, 66 | 77 | 100)
        && info.progressive
        && info.chroma_format == 1
        && (info.bit_depth_luma, info.bit_depth_chroma) == (8, 8)
        && order_count_type(set).is_some_and(|t| t != 1)
}

/// `pic_order_cnt_type` of a sequence parameter set; `None` where it lies behind scaling lists that cannot be read.
fn order_count_type(set: &[u8]) -> Option<u32> {
    let mut bits = Bits::of(set);
    bits.read(8)?;
    let profile = bits.read(8)?;
    bits.read(16)?;
    bits.exp_golomb()?;
    if profile == 100 {
        for _ in 0..3 {
            bits.exp_golomb()?;
        }
        bits.read(1)?;
        if bits.read(1)? == 1 {
            (0..8).try_for_each(|i| bits.skip_scaling_list(if i < 6 { 16 } else { 64 }))?;
        }
    }
    bits.exp_golomb()?;
    bits.exp_golomb()
}

/// Reads bits, most significant first.
struct Bits {
    bytes: Vec<u8>,
    at: usize,
}

impl Bits {
    /// The bits of a unit without the bytes that only keep start codes apart (3 behind two zeros).
    fn of(unit: &[u8]) -> Self {
        let between = |i: usize| i >= 2 && unit[i] == 3 && unit[i - 2..i] == [0, 0];
        Self { bytes: (0..unit.len()).filter(|i| !between(*i)).map(|i| unit[i]).collect(), at: 0 }
    }

    fn read(&mut self, n: u32) -> Option<u32> {
        (0..n).try_fold(0, |value, _| {
            let byte = self.bytes.get(self.at / 8)?;
            let bit = byte >> (7 - self.at % 8) & 1;
            self.at += 1;
            Some(value << 1 | u32::from(bit))
        })
    }

    fn exp_golomb(&mut self) -> Option<u32> {
        let mut zeros = 0;
        while self.read(1)? == 0 {
            zeros += 1;
            if zeros == 32 {
                return None;
            }
        }
        Some(((1u64 << zeros) - 1) as u32 + self.read(zeros)?)
    }

    fn skip_scaling_list(&mut self, n: u32) -> Option<()> {
        if self.read(1)? == 0 {
            return Some(());
        }
        let (mut last, mut next) = (8i64, 8i64);
        for _ in 0..n {
            if next != 0 {
                let code = i64::from(self.exp_golomb()?);
                let delta = if code % 2 == 1 { (code + 1) / 2 } else { -code / 2 };
                next = (last + delta + 256) % 256;
            }
            if next != 0 {
                last = next;
            }
        }
        Some(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_type_of_the_order_counts_is_read() {
        // Main profile, level 3.0, id 0, log2_max_frame_num 4, type 0 / 1 / 2: `1 1 1`, `1 1 010`, `1 1 011`.
        for (bits, want) in [(0b1110_0000, 0), (0b1101_0000, 1), (0b1101_1000, 2)] {
            assert_eq!(order_count_type(&[0x67, 77, 0, 30, bits]), Some(want));
        }
        // High: chroma 1 (`010`), depths 0 (`1 1`), no bypass, no lists, then as above.
        assert_eq!(order_count_type(&[0x67, 100, 0, 30, 0b1010_1100, 0b1011_0000]), Some(2));
        assert_eq!(order_count_type(&[0x67, 100, 0]), None);
    }

    #[test]
    fn a_configuration_record_that_is_cut_is_none() {
        let whole = [1, 77, 0, 30, 0xff, 0xe1, 0, 2, 0x67, 77, 1, 0, 1, 0x68];
        assert_eq!(avc_c(&whole), Some((4, vec![&[0x67u8, 77][..], &[0x68]])));
        assert!((0..whole.len()).all(|n| avc_c(&whole[..n]).is_none()));
    }
}
