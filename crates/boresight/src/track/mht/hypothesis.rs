//! A track hypothesis and the tree of all hypotheses of one target.

use super::super::scan_table::Predicted;
use super::super::single_track::{Outcome, Track};

/// No detection in that scan.
pub(super) const NONE: u32 = u32::MAX;

/// Scans remembered by a hypothesis.
pub(super) const WINDOW: usize = 8;

/// One possible history of a target.
#[derive(Clone)]
pub(super) struct Hypothesis {
    pub track: Track,
    /// Track score: Σ ln Λ, from ln(β_new / λ).
    pub score: f64,
    /// Detections of the last scans, the newest first.
    pub path: [u32; WINDOW],
    pub predicted: Predicted,
    pub outcome: Outcome,
}

/// One target that may exist.
pub(super) struct Tree {
    /// Given when it is first part of an answer; 0 before.
    pub id: u64,
    pub leaves: Vec<Hypothesis>,
    /// The leaf in the answer, if it is in it.
    pub chosen: Option<usize>,
    /// Scans in a row without being in the answer.
    pub unchosen: u32,
}

impl Tree {
    /// The hypothesis in the answer.
    pub fn answer(&self) -> Option<&Hypothesis> {
        self.chosen.map(|c| &self.leaves[c])
    }
}
