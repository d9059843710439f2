//! Probabilistic data association: every gated detection counts with the probability that it is the target's own.
//!
//! Source: `docs/theory/association.md` (thesis eq. 4.34, corrected): p_i = e_i / (b + Σ e), b = λ √det(2πS) (1 − P_D
//! P_G) / P_D, written here with densities: p_i ∝ ψ P_D l_i / λ, p_0 ∝ 1 − ψ P_D P_G, the same quotient. With ψ < 1 it
//! is the weight of IPDA. Tracks do not see each other: two tracks may be corrected by one detection (JPDA mends that).

use super::{Assignment, Associator, Gates};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Probabilistic data association (its clutter density and P_D are the tracker's).
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct PdaConfig {}

/// The PDA associator.
#[derive(Clone, Debug, Default)]
pub struct Pda {
    weights: Vec<f64>,
}

impl Pda {
    /// Builds the associator.
    pub fn new(_config: &PdaConfig) -> Self {
        Self::default()
    }
}

impl Associator for Pda {
    fn needs_likelihood(&self) -> bool {
        true
    }

    fn associate(&mut self, gates: &Gates, out: &mut Assignment) {
        out.reset();
        for i in 0..gates.n_tracks() {
            let row = gates.row(i);
            let miss = gates.log_miss(i);
            self.weights.clear();
            self.weights.extend(row.iter().map(|p| gates.log_weight(i, p)));
            // The largest term is drawn out, so that nothing overflows however sparse the clutter.
            let top = self.weights.iter().copied().fold(miss, f64::max);
            if top.is_finite() {
                let total = (miss - top).exp() + self.weights.iter().map(|w| (w - top).exp()).sum::<f64>();
                for (pair, w) in row.iter().zip(&self.weights) {
                    out.push(pair.detection, (w - top).exp() / total);
                }
            }
            out.end_row();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::associate::{Pair, Prior};

    fn weights(density: f64, p_detection: f64, log_likelihoods: &[f64]) -> Vec<f64> {
        let mut gates = Gates::new();
        gates.reset(log_likelihoods.len(), density);
        for (k, l) in log_likelihoods.iter().enumerate() {
            gates.push(Pair { detection: k as u32, cost: 1.0, log_likelihood: *l });
        }
        gates.end_row(Prior { p_detection, p_gate: 0.5, existence: 1.0, miss_cost: 9.0 });
        let mut answer = Assignment::new();
        Pda::new(&PdaConfig {}).associate(&gates, &mut answer);
        answer.row(0).iter().map(|s| s.weight).collect()
    }

    #[test]
    fn the_weights_are_those_of_the_formula_by_hand() {
        // P_D l / λ = 0.8 · 0.3 / 0.1 = 2.4 and 0.8 · 0.1 / 0.1 = 0.8; a miss 1 − 0.8 · 0.5 = 0.6: of 3.8.
        let w = weights(0.1, 0.8, &[0.3_f64.ln(), 0.1_f64.ln()]);
        assert!((w[0] - 2.4 / 3.8).abs() < 1e-12 && (w[1] - 0.8 / 3.8).abs() < 1e-12, "{w:?}");
    }

    #[test]
    fn weights_far_beyond_the_range_of_a_float_keep_their_ratio() {
        let w = weights(1e-200, 0.8, &[600.0, 600.0 + 3.0_f64.ln()]);
        assert!((w[0] - 0.25).abs() < 1e-12 && (w[1] - 0.75).abs() < 1e-12, "{w:?}");
        assert!(weights(1.0, 0.0, &[f64::NEG_INFINITY]).iter().all(|w| *w == 0.0));
    }
}
