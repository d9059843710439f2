//! The parameters of multiple-hypothesis tracking.

use crate::Result;
use crate::validate::{check, positive};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Multiple-hypothesis tracking.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct MhtConfig {
    /// Scans after which a decision is final, 1..=7. More resolves longer ambiguities and costs more.
    pub n_scan: u32,
    /// Most histories kept of one target, the best, 1..=1000.
    pub max_leaves: u32,
    /// Most histories in all, the best of each target first, 1 or more.
    pub max_hypotheses: u32,
    /// A history whose score lies this far below its target's best is cut, above 0 (natural units).
    pub max_score_gap: f64,
    /// New targets per px² and scan, above 0.
    pub new_target_density_per_px2: f64,
    /// Steps spent on selecting among targets that compete, 1 or more; beyond them the best found so far is taken.
    pub max_steps: u32,
}

impl Default for MhtConfig {
    fn default() -> Self {
        Self {
            n_scan: 3,
            max_leaves: 12,
            max_hypotheses: 20_000,
            max_score_gap: 12.0,
            new_target_density_per_px2: 1e-6,
            max_steps: 2000,
        }
    }
}

impl MhtConfig {
    /// Checks all values; `at` names the place in the configuration.
    /// # Errors
    /// The first value outside its range.
    pub fn validate(&self, at: &str) -> Result<()> {
        check((1..=7).contains(&self.n_scan), at, "n-scan", self.n_scan, "1..=7 scans", "3 is usual")?;
        check((1..=1000).contains(&self.max_leaves), at, "max-leaves", self.max_leaves, "1..=1000", "12 is usual")?;
        let some = "a whole number of 1 or more";
        check(self.max_hypotheses >= 1, at, "max-hypotheses", self.max_hypotheses, some, "20000 is usual")?;
        check(self.max_steps >= 1, at, "max-steps", self.max_steps, some, "2000 is usual")?;
        positive(at, "max-score-gap", self.max_score_gap, "12: one in 160 000")?;
        positive(
            at,
            "new-target-density-per-px2",
            self.new_target_density_per_px2,
            "1e-6 is one new target in three scans of 640 x 512 px",
        )
    }
}
