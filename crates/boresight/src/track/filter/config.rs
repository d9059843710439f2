//! The filter of each track by name: every filter of `boresight-filters`, started from a belief in position and velocity.
//!
//! The plain constant-velocity Kalman filter lives in the track itself; all others stand behind [`TrackFilter`]. The
//! process noise is the tracker's `acceleration-std-px-per-s2`. The text of a variant is what
//! `boresight config --list filters` prints: what it is, when to take it, its source.

use super::belief::Belief;
use super::constant_velocity;
use super::form::{self, Form};
use super::innovation::{CorrelatorConfig, FormConfig, HuberConfig, InnovationConfig, StudentTConfig, TurningConfig};
use super::model::{ModelConfig, SingerConfig, WhiteNoiseConfig};
use super::whole::{Ar1Config, DisplacementConfig, ImmConfig, LmsConfig};
use crate::Result;
use boresight_filters::{Filter, FilterError, Gaussian};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The filter of each track.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum FilterConfig {
    /// Kalman filter in covariance form, Joseph update (Kalman 1960): the default. Exact for linear models in
    /// f64 and the fastest: without options it is kept in place in the track.
    Kf(FormConfig),
    /// Kalman filter with the short update P - K H P: to compare with. Saves little and loses digits first.
    KfShort(FormConfig),
    /// U-D factors P = U D Uᵀ (Bierman 1977, Thornton 1976): the covariance cannot lose its sign. For tiny
    /// measurement noise beside a large first uncertainty, and as the papers' CTUDF.
    Ud(FormConfig),
    /// Square-root information filter by Householder reflections (Bierman 1977): best conditioned, works without
    /// process noise; as the papers' CTSRIF.
    Srif(FormConfig),
    /// Square-root information filter with the fuzzy-logic correlator (CTFSRIF; Parimala, Raol): the papers' filter for
    /// heavy-tailed centroids; its memberships and rules can be replaced.
    FuzzySrif(FuzzySrifConfig),
    /// Information filter P⁻¹, P⁻¹x (Maybeck 1979): measurements add up cheaply; for many sensors, few readings.
    Information(FormConfig),
    /// Square-root covariance filter (Potter 1963, in Bierman 1977): as robust as U-D, two roots more a step.
    SquareRoot(FormConfig),
    /// Extended Kalman filter (Jazwinski 1970): a nonlinear model, by default the nearly constant turn, by its
    /// Jacobian. For targets that turn for seconds at moderate rates.
    Ekf(TurningConfig),
    /// Unscented Kalman filter (Julier, Uhlmann 2004): the same by sigma points instead of Jacobians. For turns that are
    /// fast or seldom seen.
    Ukf(TurningConfig),
    /// Kalman filter with a Huber innovation (Huber 1981): an outlier's pull is bounded. Short for `kf` with that
    /// innovation.
    Huber(HuberConfig),
    /// Kalman filter with a Student-t innovation (Roth et al. 2013): the farther a measurement, the less it counts. Short
    /// for `kf` with that innovation.
    StudentT(StudentTConfig),
    /// Kalman filter with constant acceleration (Bar-Shalom et al. 2001): for long, steady manoeuvres. Short for `kf`
    /// with that model.
    ConstantAcceleration(WhiteNoiseConfig),
    /// Kalman filter with an acceleration that fades (Singer 1970): for pilots' manoeuvres. Short for `kf` with that
    /// model.
    Singer(SingerConfig),
    /// Interacting multiple models (Blom, Bar-Shalom 1988): a quiet and a manoeuvring filter of any form side by side,
    /// weighed by likelihood. For straight flight with bouts of manoeuvre.
    Imm(ImmConfig),
    /// Time-varying Kalman filter with learnt acceleration weights (Obolensky, Erdogmus, Principe 2002): guarded by
    /// default; as printed on request, which diverges (a track whose filter does keeps its last state until it ends).
    Lms(LmsConfig),
    /// Scalar AR(1) recursion of each coordinate (Cai, Cui 2014): the paper's baseline. Lags a steady motion and
    /// depends on the origin: to compare with.
    Ar1(Ar1Config),
    /// Coordinate now and one frame before, [2 -1; 1 0] (Cai, Cui 2014): straight-line extrapolation with two states
    /// an axis, without the faults of `ar1`.
    Displacement(DisplacementConfig),
}

impl Default for FilterConfig {
    fn default() -> Self {
        Self::Kf(FormConfig::default())
    }
}

/// Square-root information filter with the fuzzy correlator.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct FuzzySrifConfig {
    /// How targets move.
    pub model: ModelConfig,
    /// Scales, memberships and rules.
    pub correlator: Box<CorrelatorConfig>,
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
            Self::Kf(FormConfig::default()),
            Self::KfShort(FormConfig::default()),
            Self::Ud(FormConfig::default()),
            Self::Srif(FormConfig::default()),
            Self::FuzzySrif(FuzzySrifConfig::default()),
            Self::Information(FormConfig::default()),
            Self::SquareRoot(FormConfig::default()),
            Self::Ekf(TurningConfig::default()),
            Self::Ukf(TurningConfig::default()),
            Self::Huber(HuberConfig::default()),
            Self::StudentT(StudentTConfig::default()),
            Self::ConstantAcceleration(WhiteNoiseConfig::default()),
            Self::Singer(SingerConfig::default()),
            Self::Imm(ImmConfig::default()),
            Self::Lms(LmsConfig::default()),
            Self::Ar1(Ar1Config::default()),
            Self::Displacement(DisplacementConfig::default()),
        ]
    }

    /// Whether its belief is that of a constant-velocity model, as the smoother takes it.
    pub fn is_constant_velocity(&self) -> bool {
        let cv = |model: &ModelConfig| matches!(model, ModelConfig::ConstantVelocity(_));
        match self {
            Self::Kf(c)
            | Self::KfShort(c)
            | Self::Ud(c)
            | Self::Srif(c)
            | Self::Information(c)
            | Self::SquareRoot(c) => cv(&c.model),
            Self::FuzzySrif(c) => cv(&c.model),
            Self::Ekf(c) | Self::Ukf(c) => cv(&c.model),
            Self::Huber(_) | Self::StudentT(_) => true,
            _ => false,
        }
    }

    /// Checks all values; `at` names the place in the configuration.
    /// # Errors
    /// The first value outside its range.
    pub fn validate(&self, at: &str) -> Result<()> {
        match self {
            Self::Kf(c) => c.validate(&format!("{at}.kf")),
            Self::KfShort(c) => c.validate(&format!("{at}.kf-short")),
            Self::Ud(c) => c.validate(&format!("{at}.ud")),
            Self::Srif(c) => c.validate(&format!("{at}.srif")),
            Self::FuzzySrif(c) => {
                c.model.validate(&format!("{at}.fuzzy-srif.model"))?;
                c.correlator.validate(&format!("{at}.fuzzy-srif.correlator"))
            }
            Self::Information(c) => c.validate(&format!("{at}.information")),
            Self::SquareRoot(c) => c.validate(&format!("{at}.square-root")),
            Self::Ekf(c) => c.form().validate(&format!("{at}.ekf")),
            Self::Ukf(c) => c.form().validate(&format!("{at}.ukf")),
            Self::Huber(c) => c.validate(&format!("{at}.huber")),
            Self::StudentT(c) => c.validate(&format!("{at}.student-t")),
            Self::ConstantAcceleration(c) => ModelConfig::ConstantAcceleration(c.clone()).validate(at),
            Self::Singer(c) => ModelConfig::Singer(c.clone()).validate(at),
            Self::Imm(c) => c.validate(&format!("{at}.imm")),
            Self::Lms(c) => c.validate(&format!("{at}.lms")),
            Self::Ar1(c) => c.validate(&format!("{at}.ar1")),
            Self::Displacement(c) => c.validate(&format!("{at}.displacement")),
        }
    }

    /// Builds the filter of a new track.
    pub(in crate::track) fn start(&self, start: &Gaussian<4>, acceleration_std: f64) -> Result<Belief, FilterError> {
        let form = |form, config: &FormConfig| form::build(form, config, start, acceleration_std).map(Belief::Boxed);
        let with = |model, innovation| form(Form::Kf, &FormConfig { model, innovation, adaptive: None });
        match self {
            Self::Kf(c) if c.is_plain() => {
                Ok(Belief::Cv(constant_velocity::ConstantVelocity::new(start, acceleration_std)))
            }
            Self::Kf(c) => form(Form::Kf, c),
            Self::KfShort(c) => form(Form::KfShort, c),
            Self::Ud(c) => form(Form::Ud, c),
            Self::Srif(c) => form(Form::Srif, c),
            Self::FuzzySrif(c) => form(Form::Srif, &c.form()),
            Self::Information(c) => form(Form::Information, c),
            Self::SquareRoot(c) => form(Form::SquareRoot, c),
            // A nonlinear model makes the Kalman filter the extended one.
            Self::Ekf(c) => form(Form::Kf, &c.form()),
            Self::Ukf(c) => form(Form::Ukf, &c.form()),
            Self::Huber(c) => with(ModelConfig::default(), InnovationConfig::Huber(c.clone())),
            Self::StudentT(c) => with(ModelConfig::default(), InnovationConfig::StudentT(c.clone())),
            Self::ConstantAcceleration(c) => {
                with(ModelConfig::ConstantAcceleration(c.clone()), InnovationConfig::default())
            }
            Self::Singer(c) => with(ModelConfig::Singer(c.clone()), InnovationConfig::default()),
            Self::Imm(c) => c.start(start, acceleration_std),
            Self::Lms(c) => c.start(start, acceleration_std),
            Self::Ar1(c) => c.start(start),
            Self::Displacement(c) => c.start(start, acceleration_std),
        }
    }
}

impl FuzzySrifConfig {
    fn form(&self) -> FormConfig {
        let innovation = InnovationConfig::Fuzzy(self.correlator.clone());
        FormConfig { model: self.model.clone(), innovation, adaptive: None }
    }
}
