//! The pictures that belong to a table of detections: one for each of its frames, so that a run on a table can be drawn.
//!
//! Which picture is which frame: where the table counts its frames from 1 (MOTChallenge) and the files' names carry numbers from 1 on, a frame's picture is the
//! one with its number; in all other cases the first picture is the table's first possible frame (0, or 1), and so on.
//! The table decides which frames there are, so that its tracks are the same with pictures and without: pictures before its first and behind its last row are not
//! read out, and a frame whose picture is missing is black.
//! Limits: how many frames a video that is read through ffmpeg has is known only at its end.

#[cfg(feature = "images")]
use super::open::images_of;
use super::open::open;
use super::options::{Colour, OpenOptions};
use super::tables::{DetectionTable, SequenceInfo};
use crate::{Error, ErrorKind, Frame, FrameIndex, FrameSource, Pixels, Result, SourceInfo, Timestamp};
use std::ffi::OsStr;
#[cfg(feature = "images")]
use std::path::Path;

/// The frames of a table.
pub struct Pictures {
    source: Box<dyn FrameSource>,
    info: SourceInfo,
    /// The table's frames.
    frames: std::vec::IntoIter<(FrameIndex, Timestamp)>,
    /// What the table calls its frame 0.
    first_frame: u64,
    /// Numbers of the source's pictures, less `first_frame`; without them they are the source's own.
    numbers: Option<Vec<u64>>,
    n_read: usize,
    /// A picture that was read and belongs to a later frame.
    held: Option<(u64, Frame)>,
    n_missing: u64,
    first_missing: Option<u64>,
    warnings: Vec<String>,
}

opaque_debug!(Pictures);

impl Pictures {
    /// Opens the pictures of a table: a folder, a pattern or a video; in colour if they have it.
    /// # Errors
    /// What [`open`] fails with; [`ErrorKind::Damaged`] if the table's frames or places do not fit the pictures, with what to do.
    pub fn open(
        input: impl AsRef<OsStr>,
        options: &OpenOptions,
        table: &DetectionTable,
        sequence: &SequenceInfo,
    ) -> Result<Self> {
        let input = input.as_ref();
        let source = open(input, &OpenOptions { colour: Colour::Rgb, ..options.clone() })?;
        let mut info = source.info().clone();
        let frames: Vec<(FrameIndex, Timestamp)> = table.scans.iter().map(|s| (s.index, s.time)).collect();
        info.n_frames = Some(frames.len() as u64);
        info.rate_hz = Some(table.rate_hz);
        info.true_times = false;
        let numbers = numbers(input, source.info(), table.first_frame);
        let one = Self {
            source,
            info,
            frames: frames.into_iter(),
            first_frame: table.first_frame,
            numbers,
            n_read: 0,
            held: None,
            n_missing: 0,
            first_missing: None,
            warnings: Vec::new(),
        };
        one.check_frames(input, table, sequence)?;
        one.check_places(input, table, sequence)?;
        Ok(one)
    }

    /// Whether the pictures reach from the table's first to its last frame.
    fn check_frames(&self, input: &OsStr, table: &DetectionTable, sequence: &SequenceInfo) -> Result<()> {
        let (Some(first), Some(last)) = (table.scans.first(), table.scans.last()) else { return Ok(()) };
        let called = |frame: u64| frame + self.first_frame;
        let last = last.index.0;
        if let Some(n) = sequence.n_frames.filter(|n| last >= *n as u64) {
            let what = format!("has rows in frame {}, seqinfo.ini says {n} frames", called(last));
            return Err(Error::new(ErrorKind::Damaged, what)
                .at(input.display())
                .hint("is the table of another sequence?"));
        }
        let pictures = match (&self.numbers, self.source.info().n_frames) {
            (Some(numbers), _) => numbers.first().copied().zip(numbers.last().copied()),
            (None, Some(n)) if n > 0 => Some((0, self.last_place(input).unwrap_or(n - 1))),
            _ => None,
        };
        match pictures {
            Some((from, to)) if last > to || first.index.0 > to || last < from => {
                let what = format!(
                    "the table's frames {} to {} do not fit the pictures, which are those of frames {} to {}",
                    called(first.index.0),
                    called(last),
                    called(from),
                    called(to)
                );
                Err(Error::new(ErrorKind::Damaged, what).at(input.display()).hint(
                    "give the pictures of this sequence; if the table counts from another number, say which it gives to the first picture: --set input.table.first-frame=1",
                ))
            }
            _ => Ok(()),
        }
    }

    /// The place of the last file whose name has a number.
    #[cfg(feature = "images")]
    fn last_place(&self, input: &OsStr) -> Option<u64> {
        let files = images_of(input)?;
        let n_files = super::numbered::numbers(&files)?.len() as u64;
        if n_files != self.source.info().n_frames.unwrap_or(0) {
            return None;
        }
        super::numbered::holes(&files).and_then(|n| n.places.last().copied())
    }

    /// Without images there are no numbered files.
    #[cfg(not(feature = "images"))]
    fn last_place(&self, _: &OsStr) -> Option<u64> {
        None
    }

    /// Whether the detections lie in the pictures.
    fn check_places(&self, input: &OsStr, table: &DetectionTable, sequence: &SequenceInfo) -> Result<()> {
        let (w, h) = (self.info.width as f64, self.info.height as f64);
        if let Some((sw, sh)) = sequence.size_px.filter(|s| *s != (w, h)) {
            let what = format!("the pictures have {w} x {h} px, seqinfo.ini says {sw} x {sh}");
            return Err(Error::new(ErrorKind::Damaged, what)
                .at(input.display())
                .hint("give the pictures that the detections were made in, in their own size"));
        }
        let all = || table.scans.iter().flat_map(|s| &s.detections);
        let outside = |p: &nalgebra::Vector2<f64>| p.x < -0.5 || p.y < -0.5 || p.x > w - 0.5 || p.y > h - 0.5;
        let n_outside = all().filter(|d| outside(&d.position)).count();
        if 2 * n_outside > all().count() {
            let far = all().fold([0.0f64; 2], |m, d| [m[0].max(d.position.x), m[1].max(d.position.y)]);
            let what = format!(
                "most detections ({n_outside} of {}) lie outside the pictures of {w} x {h} px; they reach to ({:.0}, {:.0})",
                all().count(),
                far[0],
                far[1]
            );
            return Err(Error::new(ErrorKind::Damaged, what)
                .at(input.display())
                .hint("give the pictures that the detections were made in, in their own size"));
        }
        Ok(())
    }

    /// The next picture of the source, with the table's frame that it belongs to.
    fn read(&mut self) -> Result<Option<(u64, Frame)>> {
        if let Some(held) = self.held.take() {
            return Ok(Some(held));
        }
        let Some(frame) = self.source.next_frame()? else { return Ok(None) };
        let place = match &self.numbers {
            Some(numbers) => numbers.get(self.n_read).copied().unwrap_or(u64::MAX),
            None => frame.index.0,
        };
        self.n_read += 1;
        Ok(Some((place, frame)))
    }

    /// Gathers the warnings at the end.
    fn end(&mut self) {
        self.warnings = self.source.warnings().to_vec();
        if let Some(first) = self.first_missing {
            let (n, first) = (self.n_missing, first + self.first_frame);
            self.warnings.push(match n {
                1 => format!("1 frame of the table has no picture and is drawn on black: frame {first}."),
                n => format!(
                    "{n} frames of the table have no picture and are drawn on black, the first of them frame {first}."
                ),
            });
        }
    }
}

/// The frames of a table that pictures belong to by the numbers in their names, where both count from 1.
#[cfg(feature = "images")]
fn numbers(input: &OsStr, info: &SourceInfo, first_frame: u64) -> Option<Vec<u64>> {
    if first_frame == 0 || Path::new(input).is_file() {
        return None;
    }
    let files = images_of(input)?;
    let numbers = super::numbered::numbers(&files)?;
    // A TIFF of several pages gives more frames than it has names.
    let fits = info.n_frames == Some(numbers.len() as u64) && numbers.first().is_some_and(|n| *n >= first_frame);
    fits.then(|| numbers.into_iter().map(|n| n - first_frame).collect())
}

/// Without images there are no numbered files.
#[cfg(not(feature = "images"))]
fn numbers(_: &OsStr, _: &SourceInfo, _: u64) -> Option<Vec<u64>> {
    None
}

impl FrameSource for Pictures {
    fn info(&self) -> &SourceInfo {
        &self.info
    }

    fn next_frame(&mut self) -> Result<Option<Frame>> {
        let Some((index, time)) = self.frames.next() else {
            self.end();
            return Ok(None);
        };
        loop {
            match self.read()? {
                Some((place, frame)) if place < index.0 => self.source.recycle(frame),
                Some((place, frame)) if place == index.0 => return Ok(Some(Frame { index, time, ..frame })),
                Some(later) => {
                    self.held = Some(later);
                    break;
                }
                None => {
                    self.end();
                    let (at, last) = (self.source.info().label.clone(), self.frames.clone().next_back());
                    let last = last.map_or(index.0, |l| l.0.0) + self.first_frame;
                    let what = format!(
                        "the pictures end before frame {}, the table goes on to frame {last}",
                        index.0 + self.first_frame
                    );
                    return Err(Error::new(ErrorKind::Damaged, what)
                        .at(at)
                        .hint("give the pictures of this sequence, or leave --frames out"));
                }
            }
        }
        self.n_missing += 1;
        self.first_missing.get_or_insert(index.0);
        Ok(Some(Frame { index, time, pixels: Pixels::black(self.info.kind, self.info.width, self.info.height) }))
    }

    fn recycle(&mut self, frame: Frame) {
        self.source.recycle(frame);
    }

    fn reads_ahead(&self) -> bool {
        self.source.reads_ahead()
    }

    fn warnings(&self) -> &[String] {
        &self.warnings
    }
}
