//! From an input's name to what runs it, in the order of the steps:
//!
//! 1. open the input and read its first frames ahead ([`Replay`] hands them out again: a stream is read once, and no frame is lost);
//! 2. look at them as a whole; a file whose camera stands still is read a second time, further on and in colour ([`super::second_look`]);
//! 3. choose detector and tracker;
//! 4. hand on the frames. Only where a colour was chosen is the file opened anew: grey frames cannot be turned into coloured ones.

use super::choose::{Choice, choose_seen};
use super::noise;
use super::replay::Replay;
use super::scene::{self, Camera};
use super::second_look;
use crate::track::Tracking;
use crate::vision::Detector;
use crate::{Config, Frame, FrameSource, Result, Scan, SourceInfo};

/// Frames looked at by the automatic choice.
pub const PROBE_FRAMES: usize = 48;

/// Frames of the first pass that tells noise and motion.
const LEARN_FRAMES: usize = 300;

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
pub fn open_and_choose(input: &str, base: &Config) -> Result<(Replay, Choice)> {
    let read = |config: &Config| -> Result<Replay> {
        Ok(Replay::new(crate::io::open(input, &config.input.open_options())?, PROBE_FRAMES))
    };
    let mut frames = read(base)?;
    let info = frames.info().clone();
    let scene = scene::look(frames.ahead(), &info)?;
    let look_again = scene.camera == Camera::Fixed && second_look::can_be_opened_twice(input);
    let second = if look_again { second_look::frames(input, base, PROBE_FRAMES) } else { Vec::new() };
    let mut choice = choose_seen(frames.ahead(), scene, &second, &info, base)?;
    if choice.config.input.colour != base.input.colour {
        frames = read(&choice.config)?;
    }
    let scans = if second_look::can_be_opened_twice(input) {
        let again = crate::io::open(input, &choice.config.input.open_options())?;
        first_pass(again, &choice.config)?
    } else {
        detections(frames.ahead(), &choice.config, &info)?
    };
    let area_px2 = (info.width * info.height).max(1) as f64;
    noise::learn(&scans, area_px2, &mut choice.config, &mut choice.reasons)?;
    Ok((frames, choice))
}

/// The detections of the first frames of a file; what cannot be read ends them.
fn first_pass(mut source: Box<dyn FrameSource>, config: &Config) -> Result<Vec<Scan>> {
    let mut detector = crate::vision::build(&config.detector, source.info())?;
    let mut scans = Vec::new();
    while scans.len() < LEARN_FRAMES
        && let Ok(Some(frame)) = source.next_frame()
    {
        let mut scan = Scan::default();
        detector.detect(&frame, &mut scan)?;
        scans.push(scan);
        source.recycle(frame);
    }
    Ok(scans)
}

/// The detections in frames at hand.
fn detections(frames: &[Frame], config: &Config, info: &SourceInfo) -> Result<Vec<Scan>> {
    let mut detector = crate::vision::build(&config.detector, info)?;
    let detect = |frame: &Frame| {
        let mut scan = Scan::default();
        detector.detect(frame, &mut scan).map(|()| scan)
    };
    frames.iter().map(detect).collect()
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
pub fn open(input: &str, base: &Config) -> Result<Opened> {
    let (frames, choice) = open_and_choose(input, base)?;
    let info = frames.info().clone();
    Ok(Opened {
        frames: Box::new(frames),
        detector: crate::vision::build(&choice.config.detector, &info)?,
        tracker: crate::track::build(&choice.config.tracker)?,
        config: choice.config,
        reasons: choice.reasons,
    })
}
