//! Frames of an MP4 or MOV file with H.264, decoded in process on a thread of their own.
//!
//! The reader of the tables says which samples are shown and when; the decoder runs a few frames ahead of the caller
//! and the luma planes it makes are handed out as they are, without a copy.
//! Damage: a picture that cannot be decoded is lost, and so are those that depend on it, up to the next sync sample;
//! frame numbers and times stay true, so that lost frames leave a gap, and a warning counts them.

use super::decoders::Decoders;
use super::movie::{Movie, read_movie};
use super::picture::{Picture, Refusal, start_error};
use super::reorder::{Order, Reorder};
use super::sample::{Codec, Sample};
use super::timeline::Step;
use crate::io::options::{Colour, OpenOptions};
use crate::io::video::yuv::{Matrix, Planes, to_rgb, to_u16};
use crate::{
    Error, ErrorKind, Frame, FrameIndex, FrameSource, Image, PixelKind, Pixels, Result, SourceInfo, Timestamp, Wanted,
};
use std::fs::File;
use std::io::{Read, Seek, SeekFrom};
use std::path::Path;
use std::sync::mpsc::{Receiver, Sender, SyncSender, channel, sync_channel};
use std::sync::{Arc, OnceLock};

/// Frames decoded ahead of the caller.
const AHEAD: usize = 4;
/// Largest accepted sample, bytes (an uncompressed picture of the largest size is below it).
const MAX_SAMPLE_BYTES: u32 = 1 << 28;

/// What the decoding thread reports.
enum Message {
    /// A frame in presentation order, and what it was read with.
    Frame(Frame, &'static str),
    /// Frames that could not be decoded: how many of them at the end, how many before, and the first reason.
    End { lost_before: u64, lost_tail: u64, reason: Option<String> },
    /// The stream cannot be decoded at all.
    Refused(Refusal),
}

/// The source.
pub(in crate::io::video) struct Mp4Source {
    info: SourceInfo,
    warnings: Vec<String>,
    first: Option<Frame>,
    frames: Option<Receiver<Message>>,
    spare: Sender<Pixels>,
    wanted: Arc<OnceLock<Wanted>>,
    n_frames: u64,
}

/// What [`open`] found.
pub(in crate::io::video) enum Opened {
    /// Frames.
    Source(Box<Mp4Source>),
    /// A kind of video that another decoder must read, and why.
    Other(Error),
}

/// Opens an MP4 file.
/// # Errors
/// When the file is missing, damaged or too large.
pub(in crate::io::video) fn open(path: &Path, options: &OpenOptions) -> Result<Opened> {
    let mut file = File::open(path)
        .map_err(|e| Error::new(ErrorKind::NotFound, "cannot be opened").at(path.display()).because(e))?;
    let mut movie = match read_movie(&mut file, path) {
        Err(e) if e.kind() == ErrorKind::Unsupported => return Ok(Opened::Other(e)),
        other => other?,
    };
    let configurations = match std::mem::replace(&mut movie.codec, Codec::Other(String::new())) {
        Codec::H264(c) => c,
        Codec::Other(name) => {
            let what = format!("its video is '{}', not H.264", name.escape_default());
            return Ok(Opened::Other(Error::new(ErrorKind::Unsupported, what).at(path.display())));
        }
    };
    let mut warnings = std::mem::take(&mut movie.warnings);
    let ranks = ranks(&movie.steps);
    let n_frames = movie.steps.iter().filter(|s| s.shown).count() as u64;
    let rate_hz = rate(&movie);
    let (frame_in, frame_out) = sync_channel(AHEAD);
    let (spare_in, spare_out) = channel();
    let units = Decoders::new(configurations, options.max_pixels);
    let wanted = Arc::<OnceLock<Wanted>>::default();
    let worker = Worker {
        file,
        movie,
        ranks,
        units,
        colour: options.colour,
        out: frame_in,
        spare: spare_out,
        wanted: Arc::clone(&wanted),
        n_frames,
    };
    std::thread::Builder::new()
        .name("boresight-h264".into())
        .spawn(move || worker.run())
        .map_err(|e| Error::new(ErrorKind::NotFound, "no thread for decoding can be started").because(e))?;
    let (first, reader) = match frame_out.recv() {
        Ok(Message::Frame(frame, reader)) => (frame, reader),
        Ok(Message::Refused(refusal @ Refusal::Unsupported(_))) => {
            return Ok(Opened::Other(start_error(refusal).at(path.display())));
        }
        Ok(Message::Refused(refusal)) => return Err(start_error(refusal).at(path.display())),
        Ok(Message::End { reason, .. }) => {
            let why = reason.unwrap_or_else(|| "no reason known".into());
            let what = format!("none of its {n_frames} frames can be decoded: {why}");
            return Err(Error::new(ErrorKind::Damaged, what).at(path.display()));
        }
        Err(_) => return Err(Error::new(ErrorKind::Damaged, "the decoder stopped").at(path.display())),
    };
    if first.index.0 > 0 {
        warnings.push(format!("the first {} frames are damaged and left out", first.index.0));
    }
    let info = SourceInfo {
        label: path.display().to_string(),
        reader: reader.into(),
        width: first.pixels.width(),
        height: first.pixels.height(),
        kind: first.pixels.kind(),
        n_frames: Some(n_frames),
        rate_hz,
        true_times: true,
    };
    Ok(Opened::Source(Box::new(Mp4Source {
        info,
        warnings,
        first: Some(first),
        frames: Some(frame_out),
        spare: spare_in,
        wanted,
        n_frames,
    })))
}

/// Place of each step among the shown pictures in the order of their times; steps that are not shown have none.
fn ranks(steps: &[Step]) -> Vec<Option<u64>> {
    let mut order: Vec<usize> = (0..steps.len()).filter(|i| steps[*i].shown).collect();
    order.sort_by_key(|i| steps[*i].pts);
    let mut ranks = vec![None; steps.len()];
    for (rank, i) in order.into_iter().enumerate() {
        ranks[i] = Some(rank as u64);
    }
    ranks
}

/// Mean rate of the shown pictures, frames/s.
fn rate(movie: &Movie) -> Option<f64> {
    let shown = || movie.steps.iter().filter(|s| s.shown).map(|s| s.pts);
    let (first, last, n) = (shown().min()?, shown().max()?, shown().count());
    let span = last.checked_sub(first).filter(|s| *s > 0)?;
    Some((n - 1) as f64 * f64::from(movie.timescale) / span as f64)
}

impl FrameSource for Mp4Source {
    fn info(&self) -> &SourceInfo {
        &self.info
    }

    fn next_frame(&mut self) -> Result<Option<Frame>> {
        if let Some(frame) = self.first.take() {
            return Ok(Some(frame));
        }
        let Some(frames) = &self.frames else { return Ok(None) };
        match frames.recv() {
            Ok(Message::Frame(frame, _)) => {
                let (w, h, kind) = (frame.pixels.width(), frame.pixels.height(), frame.pixels.kind());
                let i = &self.info;
                if (w, h, kind) != (i.width, i.height, i.kind) && (w, h) != (0, 0) {
                    let what = format!("the picture changes from {} x {} to {w} x {h} pixels", i.width, i.height);
                    self.frames = None;
                    return Err(Error::new(ErrorKind::Damaged, what)
                        .at(format!("{}: frame {}", self.info.label, frame.index.0))
                        .hint("cut the video where the size changes and run the parts one by one"));
                }
                Ok(Some(frame))
            }
            Ok(Message::End { lost_before, lost_tail, reason }) => {
                self.frames = None;
                let why = reason.map(|r| format!(" ({r})")).unwrap_or_default();
                let n = self.n_frames;
                if lost_tail > 0 {
                    self.warnings.push(format!("the end is damaged: the last {lost_tail} of {n} frames are lost{why}"));
                }
                if lost_before > 0 {
                    self.warnings.push(format!(
                        "{lost_before} of {n} frames are damaged or depend on damaged ones and are left out{why}"
                    ));
                }
                Ok(None)
            }
            Ok(Message::Refused(refusal)) => {
                self.frames = None;
                Err(start_error(refusal).at(&self.info.label))
            }
            Err(_) => {
                self.frames = None;
                Err(Error::new(ErrorKind::Damaged, "the decoder stopped").at(&self.info.label))
            }
        }
    }

    fn recycle(&mut self, frame: Frame) {
        // Grey planes come from the decoder itself; only converted pixels are made in a buffer of ours.
        if matches!(frame.pixels.kind(), PixelKind::Rgb8 | PixelKind::Gray16) {
            let _ = self.spare.send(frame.pixels);
        }
    }

    fn want_only(&mut self, wanted: Wanted) {
        // Said twice, the first holds: it may have been acted on.
        let _ = self.wanted.set(wanted);
    }

    fn reads_ahead(&self) -> bool {
        true
    }

    fn warnings(&self) -> &[String] {
        &self.warnings
    }
}

struct Worker {
    file: File,
    movie: Movie,
    ranks: Vec<Option<u64>>,
    units: Decoders,
    colour: Colour,
    out: SyncSender<Message>,
    spare: Receiver<Pixels>,
    wanted: Arc<OnceLock<Wanted>>,
    n_frames: u64,
}

/// The caller is gone.
struct Gone;

impl Worker {
    fn run(mut self) {
        let mut tally = Tally::default();
        if let Err(refusal) = self.units.configure(self.movie.samples.first().map_or(0, |s| s.description)) {
            let _ = self.out.send(Message::Refused(refusal));
            return;
        }
        let order = self.order();
        if order == Order::Rank {
            self.units.allow_fast();
        }
        let mut reorder = Reorder::new(order);
        match self.decode_all(&mut reorder, &mut tally) {
            Ok(None) => {
                let lost_tail = self.n_frames - tally.next_rank.min(self.n_frames);
                let lost_before = tally.next_rank.min(self.n_frames).saturating_sub(tally.sent);
                let _ = self.out.send(Message::End { lost_before, lost_tail, reason: tally.reason });
            }
            Ok(Some(refusal)) => {
                let _ = self.out.send(Message::Refused(refusal));
            }
            Err(Gone) => {}
        }
    }

    fn order(&self) -> Order {
        let info = self.units.info();
        let never_reorders = info.is_some_and(|i| i.profile == 66 || i.max_reorder_frames == Some(0));
        if self.movie.reordered || never_reorders {
            return Order::Rank;
        }
        let depth = info.and_then(|i| i.max_reorder_frames).unwrap_or(16);
        Order::Count { depth: depth.min(16) as usize }
    }

    /// Decodes every step; gives the refusal that stops the stream before its first picture.
    fn decode_all(&mut self, reorder: &mut Reorder<Pixels>, tally: &mut Tally) -> Result<Option<Refusal>, Gone> {
        let mut data = Vec::new();
        let mut pictures = Vec::new();
        let mut due = Vec::new();
        let mut wait_for_sync = false;
        for step in 0..self.movie.steps.len() {
            let Some(sample) = self.movie.steps.get(step).and_then(|s| self.movie.samples.get(s.sample as usize))
            else {
                continue;
            };
            let sample = *sample;
            let unwanted = self.ranks.get(step).copied().flatten().filter(|rank| !is_wanted(&self.wanted, *rank));
            let result = if wait_for_sync && !sample.sync {
                Err(Refusal::Damaged("it depends on a damaged picture".into()))
            } else {
                wait_for_sync = false;
                let (file, movie) = (&mut self.file, &self.movie);
                let mut read = |step: usize, data: &mut Vec<u8>| {
                    let sample = *movie.samples.get(movie.steps.get(step)?.sample as usize)?;
                    Some(read_sample(file, &sample, movie.file_len, data).map(|()| sample))
                };
                match read(step, &mut data) {
                    Some(Ok(_)) if unwanted.is_some() && self.units.may_leave_out(&data) => {
                        unwanted.iter().for_each(|rank| reorder.push(0, 0, *rank, nothing(), &mut due));
                        Ok(())
                    }
                    Some(Ok(sample)) => self.units.decode((&data, &sample, step), &mut read, &mut pictures),
                    Some(Err(refusal)) => Err(refusal),
                    None => continue,
                }
            };
            if let Err(refusal) = result {
                if let (Refusal::Unsupported(_), 0, true) = (&refusal, tally.sent, pictures.is_empty()) {
                    return Ok(Some(refusal));
                }
                if !wait_for_sync {
                    self.units.reset();
                    wait_for_sync = true;
                    let (Refusal::Damaged(why) | Refusal::Unsupported(why)) = refusal;
                    tally.reason.get_or_insert_with(|| format!("first in coded picture {step}: {why}"));
                }
                if let Some(rank) = self.ranks.get(step).copied().flatten() {
                    reorder.lose(rank, &mut due);
                }
            }
            self.place(&mut pictures, reorder, &mut due);
            self.send(&mut due, tally)?;
        }
        self.units.finish(&mut pictures);
        self.place(&mut pictures, reorder, &mut due);
        reorder.finish(&mut due);
        self.send(&mut due, tally)?;
        Ok(None)
    }

    fn place(&mut self, pictures: &mut Vec<Picture>, reorder: &mut Reorder<Pixels>, due: &mut Vec<(u64, Pixels)>) {
        for picture in pictures.drain(..) {
            let Some(rank) = self.ranks.get(picture.step).copied().flatten() else { continue };
            let (period, count) = (picture.period, picture.order_count);
            if !is_wanted(&self.wanted, rank) {
                reorder.push(period, count, rank, nothing(), due);
                continue;
            }
            match self.pixels(picture) {
                Some(pixels) => reorder.push(period, count, rank, pixels, due),
                None => reorder.lose(rank, due),
            }
        }
    }

    fn send(&mut self, due: &mut Vec<(u64, Pixels)>, tally: &mut Tally) -> Result<(), Gone> {
        for (rank, pixels) in due.drain(..) {
            // Times that run backwards can only come from tables that lie; such a frame counts as lost.
            if rank < tally.next_rank {
                continue;
            }
            if tally.pts.is_empty() {
                tally.pts = shown_times(&self.movie.steps);
            }
            let ticks = tally.pts.get(rank as usize).copied().unwrap_or_default();
            let time = Timestamp::from_ticks(ticks, 1, i64::from(self.movie.timescale));
            tally.next_rank = rank + 1;
            tally.sent += 1;
            let frame = Frame { index: FrameIndex(rank), time, pixels };
            self.out.send(Message::Frame(frame, self.units.reader())).map_err(|_| Gone)?;
        }
        Ok(())
    }

    fn pixels(&mut self, picture: Picture) -> Option<Pixels> {
        let f = picture;
        let (width, height) = (f.width, f.height);
        let spare = self.spare.try_recv().ok();
        if self.colour == Colour::Rgb && self.units.info().is_some_and(|i| i.chroma_format != 0) {
            let mut rgb = match spare {
                Some(Pixels::Rgb8(image)) => image.into_vec(),
                _ => Vec::new(),
            };
            let info = self.units.info();
            let matrix = Matrix::new(info.map_or(2, |i| i.matrix), info.is_some_and(|i| i.full_range), height);
            let shift = (1, f.chroma_row_shift);
            let planes = Planes { width, height, y: &f.y, u: &f.u, v: &f.v, shift, bits: f.bits };
            if !to_rgb(&planes, &matrix, &mut rgb) {
                return None;
            }
            return Image::from_vec(width, height, rgb).map(Pixels::Rgb8);
        }
        if f.bits > 8 {
            let mut gray = match spare {
                Some(Pixels::Gray16(image)) => image.into_vec(),
                _ => Vec::new(),
            };
            to_u16(&f.y, &mut gray);
            return Image::from_vec(width, height, gray).map(Pixels::Gray16);
        }
        Image::from_vec(width, height, f.y).map(Pixels::Gray8)
    }
}

/// What stands for a picture that nobody wants.
fn nothing() -> Pixels {
    Pixels::Gray8(Image::default())
}

fn is_wanted(wanted: &OnceLock<Wanted>, rank: u64) -> bool {
    wanted.get().is_none_or(|wanted| wanted(rank))
}

/// What has been sent.
#[derive(Default)]
struct Tally {
    sent: u64,
    /// Rank after the last one sent.
    next_rank: u64,
    reason: Option<String>,
    /// Presentation times by rank, media ticks.
    pts: Vec<i64>,
}

fn shown_times(steps: &[Step]) -> Vec<i64> {
    let mut times: Vec<i64> = steps.iter().filter(|s| s.shown).map(|s| s.pts).collect();
    times.sort_unstable();
    times
}

fn read_sample(file: &mut File, s: &Sample, file_len: u64, data: &mut Vec<u8>) -> Result<(), Refusal> {
    if s.offset.saturating_add(u64::from(s.size)) > file_len {
        return Err(Refusal::Damaged("the file ends before it".into()));
    }
    if s.size > MAX_SAMPLE_BYTES {
        return Err(Refusal::Damaged(format!("it claims {} bytes", s.size)));
    }
    data.resize(s.size as usize, 0);
    file.seek(SeekFrom::Start(s.offset))
        .and_then(|_| file.read_exact(data))
        .map_err(|e| Refusal::Damaged(format!("it cannot be read: {e}")))
}
