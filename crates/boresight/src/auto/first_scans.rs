//! The scans that a first pass learns from, and which of their detections are one track's alone.
//!
//! Source: our own. Every pass that learns (noise and motion, what the detections are made of) looks at the same scans.
//! Limits: what comes after [`MOST_SCANS`] scans or [`MOST_DETECTIONS`] detections has no part in what is learnt.

use crate::{Scan, TrackState};

/// Frames looked at by the automatic choice.
pub const PROBE_FRAMES: usize = 48;

/// Most scans and detections of the first pass: half a minute of most videos, or of a table; a guard of time and memory.
pub const MOST_SCANS: usize = crate::io::MOST_FRAMES;
const MOST_DETECTIONS: usize = 2_000_000;

/// The scans to learn from: the first ones, as many as the limits allow.
pub fn first(scans: &[Scan]) -> &[Scan] {
    let mut n_seen = 0usize;
    let n = scans
        .iter()
        .take(MOST_SCANS)
        .take_while(|s| {
            n_seen = n_seen.saturating_add(s.detections.len());
            n_seen <= MOST_DETECTIONS
        })
        .count();
    &scans[..n]
}

/// How many tracks hold each detection of one scan; keeps its memory.
#[derive(Debug, Default)]
pub struct Shares(Vec<u8>);

impl Shares {
    /// Counts the tracks of a scan with that many detections.
    pub fn count(&mut self, n_detections: usize, states: &[TrackState]) {
        self.0.clear();
        self.0.resize(n_detections, 0);
        for j in states.iter().filter_map(|s| s.detection) {
            self.0[j as usize] = self.0[j as usize].saturating_add(1);
        }
    }

    /// Whether one track alone holds detection `j`.
    pub fn is_one(&self, j: u32) -> bool {
        self.0[j as usize] == 1
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Detection, FrameIndex, Timestamp};
    use nalgebra::{Matrix2, Vector2};

    #[test]
    fn a_long_table_is_learnt_from_its_beginning() {
        let scan = |n: usize| {
            let d = Detection::at(Vector2::zeros(), Matrix2::identity());
            Scan::at(FrameIndex(0), Timestamp::from_ns(0)).with_detections(vec![d; n])
        };
        assert_eq!(first(&[]).len(), 0);
        assert_eq!(first(&vec![scan(1); MOST_SCANS + 5]).len(), MOST_SCANS);
        assert_eq!(first(&vec![scan(MOST_DETECTIONS / 4); 9]).len(), 4);
    }
}
