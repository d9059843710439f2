//! Parameters of the difference from steadied frames.

use crate::Result;
use crate::validate::wrong;
use crate::vision::background::CleanUp;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// How long ago the frames are that the present one is compared with, and what stands out from them.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct SteadiedConfig {
    /// Standard deviations of the ground's own difference that make a pixel moving, from both earlier frames, 1 to 50. Lower finds fainter and slower targets
    /// and more false ones.
    pub threshold_sd: f32,
    /// Time to the first of the two earlier frames, s, 1e-9 to 1e6; the second is three times as long ago. A target shows once it has moved by about its own
    /// size; longer finds slower ones and more of what parallax moves.
    pub lag_s: f64,
    /// Smallest difference that counts, counts, 0... .
    pub min_difference: f32,
    /// How the moving pixels are cleaned.
    pub clean_up: CleanUp,
}

impl Default for SteadiedConfig {
    fn default() -> Self {
        Self { threshold_sd: 4.0, lag_s: 0.32, min_difference: 0.0, clean_up: CleanUp::Close }
    }
}

impl SteadiedConfig {
    /// Checks the parameters; `at` is the key of this part, for messages.
    /// # Errors
    /// The first parameter out of its range.
    pub fn validate(&self, at: &str) -> Result<()> {
        if !(1.0..=50.0).contains(&self.threshold_sd) {
            let hint = "4 leaves few false targets";
            return Err(wrong(at, "threshold-sd", self.threshold_sd, "a number from 1 to 50", hint));
        }
        if !(1e-9..=1e6).contains(&self.lag_s) {
            let hint = "the time in which a target moves by its own size";
            return Err(wrong(at, "lag-s", self.lag_s, "a time of 1e-9 to 1e6 s", hint));
        }
        if !(self.min_difference >= 0.0 && self.min_difference.is_finite()) {
            let hint = "0 leaves it to the noise";
            return Err(wrong(at, "min-difference", self.min_difference, "0 or more counts", hint));
        }
        Ok(())
    }
}
