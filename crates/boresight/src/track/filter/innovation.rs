//! How a far measurement is held back, by name: the innovation of a track's filter.

use crate::Result;
use crate::validate::{check, positive};
use boresight_filters::InnovationRule;
use boresight_filters::fuzzy::{Correlator, SETS, Triangle};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

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
    pub(super) fn correlator(&self) -> Correlator {
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

    fn validate(&self, at: &str) -> Result<()> {
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
    pub(super) fn validate(&self, at: &str) -> Result<()> {
        match self {
            Self::Plain {} => Ok(()),
            Self::Huber(c) => c.validate(&format!("{at}.huber")),
            Self::StudentT(c) => c.validate(&format!("{at}.student-t")),
            Self::Fuzzy(c) => c.validate(&format!("{at}.fuzzy")),
        }
    }
}

impl HuberConfig {
    fn validate(&self, at: &str) -> Result<()> {
        positive(at, "threshold", self.threshold, "2 is usual")
    }
    pub(super) fn innovation(&self) -> InnovationRule {
        InnovationRule::Huber { threshold: self.threshold }
    }
}

impl StudentTConfig {
    fn validate(&self, at: &str) -> Result<()> {
        positive(at, "degrees-of-freedom", self.degrees_of_freedom, "4 is usual")
    }
    pub(super) fn innovation(&self) -> InnovationRule {
        InnovationRule::StudentT { degrees_of_freedom: self.degrees_of_freedom }
    }
}
