//! The confirmation rule of a configuration: one choice among M of N, the sequential test and existence, with one interface.
//!
//! Source: docs/theory/track-management.md and the files of the three rules.
//! Limits: a confirmed track without detections also ends when its coasting budget is over (`step::delete`).

use super::existence::{ExistenceConfig, probability_of};
use super::history::{Decision, Evidence, History, ODDS};
use super::m_of_n::MOfNConfig;
use super::sprt::SprtConfig;
use crate::Result;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// When a track is confirmed and when it is deleted.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum ConfirmationConfig {
    /// Confirmed after M detections in N scans.
    MOfN(MOfNConfig),
    /// Confirmed and deleted by the log-likelihood ratio against clutter (track score; Wald's sequential probability ratio test).
    Sprt(SprtConfig),
    /// Confirmed and deleted by the probability that the target exists (IPDA; with JPDA: JIPDA).
    Existence(ExistenceConfig),
}

impl Default for ConfirmationConfig {
    fn default() -> Self {
        Self::MOfN(MOfNConfig::default())
    }
}

impl ConfirmationConfig {
    /// Checks all values; `at` names the place in the configuration.
    /// # Errors
    /// The first value outside its range.
    pub fn validate(&self, at: &str) -> Result<()> {
        match self {
            Self::MOfN(c) => c.validate(&format!("{at}.m-of-n")),
            Self::Sprt(c) => c.validate(&format!("{at}.sprt")),
            Self::Existence(c) => c.validate(&format!("{at}.existence")),
        }
    }

    /// History of a track initiated from `n_points` detections (1 or 2).
    ///
    /// `clutter_density` is in 1/px²; `likelihood_ratio` is P_D l / λ of the second point given the first (1 for one point).
    pub(crate) fn begin(&self, n_points: u32, now_ns: i64, clutter_density: f64, likelihood_ratio: f64) -> History {
        let first = |new_target_density: f64| {
            (new_target_density / clutter_density.max(1e-300) * likelihood_ratio).clamp(ODDS.0, ODDS.1)
        };
        let value = match self {
            Self::MOfN(_) => 0.0,
            Self::Sprt(c) => first(c.new_target_density_per_px2).ln(),
            Self::Existence(c) => first(c.new_target_density_per_px2),
        };
        let accepted = match self {
            Self::MOfN(c) => c.hits <= n_points,
            Self::Sprt(c) => value >= c.confirm_score(),
            Self::Existence(c) => value.ln() >= c.confirm_log_odds(),
        };
        History {
            hits: (1 << n_points) - 1,
            alone: (1 << n_points) - 1,
            scans: n_points as u8,
            accepted,
            was_accepted: accepted,
            misses: 0,
            value,
            best: if let Self::Existence(_) = self { value.ln() } else { value },
            last_seen_ns: now_ns,
            initiated_ns: now_ns,
            alone_s: 0.0,
        }
    }

    /// Probability that a target stays in view for `dt_s`; 1 where the rule knows none.
    pub(crate) fn survival(&self, dt_s: f64) -> f64 {
        match self {
            Self::Existence(c) => c.survival(dt_s),
            _ => 1.0,
        }
    }

    /// New targets per px² and scan; none where the rule knows none.
    pub(crate) fn new_target_density_per_px2(&self) -> Option<f64> {
        match self {
            Self::Sprt(c) => Some(c.new_target_density_per_px2),
            Self::Existence(c) => Some(c.new_target_density_per_px2),
            _ => None,
        }
    }

    /// Predicts existence to the scan; `survival` is the probability to have stayed in view since the last.
    #[inline]
    pub(crate) fn predict_existence(&self, history: &mut History, survival: f64) {
        if let Self::Existence(c) = self {
            c.predict(history, survival);
        }
    }

    /// Takes that prediction back.
    #[inline]
    pub(crate) fn undo_prediction(&self, history: &mut History, survival: f64) {
        if let Self::Existence(c) = self {
            c.undo_prediction(history, survival);
        }
    }

    /// Existence probability that weighs in the association: ψ, or 1 where the rule has none.
    #[inline]
    pub(crate) fn existence(&self, history: &History) -> f64 {
        match self {
            Self::Existence(_) => probability_of(history.value),
            _ => 1.0,
        }
    }

    /// Score of a track, 0..=1: share of hits, or probability.
    #[inline]
    pub(crate) fn score(&self, history: &History) -> f32 {
        match self {
            Self::MOfN(c) => c.score(history),
            Self::Sprt(c) => c.score(history),
            Self::Existence(_) => probability_of(history.value) as f32,
        }
    }

    /// Takes the evidence of a scan in and decides; the coasting budget is the tracker's.
    #[inline]
    pub(crate) fn decide(&self, history: &mut History, evidence: Evidence, now_ns: i64) -> Decision {
        history.record(evidence, now_ns);
        match self {
            Self::MOfN(c) => c.decide(history, now_ns),
            Self::Sprt(c) => c.decide(history, evidence.likelihood_ratio.clamp(ODDS.0, ODDS.1)),
            Self::Existence(c) => c.decide(history, evidence.likelihood_ratio),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_detection_ends_the_misses_and_is_the_last_seen() {
        let rule = ConfirmationConfig::default();
        let mut history = rule.begin(1, 0, 1e-5, 1.0);
        rule.decide(&mut history, Evidence { hit: false, likelihood_ratio: 1.0 }, 5);
        assert_eq!((history.misses, history.last_seen_ns), (1, 0));
        rule.decide(&mut history, Evidence { hit: true, likelihood_ratio: 1.0 }, 9);
        assert_eq!((history.misses, history.last_seen_ns), (0, 9));
    }
}
