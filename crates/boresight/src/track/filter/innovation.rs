//! What a filter of a track can be given beside its name: innovation, learning of the noise, and its motion model.

use super::model::{ModelConfig, NearlyConstantTurnConfig};
use crate::Result;
use crate::validate::{check, positive};
use boresight_filters::fuzzy::{Correlator, SETS, Triangle};
use boresight_filters::{AdaptiveConfig, Innovation, Memory};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Motion model, innovation and noise of a filter.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct FormConfig {
    /// How targets move.
    pub model: ModelConfig,
    /// How a far measurement is held back.
    pub innovation: InnovationConfig,
    /// Learns the measurement noise or the scale of the process noise from the innovations; left out: both are as given.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub adaptive: Option<LearningConfig>,
}

impl FormConfig {
    pub(in crate::track) fn validate(&self, at: &str) -> Result<()> {
        self.model.validate(&format!("{at}.model"))?;
        self.innovation.validate(&format!("{at}.innovation"))?;
        self.adaptive.as_ref().map_or(Ok(()), |c| c.validate(&format!("{at}.adaptive")))
    }

    /// Whether nothing is asked for that the plain constant-velocity filter has not.
    pub(in crate::track) fn is_plain(&self) -> bool {
        *self == Self::default()
    }
}

/// [`FormConfig`] of a nonlinear filter: its model is the nearly constant turn unless another is named.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct TurningConfig {
    /// How targets move.
    pub model: ModelConfig,
    /// How a far measurement is held back.
    pub innovation: InnovationConfig,
    /// Learns the measurement noise or the scale of the process noise from the innovations; left out: both are as given.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub adaptive: Option<LearningConfig>,
}

impl Default for TurningConfig {
    fn default() -> Self {
        let model = ModelConfig::NearlyConstantTurn(NearlyConstantTurnConfig::default());
        Self { model, innovation: InnovationConfig::default(), adaptive: None }
    }
}

impl TurningConfig {
    pub(in crate::track) fn form(&self) -> FormConfig {
        FormConfig { model: self.model.clone(), innovation: self.innovation.clone(), adaptive: self.adaptive.clone() }
    }
}

/// How a far measurement is held back.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum InnovationConfig {
    /// Every measurement counts as its covariance says: the default.
    Plain {},
    /// Beyond a threshold the pull of a measurement no longer grows (Huber 1981): for outliers that pass the gate.
    Huber(HuberConfig),
    /// The farther, the less weight (Student-t, Roth et al. 2013): for heavy-tailed measurements.
    StudentT(StudentTConfig),
    /// Fuzzy-logic correlator on innovation and its difference (the papers' CTFSRIF); saturates at two deviations.
    Fuzzy(Box<CorrelatorConfig>),
}

impl Default for InnovationConfig {
    fn default() -> Self {
        Self::Plain {}
    }
}

/// Huber innovation.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct HuberConfig {
    /// Innovations up to this many standard deviations are trusted fully, above 0.
    pub threshold: f64,
}

impl Default for HuberConfig {
    fn default() -> Self {
        Self { threshold: 2.0 }
    }
}

/// Student-t innovation.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct StudentTConfig {
    /// Degrees of freedom, above 0; fewer hold far innovations back more.
    pub degrees_of_freedom: f64,
}

impl Default for StudentTConfig {
    fn default() -> Self {
        Self { degrees_of_freedom: 4.0 }
    }
}

/// Scales, memberships and rules of the fuzzy-logic correlator; everything can be replaced.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct CorrelatorConfig {
    /// Innovation, in standard deviations, that fills its input, above 0.
    pub innovation_scale: f64,
    /// Difference of successive innovations, in standard deviations, that fills its input, above 0; smaller makes it
    /// count more.
    pub difference_scale: f64,
    /// Standard deviations of a full output, above 0.
    pub output_scale: f64,
    /// Output of each rule, -1..=1: rows by the set of the innovation (large negative .. large positive), columns by
    /// that of the difference.
    pub rules: [[f64; SETS]; SETS],
    /// Triangles `[left, peak, right]` of the innovation's sets, ascending, that overlap and cover -1..=1.
    pub innovation_sets: [[f64; 3]; SETS],
    /// Triangles of the difference's sets.
    pub difference_sets: [[f64; 3]; SETS],
}

impl Default for CorrelatorConfig {
    fn default() -> Self {
        let c = Correlator::default();
        let sets = |of: [Triangle; SETS]| of.map(|t| [t.left, t.peak, t.right]);
        Self {
            innovation_scale: c.innovation_scale,
            difference_scale: c.difference_scale,
            output_scale: c.output_scale,
            rules: c.rules,
            innovation_sets: sets(c.innovation_sets),
            difference_sets: sets(c.difference_sets),
        }
    }
}

impl CorrelatorConfig {
    pub(in crate::track) fn correlator(&self) -> Correlator {
        let sets = |of: &[[f64; 3]; SETS]| of.map(|[left, peak, right]| Triangle { left, peak, right });
        Correlator {
            innovation_sets: sets(&self.innovation_sets),
            difference_sets: sets(&self.difference_sets),
            rules: self.rules,
            innovation_scale: self.innovation_scale,
            difference_scale: self.difference_scale,
            output_scale: self.output_scale,
        }
    }

    pub(in crate::track) fn validate(&self, at: &str) -> Result<()> {
        positive(at, "innovation-scale", self.innovation_scale, "3 is the papers'")?;
        positive(at, "difference-scale", self.difference_scale, "12 is the papers'")?;
        positive(at, "output-scale", self.output_scale, "3 is the papers'")?;
        let rules_fine = self.rules.iter().flatten().all(|v| v.abs() <= 1.0);
        check(
            rules_fine,
            at,
            "rules",
            format!("{:?}", self.rules),
            "49 numbers in -1..=1",
            "leave it out for the papers'",
        )?;
        let fine = self.correlator().validate().is_ok();
        let mend = "leave them out for seven triangles a third apart";
        check(fine, at, "innovation-sets", "..", "ascending triangles that overlap and cover -1..=1", mend)
    }
}

impl InnovationConfig {
    fn validate(&self, at: &str) -> Result<()> {
        match self {
            Self::Plain {} => Ok(()),
            Self::Huber(c) => c.validate(&format!("{at}.huber")),
            Self::StudentT(c) => c.validate(&format!("{at}.student-t")),
            Self::Fuzzy(c) => c.validate(&format!("{at}.fuzzy")),
        }
    }
}

impl HuberConfig {
    pub(in crate::track) fn validate(&self, at: &str) -> Result<()> {
        positive(at, "threshold", self.threshold, "2 is usual")
    }
    pub(in crate::track) fn innovation(&self) -> Innovation {
        Innovation::Huber { threshold: self.threshold }
    }
}

impl StudentTConfig {
    pub(in crate::track) fn validate(&self, at: &str) -> Result<()> {
        positive(at, "degrees-of-freedom", self.degrees_of_freedom, "4 is usual")
    }
    pub(in crate::track) fn innovation(&self) -> Innovation {
        Innovation::StudentT { degrees_of_freedom: self.degrees_of_freedom }
    }
}

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
    fn validate(&self, at: &str) -> Result<()> {
        let memory = self.memory_updates;
        let fine = memory > 1.0 && memory.is_finite();
        check(fine, at, "memory-updates", memory, "a number above 1", "50 updates are usual")?;
        check((0.0..=1.0).contains(&self.floor), at, "floor", self.floor, "a fraction in 0..=1", "0.1 is usual")
    }

    pub(in crate::track) fn config(&self) -> AdaptiveConfig {
        let memory = if self.windowed { Memory::Windowed } else { Memory::Recursive(self.memory_updates) };
        AdaptiveConfig {
            measurement_noise: self.measurement_noise,
            process_noise: self.process_noise,
            memory,
            floor: self.floor,
            ..AdaptiveConfig::default()
        }
    }
}
