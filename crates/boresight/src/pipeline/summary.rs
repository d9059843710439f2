//! What a run gave, in numbers.

use std::time::Duration;

/// Time spent in each stage.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct StageTimes {
    /// Reading and decoding (waiting for it).
    pub read: Duration,
    /// Frame to detections, of all threads together.
    pub detect: Duration,
    /// Detections to tracks.
    pub track: Duration,
    /// Tables, video, report.
    pub write: Duration,
}

/// What a run gave.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Summary {
    /// Frames done.
    pub frames: u64,
    /// Time from the first to the last frame, s.
    pub duration_s: f64,
    /// Detections in all frames.
    pub detections: u64,
    /// Of these, how many have the position of a fitted spot, and how many fell back to the centroid, where a fit was asked for.
    pub fits: [u64; 2],
    /// Tracks that were confirmed at some time.
    pub confirmed_tracks: u64,
    /// Most confirmed tracks in one frame.
    pub most_at_once: u64,
    /// Mean normalised innovation squared of confirmed tracks (2 if the filter is consistent), and their number.
    pub mean_nis: Option<(f64, u64)>,
    /// Time in each stage.
    pub times: StageTimes,
    /// Warnings of the source.
    pub warnings: Vec<String>,
    /// Whether the caller ended the run before the source did.
    pub interrupted: bool,
}
