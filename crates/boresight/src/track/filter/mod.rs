//! The filter of a track: form x model x innovation x learning of the noise, and names for whole filters.

pub(crate) mod acceleration_noise;
mod conditioned;
pub(crate) mod config;
pub(crate) mod constant_velocity;
pub(crate) mod form;
pub(crate) mod innovation;
pub(crate) mod learning;
pub(crate) mod model;
pub(crate) mod own_model;
pub(crate) mod presets;
mod tracked_filter;
pub use acceleration_noise::AccelerationNoise;
pub(in crate::track) use acceleration_noise::DEFAULT_DENSITY_PX2_PER_S3;
pub use constant_velocity::ConstantVelocityKf;
pub use own_model::{Ar1Config, AsPrintedConfig, DisplacementConfig, ImmConfig, ImmForm, LmsConfig, LmsRuleConfig};

pub use config::FilterConfig;
pub use form::FormConfig;
pub use innovation::{CorrelatorConfig, HuberConfig, InnovationConfig, StudentTConfig};
pub use learning::LearningConfig;
pub use model::{
    ConstantTurnConfig, ModelConfig, NearlyConstantTurnConfig, OrnsteinUhlenbeckConfig, RandomWalkConfig, SingerConfig,
    WhiteNoiseConfig,
};
pub use presets::{PRESETS, Preset};
pub use tracked_filter::TrackFilter;
pub(super) use tracked_filter::TrackedFilter;
