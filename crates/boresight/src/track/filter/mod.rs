//! The filter of a track by name: forms, models, innovations, and the names that the configuration takes.

mod belief;
pub mod config;
pub mod constant_velocity;
mod form;
pub mod innovation;
pub mod model;
pub mod whole;

pub(super) use belief::Belief;
pub use config::{FilterConfig, TrackFilter};
pub use innovation::{FormConfig, InnovationConfig};
pub use model::ModelConfig;
