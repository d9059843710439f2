//! A sink that is shown only the tracks in which something was measured: no row of the table behind it is a prediction.
//!
//! Limits: a frame in which nothing was measured is shown to it without tracks.

use crate::{Result, Sink, TrackState, View};

/// Hands on each view with the tracks that took a detection in it.
pub struct MeasuredOnly {
    sink: Box<dyn Sink>,
    tracks: Vec<TrackState>,
}

opaque_debug!(MeasuredOnly);

impl MeasuredOnly {
    /// In front of this sink.
    pub fn new(sink: Box<dyn Sink>) -> Self {
        Self { sink, tracks: Vec::new() }
    }
}

impl Sink for MeasuredOnly {
    fn needs_frames(&self) -> bool {
        self.sink.needs_frames()
    }

    fn put(&mut self, view: &View<'_>) -> Result<()> {
        self.tracks.clear();
        self.tracks.extend(view.tracks.iter().filter(|t| t.detection.is_some()).cloned());
        self.sink.put(&View { tracks: &self.tracks, ..*view })
    }

    fn finish(self: Box<Self>) -> Result<()> {
        self.sink.finish()
    }
}
