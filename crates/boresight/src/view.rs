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
