//! Learning of the noise of a track's filter from its innovations.

use crate::Result;
use crate::validate::check;
use boresight_filters::{AdaptiveConfig, Memory};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Learning of the noise from the innovations (covariance matching, Mehra 1972).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct LearningConfig {
    /// Whether the measurement covariance is learnt; the given one is used until enough was seen.
    pub measurement_noise: bool,
    /// Whether a factor on the process noise is learnt. Both explain the same innovations: learn one at a time.
    pub process_noise: bool,
    /// Memory of the estimate, updates, above 1.
    pub memory_updates: f64,
    /// Whether the last 64 updates count all alike, instead of an exponential memory.
    pub windowed: bool,
    /// Least learnt variance as a fraction of the given one, in 0..=1.
    pub floor: f64,
}

impl Default for LearningConfig {
    fn default() -> Self {
        Self { measurement_noise: true, process_noise: false, memory_updates: 50.0, windowed: false, floor: 0.1 }
    }
}

impl LearningConfig {
    pub(super) fn validate(&self, at: &str) -> Result<()> {
        let memory = self.memory_updates;
        let fine = memory > 1.0 && memory.is_finite();
        check(fine, at, "memory-updates", memory, "a number above 1", "50 updates are usual")?;
        check((0.0..=1.0).contains(&self.floor), at, "floor", self.floor, "a fraction in 0..=1", "0.1 is usual")
    }

    pub(super) fn config(&self) -> AdaptiveConfig {
        let memory = if self.windowed { Memory::Windowed } else { Memory::Recursive(self.memory_updates) };
        let mut config = AdaptiveConfig::measurement_noise(memory);
        config.measurement_noise = self.measurement_noise;
        config.process_noise = self.process_noise;
        config.floor = self.floor;
        config
    }
}
