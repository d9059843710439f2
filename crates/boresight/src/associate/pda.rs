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
