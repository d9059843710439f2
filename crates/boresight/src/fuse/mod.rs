//! Fusion of tracks from several sensors.
//!
//! Rules are free functions on [`boresight_filters::Gaussian`]: `track_to_track` (independent errors, known cross covariance),
//! [`covariance_intersection`] (unknown correlation). [`fuse_tables`] does whole tables: `registration` from common targets,
//! `pairing` of tracks, fusion at every time of either sensor, and a check whether the sensors agree.
//! Measurements: `measurement` feeds one target's filter with several sensors' reports (stacked in the square-root information
//! filter, one after the other in the others, late ones where they belong); `merge` makes one sequence of scans for a tracker.
//! `polar_registration` finds a radar's biases of range and azimuth, from ships' own reports and plots (`reports`) or tracks.
//! `plane` brings frames of reference together (affine map, homography; given or estimated).

pub(crate) mod covariance_intersection;
pub(crate) mod measurement;
pub(crate) mod merge;
pub(crate) mod pairing;
pub(crate) mod plane;
pub(crate) mod polar_registration;
pub(crate) mod registration;
pub(crate) mod reports;
pub(crate) mod tables;
pub(crate) mod timeline;
pub(crate) mod track_to_track;
pub use covariance_intersection::{Intersection, covariance_intersection, inverse_covariance_intersection};
pub use measurement::{Central, Taken, TakesSeveral};
pub use plane::{MapEstimate, common_points};
pub use track_to_track::{fuse_correlated, fuse_independent};

pub use merge::{SensorScans, merge_scans};
pub use plane::{MapKind, PlaneMap};
pub use polar_registration::{PolarConfig, PolarRegistration, register_polar};
pub use registration::{Registration, RegistrationConfig};
pub use reports::{REPORT_STD_M, plots_taken, timeline_of_reports};
pub use tables::{FuseConfig, Fused, Rule, fuse_tables};
pub use timeline::{Timeline, timelines};
