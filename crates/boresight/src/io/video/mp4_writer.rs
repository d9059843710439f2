//! Writes MP4 with H.264 that browsers and ffmpeg play, with the frames' own times.
//!
//! Encoder: `openh264` at constant quality, no frame skipped, no reordering; it runs on a thread of its own, so that
//! drawing the next frame and encoding this one overlap. Container: `shiguredo_mp4`, 720 000 ticks a second, in which
//! 24, 25, 30, 50 and 60 frames/s and their 1000/1001 versions are exact; other times are rounded to 0.7 us without
//! drift. The first frame is at time 0.
//! The file has its name only when it is whole: until then it is `NAME.part`, removed if the writer is dropped.
//! Limits: 8 bit 4:2:0, at most 3840 x 2160 pixels (level 5.2 of the encoder), one hour between two frames.

use super::i420::I420;
use crate::io::tables::AtomicFile;
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
use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, Sender, SyncSender, channel, sync_channel};
use std::thread::JoinHandle;

/// Ticks a second.
const TIMESCALE: u32 = 720_000;
/// Longest time a frame may stand, ticks.
const MAX_DURATION: i64 = 3600 * TIMESCALE as i64;
/// Largest picture that the encoder takes, px (longer side, shorter side).
pub const MAX_SIZE: (usize, usize) = (3840, 2160);

/// How a video is written.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mp4Options {
    /// Quantiser of H.264, 10 (nearly lossless, large) to 40 (coarse, small).
    pub quantiser: u8,
    /// Frames between two from which decoding can start.
    pub key_every: u32,
    /// Number of frames, if known: their table is then put in front, so that players can start before all is loaded.
    pub expected_frames: Option<u64>,
}

impl Default for Mp4Options {
    fn default() -> Self {
        Self { quantiser: 24, key_every: 60, expected_frames: None }
    }
}

/// A frame to encode, or the wish to end.
type Work = Option<(Image<[u8; 3]>, Timestamp)>;

/// A video being written.
pub struct Mp4Writer {
    path: PathBuf,
    size: (usize, usize),
    frames: Option<SyncSender<Work>>,
    spare: Receiver<Image<[u8; 3]>>,
    thread: Option<JoinHandle<Result<()>>>,
}

impl Mp4Writer {
    /// Starts a video of `width` x `height` pixels.
    /// # Errors
    /// [`ErrorKind::Output`] if the file cannot be created or the size is beyond the encoder's.
    pub fn create(path: impl Into<PathBuf>, width: usize, height: usize, options: Mp4Options) -> Result<Self> {
        let path = path.into();
        let (long, short) = (width.max(height), width.min(height));
        if short == 0 || long > MAX_SIZE.0 || short > MAX_SIZE.1 {
            let what = format!("a video of {width} x {height} pixels cannot be written");
            return Err(Error::new(ErrorKind::Output, what)
                .at(path.display())
                .hint(format!("at most {} x {} pixels can; write a folder of PNG instead", MAX_SIZE.0, MAX_SIZE.1)));
        }
        let encoding = Encoding::new(&path, width, height, options).map_err(|e| e.at(path.display()))?;
        let (frames, frames_out) = sync_channel(2);
        let (spare_in, spare) = channel();
        let work = move || encoding.run(&frames_out, &spare_in);
        let thread = std::thread::Builder::new()
            .name("boresight-encode".into())
            .spawn(work)
            .map_err(|e| Error::new(ErrorKind::Output, "no thread for encoding can be started").because(e))?;
        Ok(Self { path, size: (width, height), frames: Some(frames), spare, thread: Some(thread) })
    }

    /// A picture to be drawn on whose memory is used again, if one is free.
    pub fn spare(&self) -> Option<Image<[u8; 3]>> {
        self.spare.try_recv().ok()
    }

    /// Appends a frame; times must rise.
    /// # Errors
    /// [`ErrorKind::Output`] if the frame has another size or its time does not rise, or the file cannot be written.
    pub fn write(&mut self, frame: Image<[u8; 3]>, time: Timestamp) -> Result<()> {
        if (frame.width(), frame.height()) != self.size {
            let (w, h) = self.size;
            let what = format!("a frame has {} x {} pixels, the video {w} x {h}", frame.width(), frame.height());
            return Err(Error::new(ErrorKind::Output, what).at(self.path.display()));
        }
        let sent = self.frames.as_ref().is_some_and(|f| f.send(Some((frame, time))).is_ok());
        if sent { Ok(()) } else { Err(self.outcome().err().unwrap_or_else(|| self.stopped())) }
    }

    /// Ends the video and gives it its name.
    /// # Errors
    /// [`ErrorKind::Output`] if it cannot be written, or has no frames.
    pub fn finish(mut self) -> Result<()> {
        if let Some(frames) = &self.frames {
            // A thread that no longer listens has an error to tell, which `outcome` fetches.
            let _ = frames.send(None);
        }
        self.outcome()
    }

    fn outcome(&mut self) -> Result<()> {
        self.frames = None;
        match self.thread.take().map(JoinHandle::join) {
            Some(Ok(result)) => result.map_err(|e| e.at(self.path.display())),
            _ => Err(self.stopped()),
        }
    }

    fn stopped(&self) -> Error {
        Error::new(ErrorKind::Output, "the encoder stopped").at(self.path.display())
    }
}

impl Drop for Mp4Writer {
    fn drop(&mut self) {
        // Waits until the unfinished file is gone; its fate was asked for by nobody.
        let _ = self.outcome();
    }
}

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
struct Encoding {
    file: AtomicFile,
    encoder: Encoder,
    muxer: Mp4FileMuxer,
    size: (usize, usize),
    written: u64,
    planes: I420,
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
    fn new(path: &Path, width: usize, height: usize, options: Mp4Options) -> Result<Self> {
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
            waiting: None,
            entry: None,
            described: false,
            first: None,
            last_duration: i64::from(TIMESCALE / 25),
        })
    }

    fn run(mut self, frames: &Receiver<Work>, spare: &Sender<Image<[u8; 3]>>) -> Result<()> {
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
        let coded = self.encoder.encode(&self.planes).map_err(|e| failed("a frame cannot be encoded", e))?;
        let key = matches!(coded.frame_type(), FrameType::IDR);
        let mut bytes = Vec::new();
        let (mut sps, mut pps) = (Vec::new(), Vec::new());
        for layer in (0..coded.num_layers()).filter_map(|i| coded.layer(i)) {
            for nal in (0..layer.nal_count()).filter_map(|i| layer.nal_unit(i)) {
                let nal = nal.strip_prefix(&[0, 0, 0, 1]).or_else(|| nal.strip_prefix(&[0, 0, 1])).unwrap_or(nal);
                match nal.first().map(|b| b & 31) {
                    Some(7) => sps.push(nal.to_vec()),
                    Some(8) => pps.push(nal.to_vec()),
                    Some(_) => {
                        let len = u32::try_from(nal.len()).map_err(|e| failed("a frame is too large", e))?;
                        bytes.extend(len.to_be_bytes());
                        bytes.extend(nal);
                    }
                    None => {}
                }
            }
        }
        if bytes.is_empty() {
            return Err(Error::new(ErrorKind::Output, "the encoder gave no data for a frame"));
        }
        if !self.described {
            self.entry = Some(sample_entry(self.size, sps, pps)?);
            self.described = true;
        }
        self.file.write_all(&bytes).map_err(|e| failed("cannot be written", e))?;
        self.waiting = Some((ticks, self.written, bytes.len(), key));
        self.written += bytes.len() as u64;
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Pixels;
    use crate::io::OpenOptions;
    use crate::io::video::open_mp4;

    fn ramp(width: usize, height: usize, k: usize) -> Image<[u8; 3]> {
        let pixel = |i: usize| [((i % width) * 3 + k * 7) as u8, ((i / width) * 3) as u8, 90];
        Image::from_vec(width, height, (0..width * height).map(pixel).collect()).unwrap()
    }

    #[test]
    fn every_frame_comes_back_with_its_own_time() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("out.mp4");
        // Uneven times, odd size.
        let times: Vec<i64> = vec![5_000_000_000, 5_040_000_000, 5_100_000_000, 5_100_100_000, 7_000_000_000];
        for expected_frames in [None, Some(5)] {
            let options = Mp4Options { expected_frames, ..Mp4Options::default() };
            let mut w = Mp4Writer::create(&path, 35, 27, options).unwrap();
            for (k, t) in times.iter().enumerate() {
                w.write(ramp(35, 27, k), Timestamp::from_ns(*t)).unwrap();
            }
            w.finish().unwrap();
            let mut source = open_mp4(&path, &OpenOptions::default()).unwrap();
            assert_eq!((source.info().width, source.info().n_frames), (36, Some(5)));
            for (k, t) in times.iter().enumerate() {
                let frame = source.next_frame().unwrap().unwrap();
                assert!((frame.time.ns - (t - times[0])).abs() <= 700, "{} {t}", frame.time.ns);
                let Pixels::Gray8(luma) = &frame.pixels else { panic!("luma wanted") };
                let mut want = I420::default();
                want.fill(&ramp(35, 27, k));
                let error: u32 = luma.as_slice().iter().zip(&want.y).map(|(a, b)| u32::from(a.abs_diff(*b))).sum();
                // Quantiser 24 keeps the mean error of smooth pictures below 3 levels.
                assert!(error < 3 * want.y.len() as u32, "mean error {}", error as f64 / want.y.len() as f64);
            }
            assert!(source.next_frame().unwrap().is_none());
        }
    }

    #[test]
    fn an_unfinished_video_leaves_nothing_behind() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("out.mp4");
        let mut w = Mp4Writer::create(&path, 32, 32, Mp4Options::default()).unwrap();
        w.write(ramp(32, 32, 0), Timestamp::from_ns(0)).unwrap();
        drop(w);
        assert_eq!(std::fs::read_dir(dir.path()).unwrap().count(), 0);
    }

    #[test]
    fn times_that_do_not_rise_are_refused() {
        let dir = tempfile::tempdir().unwrap();
        let mut w = Mp4Writer::create(dir.path().join("out.mp4"), 32, 32, Mp4Options::default()).unwrap();
        w.write(ramp(32, 32, 0), Timestamp::from_ns(1000)).unwrap();
        let second = w.write(ramp(32, 32, 1), Timestamp::from_ns(0));
        let err = second.and(w.finish()).unwrap_err();
        assert!(err.to_string().contains("must rise"), "{err}");
    }

    #[test]
    fn a_size_beyond_the_encoders_is_refused_with_a_way_out() {
        let dir = tempfile::tempdir().unwrap();
        let err = Mp4Writer::create(dir.path().join("a.mp4"), 5000, 100, Mp4Options::default()).err().unwrap();
        assert!(err.to_string().contains("PNG"), "{err}");
    }
}
