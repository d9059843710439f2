//! When a track is believed and when it is given up: the choices and their numbers; what they do is in `life.rs`.

use crate::Result;
use crate::validate::{check, positive, probability};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// When a track is believed and when it is given up.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum LifeConfig {
    /// Confirmed after M detections in N scans.
    MOfN(MOfNConfig),
    /// Confirmed and deleted by the log-likelihood ratio against clutter (sequential probability ratio test).
    Score(ScoreConfig),
    /// Confirmed and deleted by the probability that the target exists (IPDA; with JPDA: JIPDA).
    Existence(ExistenceConfig),
}

impl Default for LifeConfig {
    fn default() -> Self {
        Self::MOfN(MOfNConfig::default())
    }
}

/// Confirmed after M detections in N scans.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct MOfNConfig {
    /// M: detections needed, 1..=`scans`; a two-point start counts as two. More means fewer false tracks, later ones.
    pub hits: u32,
    /// N: scans looked back, `hits`..=64.
    pub scans: u32,
    /// A tentative track is given up after this time without being confirmed, s, above 0.
    pub tentative_s: f64,
}

impl Default for MOfNConfig {
    fn default() -> Self {
        Self { hits: 3, scans: 5, tentative_s: 1e9 }
    }
}

/// Confirmed and deleted by the log-likelihood ratio against clutter.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct ScoreConfig {
    /// Probability α that a start from clutter is confirmed, in (0, 1).
    pub false_confirm_probability: f64,
    /// Probability β that a true tentative track is deleted, in (0, 1).
    pub true_delete_probability: f64,
    /// New targets per px² and scan, above 0: a start's first odds are this over the clutter density.
    pub birth_density_per_px2: f64,
    /// A confirmed track is deleted when its score falls this far below its best, above 0 (natural units).
    pub max_drop: f64,
}

impl Default for ScoreConfig {
    fn default() -> Self {
        Self {
            false_confirm_probability: 1e-3,
            true_delete_probability: 1e-2,
            birth_density_per_px2: 1e-6,
            max_drop: 12.0,
        }
    }
}

/// Confirmed and deleted by the probability that the target exists.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct ExistenceConfig {
    /// New targets per px² and scan, above 0: a start's first odds are this over the clutter density.
    pub birth_density_per_px2: f64,
    /// A track at or above this is confirmed, in (0, 1).
    pub confirm_probability: f64,
    /// A track below this is deleted, in (0, 1), below the probability that confirms.
    pub delete_probability: f64,
    /// A confirmed track that falls below this is tentative again until it recovers, in (0, 1), below the one that
    /// confirms: a target that left is no longer reported, but still known if it comes back.
    pub doubt_probability: f64,
    /// Mean time a target stays in view, s, above 0: existence fades with it while nothing is seen.
    pub mean_life_s: f64,
}

impl Default for ExistenceConfig {
    fn default() -> Self {
        Self {
            birth_density_per_px2: 1e-6,
            confirm_probability: 0.95,
            delete_probability: 0.001,
            doubt_probability: 0.5,
            mean_life_s: 30.0,
        }
    }
}

const BIRTH_HINT: &str = "1e-6 is one new target in three scans of 640 x 512 px";

impl LifeConfig {
    /// Checks all values; `at` names the place in the configuration.
    /// # Errors
    /// The first value outside its range.
    pub fn validate(&self, at: &str) -> Result<()> {
        match self {
            Self::MOfN(c) => {
                let at = format!("{at}.m-of-n");
                check((1..=64).contains(&c.scans), &at, "scans", c.scans, "1..=64 scans", "3 of 5 is usual")?;
                check((1..=c.scans).contains(&c.hits), &at, "hits", c.hits, "1..=scans", "3 of 5 is usual")?;
                positive(&at, "tentative-s", c.tentative_s, "a second is long at video rate")
            }
            Self::Score(c) => {
                let at = format!("{at}.score");
                probability(&at, "false-confirm-probability", c.false_confirm_probability, "0.001 is usual")?;
                probability(&at, "true-delete-probability", c.true_delete_probability, "0.01 is usual")?;
                positive(&at, "birth-density-per-px2", c.birth_density_per_px2, BIRTH_HINT)?;
                positive(&at, "max-drop", c.max_drop, "12 is about five missed scans at P_D 0.9")
            }
            Self::Existence(c) => {
                let at = format!("{at}.existence");
                positive(&at, "birth-density-per-px2", c.birth_density_per_px2, BIRTH_HINT)?;
                probability(&at, "confirm-probability", c.confirm_probability, "0.95 is usual")?;
                probability(&at, "delete-probability", c.delete_probability, "0.01 is usual")?;
                probability(&at, "doubt-probability", c.doubt_probability, "0.5 is usual")?;
                check(
                    c.doubt_probability <= c.confirm_probability,
                    &at,
                    "doubt-probability",
                    c.doubt_probability,
                    "at most confirm-probability",
                    "0.5 and 0.95 are usual",
                )?;
                check(
                    c.delete_probability < c.confirm_probability,
                    &at,
                    "delete-probability",
                    c.delete_probability,
                    "less than confirm-probability",
                    "0.01 and 0.95 are usual",
                )?;
                positive(&at, "mean-life-s", c.mean_life_s, "30 s suits most scenes")
            }
        }
    }
}
