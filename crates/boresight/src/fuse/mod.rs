//! Fusion of tracks from several sensors.
//!
//! Rules are free functions on [`boresight_filters::Gaussian`]: [`track_to_track`] (independent errors, known cross covariance),
//! [`covariance_intersection`] (unknown correlation). [`fuse_tables`] does whole tables: [`registration`] from common targets,
//! [`pairing`] of tracks, fusion at every time of either sensor, and a check whether the sensors agree.
//! Measurements: [`measurement`] feeds one target's filter with several sensors' reports (stacked in the square-root information
//! filter, one after the other in the others, late ones where they belong); [`merge`] makes one sequence of scans for a tracker.
//! [`plane`] brings frames of reference together (affine map, homography; given or estimated).

pub mod covariance_intersection;
pub mod measurement;
pub mod merge;
pub mod pairing;
pub mod plane;
pub mod registration;
pub mod tables;
pub mod timeline;
pub mod track_to_track;

pub use measurement::Central;
pub use merge::{SensorScans, merge_scans};
pub use plane::{MapKind, PlaneMap};
pub use registration::{Registration, RegistrationConfig};
pub use tables::{FuseConfig, Fused, Rule, fuse_tables};
pub use timeline::{Timeline, timelines};
