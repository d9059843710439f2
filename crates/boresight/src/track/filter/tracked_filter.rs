//! The filter of one track as the tracker stores it: in place for the constant-velocity Kalman filter, boxed for the rest.

use super::constant_velocity::ConstantVelocityKf;
use boresight_filters::{Filter, FilterError, Gaussian, Weighted};

/// A filter that can be copied behind its trait: what the tracker holds when the filter is not kept in place.
pub trait TrackFilter: Filter + Send + Sync {
    /// Copies the filter.
    fn boxed_clone(&self) -> Box<dyn TrackFilter>;
}

impl<F: Filter + Clone + Send + Sync + 'static> TrackFilter for F {
    fn boxed_clone(&self) -> Box<dyn TrackFilter> {
        Box::new(self.clone())
    }
}

/// A filter in place, or behind its trait.
pub enum TrackedFilter {
    /// Constant velocity, 15 numbers in the track itself: no pointer to follow at a hundred thousand tracks.
    Cv(ConstantVelocityKf),
    /// Any other filter.
    Boxed(Box<dyn TrackFilter>),
}

impl Clone for TrackedFilter {
    fn clone(&self) -> Self {
        match self {
            Self::Cv(f) => Self::Cv(*f),
            Self::Boxed(f) => Self::Boxed((**f).boxed_clone()),
        }
    }
}

impl TrackedFilter {
    /// Multiplies the density of the acceleration that drives a filter in place; another keeps its own until its track ends.
    pub(in crate::track) fn scale_density(&mut self, factor: f64) {
        if let Self::Cv(f) = self {
            f.scale_density(factor);
        }
    }
}

impl Filter for TrackedFilter {
    #[inline]
    fn predict(&mut self, dt_s: f64) -> Result<(), FilterError> {
        match self {
            Self::Cv(f) => f.predict(dt_s),
            // A filter that has diverged (LMS as printed) refuses the step and stays as it is: its own track is lost and
            // ends by its life's rule, the others go on.
            Self::Boxed(f) => {
                f.predict(dt_s).or_else(|e| if dt_s >= 0.0 && dt_s.is_finite() { Ok(()) } else { Err(e) })
            }
        }
    }

    #[inline]
    fn predicted(&self) -> Gaussian<2> {
        match self {
            Self::Cv(f) => f.predicted(),
            Self::Boxed(f) => f.predicted(),
        }
    }

    #[inline]
    fn update(&mut self, hypotheses: &[Weighted]) -> Result<(), FilterError> {
        match self {
            Self::Cv(f) => f.update(hypotheses),
            Self::Boxed(f) => f.update(hypotheses),
        }
    }

    #[inline]
    fn kinematics(&self) -> Gaussian<4> {
        match self {
            Self::Cv(f) => f.kinematics(),
            Self::Boxed(f) => f.kinematics(),
        }
    }
}
