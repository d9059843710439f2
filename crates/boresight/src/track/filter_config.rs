//! The filter of each track by name: every filter of `boresight-filters`, started from a belief in position and velocity.
//!
//! The constant-velocity Kalman filter lives in the track itself; all others stand behind [`TrackFilter`]. The process
//! noise is the tracker's `acceleration-std-px-per-s2`.

use super::belief::Belief;
use super::config::positive;
use super::cv;
use crate::Result;
use boresight_filters::model::{ConstantAcceleration, ConstantVelocity, Singer};
use boresight_filters::{
    Ar1, Filter, FilterError, FuzzySrif, Gaussian, Imm, Information, Innovation, Kf, Lms, LmsRule, Measurement, Robust,
    SquareRoot, Srif, Start, Tracked, Ud,
};
use nalgebra::{Matrix2, Vector2};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The filter of each track.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum FilterConfig {
    /// Constant-velocity Kalman filter (Joseph form), kept in place in the tracker: the fastest.
    Kf {},
    /// Bierman-Thornton U-D filter.
    Ud {},
    /// Square-root information filter.
    Srif {},
    /// Square-root information filter with the fuzzy correlator.
    FuzzySrif {},
    /// Information filter.
    Information {},
    /// Square-root covariance filter.
    SquareRoot {},
    /// Kalman filter whose far innovations are held back (Huber).
    Huber(HuberConfig),
    /// Kalman filter whose far innovations are held back (Student-t).
    StudentT(StudentTConfig),
    /// Kalman filter with constant acceleration.
    ConstantAcceleration {},
    /// Kalman filter with Singer acceleration (correlated in time).
    Singer(SingerConfig),
    /// Two Kalman filters, quiet and manoeuvring, joined (interacting multiple model).
    Imm(ImmConfig),
    /// Time-varying Kalman filter with LMS acceleration weights, guarded form, window 2.
    Lms {},
    /// Scalar AR(1) recursion of each axis.
    Ar1(Ar1Config),
}

impl Default for FilterConfig {
    fn default() -> Self {
        Self::Kf {}
    }
}

/// Huber innovation.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct HuberConfig {
    /// Innovations up to this many standard deviations are trusted fully, above 0.
    pub threshold: f64,
}

impl Default for HuberConfig {
    fn default() -> Self {
        Self { threshold: 2.0 }
    }
}

/// Student-t innovation.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct StudentTConfig {
    /// Degrees of freedom, above 0; fewer hold far innovations back more.
    pub degrees_of_freedom: f64,
}

impl Default for StudentTConfig {
    fn default() -> Self {
        Self { degrees_of_freedom: 4.0 }
    }
}

/// Singer acceleration.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct SingerConfig {
    /// How long a manoeuvre lasts, s, above 0.
    pub manoeuvre_s: f64,
}

impl Default for SingerConfig {
    fn default() -> Self {
        Self { manoeuvre_s: 2.0 }
    }
}

/// Interacting multiple model of two constant-velocity filters.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct ImmConfig {
    /// Acceleration of the manoeuvring model over that of the quiet one, above 1.
    pub manoeuvre_factor: f64,
    /// How long a target stays quiet, s, above 0.
    pub quiet_s: f64,
    /// How long a manoeuvre lasts, s, above 0.
    pub manoeuvre_s: f64,
}

impl Default for ImmConfig {
    fn default() -> Self {
        Self { manoeuvre_factor: 10.0, quiet_s: 5.0, manoeuvre_s: 1.0 }
    }
}

/// AR(1) recursion.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct Ar1Config {
    /// Expected time between frames, s, above 0.
    pub frame_s: f64,
}

impl Default for Ar1Config {
    fn default() -> Self {
        Self { frame_s: 0.04 }
    }
}

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

impl FilterConfig {
    /// Every filter with its default parameters, in the order of the documentation.
    pub fn all() -> Vec<Self> {
        vec![
            Self::Kf {},
            Self::Ud {},
            Self::Srif {},
            Self::FuzzySrif {},
            Self::Information {},
            Self::SquareRoot {},
            Self::Huber(HuberConfig::default()),
            Self::StudentT(StudentTConfig::default()),
            Self::ConstantAcceleration {},
            Self::Singer(SingerConfig::default()),
            Self::Imm(ImmConfig::default()),
            Self::Lms {},
            Self::Ar1(Ar1Config::default()),
        ]
    }

    /// Checks all values; `at` names the place in the configuration.
    /// # Errors
    /// The first value outside its range.
    pub fn validate(&self, at: &str) -> Result<()> {
        match self {
            Self::Huber(c) => positive(&format!("{at}.huber"), "threshold", c.threshold, "2 is usual"),
            Self::StudentT(c) => {
                positive(&format!("{at}.student-t"), "degrees-of-freedom", c.degrees_of_freedom, "4 is usual")
            }
            Self::Singer(c) => positive(&format!("{at}.singer"), "manoeuvre-s", c.manoeuvre_s, "2 s is a slow turn"),
            Self::Imm(c) => {
                let at = format!("{at}.imm");
                positive(&at, "manoeuvre-factor", c.manoeuvre_factor, "10 is usual")?;
                positive(&at, "quiet-s", c.quiet_s, "5 s is usual")?;
                positive(&at, "manoeuvre-s", c.manoeuvre_s, "1 s is usual")
            }
            Self::Ar1(c) => positive(&format!("{at}.ar1"), "frame-s", c.frame_s, "the frame time, 0.04 s at 25 Hz"),
            _ => Ok(()),
        }
    }

    /// Builds the filter of a new track.
    pub(super) fn start(&self, start: &Gaussian<4>, acceleration_std: f64) -> Result<Belief, FilterError> {
        let model = ConstantVelocity::discrete(acceleration_std)?;
        let k = start;
        Ok(match self {
            Self::Kf {} => Belief::Cv(cv::ConstantVelocity::new(start, acceleration_std)),
            Self::Ud {} => boxed(Tracked(Ud::<_, 4>::from_kinematics(model, k)?)),
            Self::Srif {} => boxed(Tracked(Srif::<_, 4>::from_kinematics(model, k)?)),
            Self::FuzzySrif {} => boxed(Tracked(FuzzySrif::<_, 4>::from_kinematics(model, k)?)),
            Self::Information {} => boxed(Tracked(Information::<_, 4>::from_kinematics(model, k)?)),
            Self::SquareRoot {} => boxed(Tracked(SquareRoot::<_, 4>::from_kinematics(model, k)?)),
            Self::Huber(c) => {
                let innovation = Innovation::Huber { threshold: c.threshold };
                boxed(Tracked(Robust::new(Kf::<_, 4>::from_kinematics(model, k)?, innovation)?))
            }
            Self::StudentT(c) => {
                let innovation = Innovation::StudentT { degrees_of_freedom: c.degrees_of_freedom };
                boxed(Tracked(Robust::new(Kf::<_, 4>::from_kinematics(model, k)?, innovation)?))
            }
            Self::ConstantAcceleration {} => {
                let model = ConstantAcceleration::discrete(acceleration_std, acceleration_std)?;
                boxed(Tracked(Kf::<_, 6>::from_kinematics(model, k)?))
            }
            Self::Singer(c) => {
                let model = Singer::new(acceleration_std, c.manoeuvre_s)?;
                boxed(Tracked(Kf::<_, 6>::from_kinematics(model, k)?))
            }
            Self::Imm(c) => {
                let fast = ConstantVelocity::discrete(acceleration_std * c.manoeuvre_factor)?;
                let filters = [Kf::<_, 4>::from_kinematics(model, k)?, Kf::<_, 4>::from_kinematics(fast, k)?];
                boxed(Tracked(Imm::new(filters, [c.quiet_s, c.manoeuvre_s])?))
            }
            Self::Lms {} => boxed(Lms::<5>::from_kinematics(k, acceleration_std, LmsRule::default())?),
            Self::Ar1(c) => {
                let cov = Matrix2::new(k.cov[(0, 0)], k.cov[(0, 2)], k.cov[(2, 0)], k.cov[(2, 2)]);
                let position = Vector2::new(k.mean[0], k.mean[2]);
                boxed(Ar1::new(&Measurement { position, cov }, c.frame_s)?)
            }
        })
    }
}

fn boxed(filter: impl TrackFilter + 'static) -> Belief {
    Belief::Boxed(Box::new(filter))
}
