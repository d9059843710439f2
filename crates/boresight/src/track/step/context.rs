//! What every part of a step reads and none changes: the scan, its table, the configuration.

use super::super::config::TrackerConfig;
use super::super::scan_table::ScanTable;
use crate::{Scan, Timestamp};

/// What every part of a step reads.
#[derive(Clone, Copy)]
pub(in crate::track) struct Context<'a> {
    pub scan: &'a Scan,
    pub table: &'a ScanTable,
    pub config: &'a TrackerConfig,
    /// Gate threshold γ on d² (no unit).
    pub gate: f64,
}

impl Context<'_> {
    /// Time of the scan.
    pub fn now(&self) -> Timestamp {
        self.scan.time
    }

    /// Least score of a detection that may initiate a track or is assigned first: −∞ without the two-stage rule.
    pub fn high_score(&self) -> f32 {
        self.config.two_stage.as_ref().map_or(f32::NEG_INFINITY, |c| c.high_score)
    }
}
