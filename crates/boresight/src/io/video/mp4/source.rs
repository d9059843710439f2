//! Frames of an MP4 or MOV file with H.264, decoded in process on a thread of their own.
//!
//! The reader of the tables says which samples are shown and when; the decoder runs a few frames ahead of the caller
//! and the luma planes it makes are handed out as they are, without a copy.
//! Damage: a picture that cannot be decoded is lost, and so are those that depend on it, up to the next sync sample;
//! frame numbers and times stay true, so that lost frames leave a gap, and a warning counts them.

use super::ahead::Ahead;
use super::decoders::Decoders;
use super::movie::{Movie, read_movie};
use super::picture::{Refusal, start_error};
use super::sample::Codec;
use super::timeline::Step;
use super::worker::{Message, Worker};
use crate::io::options::OpenOptions;
use crate::{Error, ErrorKind, Frame, FrameSource, PixelKind, Pixels, Result, SourceInfo, Wanted};
use std::fs::File;
use std::path::Path;
use std::sync::mpsc::{Receiver, Sender, channel};
use std::sync::{Arc, OnceLock};

/// The source.
pub(in crate::io::video) struct Mp4Source {
    info: SourceInfo,
    warnings: Vec<String>,
    first: Option<Frame>,
    frames: Option<Receiver<Message>>,
    ahead: Arc<Ahead>,
    spare: Sender<Pixels>,
    wanted: Arc<OnceLock<Wanted>>,
    /// Numbers of the frames at sync samples.
    entries: Vec<u64>,
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
    open_by(path, options, true)
}

/// Opens an MP4 file, with the fast decoder where it may or with the complete one alone.
pub(super) fn open_by(path: &Path, options: &OpenOptions, may_be_fast: bool) -> Result<Opened> {
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
    let entries = entries(&movie, &ranks);
    let (frame_in, frame_out) = channel();
    let ahead = Arc::<Ahead>::default();
    let (spare_in, spare_out) = channel();
    let units = Decoders::new(configurations, options.max_pixels, may_be_fast);
    let wanted = Arc::<OnceLock<Wanted>>::default();
    let worker = Worker {
        file,
        movie,
        ranks,
        units,
        colour: options.colour,
        colours_beside: options.colours_beside.clone(),
        out: frame_in,
        ahead: Arc::clone(&ahead),
        spare: spare_out,
        wanted: Arc::clone(&wanted),
        n_frames,
    };
    std::thread::Builder::new()
        .name("boresight-h264".into())
        .spawn(move || worker.run())
        .map_err(|e| Error::new(ErrorKind::NotFound, "no thread for decoding can be started").because(e))?;
    let (first, reader) = match frame_out.recv() {
        Ok(Message::Frame(frame, reader)) => {
            ahead.taken();
            (frame, reader)
        }
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
        ahead,
        spare: spare_in,
        wanted,
        entries,
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

/// Places of the shown pictures at sync samples, in their order.
fn entries(movie: &Movie, ranks: &[Option<u64>]) -> Vec<u64> {
    let is_sync = |s: &Step| movie.samples.get(s.sample as usize).is_some_and(|s| s.sync);
    let mut entries: Vec<u64> =
        movie.steps.iter().zip(ranks).filter(|(s, _)| is_sync(s)).filter_map(|(_, rank)| *rank).collect();
    entries.sort_unstable();
    entries
}

/// Mean rate of the shown pictures, frames/s.
fn rate(movie: &Movie) -> Option<f64> {
    let shown = || movie.steps.iter().filter(|s| s.shown).map(|s| s.pts);
    let (first, last, n) = (shown().min()?, shown().max()?, shown().count());
    let span = last.checked_sub(first).filter(|s| *s > 0)?;
    Some((n - 1) as f64 * f64::from(movie.timescale) / span as f64)
}

impl Drop for Mp4Source {
    fn drop(&mut self) {
        self.ahead.end();
    }
}

impl FrameSource for Mp4Source {
    fn info(&self) -> &SourceInfo {
        &self.info
    }

    fn is_coded(&self) -> bool {
        true
    }

    fn next_frame(&mut self) -> Result<Option<Frame>> {
        if let Some(frame) = self.first.take() {
            return Ok(Some(frame));
        }
        let Some(frames) = &self.frames else { return Ok(None) };
        match frames.recv() {
            Ok(Message::Frame(frame, _)) => {
                self.ahead.taken();
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

    fn will_hold(&mut self, n: usize) {
        self.ahead.go_on_to(n as u64);
    }

    fn want_only(&mut self, wanted: Wanted) {
        // Said twice, the first holds: it may have been acted on.
        let _ = self.wanted.set(wanted);
    }

    fn entries(&self) -> Vec<u64> {
        self.entries.clone()
    }

    fn reads_ahead(&self) -> bool {
        true
    }

    fn warnings(&self) -> &[String] {
        &self.warnings
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::io::Colour;

    /// The frames of a clip with pixels, of those that are wanted.
    fn frames(name: &str, wanted: Option<Vec<u64>>) -> Vec<Frame> {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/video").join(name);
        let options = OpenOptions { colour: Colour::Native, ..OpenOptions::default() };
        let Ok(Opened::Source(mut source)) = open(&path, &options) else { panic!("{name}") };
        let all = wanted.is_none();
        if let Some(wanted) = wanted.clone() {
            source.want_only(Box::new(move |k| wanted.contains(&k)));
        }
        let mut frames = Vec::new();
        while let Some(frame) = source.next_frame().unwrap() {
            let is_wanted = wanted.as_ref().is_some_and(|w| w.contains(&frame.index.0));
            frames.extend((all || is_wanted).then_some(frame));
        }
        assert!(source.warnings().is_empty(), "{name}: {:?}", source.warnings());
        frames
    }

    #[test]
    fn frames_behind_what_is_passed_over_are_those_of_the_whole_file() {
        let names =
            ["b_frames", "slices", "open_gop", "cropped", "edit_list", "fragmented", "variable_rate", "interlaced"];
        for name in names.map(|n| format!("{n}.mp4")) {
            let all = frames(&name, None);
            let n = all.len() as u64;
            for wanted in [vec![n - 1], vec![n / 2], vec![n / 3, n - 2], vec![0, 7, 8, n - 5], vec![]] {
                let want: Vec<&Frame> = all.iter().filter(|f| wanted.contains(&f.index.0)).collect();
                let got = frames(&name, Some(wanted.clone()));
                assert!(got.iter().collect::<Vec<_>>() == want, "{name}: {wanted:?}");
            }
        }
    }

    #[test]
    fn sync_samples_are_where_reading_can_begin() {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/video/b_frames.mp4");
        let Ok(Opened::Source(source)) = open(&path, &OpenOptions::default()) else { panic!() };
        let entries = source.entries();
        assert!(entries.first() == Some(&0) && entries.windows(2).all(|w| w[0] < w[1]), "{entries:?}");
    }
}
