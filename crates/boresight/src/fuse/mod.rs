//! Fusion of tracks and of measurements from several sensors.
//!
//! Rules are free functions on [`boresight_filters::Gaussian`]: [`track_to_track`] (independent errors, known cross covariance),
//! [`covariance_intersection`] (unknown correlation).

pub mod covariance_intersection;
pub mod track_to_track;
