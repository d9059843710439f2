//! From detections to tracks: filters, life cycle, birth; never sees pixels.

use crate::{Result, Scan, TrackState};

/// Turns scans into tracks: the tracker, or the multiple-hypothesis tracker.
pub trait Tracking: Send {
    /// Takes the next scan and returns all living tracks after it.
    /// # Errors
    /// A scan that runs back in time or holds values that are not finite; the tracks are then unchanged.
    fn step(&mut self, scan: &Scan) -> Result<&[TrackState]>;
}
