//! Which contrast a threshold looks for: bright targets, dark ones, or both.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Whether targets are brighter or darker than their surroundings.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Side {
    /// Targets are brighter.
    #[default]
    Bright,
    /// Targets are darker.
    Dark,
}

/// Which contrast is looked for.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Polarity {
    /// Targets brighter than the background.
    #[default]
    Bright,
    /// Targets darker than the background.
    Dark,
    /// Either; a cluster is wholly bright or wholly dark.
    Both,
}

impl Polarity {
    /// The other one; of either there is none.
    pub(crate) fn opposite(self) -> Option<Self> {
        match self {
            Self::Bright => Some(Self::Dark),
            Self::Dark => Some(Self::Bright),
            Self::Both => None,
        }
    }

    /// Whether `side` is looked for.
    pub fn has(self, side: Side) -> bool {
        matches!((self, side), (Self::Both, _) | (Self::Bright, Side::Bright) | (Self::Dark, Side::Dark))
    }
}
