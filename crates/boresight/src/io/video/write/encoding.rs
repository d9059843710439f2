//! H.264 in MP4: frames in, coded pictures and the tables of their times out; what the encoding thread does.
//!
//! Encoder: `openh264` at constant quality, no frame skipped, no reordering. Container: `shiguredo_mp4`, 720 000 ticks a
//! second, in which 24, 25, 30, 50 and 60 frames/s and their 1000/1001 versions are exact; other times are rounded to
//! 0.7 us without drift. A frame is entered in the tables when the next one says how long it stood; the last one stands
//! as long as the one before.

use super::i420::I420;
use super::options::Mp4Options;
use crate::io::atomic::AtomicFile;
use crate::{Error, ErrorKind, Image, Result, Timestamp};
use openh264::OpenH264API;
use openh264::encoder::{
    Complexity, Encoder, EncoderConfig, FrameType, IntraFramePeriod, QpRange, RateControlMode, VuiConfig,
};
use openh264::formats::YUVSource;
use shiguredo_mp4::boxes::{Avc1Box, AvccBox, SampleEntry, VisualSampleEntryFields};
use shiguredo_mp4::mux::{Mp4FileMuxer, Mp4FileMuxerOptions, Sample, estimate_maximum_moov_box_size};
use shiguredo_mp4::{TrackKind, Uint};
use std::io::{Seek, SeekFrom, Write};
use std::num::NonZeroU32;
use std::path::Path;
use std::sync::mpsc::{Receiver, Sender};

/// Ticks a second.
const TIMESCALE: u32 = 720_000;
/// Longest time a frame may stand, ticks.
const MAX_DURATION: i64 = 3600 * TIMESCALE as i64;
/// Kinds of the parts of a coded picture that describe it (H.264, table 7-1): sequence and picture parameter set.
const NAL_SPS: u8 = 7;
const NAL_PPS: u8 = 8;

/// A frame to encode, or the wish to end.
pub(super) type Work = Option<(Image<[u8; 3]>, Timestamp)>;

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

/// The work of the encoding thread.
pub(super) struct Encoding {
    file: AtomicFile,
    encoder: Encoder,
    muxer: Mp4FileMuxer,
    size: (usize, usize),
    written: u64,
    planes: I420,
    /// The coded picture, with the length of each part before it.
    coded: Vec<u8>,
    /// The coded frame that waits for its duration: time in ticks, place, size, key.
    waiting: Option<(i64, u64, usize, bool)>,
    /// How the frames are coded, until the muxer has it.
    entry: Option<SampleEntry>,
    described: bool,
    first: Option<Timestamp>,
    last_duration: i64,
}

fn failed(what: &str, e: impl std::fmt::Display) -> Error {
    Error::new(ErrorKind::Output, format!("{what}: {e}"))
}

impl Encoding {
    /// Starts the file and the encoder.
    /// # Errors
    /// [`ErrorKind::Output`] if either cannot be started.
    pub fn new(path: &Path, width: usize, height: usize, options: Mp4Options) -> Result<Self> {
        let q = options.quantiser.clamp(0, 51);
        let config = EncoderConfig::new()
            .skip_frames(false)
            .rate_control_mode(RateControlMode::Off)
            .qp(QpRange::new(q, q))
            .complexity(Complexity::Low)
            .scene_change_detect(false)
            .adaptive_quantization(false)
            .background_detection(false)
            .intra_frame_period(IntraFramePeriod::from_num_frames(options.key_every.max(1)))
            .vui(VuiConfig::bt709());
        let encoder = Encoder::with_api_config(OpenH264API::from_source(), config)
            .map_err(|e| failed("the encoder does not start", e))?;
        let reserved = options.expected_frames.and_then(|n| usize::try_from(n).ok()).filter(|n| *n < 10_000_000);
        let muxer = Mp4FileMuxer::with_options(Mp4FileMuxerOptions {
            reserved_moov_box_size: reserved.map_or(0, |n| estimate_maximum_moov_box_size(&[n])),
            ..Mp4FileMuxerOptions::default()
        })
        .map_err(|e| failed("the file's head cannot be made", e))?;
        let mut file = AtomicFile::create(path)?;
        let head = muxer.initial_boxes_bytes();
        file.write_all(head).map_err(|e| failed("cannot be written", e))?;
        let written = head.len() as u64;
        let size = (width, height);
        Ok(Self {
            file,
            encoder,
            muxer,
            size,
            written,
            planes: I420::default(),
            coded: Vec::new(),
            waiting: None,
            entry: None,
            described: false,
            first: None,
            last_duration: i64::from(TIMESCALE / 25),
        })
    }

    /// Encodes what comes until the end is asked for.
    /// # Errors
    /// [`ErrorKind::Output`] for times that do not rise, and if the file cannot be written or has no frames.
    pub fn run(mut self, frames: &Receiver<Work>, spare: &Sender<Image<[u8; 3]>>) -> Result<()> {
        // `None` asks for the end; a channel that closes without it is a writer dropped before its time.
        while let Some((frame, time)) = match frames.recv() {
            Ok(work) => work,
            Err(_) => return Ok(()),
        } {
            self.planes.fill(&frame);
            // The caller may be gone already; then nobody needs the buffer.
            let _ = spare.send(frame);
            self.encode(time)?;
        }
        self.finish()
    }

    fn encode(&mut self, time: Timestamp) -> Result<()> {
        let first = *self.first.get_or_insert(time);
        let ns = i128::from(time.ns) - i128::from(first.ns);
        let ticks = (ns * i128::from(TIMESCALE) + 500_000_000).div_euclid(1_000_000_000);
        let ticks = i64::try_from(ticks).map_err(|e| failed("a frame's time is out of range", e))?;
        if let Some((start, ..)) = self.waiting {
            let duration = ticks - start;
            if !(1..=MAX_DURATION).contains(&duration) {
                let what = format!(
                    "frame times must rise by at most an hour; one follows after {} ns",
                    i128::from(duration) * 12500 / 9
                );
                return Err(Error::new(ErrorKind::Output, what));
            }
            self.last_duration = duration;
            self.append()?;
        }
        let picture = self.encoder.encode(&self.planes).map_err(|e| failed("a frame cannot be encoded", e))?;
        let key = matches!(picture.frame_type(), FrameType::IDR);
        self.coded.clear();
        let (mut sps, mut pps) = (Vec::new(), Vec::new());
        for layer in (0..picture.num_layers()).filter_map(|i| picture.layer(i)) {
            for nal in (0..layer.nal_count()).filter_map(|i| layer.nal_unit(i)) {
                let nal = nal.strip_prefix(&[0, 0, 0, 1]).or_else(|| nal.strip_prefix(&[0, 0, 1])).unwrap_or(nal);
                match nal.first().map(|b| b & 31) {
                    Some(NAL_SPS) => sps.push(nal.to_vec()),
                    Some(NAL_PPS) => pps.push(nal.to_vec()),
                    Some(_) => {
                        let len = u32::try_from(nal.len()).map_err(|e| failed("a frame is too large", e))?;
                        self.coded.extend(len.to_be_bytes());
                        self.coded.extend(nal);
                    }
                    None => {}
                }
            }
        }
        if self.coded.is_empty() {
            return Err(Error::new(ErrorKind::Output, "the encoder gave no data for a frame"));
        }
        if !self.described {
            self.entry = Some(sample_entry(self.size, sps, pps)?);
            self.described = true;
        }
        self.file.write_all(&self.coded).map_err(|e| failed("cannot be written", e))?;
        self.waiting = Some((ticks, self.written, self.coded.len(), key));
        self.written += self.coded.len() as u64;
        Ok(())
    }

    /// Enters the waiting frame in the tables.
    fn append(&mut self) -> Result<()> {
        let Some((_, data_offset, data_size, keyframe)) = self.waiting.take() else { return Ok(()) };
        let sample = Sample {
            track_kind: TrackKind::Video,
            sample_entry: self.entry.take(),
            keyframe,
            timescale: NonZeroU32::MIN.saturating_add(TIMESCALE - 1),
            duration: self.last_duration as u32,
            composition_time_offset: None,
            data_offset,
            data_size,
        };
        self.muxer.append_sample(&sample).map_err(|e| failed("the file's tables cannot be made", e))
    }

    fn finish(mut self) -> Result<()> {
        if self.waiting.is_none() {
            return Err(Error::new(ErrorKind::Output, "no frame was written, so there is no video"));
        }
        self.append()?;
        let boxes = self.muxer.finalize().map_err(|e| failed("the file's tables cannot be made", e))?;
        for (offset, bytes) in boxes.offset_and_bytes_pairs() {
            self.file
                .seek(SeekFrom::Start(offset))
                .and_then(|_| self.file.write_all(bytes))
                .map_err(|e| failed("cannot be written", e))?;
        }
        self.file.finish()
    }
}

fn sample_entry((width, height): (usize, usize), sps: Vec<Vec<u8>>, pps: Vec<Vec<u8>>) -> Result<SampleEntry> {
    let Some([_, profile, compatibility, level, ..]) = sps.first().map(Vec::as_slice) else {
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
        pps_list: pps,
        sps_list: sps,
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
