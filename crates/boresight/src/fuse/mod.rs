//! Fusion of tracks from several sensors.
//!
//! Rules are free functions on [`boresight_filters::Gaussian`]: [`track_to_track`] (independent errors, known cross covariance),
//! [`covariance_intersection`] (unknown correlation). [`fuse_tables`] does whole tables: [`registration`] from common targets,
//! [`pairing`] of tracks, fusion at every time of either sensor, and a check whether the sensors agree.
//! Measurement-level fusion is the filters' own: `Srif::correct_both`, or one correction after the other.

pub mod covariance_intersection;
pub mod pairing;
pub mod registration;
pub mod tables;
pub mod timeline;
pub mod track_to_track;

pub use registration::{Registration, RegistrationConfig};
pub use tables::{FuseConfig, Fused, Rule, fuse_tables};
pub use timeline::{Timeline, timelines};
