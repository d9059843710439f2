//! The filter of each track by name: every filter of `boresight-filters`, started from a belief in position and velocity.
//!
//! The plain constant-velocity Kalman filter lives in the track itself; all others stand behind [`TrackFilter`]. The
//! process noise is the tracker's `acceleration-std-px-per-s2`. The text of a variant is what
//! `boresight config --list filters` prints: what it is, when to take it, its source.

use super::belief::Belief;
use super::config::{check, not_negative, positive};
use super::cv;
use super::filter_forms::{self, Form};
use super::filter_model::{ModelConfig, SingerConfig, WhiteNoiseConfig};
use super::filter_options::{
    CorrelatorConfig, FormConfig, HuberConfig, InnovationConfig, StudentTConfig, TurningConfig,
};
use crate::Result;
use boresight_filters::model::ConstantVelocity;
use boresight_filters::{
    Ar1, Displacement, Filter, FilterError, Gaussian, Imm, Information, Kf, Lms, LmsRule, Measurement, SquareRoot,
    Srif, Start, Tracked, Ud, Ukf,
};
use nalgebra::{Matrix2, Vector2};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The filter of each track.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum FilterConfig {
    /// Kalman filter in covariance form, Joseph update (Kalman 1960; SPEC D.1): the default. Exact for linear models in
    /// f64 and the fastest: without options it is kept in place in the track.
    Kf(FormConfig),
    /// Kalman filter with the short update P - K H P: to compare with. Saves little and loses digits first.
    KfShort(FormConfig),
    /// U-D factors P = U D Uᵀ (Bierman 1977, Thornton 1976; SPEC D.2-3): the covariance cannot lose its sign. For tiny
    /// measurement noise beside a large first uncertainty, and as the papers' CTUDF.
    Ud(FormConfig),
    /// Square-root information filter by Householder reflections (Bierman 1977; SPEC G): best conditioned, works without
    /// process noise; as the papers' CTSRIF.
    Srif(FormConfig),
    /// Square-root information filter with the fuzzy-logic correlator (CTFSRIF; SPEC G.1): the papers' filter for
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
    /// Time-varying Kalman filter with learnt acceleration weights (Obolensky, Erdogmus, Principe; SPEC H): guarded by
    /// default; as printed on request, which diverges (a track whose filter does keeps its last state until it ends).
    Lms(LmsConfig),
    /// Scalar AR(1) recursion of each coordinate (Cai, Cui; SPEC I.4): the paper's baseline. Lags a steady motion and
    /// depends on the origin: to compare with.
    Ar1(Ar1Config),
    /// Coordinate now and one frame before, [2 -1; 1 0] (Cai, Cui; SPEC I.5): straight-line extrapolation with two states
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

/// Interacting multiple model of two constant-velocity filters.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct ImmConfig {
    /// Form of both filters.
    pub form: ImmForm,
    /// Acceleration of the manoeuvring model over that of the quiet one, above 0.
    pub manoeuvre_factor: f64,
    /// How long a target stays quiet, s, above 0.
    pub quiet_s: f64,
    /// How long a manoeuvre lasts, s, above 0.
    pub manoeuvre_s: f64,
}

/// Form of the filters of an IMM.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum ImmForm {
    /// Kalman filter (Joseph).
    #[default]
    Kf,
    /// U-D factors.
    Ud,
    /// Square-root information filter.
    Srif,
    /// Information filter.
    Information,
    /// Square-root covariance filter.
    SquareRoot,
    /// Unscented filter.
    Ukf,
}

impl Default for ImmConfig {
    fn default() -> Self {
        Self { form: ImmForm::Kf, manoeuvre_factor: 10.0, quiet_s: 5.0, manoeuvre_s: 1.0 }
    }
}

/// LMS acceleration weights.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct LmsConfig {
    /// N, the measured accelerations reach back this many frames, 2..=5; the filter has N + 3 states an axis.
    pub window: u32,
    /// How the weights learn.
    pub rule: LmsRuleConfig,
}

impl Default for LmsConfig {
    fn default() -> Self {
        Self { window: 2, rule: LmsRuleConfig::default() }
    }
}

/// How the weights learn.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum LmsRuleConfig {
    /// Normalised step, leak, row limit and watchdog: did not diverge in 400 runs.
    Guarded {},
    /// The paper's corrected equations.
    AsPrinted(AsPrintedConfig),
}

impl Default for LmsRuleConfig {
    fn default() -> Self {
        Self::Guarded {}
    }
}

/// The paper's learning rule.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct AsPrintedConfig {
    /// Step factor α, 0 or more. At 25 frames/s: 1e-14 does nothing, 1e-12 diverges in a quarter of the runs, 1e-8 in all.
    pub step_factor: f64,
}

impl Default for AsPrintedConfig {
    fn default() -> Self {
        Self { step_factor: 1e-14 }
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

/// Displacement model.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct DisplacementConfig {
    /// Expected time between frames, s, above 0.
    pub frame_s: f64,
    /// Standard deviation of the noise of a frame, px, 0 or more; left out: acceleration × frame time².
    #[serde(skip_serializing_if = "Option::is_none")]
    pub noise_px: Option<f64>,
}

impl Default for DisplacementConfig {
    fn default() -> Self {
        Self { frame_s: 0.04, noise_px: None }
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

    /// Checks all values; `at` names the place in the configuration.
    /// # Errors
    /// The first value outside its range.
    pub fn validate(&self, at: &str) -> Result<()> {
        let frame =
            |name: &str, s: f64| positive(&format!("{at}.{name}"), "frame-s", s, "the frame time, 0.04 s at 25 Hz");
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
            Self::Imm(c) => {
                let at = format!("{at}.imm");
                positive(&at, "manoeuvre-factor", c.manoeuvre_factor, "10 is usual")?;
                positive(&at, "quiet-s", c.quiet_s, "5 s is usual")?;
                positive(&at, "manoeuvre-s", c.manoeuvre_s, "1 s is usual")
            }
            Self::Lms(c) => {
                let at = format!("{at}.lms");
                check((2..=5).contains(&c.window), &at, "window", c.window, "2..=5", "2 is the paper's")?;
                match &c.rule {
                    LmsRuleConfig::Guarded {} => Ok(()),
                    LmsRuleConfig::AsPrinted(c) => not_negative(
                        &format!("{at}.rule.as-printed"),
                        "step-factor",
                        c.step_factor,
                        "1e-14 is harmless",
                    ),
                }
            }
            Self::Ar1(c) => frame("ar1", c.frame_s),
            Self::Displacement(c) => {
                frame("displacement", c.frame_s)?;
                c.noise_px
                    .map_or(Ok(()), |v| not_negative(&format!("{at}.displacement"), "noise-px", v, "0.3 is usual"))
            }
        }
    }

    /// Builds the filter of a new track.
    pub(super) fn start(&self, start: &Gaussian<4>, acceleration_std: f64) -> Result<Belief, FilterError> {
        let form =
            |form, config: &FormConfig| filter_forms::build(form, config, start, acceleration_std).map(Belief::Boxed);
        let with = |model, innovation| form(Form::Kf, &FormConfig { model, innovation, adaptive: None });
        match self {
            Self::Kf(c) if c.is_plain() => Ok(Belief::Cv(cv::ConstantVelocity::new(start, acceleration_std))),
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
            Self::Ar1(c) => {
                let p = &start.cov;
                let cov = Matrix2::new(p[(0, 0)], p[(0, 2)], p[(2, 0)], p[(2, 2)]);
                let position = Vector2::new(start.mean[0], start.mean[2]);
                Ok(boxed(Ar1::new(&Measurement { position, cov }, c.frame_s)?))
            }
            Self::Displacement(c) => {
                let noise = c.noise_px.unwrap_or(acceleration_std * c.frame_s * c.frame_s);
                Ok(boxed(Tracked(Displacement::from_kinematics(start, noise * noise, c.frame_s)?)))
            }
        }
    }
}

impl FuzzySrifConfig {
    fn form(&self) -> FormConfig {
        let innovation = InnovationConfig::Fuzzy(self.correlator.clone());
        FormConfig { model: self.model.clone(), innovation, adaptive: None }
    }
}

impl ImmConfig {
    fn start(&self, start: &Gaussian<4>, acceleration_std: f64) -> Result<Belief, FilterError> {
        let quiet = ConstantVelocity::discrete(acceleration_std)?;
        let fast = ConstantVelocity::discrete(acceleration_std * self.manoeuvre_factor)?;
        let stays = [self.quiet_s, self.manoeuvre_s];
        macro_rules! imm {
            ($form:ident) => {{
                let filters = [$form::<_, 4>::from_kinematics(quiet, start)?, $form::from_kinematics(fast, start)?];
                boxed(Tracked(Imm::new(filters, stays)?))
            }};
        }
        Ok(match self.form {
            ImmForm::Kf => imm!(Kf),
            ImmForm::Ud => imm!(Ud),
            ImmForm::Srif => imm!(Srif),
            ImmForm::Information => imm!(Information),
            ImmForm::SquareRoot => imm!(SquareRoot),
            ImmForm::Ukf => imm!(Ukf),
        })
    }
}

impl LmsConfig {
    fn start(&self, start: &Gaussian<4>, acceleration_std: f64) -> Result<Belief, FilterError> {
        let rule = match &self.rule {
            LmsRuleConfig::Guarded {} => LmsRule::Guarded,
            LmsRuleConfig::AsPrinted(c) => LmsRule::AsPrinted { alpha: c.step_factor },
        };
        Ok(match self.window {
            2 => boxed(Lms::<5>::from_kinematics(start, acceleration_std, rule)?),
            3 => boxed(Lms::<6>::from_kinematics(start, acceleration_std, rule)?),
            4 => boxed(Lms::<7>::from_kinematics(start, acceleration_std, rule)?),
            5 => boxed(Lms::<8>::from_kinematics(start, acceleration_std, rule)?),
            _ => return Err(FilterError::OutOfRange("a window of 2..=5")),
        })
    }
}

fn boxed(filter: impl TrackFilter + 'static) -> Belief {
    Belief::Boxed(Box::new(filter))
}
