//! What every part of a step reads and none changes: the scan, its table, the configuration.

use super::super::config::TrackerConfig;
use super::super::scan_table::{Cov2, Predicted, ScanTable};
use super::super::score_likelihood::LogScore;
use super::super::single_track::Track;
use crate::{Scan, Timestamp};
use nalgebra::Vector2;

/// What every part of a step reads.
#[derive(Clone, Copy)]
pub(in crate::track) struct Context<'a> {
    pub scan: &'a Scan,
    pub table: &'a ScanTable,
    pub config: &'a TrackerConfig,
    /// Gate threshold γ on d² (no unit).
    pub gate: f64,
    /// Time since the scan before, s.
    pub dt_s: f64,
}

impl Context<'_> {
    /// Time of the scan.
    pub fn now(&self) -> Timestamp {
        self.scan.time
    }

    /// How long before the scan's time detection `j` was seen, ns.
    #[inline]
    pub fn age_ns(&self, j: u32) -> u64 {
        if self.table.is_timed() { self.scan.detections[j as usize].age_ns } else { 0 }
    }

    /// Where detection `j` counts for a track predicted there (px), and with which noise.
    #[inline]
    pub fn measured(&self, j: u32, at: &Predicted) -> (Vector2<f64>, Cov2) {
        self.table.measured(j, self.scan.detections[j as usize].position, at)
    }

    /// −2 ln of the density of detection `j`'s score for a track; 0 where scores say nothing.
    #[inline]
    pub fn score_cost(&self, track: &Track, j: u32) -> f64 {
        match (&self.config.score_likelihood, self.table.scores.of(j)) {
            (Some(c), Some(score)) => -2.0 * c.target_density(track.log_score, track.history.misses > 0, score).ln(),
            _ => 0.0,
        }
    }

    /// Likelihood ratio of detection `j`'s score for a target not known before the detection with the score `first`, if there is one; 1 where scores say
    /// nothing.
    pub fn new_target_score_ratio(&self, first: Option<LogScore>, j: u32) -> f64 {
        match (&self.config.score_likelihood, self.table.scores.of(j)) {
            (Some(c), Some(score)) => {
                first.map_or(1.0, |first| c.ratio(None, first)) * c.ratio(first.map(|f| f.ln), score)
            }
            _ => 1.0,
        }
    }

    /// Least score of a detection that may initiate a track or is assigned first: −∞ without the two-stage rule.
    pub fn high_score(&self) -> f32 {
        self.config.two_stage.as_ref().map_or(f32::NEG_INFINITY, |c| c.high_score)
    }
}
