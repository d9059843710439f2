//! The trait of everything that turns scans into tracks.

use crate::{Result, Scan, TrackState};

/// Turns scans into tracks: the tracker, or the multiple-hypothesis tracker.
pub trait Tracking: Send {
    /// Takes the next scan and returns all tracks after it, in the order of their ids.
    /// # Errors
    /// A scan that runs back in time or holds values that are not finite; the tracks are then unchanged.
    fn step(&mut self, scan: &Scan) -> Result<&[TrackState]>;
}
