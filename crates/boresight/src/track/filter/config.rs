//! The filter of each track: form, motion model, innovation, learning of the noise.
//!
//! The plain constant-velocity Kalman filter lives in the track itself; all others stand behind
//! [`TrackFilter`](super::TrackFilter). The process noise is the tracker's white acceleration (`acceleration_noise`). Names for whole
//! filters stand in `presets`.

use super::acceleration_noise::AccelerationNoise;
use super::constant_velocity::ConstantVelocityKf;
use super::form::FormConfig;
use super::innovation::InnovationConfig;
use super::learning::LearningConfig;
use super::model::ModelConfig;
use super::tracked_filter::TrackedFilter;
use crate::Result;
use crate::validate::check;
use boresight_filters::{FilterError, Gaussian};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The filter of each track. A name alone (`filter = "ud"`, `boresight config --list filters`) stands for all four.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct FilterConfig {
    /// How the filter keeps its belief.
    pub form: FormConfig,
    /// How targets move.
    pub model: ModelConfig,
    /// How a far measurement is held back.
    pub innovation: InnovationConfig,
    /// Learns the measurement noise or the scale of the process noise from the innovations; left out: both are as given.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub adaptive: Option<LearningConfig>,
}

impl FilterConfig {
    /// Whether its belief is that of a constant-velocity model, as the smoother takes it.
    pub fn is_constant_velocity(&self) -> bool {
        self.form.takes_a_model() && matches!(self.model, ModelConfig::ConstantVelocity(_))
    }

    /// Checks all values; `at` names the place in the configuration.
    /// # Errors
    /// The first value outside its range, and a model, innovation or learning beside a form that has its own.
    pub fn validate(&self, at: &str) -> Result<()> {
        self.form.validate(&format!("{at}.form"))?;
        self.model.validate(&format!("{at}.model"))?;
        self.innovation.validate(&format!("{at}.innovation"))?;
        self.adaptive.as_ref().map_or(Ok(()), |c| c.validate(&format!("{at}.adaptive")))?;
        let bare = Self { form: self.form.clone(), ..Self::default() };
        let mend = "imm, lms, ar1 and displacement bring a model of their own";
        let expected = "neither model, innovation nor adaptive beside this form";
        check(self.form.takes_a_model() || *self == bare, at, "form", "..", expected, mend)
    }

    /// Builds the filter of a new track.
    pub(in crate::track) fn start(
        &self,
        start: &Gaussian<4>,
        noise: AccelerationNoise,
    ) -> Result<TrackedFilter, FilterError> {
        if *self == Self::default() {
            return Ok(TrackedFilter::Cv(ConstantVelocityKf::new(start, noise)));
        }
        let adaptive = self.adaptive.as_ref();
        self.form.start(&self.model, &self.innovation, adaptive, start, noise).map(TrackedFilter::Boxed)
    }
}
