//! A truth, a result, and what is known of their sequence.

use crate::metrics::cells::CellSequence;
use crate::{ASSUMED_RATE_HZ, Scan, TrackTable};

/// A truth and a result, and what is known of their sequence.
#[derive(Clone, Copy, Debug)]
#[non_exhaustive]
pub struct Sequence<'a> {
    /// Name of the sequence.
    pub name: &'a str,
    /// What was there.
    pub truth: &'a TrackTable,
    /// What was found.
    pub result: &'a TrackTable,
    /// Frame rate, frames/s; [`ASSUMED_RATE_HZ`] where a measure needs one and none is given.
    pub rate_hz: Option<f64>,
    /// Width and height of the frames, px.
    pub size_px: Option<(f64, f64)>,
    /// The detections that the result was made of, for the NIS.
    pub detections: Option<&'a [Scan]>,
    /// Labelled images, for DET and TRA.
    pub cells: Option<&'a CellSequence>,
}

impl<'a> Sequence<'a> {
    /// A truth and a result of which nothing else is known.
    pub fn new(truth: &'a TrackTable, result: &'a TrackTable) -> Self {
        Self { name: "", truth, result, rate_hz: None, size_px: None, detections: None, cells: None }
    }

    /// Time from one frame to the next, s.
    pub(super) fn dt_s(&self) -> f64 {
        1.0 / self.rate_hz.unwrap_or(ASSUMED_RATE_HZ)
    }
}
