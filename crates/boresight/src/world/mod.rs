//! Where on Earth a track is, from the camera's pose or a map of the ground: latitude and longitude with covariance, or a line of bearing.
//!
//! `config` says what is known of the camera, `flat` goes by a map of a plane, `pinhole` by position and attitude; [`World`] is either of them.

mod config;
mod flat;
mod located;
mod pinhole;
mod project;

pub use config::{PinholeConfig, PlaneConfig, PointsConfig, WorldConfig};
pub use located::{Bearing, Located, Place, Site};
pub use project::World;
