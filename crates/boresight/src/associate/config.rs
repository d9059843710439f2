//! The associators by name.

use super::associator::Associator;
use super::{global_nearest, jpda, nearest, pda};
use crate::Result;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// How detections are shared out among tracks.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum AssociatorConfig {
    /// Each track takes its nearest gated detection (Mahalanobis distance); nearer tracks choose first.
    Nearest(nearest::NearestConfig),
    /// The pairing with the least total cost (global nearest neighbour), exact.
    GlobalNearest(global_nearest::GlobalNearestConfig),
    /// Probabilistic data association: each track is corrected by all its gated detections, weighted.
    Pda(pda::PdaConfig),
    /// Joint probabilistic data association: as PDA, but no detection counts for two tracks at once.
    Jpda(jpda::JpdaConfig),
}

impl Default for AssociatorConfig {
    fn default() -> Self {
        Self::GlobalNearest(global_nearest::GlobalNearestConfig::default())
    }
}

impl AssociatorConfig {
    /// Checks all values; `at` names the place in the configuration.
    /// # Errors
    /// The first value outside its range.
    pub fn validate(&self, at: &str) -> Result<()> {
        match self {
            Self::Jpda(c) => c.validate(at),
            Self::Nearest(_) | Self::GlobalNearest(_) | Self::Pda(_) => Ok(()),
        }
    }

    /// Builds the associator.
    pub fn build(&self) -> Box<dyn Associator> {
        match self {
            Self::Nearest(c) => Box::new(nearest::Nearest::new(c)),
            Self::GlobalNearest(c) => Box::new(global_nearest::GlobalNearest::new(c)),
            Self::Pda(c) => Box::new(pda::Pda::new(c)),
            Self::Jpda(c) => Box::new(jpda::Jpda::new(c)),
        }
    }

    /// Whether a detection may correct more than one track, or a track take more than one detection.
    pub fn is_soft(&self) -> bool {
        matches!(self, Self::Pda(_) | Self::Jpda(_))
    }
}
