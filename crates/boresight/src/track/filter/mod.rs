//! The filter of a track: form x model x innovation x learning of the noise, and names for whole filters.

mod belief;
mod conditioned;
pub mod config;
pub mod constant_velocity;
pub mod form;
pub mod innovation;
pub mod learning;
pub mod model;
pub mod own_model;
pub mod presets;

pub(super) use belief::Belief;
pub use belief::TrackFilter;
pub use config::FilterConfig;
pub use form::FormConfig;
pub use innovation::InnovationConfig;
pub use learning::LearningConfig;
pub use model::ModelConfig;
pub use presets::{PRESETS, Preset};
