//! The second look at a file whose camera stands still: over its first [`SECOND_LOOK_FRAMES`] frames and in colour.
//!
//! The target may come late, and its colour may be what tells it; the first frames, read as the configuration says (grey), show neither. Small frames are kept in colour while the file
//! is read ahead ([`ColoursBeside`]). Of large ones (beyond 493 kpx) those held for the first pass are looked at, some 5 s of 1080p, with small ones in colour; only where large
//! things move that do not fit what is looked for, nothing is chosen by them, or too few can be held, is the file read a second time.

use super::first_scans::PROBE_FRAMES;
use super::scene::Scene;
use super::shaken::Shaken;
use super::spread::spread;
use crate::io::{Colour, ColoursBeside, KeepColours, MOST_BYTES, OpenOptions, Replay};
use crate::sensor::Correction;
use crate::vision::colour::GRID_PX;
use crate::{Config, Frame, FrameSource, PixelKind};
use std::ffi::OsStr;
use std::path::Path;

/// Frames of a file that are looked through when its camera stands still.
pub const SECOND_LOOK_FRAMES: usize = 400;
/// Most memory taken by the frames kept of them, bytes.
const MAX_BYTES: usize = 256 << 20;
/// Least number of frames held for the first pass that show as much: twice what the first look sees.
const LEAST_HELD: usize = 2 * PROBE_FRAMES;

/// The frames of a second look; none where it was not taken.
#[derive(Debug, Default)]
pub(super) struct Second<'a> {
    /// In the order of time, spread evenly.
    pub frames: Vec<&'a Frame>,
    /// Those that are in colour, or the same.
    pub coloured: Vec<&'a Frame>,
    /// What moves before a camera that shakes, and the frames in which it was looked for.
    pub shaken: Option<(&'a Scene, Vec<&'a Frame>)>,
}

impl<'a> Second<'a> {
    /// Frames that are looked at and are in colour, if the file is.
    pub(super) fn of(frames: &'a [Frame]) -> Self {
        let all: Vec<&Frame> = frames.iter().collect();
        Self { frames: all.clone(), coloured: all, shaken: None }
    }

    /// With what moves in those held before a camera that shakes, if it does.
    pub(super) fn with(self, shaken: Option<&'a Shaken>, held: &'a [Frame]) -> Self {
        Self { shaken: shaken.map(|s| (&s.scene, s.frames(held))), ..self }
    }

    /// The frames, or those of the first look where there are none.
    pub(super) fn or(&self, first: &'a [Frame]) -> Vec<&'a Frame> {
        if self.frames.is_empty() { first.iter().collect() } else { self.frames.clone() }
    }
}

/// What was read for a second look.
#[derive(Debug)]
pub(super) enum Read {
    /// Its frames.
    All(Vec<Frame>),
    /// Those in colour, small: the frames are those held.
    Coloured(Vec<Frame>),
}

impl Read {
    /// The same, with what is drawn on the picture filled; small frames, which tell colours, stay as they are.
    pub(super) fn without(mut self, overlay: Option<&mut Correction>) -> Self {
        if let (Self::All(frames), Some(overlay)) = (&mut self, overlay) {
            frames.iter_mut().for_each(|f| overlay.apply(&mut f.pixels));
        }
        self
    }

    /// The frames of the look, of those held if need be.
    pub(super) fn with<'a>(&'a self, held: &'a [Frame]) -> Second<'a> {
        match self {
            Self::All(frames) => Second::of(frames),
            Self::Coloured(small) => {
                Second { frames: spread(held, PROBE_FRAMES).collect(), coloured: small.iter().collect(), shaken: None }
            }
        }
    }
}

/// Whether the input is a file or files, which are the same when they are read again.
pub(super) fn can_be_opened_twice(input: &OsStr) -> bool {
    let on_disk = std::fs::metadata(Path::new(input)).is_ok_and(|m| m.is_file() || m.is_dir());
    on_disk || input.to_str().is_some_and(|t| t.contains('*') && !t.contains("://"))
}

/// Which frames are kept, so that at most `most` of any number stay, spread evenly.
struct Spread {
    most: usize,
    n_kept: usize,
    step: usize,
}

impl Spread {
    fn new(most: usize) -> Self {
        Self { most, n_kept: 0, step: 1 }
    }

    /// Whether the frame at place `k` is kept; first, whether every other one of those kept before goes.
    fn keeps(&mut self, k: usize) -> (bool, bool) {
        let mut thins = false;
        if k.is_multiple_of(self.step) && self.n_kept == self.most {
            // Twice as far apart, over twice the time.
            thins = true;
            self.n_kept = self.most.div_ceil(2);
            self.step *= 2;
        }
        let keeps = k.is_multiple_of(self.step);
        self.n_kept += usize::from(keeps);
        (thins, keeps)
    }
}

/// What a source keeps in colour while it is read ahead: of small frames all that is looked at, with all frames before them; of large ones what tells a colour, over as many as are held.
fn keep(width: usize, height: usize) -> KeepColours {
    let n_px = width.saturating_mul(height).max(1);
    if n_px.saturating_mul(SECOND_LOOK_FRAMES + 3 * PROBE_FRAMES) <= MAX_BYTES {
        return KeepColours { over: SECOND_LOOK_FRAMES, most: PROBE_FRAMES, every_px: 1 };
    }
    let over = (MOST_BYTES / n_px).min(SECOND_LOOK_FRAMES);
    let most = if over < LEAST_HELD { 0 } else { PROBE_FRAMES };
    KeepColours { over, most, every_px: width.div_ceil(GRID_PX).max(2) }
}

/// Asks the source that is read ahead for the frames of the second look that are in colour.
pub(super) fn beside() -> ColoursBeside {
    ColoursBeside::new(keep)
}

/// What a source has kept in colour for the second look while it was read ahead; `None` if it did not keep all that was asked for.
pub(super) fn from_beside(colours: &ColoursBeside, frames: &mut Replay) -> Option<Read> {
    let info = frames.info();
    let KeepColours { over, every_px, .. } = keep(info.width, info.height);
    frames.read_on(over);
    let (until, ended) = frames.end();
    let kept = colours.take(until).filter(|_| ended || until >= over as u64)?;
    Some(if every_px > 1 { Read::Coloured(kept) } else { Read::All(kept) })
}

/// At most `n_kept` frames spread evenly over the beginning, in colour if the file has it; what cannot be read ends them.
pub(super) fn frames(input: &OsStr, base: &Config, n_kept: usize) -> Vec<Frame> {
    // Frames that are lost shift the others: then the numbers do not tell which are wanted.
    kept(input, base, n_kept, true).or_else(|| kept(input, base, n_kept, false)).unwrap_or_default()
}

/// The frames; `None` if one that is wanted came without pixels.
fn kept(input: &OsStr, base: &Config, n_kept: usize, sparing: bool) -> Option<Vec<Frame>> {
    let options = OpenOptions { colour: Colour::Rgb, ..base.input.open_options() };
    match crate::io::open(input, &options) {
        // Colours are not mended, and what cannot be mended is looked at as it is: the run itself says why.
        Ok(mut source) if source.info().kind == PixelKind::Rgb8 || !base.input.sensor.is_active() => {
            kept_of(source.as_mut(), n_kept, sparing)
        }
        Ok(source) => match base.input.mend(source) {
            Ok(mut source) => kept_of(source.as_mut(), n_kept, sparing),
            Err(_) => Some(Vec::new()),
        },
        Err(_) => Some(Vec::new()),
    }
}

/// At most `n_kept` frames spread evenly over the beginning of a source.
pub(super) fn spread_over(source: &mut dyn FrameSource, n_kept: usize) -> Vec<Frame> {
    kept_of(source, n_kept, false).unwrap_or_default()
}

fn kept_of(source: &mut dyn FrameSource, n_kept: usize, sparing: bool) -> Option<Vec<Frame>> {
    let info = source.info();
    let bytes = info.width.saturating_mul(info.height).saturating_mul(3).max(1);
    let most = (MAX_BYTES / bytes).clamp(4, n_kept);
    if sparing {
        let mut spread = Spread::new(most);
        let looked_at: Vec<bool> = (0..SECOND_LOOK_FRAMES).map(|k| spread.keeps(k).1).collect();
        source.want_only(Box::new(move |k| usize::try_from(k).is_ok_and(|k| looked_at.get(k) == Some(&true))));
    }
    let (mut kept, mut spread) = (Vec::with_capacity(most), Spread::new(most));
    for k in 0..SECOND_LOOK_FRAMES {
        let Ok(Some(frame)) = source.next_frame() else { break };
        let (thins, keeps) = spread.keeps(k);
        if thins {
            let mut i = 0;
            kept.retain(|_| {
                i += 1;
                i % 2 == 1
            });
        }
        match (keeps, frame.pixels.width()) {
            (true, 0) => return None,
            (true, _) => kept.push(frame),
            (false, _) => source.recycle(frame),
        }
    }
    Some(kept)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_are_kept_evenly_whatever_their_number() {
        for n in [3, 4, 9, 40, 399] {
            let (mut spread, mut kept) = (Spread::new(4), Vec::new());
            for k in 0..n {
                let (thins, keeps) = spread.keeps(k);
                if thins {
                    kept = kept.into_iter().step_by(2).collect();
                }
                kept.extend(keeps.then_some(k));
                assert_eq!(spread.n_kept, kept.len());
            }
            assert!(kept.len() <= 4 && kept.windows(2).all(|w| w[1] - w[0] == spread.step), "{kept:?}");
        }
    }

    #[cfg(feature = "video")]
    #[test]
    fn frames_that_nobody_keeps_change_none_of_those_kept() {
        let clip = concat!(env!("CARGO_MANIFEST_DIR"), "/../../samples/ir_drone/IR_DRONE_046.mp4");
        let [spared, all] = [true, false].map(|sparing| kept(OsStr::new(clip), &Config::default(), 8, sparing));
        assert_eq!(all.as_ref().map(Vec::len), Some(5));
        assert!(spared == all);
    }

    #[cfg(feature = "video")]
    #[test]
    fn frames_kept_in_colour_are_those_of_a_second_reading() {
        let clip = concat!(env!("CARGO_MANIFEST_DIR"), "/../../samples/ir_drone/IR_DRONE_046.mp4");
        let colours = beside();
        let options = OpenOptions { colours_beside: Some(colours.clone()), ..OpenOptions::default() };
        let mut frames = Replay::new(crate::io::open(clip, &options).unwrap(), 3).up_to(1000);
        let Some(Read::All(kept)) = from_beside(&colours, &mut frames) else { panic!("all frames are small") };
        assert!(kept.iter().all(|f| f.pixels.kind() == PixelKind::Rgb8) && kept.len() <= PROBE_FRAMES);
        assert!(kept == self::frames(OsStr::new(clip), &Config::default(), PROBE_FRAMES));
        assert!(from_beside(&colours, &mut frames).is_none(), "they are taken once");
    }

    #[test]
    fn large_frames_are_looked_at_as_they_are_held_with_small_ones_in_colour() {
        let of = |w, h| {
            let KeepColours { over, most, every_px } = keep(w, h);
            (over, most, every_px)
        };
        assert_eq!(of(768, 576), (SECOND_LOOK_FRAMES, PROBE_FRAMES, 1));
        assert_eq!(of(1280, 720), (291, PROBE_FRAMES, 4));
        assert_eq!(of(1920, 1080), (129, PROBE_FRAMES, 6));
        assert_eq!(of(3840, 2160).1, 0, "too few are held");
    }

    #[test]
    fn streams_and_cameras_are_opened_once() {
        for once in ["-", "rtsp://host/stream", "/dev/video0", "/no/such/file.mp4"] {
            assert!(!can_be_opened_twice(OsStr::new(once)), "{once}");
        }
        assert!(can_be_opened_twice(OsStr::new("frames/*.png")));
        assert!(can_be_opened_twice(OsStr::new(env!("CARGO_MANIFEST_DIR"))));
    }
}
