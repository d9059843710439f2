//! Score likelihood: what a detection's score says of whose it is, beside its position.
//!
//! Source: the amplitude feature of D. Lerro, Y. Bar-Shalom, "Interacting multiple model tracking with target amplitude feature", IEEE Trans. AES 29, 1993, with
//! densities that are measured: a target's score wanders little from one scan to the next, false detections crowd at the least score that the detector passes.
//! Method: with u = ln(s / s₀), false detections have the density f₀(u) = (1 − η) α e^(−α u) + η / L (scores of a power law, and a share anywhere in the
//! range L of all scores: of n false detections nothing is known of what is rarer than one in n). A target of the level ℓ has
//! f₁(u) = (1 − ε) N(ln s; ℓ, σ²) + ε f₀(u): with the probability ε the score says nothing, so one odd score weighs no more than that; ε is larger after a miss. A target not
//! known before has any level of the range. The densities multiply those of the position, as another coordinate of the measurement would.
//! Departures: the level is an exponential mean with the tracker's gain, and σ is measured about that mean, so no filter of its own is needed.
//! Symbols: s score (no unit); ℓ level, ln of the usual score.
//! Limits: scores above 0, the larger the surer; one law of false scores for the whole field.

use crate::validate::{positive, probability};
use crate::{Detection, Result};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Scores of false detections and of targets.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct ScoreLikelihoodConfig {
    /// Least score of a detection, above 0.
    pub least_score: f64,
    /// A false detection scores more than s with the probability (least score / s)^this, above 0.
    pub clutter_exponent: f64,
    /// Share of false detections with any score whatever, in (0, 1).
    pub clutter_outlier_share: f64,
    /// Standard deviation of the logarithm of a target's score about its mean so far, above 0.
    pub target_log_std: f64,
    /// Share of a target's scores that are unlike its others, in (0, 1): it is half hidden, or merged with another.
    pub target_outlier_share: f64,
    /// The same for the first detection after scans without one, in (0, 1): what hid it may hide a part of it still.
    pub target_outlier_share_after_miss: f64,
    /// Logarithm of the largest score over the least one, above 0: a new target's score lies anywhere between.
    pub log_range: f64,
}

impl Default for ScoreLikelihoodConfig {
    fn default() -> Self {
        Self {
            least_score: 2.5,
            clutter_exponent: 3.0,
            clutter_outlier_share: 0.01,
            target_log_std: 0.15,
            target_outlier_share: 0.05,
            target_outlier_share_after_miss: 0.3,
            log_range: 3.0,
        }
    }
}

impl ScoreLikelihoodConfig {
    /// Checks all values; `at` names the place in the configuration.
    /// # Errors
    /// The first value outside its range.
    pub fn validate(&self, at: &str) -> Result<()> {
        positive(at, "least-score", self.least_score, "the detector's least score")?;
        positive(
            at,
            "clutter-exponent",
            self.clutter_exponent,
            "3: one false detection in eight scores twice the least",
        )?;
        positive(at, "target-log-std", self.target_log_std, "0.15 suits steady targets")?;
        probability(at, "clutter-outlier-share", self.clutter_outlier_share, "0.01 where a hundred were seen")?;
        probability(at, "target-outlier-share", self.target_outlier_share, "0.05 is usual")?;
        let after_miss = self.target_outlier_share_after_miss;
        probability(at, "target-outlier-share-after-miss", after_miss, "0.3 is usual")?;
        positive(at, "log-range", self.log_range, "3 is a factor of twenty")
    }

    /// f₀: density of a false detection's ln s there.
    #[inline]
    pub(super) fn clutter_density(&self, log_score: f64) -> f64 {
        let above = (log_score - self.least_score.ln()).max(0.0);
        let usual = self.clutter_exponent * (-self.clutter_exponent * above).exp();
        (1.0 - self.clutter_outlier_share) * usual + self.clutter_outlier_share / self.log_range
    }

    /// f₁: density of the ln s of a target with that level, that was seen in the scan before or `missed`; of one whose level is not known yet, any of the range.
    #[inline]
    pub(super) fn target_density(&self, level: Option<f64>, missed: bool, score: LogScore) -> f64 {
        let Some(level) = level else { return 1.0 / self.log_range };
        let z = (score.ln - level) / self.target_log_std;
        let usual = (-0.5 * z * z).exp() / (self.target_log_std * std::f64::consts::TAU.sqrt());
        let odd = if missed { self.target_outlier_share_after_miss } else { self.target_outlier_share };
        (1.0 - odd) * usual + odd * score.clutter
    }

    /// Likelihood ratio of the score of a target with that level, or a new one's, seen in the scan before, against a false detection.
    #[inline]
    pub(super) fn ratio(&self, level: Option<f64>, score: LogScore) -> f64 {
        self.target_density(level, false, score) / score.clutter
    }
}

/// A detection's ln s and f₀ there.
#[derive(Clone, Copy, Debug)]
pub(super) struct LogScore {
    pub ln: f64,
    pub clutter: f64,
}

/// The scores of a scan's detections, their logarithms and clutter densities taken once; empty where scores say nothing.
#[derive(Clone, Debug, Default)]
pub(super) struct ScanScores(Vec<LogScore>);

impl ScanScores {
    /// Reads a scan.
    pub fn read(&mut self, config: Option<&ScoreLikelihoodConfig>, detections: &[Detection]) {
        self.0.clear();
        if let Some(c) = config {
            self.0.extend(detections.iter().map(|d| {
                // One without a score is far below all others.
                let ln = f64::from(d.score.max(f32::MIN_POSITIVE)).ln();
                LogScore { ln, clutter: c.clutter_density(ln) }
            }));
        }
    }

    /// ln s and f₀ of a detection.
    #[inline]
    pub fn of(&self, detection: u32) -> Option<LogScore> {
        self.0.get(detection as usize).copied()
    }

    /// ln s of a detection.
    #[inline]
    pub fn log_score(&self, detection: u32) -> Option<f64> {
        self.of(detection).map(|s| s.ln)
    }

    /// f₀ of a detection, 1 where scores say nothing.
    #[inline]
    pub fn clutter(&self, detection: u32) -> f64 {
        self.of(detection).map_or(1.0, |s| s.clutter)
    }

    /// Whether scores say nothing.
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::associate::{AssociatorConfig, CostKind, GlobalNearestConfig};
    use crate::track::{InitialTrackConfig, TrackerConfig, build};
    use crate::{FrameIndex, Scan, Timestamp};
    use nalgebra::{Matrix2, Vector2};

    fn at(c: &ScoreLikelihoodConfig, ln: f64) -> LogScore {
        LogScore { ln, clutter: c.clutter_density(ln) }
    }

    #[test]
    fn densities_integrate_to_one_over_all_scores() {
        let c = ScoreLikelihoodConfig::default();
        let from = c.least_score.ln();
        // The share of any score whatever ends at the range; a level well inside it loses nothing at the ends.
        let (step, n) = (1e-3, (c.log_range / 1e-3) as usize);
        let sum = |f: &dyn Fn(f64) -> f64| (0..n).map(|k| f(from + (k as f64 + 0.5) * step) * step).sum::<f64>();
        let tail = (1.0 - c.clutter_outlier_share) * (-c.clutter_exponent * c.log_range).exp();
        assert!((sum(&|u| c.clutter_density(u)) + tail - 1.0).abs() < 1e-3);
        let level = from + 1.5;
        for missed in [false, true] {
            let odd = if missed { c.target_outlier_share_after_miss } else { c.target_outlier_share };
            assert!((sum(&|u| c.target_density(Some(level), missed, at(&c, u))) + odd * tail - 1.0).abs() < 1e-3);
        }
        assert!((sum(&|u| c.ratio(None, at(&c, u)) * c.clutter_density(u)) - 1.0).abs() < 1e-3);
    }

    #[test]
    fn one_odd_score_weighs_no_more_than_its_share() {
        let c = ScoreLikelihoodConfig::default();
        let level = Some(20f64.ln());
        assert!((c.ratio(level, at(&c, 2.6f64.ln())) / c.target_outlier_share - 1.0).abs() < 1e-6);
        assert!(c.ratio(level, at(&c, 20f64.ln())) > 100.0, "its usual score, that false detections hardly ever have");
    }

    /// Where a target at (50, 50) that was seen with a score of 20 is after a miss, and a false detection of score 2.6 not far from it.
    fn after_a_weak_one(scores: Option<ScoreLikelihoodConfig>) -> f64 {
        let initial = InitialTrackConfig { position_px: [50.0; 2], ..InitialTrackConfig::default() };
        let config = TrackerConfig {
            initial_tracks: vec![initial],
            associator: AssociatorConfig::GlobalNearest(GlobalNearestConfig { cost: CostKind::Likelihood }),
            clutter_density_per_px2: 0.1,
            detection_probability: 0.9,
            score_likelihood: scores,
            ..TrackerConfig::default()
        };
        let mut tracker = build(&config).unwrap();
        let mut x = 0.0;
        for k in 0..12u64 {
            let at =
                |x: f64, score: f32| Detection::at(Vector2::new(x, 50.0), Matrix2::identity() * 0.1).with_score(score);
            let seen = match k {
                0..=9 => vec![at(50.0, 20.0)],
                10 => vec![],
                _ => vec![at(51.0, 2.6)],
            };
            let scan = Scan::at(FrameIndex(k), Timestamp::from_secs_f64(0.04 * k as f64)).with_detections(seen);
            x = tracker.step(&scan).unwrap()[0].kinematics.mean[0];
        }
        x
    }

    #[test]
    fn a_track_is_not_drawn_away_by_a_false_detection_whose_score_is_not_its_own() {
        let law = ScoreLikelihoodConfig { target_outlier_share_after_miss: 0.01, ..ScoreLikelihoodConfig::default() };
        assert!(after_a_weak_one(None) > 50.15);
        assert!((after_a_weak_one(Some(law)) - 50.0).abs() < 0.1);
    }
}
