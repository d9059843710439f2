//! H.264 in MP4: frames in, coded pictures and the tables of their times out; what the encoding thread does.
//!
//! Coded by [`super::coder`]. Container: `shiguredo_mp4`, 720 000 ticks a
//! second, in which 24, 25, 30, 50 and 60 frames/s and their 1000/1001 versions are exact; other times are rounded to
//! 0.7 us without drift. A frame is entered in the tables when the next one says how long it stood; the last one stands
//! as long as the one before.

use super::coder::{H264Coder, failed, sample_entry};
use super::options::Mp4Options;
use crate::io::atomic::AtomicFile;
use crate::tempo::{Pace, Tempo};
use crate::{Error, ErrorKind, Image, Result, Timestamp};
use shiguredo_mp4::TrackKind;
use shiguredo_mp4::boxes::SampleEntry;
use shiguredo_mp4::mux::{Mp4FileMuxer, Mp4FileMuxerOptions, Sample, estimate_maximum_moov_box_size};
use std::collections::VecDeque;
use std::io::{Seek, SeekFrom, Write};
use std::num::NonZeroU32;
use std::path::Path;
use std::sync::mpsc::{Receiver, Sender};

/// Ticks a second.
pub(super) const TIMESCALE: u32 = 720_000;
/// Longest time that a frame stands, ticks: a pause of more is one of an hour.
const MAX_DURATION: i64 = 3600 * TIMESCALE as i64;
/// Time that the only frame of a video stands, ticks.
const ALONE: i64 = TIMESCALE as i64 / 25;

/// A frame to encode, or the wish to end.
pub(super) type Work = Option<(Image<[u8; 3]>, Timestamp)>;

/// The work of the encoding thread.
pub(super) struct Encoding {
    file: AtomicFile,
    coder: H264Coder,
    muxer: Mp4FileMuxer,
    size: (usize, usize),
    written: u64,
    /// The coded frames that wait for their duration.
    waiting: VecDeque<Waiting>,
    /// How fast they are played, where that is not as they came.
    pace: Option<Pace>,
    /// How the frames are coded, until the muxer has it.
    entry: Option<SampleEntry>,
    described: bool,
    first: Option<Timestamp>,
    last_duration: i64,
}

/// A coded frame: ns since the first one, place and size in the file, whether decoding can start with it.
struct Waiting {
    since_ns: i128,
    place: u64,
    size: usize,
    is_key: bool,
}

/// A time in ns, in ticks, rounded to the nearest.
/// # Errors
/// [`ErrorKind::Output`] for more than ticks can say.
pub(super) fn ticks_of(ns: i128) -> Result<i64> {
    let ticks = (ns * i128::from(TIMESCALE) + 500_000_000).div_euclid(1_000_000_000);
    i64::try_from(ticks).map_err(|e| failed("a frame's time is out of range", e))
}

impl Encoding {
    /// Starts the file and the encoder.
    /// # Errors
    /// [`ErrorKind::Output`] if either cannot be started.
    pub fn new(path: &Path, width: usize, height: usize, options: Mp4Options) -> Result<Self> {
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
            coder: H264Coder::new(options),
            muxer,
            size,
            written,
            waiting: VecDeque::new(),
            pace: options.watchable.then(Pace::default),
            entry: None,
            described: false,
            first: None,
            last_duration: ALONE,
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
            let outcome = self.encode(&frame, time);
            // The caller may be gone already; then nobody needs the buffer.
            let _ = spare.send(frame);
            outcome?;
        }
        self.finish()
    }

    fn encode(&mut self, frame: &Image<[u8; 3]>, time: Timestamp) -> Result<()> {
        let first = *self.first.get_or_insert(time);
        let since_ns = i128::from(time.ns) - i128::from(first.ns);
        if let Some(before) = self.waiting.back()
            && since_ns <= before.since_ns
        {
            let what = format!("frame times must rise; one follows after {} ns", since_ns - before.since_ns);
            return Err(Error::new(ErrorKind::Output, what));
        }
        let is_settled = self.pace.as_mut().is_none_or(|pace| {
            pace.note(time);
            pace.is_settled()
        });
        let coded = self.coder.code_rgb(frame, false)?;
        if !self.described {
            self.entry = Some(sample_entry(self.size, coded)?);
            self.described = true;
        }
        self.file.write_all(&coded.data).map_err(|e| failed("cannot be written", e))?;
        let (size, is_key) = (coded.data.len(), coded.is_key);
        self.waiting.push_back(Waiting { since_ns, place: self.written, size, is_key });
        self.written += size as u64;
        if is_settled { self.append_ended() } else { Ok(()) }
    }

    /// When a frame is shown, ticks.
    fn shown(&self, since_ns: i128) -> Result<i64> {
        match self.pace.as_ref().map(Pace::tempo).filter(|tempo| *tempo != Tempo::VIDEO) {
            Some(tempo) => Ok((tempo.in_video(since_ns as f64 * 1e-9) * f64::from(TIMESCALE)).round() as i64),
            None => ticks_of(since_ns),
        }
    }

    /// Enters the waiting frames that another one follows in the tables.
    fn append_ended(&mut self) -> Result<()> {
        while let [a, b] = [0, 1].map(|i| self.waiting.get(i).map(|w| w.since_ns))
            && let (Some(start), Some(end)) = (a, b)
        {
            self.last_duration = (self.shown(end)? - self.shown(start)?).clamp(1, MAX_DURATION);
            self.append()?;
        }
        Ok(())
    }

    /// Enters the first of the waiting frames in the tables.
    fn append(&mut self) -> Result<()> {
        let Some(Waiting { place: data_offset, size: data_size, is_key: keyframe, .. }) = self.waiting.pop_front()
        else {
            return Ok(());
        };
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
        if self.waiting.is_empty() {
            return Err(Error::new(ErrorKind::Output, "no frame was written, so there is no video"));
        }
        self.append_ended()?;
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
