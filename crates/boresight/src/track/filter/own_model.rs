//! Forms that bring a model of their own: IMM, LMS weights, AR(1), displacement.

use super::acceleration_noise::AccelerationNoise;
use super::tracked_filter::TrackFilter;
use crate::Result;
use crate::validate::{check, not_negative, positive};
use boresight_filters::{
    Ar1, Displacement, FilterError, Gaussian, Imm, Information, Kf, Lms, LmsRule, Measurement, SquareRoot, Srif, Start,
    Tracked, Ud, Ukf,
};
use nalgebra::{Matrix2, Vector2};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// How long an acceleration whose weights are learnt is taken to last, s: a frame at 25 Hz.
const ACCELERATION_LASTS_S: f64 = 0.04;

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

impl ImmConfig {
    pub(super) fn validate(&self, at: &str) -> Result<()> {
        positive(at, "manoeuvre-factor", self.manoeuvre_factor, "10 is usual")?;
        positive(at, "quiet-s", self.quiet_s, "5 s is usual")?;
        positive(at, "manoeuvre-s", self.manoeuvre_s, "1 s is usual")
    }

    pub(super) fn start(
        &self,
        start: &Gaussian<4>,
        noise: AccelerationNoise,
    ) -> Result<Box<dyn TrackFilter>, FilterError> {
        let quiet = noise.constant_velocity(1.0)?;
        let fast = noise.constant_velocity(self.manoeuvre_factor)?;
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
    pub(super) fn validate(&self, at: &str) -> Result<()> {
        check((2..=5).contains(&self.window), at, "window", self.window, "2..=5", "2 is the paper's")?;
        match &self.rule {
            LmsRuleConfig::Guarded {} => Ok(()),
            LmsRuleConfig::AsPrinted(c) => {
                not_negative(&format!("{at}.rule.as-printed"), "step-factor", c.step_factor, "1e-14 is harmless")
            }
        }
    }

    pub(super) fn start(
        &self,
        start: &Gaussian<4>,
        noise: AccelerationNoise,
    ) -> Result<Box<dyn TrackFilter>, FilterError> {
        let acceleration_std = noise.std(ACCELERATION_LASTS_S);
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

impl Ar1Config {
    pub(super) fn validate(&self, at: &str) -> Result<()> {
        positive(at, "frame-s", self.frame_s, "the frame time, 0.04 s at 25 Hz")
    }

    pub(super) fn start(&self, start: &Gaussian<4>) -> std::result::Result<Box<dyn TrackFilter>, FilterError> {
        let p = &start.cov;
        let cov = Matrix2::new(p[(0, 0)], p[(0, 2)], p[(2, 0)], p[(2, 2)]);
        let position = Vector2::new(start.mean[0], start.mean[2]);
        Ok(boxed(Ar1::new(&Measurement { position, cov }, self.frame_s)?))
    }
}

impl DisplacementConfig {
    pub(super) fn validate(&self, at: &str) -> Result<()> {
        positive(at, "frame-s", self.frame_s, "the frame time, 0.04 s at 25 Hz")?;
        self.noise_px.map_or(Ok(()), |v| not_negative(at, "noise-px", v, "0.3 is usual"))
    }

    pub(super) fn start(
        &self,
        start: &Gaussian<4>,
        noise: AccelerationNoise,
    ) -> std::result::Result<Box<dyn TrackFilter>, FilterError> {
        let noise = self.noise_px.unwrap_or_else(|| noise.std(self.frame_s) * self.frame_s * self.frame_s);
        Ok(boxed(Tracked(Displacement::from_kinematics(start, noise * noise, self.frame_s)?)))
    }
}

fn boxed(filter: impl TrackFilter + 'static) -> Box<dyn TrackFilter> {
    Box::new(filter)
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Matrix4, Vector4};

    #[test]
    fn the_displacement_model_takes_the_square_of_its_noise() {
        // Variances 1 and 2² of position and velocity, 0.5 s a frame: [x(t), x(t−1)] has [[1, 1], [1, 2]], and 2 x(t) − x(t−1) the variance 2; 0.5² more.
        // Left out, the noise is that of 2 px/s² over a frame: 2 · 0.5² = 0.5 px.
        let cov = Matrix4::from_diagonal(&Vector4::new(1.0, 4.0, 1.0, 4.0));
        let start = Gaussian { mean: Vector4::zeros(), cov };
        for noise_px in [Some(0.5), None] {
            let config = DisplacementConfig { frame_s: 0.5, noise_px };
            let mut filter = config.start(&start, AccelerationNoise::Discrete(2.0)).unwrap();
            filter.predict(0.5).unwrap();
            assert!((filter.predicted().cov - Matrix2::identity() * 2.25).norm() < 1e-12, "{noise_px:?}");
        }
    }
}
