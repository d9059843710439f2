//! Confirmation by the track score: Wald's sequential probability ratio test of target against clutter.
//!
//! Source: A. Wald, *Sequential Analysis*, 1947; S. S. Blackman, R. Popoli, *Design and Analysis of Modern Tracking Systems*, 1999,
//! ch. 6 (track score, deletion by its drop from the best); docs/theory/track-management.md.
//! Method: the score starts at ln(β_new / λ) and adds ln Λ of every scan. A tentative track is confirmed at Wald's upper threshold
//! ln((1 − β) / α) and deleted once the score has fallen by ln((1 − α) / β), his lower threshold, from its best so far, so that a late
//! fall counts as an early one. A confirmed track is deleted when its score has fallen by `max_score_drop`.
//! Symbols: Λ likelihood ratio of a scan; α, β the test's two error probabilities; β_new density of new targets, λ of clutter, 1/px².
//! Limits: scores stay within ±50, so that a long good past does not carry a lost track for as long again.

use super::history::{Decision, History};
use crate::Result;
use crate::validate::{positive, probability};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Largest size of a score, in natural units.
const LARGEST: f64 = 50.0;

/// Confirmed and deleted by the log-likelihood ratio against clutter (the track score).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct SprtConfig {
    /// Probability α that a track of clutter is confirmed, in (0, 1).
    pub false_confirm_probability: f64,
    /// Probability β that a tentative track of a target is deleted, in (0, 1).
    pub true_delete_probability: f64,
    /// New targets per px² and scan, above 0: a track's first odds are this over the clutter density.
    pub new_target_density_per_px2: f64,
    /// A confirmed track is deleted when its score falls this far below its best, above 0 (natural units).
    pub max_score_drop: f64,
}

impl Default for SprtConfig {
    fn default() -> Self {
        Self {
            false_confirm_probability: 1e-3,
            true_delete_probability: 1e-2,
            new_target_density_per_px2: 1e-6,
            max_score_drop: 12.0,
        }
    }
}

impl SprtConfig {
    /// Checks all values; `at` names the place in the configuration.
    /// # Errors
    /// The first value outside its range.
    pub fn validate(&self, at: &str) -> Result<()> {
        probability(at, "false-confirm-probability", self.false_confirm_probability, "0.001 is usual")?;
        probability(at, "true-delete-probability", self.true_delete_probability, "0.01 is usual")?;
        let mend = "1e-6 is one new target in three scans of 640 x 512 px";
        positive(at, "new-target-density-per-px2", self.new_target_density_per_px2, mend)?;
        positive(at, "max-score-drop", self.max_score_drop, "12 is about five missed scans at P_D 0.9")
    }

    /// Wald's upper threshold ln((1 − β) / α).
    pub(super) fn confirm_score(&self) -> f64 {
        ((1.0 - self.true_delete_probability) / self.false_confirm_probability).ln()
    }

    /// The probability that belongs to the score, 0..=1.
    #[inline]
    pub(super) fn score(&self, history: &History) -> f32 {
        (1.0 / (1.0 + (-history.value).exp())) as f32
    }

    /// Adds ln Λ of a scan and decides.
    pub(super) fn decide(&self, history: &mut History, likelihood_ratio: f64) -> Decision {
        history.value = (history.value + likelihood_ratio.ln()).clamp(-LARGEST, LARGEST);
        history.best = history.best.max(history.value);
        if !history.accepted {
            if history.value >= self.confirm_score() {
                history.accept();
                history.best = history.value;
            } else if history.best - history.value
                > -(self.true_delete_probability / (1.0 - self.false_confirm_probability)).ln()
            {
                return Decision::Delete;
            }
        } else if history.best - history.value > self.max_score_drop {
            return Decision::Delete;
        }
        Decision::Keep
    }
}

#[cfg(test)]
mod tests {
    use super::super::history::Evidence;
    use super::super::rule::ConfirmationConfig;
    use super::*;

    /// Runs a rule on ln Λ of the scans: confirmed and decision after each.
    fn run(config: &SprtConfig, ln_ratios: &[f64]) -> Vec<(bool, Decision)> {
        let rule = ConfirmationConfig::Sprt(config.clone());
        let mut history = rule.begin(1, 0, 1e-5, 1.0);
        let mut step = |ln: &f64| {
            let decision = rule.decide(&mut history, Evidence { hit: *ln > 0.0, likelihood_ratio: ln.exp() }, 0);
            (history.accepted, decision)
        };
        ln_ratios.iter().map(&mut step).collect()
    }

    #[test]
    fn the_test_confirms_at_walds_upper_threshold() {
        // ln(0.99 / 0.001) = 6.8977; from ln(1e-6 / 1e-5) = -2.3026 four hits of 3 are needed (9.70; three give 6.70).
        let confirmed: Vec<bool> = run(&SprtConfig::default(), &[3.0; 5]).iter().map(|s| s.0).collect();
        assert_eq!(confirmed, [false, false, false, true, true]);
        // -2.3026 + 9.2003 = 6.8977 and a little: at the threshold, not before.
        assert!(!run(&SprtConfig::default(), &[9.2001])[0].0);
        assert!(run(&SprtConfig::default(), &[9.2005])[0].0);
    }

    #[test]
    fn a_tentative_track_is_deleted_when_it_falls_by_walds_lower_threshold_from_its_best() {
        // ln(0.999 / 0.01) = 4.6042.
        let fall = |by: f64| run(&SprtConfig::default(), &[3.0, -by])[1];
        assert_eq!(fall(4.604), (false, Decision::Keep));
        assert_eq!(fall(4.605), (false, Decision::Delete));
        // Two falls count together, counted from the best, not from the start.
        assert_eq!(run(&SprtConfig::default(), &[3.0, -2.0, -2.7])[2].1, Decision::Delete);
        assert_eq!(run(&SprtConfig::default(), &[-2.0, -2.7])[1].1, Decision::Delete);
    }

    #[test]
    fn a_confirmed_track_is_deleted_by_the_drop_from_its_best() {
        let run = |last: f64| *run(&SprtConfig::default(), &[10.0, 4.0, -8.0, last]).last().unwrap();
        assert_eq!(run(-3.999), (true, Decision::Keep));
        assert_eq!(run(-4.001), (true, Decision::Delete));
    }

    #[test]
    fn a_long_good_past_does_not_outweigh_a_loss() {
        // Thirty hits of 3 reach 90 without the bound; the drop of 12 counts from 50.
        let mut scans = vec![3.0; 30];
        scans.extend([-4.1; 3]);
        let states = run(&SprtConfig::default(), &scans);
        assert_eq!(states[31].1, Decision::Keep);
        assert_eq!(states[32].1, Decision::Delete);
    }

    #[test]
    fn the_first_score_is_the_odds_of_a_new_target_against_clutter() {
        let rule = ConfirmationConfig::Sprt(SprtConfig::default());
        // 1e-6 / 4e-6 · 2 = 1/2: probability 1/3.
        assert!((rule.score(&rule.begin(2, 0, 4e-6, 2.0)) - 1.0 / 3.0).abs() < 1e-6);
        // A second point of large likelihood confirms at once.
        assert!(rule.begin(2, 0, 1e-6, 1000.0).accepted && !rule.begin(2, 0, 1e-6, 900.0).accepted);
    }
}
