//! From an input's name to what runs it, in the order of the steps:
//!
//! 1. open the input and read its first frames ahead ([`Replay`] hands them out again: a stream is read once, and no frame is lost);
//! 2. look at them as a whole; where a file's camera stands still its frames further on are looked at in colour: those that were kept while it was read, or the file is read a second
//!    time ([`super::second_look`]);
//! 3. choose detector and tracker; where nothing is seen yet, by frames further on ([`super::later_looks`]);
//! 4. run the detector over the frames read ahead and learn noise and motion from its detections ([`learn()`]);
//! 5. hand on the frames. Only where a colour was chosen is the file opened anew: grey frames cannot be turned into coloured ones.

use super::choose::{Choice, choose_looked, choose_seen, looked_again};
use super::first_scans::{self, PROBE_FRAMES};
use super::later_looks;
use super::learn::learn;
use super::moving;
use super::request::{DetectorKind, Request};
use super::scene::{self, Camera, Scene};
use super::second_look::{self, Read, SECOND_LOOK_FRAMES};
use super::shaken::{self, Shaken};
use crate::io::{Colour, ColoursBeside, MOST_BYTES, OpenOptions, Replay, frames_ahead};
use crate::sensor::{Found, if_defective};
use crate::track::Tracking;
use crate::vision::Detector;
use crate::{Config, Error, Frame, FrameSource, Result};
use std::ffi::OsStr;

/// An input ready to be run: its frames, and what turns them into tracks.
pub struct Opened {
    /// The frames, from the first on.
    pub frames: Box<dyn FrameSource>,
    /// Frame to detections.
    pub detector: Box<dyn Detector>,
    /// Detections to tracks.
    pub tracker: Box<dyn Tracking>,
    /// The configuration chosen.
    pub config: Config,
    /// Why it is what it is, a sentence each.
    pub reasons: Vec<String>,
}

opaque_debug!(Opened);

/// Opens an input and proposes its configuration; the source hands out every frame from the first on.
/// # Errors
/// An input that cannot be opened, or whose first frames differ in size or pixel type.
pub fn open_and_choose(input: impl AsRef<OsStr>, base: &Config, request: &Request) -> Result<(Replay, Choice)> {
    let input = input.as_ref();
    let mut base = base.clone();
    let given = base.input.sensor.clone();
    let on_disk = second_look::can_be_opened_twice(input);
    let beside = (on_disk && base.input.colour != Colour::Rgb).then(second_look::beside);
    let read = |config: &mut Config, colours_beside: Option<ColoursBeside>| -> Result<(Replay, Found)> {
        let options = OpenOptions { colours_beside, ..config.input.open_options() };
        let mut source = config.input.mend(crate::io::open(input, &options)?)?;
        // A stream waits for nothing longer than the choice needs.
        let most = if on_disk { first_scans::MOST_SCANS } else { PROBE_FRAMES };
        let n = frames_ahead(source.info(), most, MOST_BYTES);
        let found;
        (source, found) = if_defective(source, n, &config.input.sensor)?;
        let sensor = &mut config.input.sensor;
        sensor.bad_pixels = sensor.bad_pixels.or((found.n_bad > 0).then_some(true));
        sensor.column_noise = sensor.column_noise.or((found.column_rms > 0.0).then_some(true));
        sensor.overlay = sensor.overlay.or((!found.drawn.is_empty()).then_some(true));
        // Those of the second look are read while the first ones are looked at, the rest of them when it is detected: where a colour is chosen they are read anew.
        Ok((Replay::new(source, n.min(PROBE_FRAMES)).up_to(n).reading_on(SECOND_LOOK_FRAMES), found))
    };
    let (mut frames, found) = read(&mut base, beside.clone())?;
    let base = &base;
    // What was found drawn is filled in the frames of a second look as well, and not looked for again.
    let mut unfilled = base.clone();
    unfilled.input.sensor.overlay = given.overlay;
    let anew = || Read::All(second_look::frames(input, &unfilled, PROBE_FRAMES));
    let mut overlay = found.overlay(frames.info().width, frames.info().height);
    let second = |frames: &mut Replay, wanted: Wanted| {
        let read = match (wanted, &beside) {
            (Wanted::None, beside) => {
                beside.iter().for_each(ColoursBeside::end);
                None
            }
            (Wanted::First, Some(beside)) => Some(second_look::from_beside(beside, frames).unwrap_or_else(anew)),
            (Wanted::First | Wanted::Anew, _) => on_disk.then(anew),
        };
        read.map(|read| read.without(overlay.as_mut()))
    };
    let mut choice = choose_from(&mut frames, second, base, request)?;
    if on_disk {
        let rate_hz = frames.info().rate_hz.unwrap_or(base.input.rate_hz);
        choice.report_whole(rate_hz);
    }
    if choice.config.input.colour != base.input.colour {
        // Frames in colour are no sensor's.
        choice.config.input.sensor = given;
        frames = read(&mut choice.config, None)?.0;
    } else {
        choice.reasons.splice(0..0, words(&found));
    }
    Ok((frames, choice))
}

/// What is mended of a sensor's frames unasked, and how not to.
fn words(found: &Found) -> Vec<String> {
    let mut out = Vec::new();
    if found.n_bad > 0 {
        let pixels = if found.n_bad == 1 { "pixel is" } else { "pixels are" };
        out.push(format!(
            "{} {pixels} always unlike all around, as no optics makes them: bad ones of the sensor, or drawn on the picture; they are filled from their neighbours (--set input.sensor.bad-pixels=false).",
            found.n_bad
        ));
    }
    if !found.drawn.is_empty() {
        out.push(format!(
            "Something is drawn on the picture (a cross, a clock, text): {} pixels stand still to a tenth of a pixel while the scene moves, or change as digits do; they are filled from around (--set input.sensor.overlay=false).",
            found.drawn.len()
        ));
    }
    if found.column_rms > 0.0 {
        out.push(format!(
            "The columns have offsets of {:.2} counts rms that stay while the scene moves over them: they are taken off (--set input.sensor.column-noise=false).",
            found.column_rms
        ));
    }
    out
}

/// As [`open_and_choose`], for frames that the caller has: `again` hands out the same frames anew, if they can be had a second time.
/// # Errors
/// First frames that cannot be read, or that differ in size or pixel type.
pub fn read_and_choose(
    source: Box<dyn FrameSource>,
    again: Option<&mut dyn FrameSource>,
    base: &Config,
    request: &Request,
) -> Result<(Replay, Choice)> {
    let info = source.info().clone();
    let most = if info.n_frames.is_some() || again.is_some() { first_scans::MOST_SCANS } else { PROBE_FRAMES };
    let n = frames_ahead(&info, most, MOST_BYTES);
    let mut frames = Replay::new(source, n.min(PROBE_FRAMES)).up_to(n).reading_on(SECOND_LOOK_FRAMES);
    let mut again = again;
    let second = |_: &mut Replay, wanted: Wanted| match wanted {
        Wanted::None => None,
        _ => again.take().map(|source| Read::All(second_look::spread_over(source, PROBE_FRAMES))),
    };
    let choice = choose_from(&mut frames, second, base, request)?;
    Ok((frames, choice))
}

/// What is wanted of a second look.
enum Wanted {
    /// Nothing: it is not taken.
    None,
    /// Frames in colour, as they are had for the least.
    First,
    /// Frames of a second reading.
    Anew,
}

/// The choice from frames read ahead; `second` gives those of the second look, which only a fixed camera or a colour asks for.
fn choose_from(
    frames: &mut Replay,
    mut second: impl FnMut(&mut Replay, Wanted) -> Option<Read>,
    base: &Config,
    request: &Request,
) -> Result<Choice> {
    let info = frames.info().clone();
    let scene = scene::look(probed(frames.ahead()), &info)?;
    let shaken = shaken::look_on(&scene, frames)?;
    // Who does not know whether it stands looks longer.
    let look_again = scene.camera != Camera::Moving || request.detector == Some(DetectorKind::Colour);
    let mut read = second(frames, if look_again { Wanted::First } else { Wanted::None });
    if let Some(held @ Read::Coloured(_)) = &read {
        if request.detector.is_none()
            && let Some(choice) = of_held(held, frames, &scene, shaken.as_ref(), base, request)?
        {
            return Ok(choice);
        }
        // Too few to say what moves, or too few for who asks for a detector: more are worth another reading.
        read = second(frames, Wanted::Anew);
    }
    let ahead = frames.ahead();
    let looked = read.as_ref().map(|read| read.with(ahead)).unwrap_or_default().with(shaken.as_ref(), ahead);
    let choice = choose_seen(probed(ahead), scene, &looked, &info, base, request)?;
    if choice.is_evident() || request.detector.is_some() {
        return Ok(choice);
    }
    drop(read);
    Ok(later_looks::choice(frames, base, request)?.unwrap_or(choice))
}

/// The choice by frames that are held for the first pass, if they say what moves.
pub(super) fn of_held(
    read: &Read,
    frames: &mut Replay,
    scene: &Scene,
    shaken: Option<&Shaken>,
    base: &Config,
    request: &Request,
) -> Result<Option<Choice>> {
    let info = frames.info().clone();
    let ahead = frames.ahead();
    let looked = read.with(ahead).with(shaken, ahead);
    let seen = looked_again(scene.clone(), &looked, &info)?;
    if moving::is_open(shaken.map_or(&seen, |s| &s.scene), &info) {
        return Ok(None);
    }
    Ok(Some(choose_looked(probed(ahead), &seen, &looked, &info, base, request)?).filter(Choice::is_evident))
}

/// The frames that are looked at for the choice.
pub(super) fn probed(ahead: &[Frame]) -> &[Frame] {
    &ahead[..ahead.len().min(PROBE_FRAMES)]
}

/// Opens frames and chooses a detector and a tracker by looking at the first [`PROBE_FRAMES`] of them, of a file also later ones.
///
/// `base` says how the input is read; its other parts are where the choice starts from.
#[cfg_attr(feature = "video", doc = "```")]
#[cfg_attr(not(feature = "video"), doc = "```no_run")]
/// use boresight::{Config, Scan, TrackStatus, auto};
///
/// # fn main() -> boresight::Result<()> {
/// let clip = concat!(env!("CARGO_MANIFEST_DIR"), "/../../samples/ir_drone/IR_DRONE_046.mp4");
/// let mut run = auto::open(clip, &Config::default())?;
/// let (mut scan, mut confirmed) = (Scan::default(), 0);
/// for _ in 0..10 {
///     let Some(frame) = run.frames.next_frame()? else { break };
///     run.detector.detect(&frame, &mut scan)?;
///     confirmed = run.tracker.step(&scan)?.iter().filter(|t| t.status == TrackStatus::Confirmed).count();
/// }
/// assert_eq!(confirmed, 1); // one drone before sky and trees
/// # Ok(())
/// # }
/// ```
/// # Errors
/// An input that cannot be read; a parameter out of its range.
pub fn open(input: impl AsRef<OsStr>, base: &Config) -> Result<Opened> {
    let (mut frames, mut choice) = open_and_choose(input, base, &Request::default())?;
    let detector = learn(&mut frames, &mut choice, &Request::default(), Ok::<_, Error>)?;
    Ok(Opened {
        frames: Box::new(frames),
        detector,
        tracker: crate::track::build(&choice.config.tracker)?,
        config: choice.config,
        reasons: choice.reasons,
    })
}
