//! What sinks see of one frame, read only, and the sinks' trait.

use crate::{Frame, Result, Scan, TrackState};

/// One frame, its detections and its tracks after the update.
#[derive(Clone, Copy, Debug)]
pub struct View<'a> {
    /// The frame; `None` when detections came from a file.
    pub frame: Option<&'a Frame>,
    /// The detections.
    pub scan: &'a Scan,
    /// All living tracks.
    pub tracks: &'a [TrackState],
}

/// Takes views one by one and makes a file or a table of them.
///
/// One of one's own, which sends where each track is:
/// ```
/// use boresight::{Detection, FrameIndex, Result, Scan, Sink, Timestamp, View, pipeline, track};
/// use std::sync::mpsc::{Sender, channel};
///
/// struct Places(Sender<(u64, f64)>);
///
/// impl Sink for Places {
///     fn put(&mut self, view: &View<'_>) -> Result<()> {
///         // Who listens no longer need not be told.
///         view.tracks.iter().for_each(|t| drop(self.0.send((view.scan.index.0, t.position().x))));
///         Ok(())
///     }
///     fn finish(self: Box<Self>) -> Result<()> {
///         Ok(())
///     }
/// }
///
/// let scan = |k: u64| {
///     let mut scan = Scan::at(FrameIndex(k), Timestamp::from_secs_f64(0.1 * k as f64));
///     scan.detections.push(Detection::point(5.0 + k as f64, 20.0, 0.3));
///     scan
/// };
/// let (sender, places) = channel();
/// let tracking = track::build(&track::TrackerConfig::default())?;
/// let scans = pipeline::Input::Scans((0..20).map(scan).collect());
/// let outcome = pipeline::run(scans, Some(tracking), vec![Box::new(Places(sender))], &mut |_| std::ops::ControlFlow::Continue(()));
/// outcome.all_written()?;
/// let (frame, x) = places.iter().last().unwrap();
/// assert!(frame == 19 && (x - 24.0).abs() < 1.0);
/// # Ok::<(), boresight::Error>(())
/// ```
pub trait Sink: Send {
    /// Takes one frame's view.
    /// # Errors
    /// When the output cannot be written.
    fn put(&mut self, view: &View<'_>) -> Result<()>;
    /// Whether it looks at the frames: a run that holds back its results keeps them only for sinks that do.
    fn needs_frames(&self) -> bool {
        true
    }
    /// Ends the output so that the file is whole and readable.
    /// # Errors
    /// When the output cannot be written.
    fn finish(self: Box<Self>) -> Result<()>;
}
