//! What the detector of isolated targets is made from.

use crate::Result;
use crate::validate::wrong;
use crate::vision::threshold::Polarity;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Closed blobs that stand clear of their surroundings.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct IsolatedConfig {
    /// Which contrast is looked for.
    pub polarity: Polarity,
    /// Least score kept, above 0: how far a blob stands clear of its surroundings, in units of their noise. 8 is sure, 4 finds dim
    /// targets and more clutter.
    pub min_score: f64,
    /// Number of levels, 4..=256. More find dimmer targets and cost more.
    pub levels: u32,
    /// Longest side of a target's box, px, 1..=4096.
    pub max_side_px: u32,
    /// Largest ratio of the box's sides, 1...
    pub max_elongation: f64,
}

impl Default for IsolatedConfig {
    fn default() -> Self {
        Self { polarity: Polarity::Bright, min_score: 4.0, levels: 40, max_side_px: 64, max_elongation: 6.0 }
    }
}

impl IsolatedConfig {
    /// Checks every parameter; `at` is the path of this table.
    /// # Errors
    /// The first parameter out of its range.
    pub fn validate(&self, at: &str) -> Result<()> {
        if !(self.min_score > 0.0 && self.min_score.is_finite()) {
            return Err(wrong(
                at,
                "min-score",
                self.min_score,
                "a score above 0",
                "4 finds dim targets, 8 only sure ones",
            ));
        }
        if !(4..=256).contains(&self.levels) {
            return Err(wrong(at, "levels", self.levels, "4..=256", "40 suits 8-bit infrared"));
        }
        if !(1..=4096).contains(&self.max_side_px) {
            return Err(wrong(
                at,
                "max-side-px",
                self.max_side_px,
                "1..=4096 px",
                "a little more than the largest target",
            ));
        }
        if !(self.max_elongation >= 1.0 && self.max_elongation.is_finite()) {
            return Err(wrong(
                at,
                "max-elongation",
                self.max_elongation,
                "a ratio of at least 1",
                "6 keeps aircraft seen from the side",
            ));
        }
        Ok(())
    }
}
