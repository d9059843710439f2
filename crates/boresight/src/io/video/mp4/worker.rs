//! The decoding thread of an MP4 file: samples in decoding order to frames in presentation order, and what was lost on the way.

use super::ahead::Ahead;
use super::decoders::Decoders;
use super::movie::Movie;
use super::picture::{Picture, Refusal};
use super::reorder::{Order, Reorder};
use super::sample::Sample;
use super::timeline::Step;
use crate::io::ColoursBeside;
use crate::io::options::Colour;
use crate::io::video::yuv::{Matrix, Planes, to_rgb, to_u16};
use crate::{Frame, FrameIndex, Image, Pixels, Timestamp, Wanted};
use rust_h264::nal::SpsInfo;
use std::fs::File;
use std::io::{Read, Seek, SeekFrom};
use std::sync::mpsc::{Receiver, Sender};
use std::sync::{Arc, OnceLock};

/// Largest accepted sample, bytes (an uncompressed picture of the largest size is below it).
const MAX_SAMPLE_BYTES: u32 = 1 << 28;

/// What the decoding thread reports.
pub(super) enum Message {
    /// A frame in presentation order, and what it was read with.
    Frame(Frame, &'static str),
    /// Frames that could not be decoded: how many of them at the end, how many before, and the first reason.
    End { lost_before: u64, lost_tail: u64, reason: Option<String> },
    /// The stream cannot be decoded at all.
    Refused(Refusal),
}

/// The work of the decoding thread.
pub(super) struct Worker {
    pub file: File,
    pub movie: Movie,
    pub ranks: Vec<Option<u64>>,
    pub units: Decoders,
    pub colour: Colour,
    pub colours_beside: Option<ColoursBeside>,
    pub out: Sender<Message>,
    pub ahead: Arc<Ahead>,
    pub spare: Receiver<Pixels>,
    pub wanted: Arc<OnceLock<Wanted>>,
    pub n_frames: u64,
}

/// The caller is gone.
struct Gone;

impl Worker {
    /// Decodes to the end, or until nobody listens.
    pub fn run(mut self) {
        let mut tally = Tally::default();
        if let Err(refusal) = self.units.configure(self.movie.samples.first().map_or(0, |s| s.description)) {
            let _ = self.out.send(Message::Refused(refusal));
            return;
        }
        let order = self.order();
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
    fn decode_all(
        &mut self,
        reorder: &mut Reorder<Option<Decoded>>,
        tally: &mut Tally,
    ) -> Result<Option<Refusal>, Gone> {
        let mut data = Vec::new();
        let mut pictures = Vec::new();
        let mut due = Vec::new();
        let mut wait_for_sync = false;
        let (mut following, mut look_at) = (0, 0);
        while following < self.movie.steps.len() {
            let step = following;
            following += 1;
            if step >= look_at && reorder.is_by_rank() && self.wanted.get().is_some() {
                match self.next_wanted(step) {
                    Err(wanted) => look_at = wanted + 1,
                    Ok(next) => {
                        self.units.finish(&mut pictures);
                        self.place(&mut pictures, reorder, &mut due);
                        for rank in (step..next).filter_map(|s| self.ranks.get(s).copied().flatten()) {
                            reorder.push(0, 0, rank, None, &mut due);
                        }
                        self.send(&mut due, tally)?;
                        // What begins here depends on nothing that was passed over.
                        self.units.reset();
                        wait_for_sync = false;
                        following = next;
                        continue;
                    }
                }
            }
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
                    Some(Ok(_)) if unwanted.is_some() && reorder.is_by_rank() && self.units.may_leave_out(&data) => {
                        unwanted.iter().for_each(|rank| reorder.push(0, 0, *rank, None, &mut due));
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

    /// The sync sample at which decoding can go on, since nobody wants a picture from this step on up to there; or else the step that is wanted.
    fn next_wanted(&self, step: usize) -> Result<usize, usize> {
        let n = self.movie.steps.len();
        let rank = |s: usize| self.ranks.get(s).copied().flatten();
        let is_sync = |s: usize| {
            self.movie.steps.get(s).and_then(|s| self.movie.samples.get(s.sample as usize)).is_some_and(|s| s.sync)
        };
        let wanted = (step..n).find(|&s| rank(s).is_some_and(|rank| is_wanted(&self.wanted, rank)));
        // Pictures behind a sync sample that are shown before it may need what was passed over.
        let is_closed = |s: usize| {
            let behind = (s + 1..n).take_while(|&k| !is_sync(k));
            rank(s).is_some_and(|own| behind.filter_map(rank).all(|rank| rank > own))
        };
        let Some(wanted) = wanted else { return Ok(n) };
        let entry = (step + 1..=wanted).rev().find(|&s| is_sync(s) && is_closed(s));
        entry.ok_or(wanted)
    }

    fn place(
        &mut self,
        pictures: &mut Vec<Picture>,
        reorder: &mut Reorder<Option<Decoded>>,
        due: &mut Vec<(u64, Option<Decoded>)>,
    ) {
        for picture in pictures.drain(..) {
            let Some(rank) = self.ranks.get(picture.step).copied().flatten() else { continue };
            let (period, count) = (picture.period, picture.order_count);
            let decoded = Decoded { picture, info: self.units.info() };
            reorder.push(period, count, rank, Some(decoded), due);
        }
    }

    fn send(&mut self, due: &mut Vec<(u64, Option<Decoded>)>, tally: &mut Tally) -> Result<(), Gone> {
        for (rank, decoded) in due.drain(..) {
            // Times that run backwards can only come from tables that lie; such a frame counts as lost.
            if rank < tally.next_rank {
                continue;
            }
            tally.next_rank = rank + 1;
            let pixels = match decoded.filter(|_| is_wanted(&self.wanted, rank)) {
                None => Some(nothing()),
                Some(decoded) => {
                    self.keep_colours(&decoded, rank, tally);
                    self.pixels(decoded)
                }
            };
            let Some(pixels) = pixels else { continue };
            let time = self.time(rank, tally);
            tally.sent += 1;
            let frame = Frame { index: FrameIndex(rank), time, pixels };
            self.ahead.wait_for(rank).then_some(()).ok_or(Gone)?;
            self.out.send(Message::Frame(frame, self.units.reader())).map_err(|_| Gone)?;
        }
        Ok(())
    }

    /// When a picture is shown.
    fn time(&self, rank: u64, tally: &mut Tally) -> Timestamp {
        if tally.pts.is_empty() {
            tally.pts = shown_times(&self.movie.steps);
        }
        let ticks = tally.pts.get(rank as usize).copied().unwrap_or_default();
        Timestamp::from_ticks(ticks, 1, i64::from(self.movie.timescale))
    }

    /// Keeps a picture in colour, if that is asked for.
    fn keep_colours(&mut self, decoded: &Decoded, rank: u64, tally: &mut Tally) {
        let Some(beside) = &self.colours_beside else { return };
        let picture = &decoded.picture;
        if !tally.kept_began {
            tally.kept_began = true;
            beside.begin(self.n_frames, (picture.width, picture.height));
        }
        if beside.wants(rank)
            && let Some(image) = rgb(decoded, std::mem::take(&mut tally.in_colour))
        {
            beside.keep(FrameIndex(rank), self.time(rank, tally), &image);
            tally.in_colour = image.into_vec();
        }
    }

    fn pixels(&mut self, decoded: Decoded) -> Option<Pixels> {
        let spare = self.spare.try_recv().ok();
        if self.colour == Colour::Rgb && decoded.info.is_some_and(|i| i.chroma_format != 0) {
            let memory = match spare {
                Some(Pixels::Rgb8(image)) => image.into_vec(),
                _ => Vec::new(),
            };
            return rgb(&decoded, memory).map(Pixels::Rgb8);
        }
        let f = decoded.picture;
        let (width, height) = (f.width, f.height);
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

/// A picture whose turn is to come, and the parameter set that it was coded with.
struct Decoded {
    picture: Picture,
    info: Option<SpsInfo>,
}

/// A picture in colour, in memory that is given; `None` where it has none.
fn rgb(Decoded { picture: f, info }: &Decoded, mut rgb: Vec<[u8; 3]>) -> Option<Image<[u8; 3]>> {
    let info = info.filter(|i| i.chroma_format != 0)?;
    let matrix = Matrix::new(info.matrix, info.full_range, f.height);
    let (width, height, shift) = (f.width, f.height, (1, f.chroma_row_shift));
    let planes = Planes { width, height, y: &f.y, u: &f.u, v: &f.v, shift, bits: f.bits };
    to_rgb(&planes, &matrix, &mut rgb).then(|| Image::from_vec(width, height, rgb))?
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
    /// Whether it was said what is kept in colour.
    kept_began: bool,
    /// Memory for a picture in colour of which a part is kept.
    in_colour: Vec<[u8; 3]>,
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
