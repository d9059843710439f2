//! Confirmation by the probability ψ that the target exists: integrated probabilistic data association.
//!
//! Source: D. Mušicki, R. Evans, S. Stanković, "Integrated probabilistic data association", IEEE Trans. Automatic Control 39, 1994
//! (Markov chain one); docs/theory/track-management.md.
//! Method: odds = ψ / (1 − ψ) are kept. Prediction ψ ← ψ p with the survival probability p = e^(−Δt / τ); a scan multiplies the odds by Λ.
//! A track is confirmed by the evidence that it ever was a target: the same odds without the survival, which else could not exceed τ / Δt however much is
//! seen. From then on ψ says whether it is still there.
//! Symbols: Λ likelihood ratio of a scan; τ mean time a target stays in view, s.
//! Limits: odds stay within 10^±12.

use super::history::{Decision, History, ODDS};
use crate::Result;
use crate::validate::{check, positive, probability};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Confirmed and deleted by the probability that the target exists.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct ExistenceConfig {
    /// New targets per px² and scan, above 0: a track's first odds are this over the clutter density.
    pub new_target_density_per_px2: f64,
    /// A track is confirmed once it is a target's with at least this probability, in (0, 1), whether or not it may have left since.
    pub confirm_probability: f64,
    /// A track below this is deleted, in (0, 1), below the probability that confirms.
    pub delete_probability: f64,
    /// A confirmed track that falls below this is tentative again until it is back above it, in (0, 1), below the one that
    /// confirms: a target that left is no longer reported, but still known if it comes back.
    pub demotion_probability: f64,
    /// Mean time a target stays in view, s, above 0: existence decays with it while nothing is detected.
    pub mean_target_lifetime_s: f64,
}

impl Default for ExistenceConfig {
    fn default() -> Self {
        Self {
            new_target_density_per_px2: 1e-6,
            confirm_probability: 0.95,
            delete_probability: 0.001,
            demotion_probability: 0.5,
            mean_target_lifetime_s: 30.0,
        }
    }
}

impl ExistenceConfig {
    /// Checks all values; `at` names the place in the configuration.
    /// # Errors
    /// The first value outside its range.
    pub fn validate(&self, at: &str) -> Result<()> {
        let mend = "1e-6 is one new target in three scans of 640 x 512 px";
        positive(at, "new-target-density-per-px2", self.new_target_density_per_px2, mend)?;
        probability(at, "confirm-probability", self.confirm_probability, "0.95 is usual")?;
        probability(at, "delete-probability", self.delete_probability, "0.001 is usual")?;
        probability(at, "demotion-probability", self.demotion_probability, "0.5 is usual")?;
        check(
            self.demotion_probability <= self.confirm_probability,
            at,
            "demotion-probability",
            self.demotion_probability,
            "at most confirm-probability",
            "0.5 and 0.95 are usual",
        )?;
        check(
            self.delete_probability < self.confirm_probability,
            at,
            "delete-probability",
            self.delete_probability,
            "less than confirm-probability",
            "0.01 and 0.95 are usual",
        )?;
        positive(at, "mean-target-lifetime-s", self.mean_target_lifetime_s, "30 s suits most scenes")
    }

    /// Logarithm of the odds that confirm.
    pub(super) fn confirm_log_odds(&self) -> f64 {
        // As good as certain is as far as odds go.
        (self.confirm_probability / (1.0 - self.confirm_probability)).min(ODDS.1).ln()
    }

    /// Probability that a target stays in view for `dt_s`.
    pub(super) fn survival(&self, dt_s: f64) -> f64 {
        (-dt_s / self.mean_target_lifetime_s).exp()
    }

    /// Existence prediction: ψ ← ψ p, in odds.
    #[inline]
    pub(super) fn predict(&self, history: &mut History, survival: f64) {
        history.value *= survival / (1.0 + history.value * (1.0 - survival));
    }

    /// Takes the prediction back: ψ ← ψ / p, in odds.
    pub(super) fn undo_prediction(&self, history: &mut History, survival: f64) {
        let left = (survival - history.value * (1.0 - survival)).max(f64::MIN_POSITIVE);
        history.value = (history.value / left).clamp(ODDS.0, ODDS.1);
    }

    /// Multiplies the odds by Λ of a scan and decides.
    pub(super) fn decide(&self, history: &mut History, likelihood_ratio: f64) -> Decision {
        // ψ ← ψ Λ / (1 − ψ + ψ Λ) is odds ← odds Λ.
        history.value = (history.value * likelihood_ratio).clamp(ODDS.0, ODDS.1);
        history.best = (history.best + likelihood_ratio.max(f64::MIN_POSITIVE).ln()).clamp(ODDS.0.ln(), ODDS.1.ln());
        let psi = probability_of(history.value);
        let known = history.was_accepted || history.best >= self.confirm_log_odds();
        if known && psi >= self.demotion_probability {
            history.accept();
        } else if psi < self.demotion_probability {
            history.accepted = false;
        }
        if psi < self.delete_probability { Decision::Delete } else { Decision::Keep }
    }
}

/// ψ of odds.
#[inline]
pub(super) fn probability_of(odds: f64) -> f64 {
    odds / (1.0 + odds)
}

#[cfg(test)]
mod tests {
    use super::super::history::Evidence;
    use super::super::rule::ConfirmationConfig;
    use super::*;

    fn evidence(likelihood_ratio: f64) -> Evidence {
        Evidence { hit: likelihood_ratio > 1.0, likelihood_ratio }
    }

    #[test]
    fn existence_follows_bayes() {
        let rule = ConfirmationConfig::Existence(ExistenceConfig::default());
        let mut history = rule.begin(1, 0, 4e-6, 1.0);
        assert!((rule.existence(&history) - 0.2).abs() < 1e-12);
        rule.decide(&mut history, evidence(8.0), 0);
        // 0.2 * 8 / (0.8 + 0.2 * 8) = 2/3.
        assert!((rule.existence(&history) - 2.0 / 3.0).abs() < 1e-12);
        rule.predict_existence(&mut history, 0.9);
        assert!((rule.existence(&history) - 0.6).abs() < 1e-12);
        rule.undo_prediction(&mut history, 0.9);
        assert!((rule.existence(&history) - 2.0 / 3.0).abs() < 1e-12);
        rule.predict_existence(&mut history, 0.9);
        assert!((f64::from(rule.score(&history)) - 0.6).abs() < 1e-7);
    }

    #[test]
    fn the_recursion_is_that_of_ipda_in_probabilities() {
        // Mušicki 1994: ψ⁻ = p ψ; δ = 1 − Λ; ψ = (1 − δ) ψ⁻ / (1 − δ ψ⁻), with hits, misses and a long gap.
        let config = ExistenceConfig { mean_target_lifetime_s: 4.0, ..ExistenceConfig::default() };
        let rule = ConfirmationConfig::Existence(config);
        let mut history = rule.begin(1, 0, 2e-6, 1.0);
        let mut psi = 1.0 / 3.0;
        for (dt_s, ratio) in [(0.5, 30.0), (0.5, 0.109), (2.0, 12.0), (0.5, 0.109), (0.5, 0.109), (8.0, 55.0)] {
            let survival = rule.survival(dt_s);
            assert!((survival - (-dt_s / 4.0f64).exp()).abs() < 1e-15);
            rule.predict_existence(&mut history, survival);
            psi *= survival;
            assert!((rule.existence(&history) - psi).abs() < 1e-12);
            rule.decide(&mut history, evidence(ratio), 0);
            let delta = 1.0 - ratio;
            psi = (1.0 - delta) * psi / (1.0 - delta * psi);
            assert!((rule.existence(&history) - psi).abs() < 1e-12, "{psi}");
        }
    }

    #[test]
    fn confirmation_demotion_and_deletion_happen_at_their_probabilities() {
        let rule = ConfirmationConfig::Existence(ExistenceConfig::default());
        // From even odds; the odds of 0.95 are 19, of 0.5 are 1, of 0.001 are 1/999.
        let mut history = rule.begin(1, 0, 1e-6, 1.0);
        let mut to = |ratio: f64| {
            let decision = rule.decide(&mut history, evidence(ratio), 0);
            (history.accepted, decision)
        };
        assert_eq!(to(18.99), (false, Decision::Keep));
        assert_eq!(to(1.001), (true, Decision::Keep));
        assert_eq!(to(1.01 / 19.0), (true, Decision::Keep), "confirmed down to the demotion probability");
        assert_eq!(to(0.98), (false, Decision::Keep));
        assert_eq!(to(1.0 / 980.0), (false, Decision::Keep));
        assert_eq!(to(0.9), (false, Decision::Delete));
    }

    #[test]
    fn no_past_outweighs_a_new_scan_for_ever() {
        let rule = ConfirmationConfig::Existence(ExistenceConfig::default());
        let mut history = rule.begin(1, 0, 1e-6, 1.0);
        (0..50).for_each(|_| _ = rule.decide(&mut history, evidence(1e6), 0));
        // Odds of 1e12 at most: three scans of 1e-5 delete it.
        let decisions = [(); 3].map(|()| rule.decide(&mut history, evidence(1e-5), 0));
        assert_eq!(decisions, [Decision::Keep, Decision::Keep, Decision::Delete]);
    }
}
