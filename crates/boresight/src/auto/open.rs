//! Opens an input and settles everything in one call: what the command `boresight track INPUT` does, for programs.

use super::open_and_choose;
use crate::track::Tracking;
use crate::vision::Detector;
use crate::{Config, FrameSource, Result};

/// Frames looked at by the automatic choice.
pub const PROBE_FRAMES: usize = 48;

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

/// Opens frames and chooses a detector and a tracker by looking at the first [`PROBE_FRAMES`] of them, of a file also further on.
///
/// `base` says how the input is read; its other parts are where the choice starts from.
/// ```
/// use boresight::{Config, Scan, auto};
///
/// # fn main() -> boresight::Result<()> {
/// let clip = concat!(env!("CARGO_MANIFEST_DIR"), "/../../samples/ir_drone/IR_DRONE_046.mp4");
/// let mut run = auto::open(clip, &Config::default())?;
/// let (mut scan, mut confirmed) = (Scan::default(), 0);
/// for _ in 0..10 {
///     let Some(frame) = run.frames.next_frame()? else { break };
///     run.detector.detect(&frame, &mut scan)?;
///     confirmed = run.tracker.step(&scan)?.len();
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
