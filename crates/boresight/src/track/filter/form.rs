//! The form of a track's filter by name: how it keeps its covariance.

use super::acceleration_noise::AccelerationNoise;
use super::conditioned::{ScaledFilter, conditioned};
use super::innovation::InnovationConfig;
use super::learning::LearningConfig;
use super::model::ModelConfig;
use super::own_model::{Ar1Config, DisplacementConfig, ImmConfig, LmsConfig};
use super::tracked_filter::TrackFilter;
use crate::Result as Checked;
use boresight_filters::model::{
    ConstantAcceleration, ConstantTurn, ConstantVelocity, NearlyConstantTurn, OrnsteinUhlenbeck, RandomWalk, Scaled,
    Singer,
};
use boresight_filters::{
    CovarianceForm, FilterError, Gaussian, GaussianFilter, Information, Kf, ScaleNoise, SquareRoot, Srif, Start,
    Tracked, Ud, Ukf,
};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// How the filter keeps its belief. The first seven take any model, innovation and learning of the noise; the last four
/// bring a model of their own.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum FormConfig {
    /// Covariance with the Joseph update (Kalman 1960). A nonlinear model makes it the extended filter (Jazwinski 1970).
    #[default]
    Kf,
    /// Covariance with the short update P - K H P: to compare with; loses digits first.
    KfShort,
    /// Factors P = U D Uᵀ (Bierman 1977, Thornton 1976): the covariance cannot lose its sign.
    Ud,
    /// Square root of the information by Householder reflections (Bierman 1977): works without process noise.
    Srif,
    /// Information P⁻¹, P⁻¹x (Maybeck 1979): measurements add up; reading the state costs an inversion.
    Information,
    /// Square root of the covariance (Potter 1963, in Bierman 1977): as robust as U-D, two roots more a step.
    SquareRoot,
    /// Unscented transform (Julier, Uhlmann 2004): sigma points instead of Jacobians of a nonlinear model.
    Ukf,
    /// Interacting multiple models (Blom, Bar-Shalom 1988): two constant-velocity filters weighed by likelihood.
    Imm(ImmConfig),
    /// Kalman filter with learnt acceleration weights (Obolensky, Erdogmus, Principe).
    Lms(LmsConfig),
    /// Scalar AR(1) recursion of each coordinate (Cai, Cui).
    Ar1(Ar1Config),
    /// Coordinate now and one frame before, [2 -1; 1 0] (Cai, Cui).
    Displacement(DisplacementConfig),
}

impl FormConfig {
    /// Whether it takes any model, innovation and learning of the noise.
    pub fn takes_a_model(&self) -> bool {
        match self {
            Self::Kf | Self::KfShort | Self::Ud | Self::Srif | Self::Information | Self::SquareRoot | Self::Ukf => true,
            Self::Imm(_) | Self::Lms(_) | Self::Ar1(_) | Self::Displacement(_) => false,
        }
    }

    /// Whether a step over some time may be cut into two; the others count frames.
    pub fn takes_any_time(&self) -> bool {
        self.takes_a_model() || matches!(self, Self::Imm(_))
    }

    pub(super) fn validate(&self, at: &str) -> Checked<()> {
        match self {
            Self::Imm(c) => c.validate(&format!("{at}.imm")),
            Self::Lms(c) => c.validate(&format!("{at}.lms")),
            Self::Ar1(c) => c.validate(&format!("{at}.ar1")),
            Self::Displacement(c) => c.validate(&format!("{at}.displacement")),
            Self::Kf | Self::KfShort | Self::Ud | Self::Srif | Self::Information | Self::SquareRoot | Self::Ukf => {
                Ok(())
            }
        }
    }

    /// Builds the filter of a new track from its first belief, driven by `noise`.
    pub(super) fn start(
        &self,
        model: &ModelConfig,
        innovation: &InnovationConfig,
        adaptive: Option<&LearningConfig>,
        start: &Gaussian<4>,
        noise: AccelerationNoise,
    ) -> Result<Box<dyn TrackFilter>, FilterError> {
        match self {
            Self::Imm(c) => c.start(start, noise),
            Self::Lms(c) => c.start(start, noise),
            Self::Ar1(c) => c.start(start),
            Self::Displacement(c) => c.start(start, noise),
            Self::Kf | Self::KfShort | Self::Ud | Self::Srif | Self::Information | Self::SquareRoot | Self::Ukf => {
                conditioned(around(self, model, start, noise)?, innovation, adaptive)
            }
        }
    }
}

/// How long an acceleration that is a state is taken to last where nothing says so, s: a manoeuvre.
const ACCELERATION_LASTS_S: f64 = 1.0;

/// Builds a form around a model.
fn around(
    form: &FormConfig,
    model: &ModelConfig,
    start: &Gaussian<4>,
    noise: AccelerationNoise,
) -> Result<Box<dyn ScaledFilter>, FilterError> {
    macro_rules! form {
        ($n:literal, $model:expr) => {{
            let m = Scaled::new($model);
            match form {
                FormConfig::Kf => boxed(Kf::<_, $n>::from_kinematics(m, start)?),
                FormConfig::KfShort => boxed(Kf::<_, $n>::from_kinematics(m, start)?.with_form(CovarianceForm::Short)),
                FormConfig::Ud => boxed(Ud::<_, $n>::from_kinematics(m, start)?),
                FormConfig::Srif => boxed(Srif::<_, $n>::from_kinematics(m, start)?),
                FormConfig::Information => boxed(Information::<_, $n>::from_kinematics(m, start)?),
                FormConfig::SquareRoot => boxed(SquareRoot::<_, $n>::from_kinematics(m, start)?),
                FormConfig::Ukf => boxed(Ukf::<_, $n>::from_kinematics(m, start)?),
                FormConfig::Imm(_) | FormConfig::Lms(_) | FormConfig::Ar1(_) | FormConfig::Displacement(_) => {
                    return Err(FilterError::OutOfRange("a form that takes a model"));
                }
            }
        }};
    }
    Ok(match model {
        ModelConfig::ConstantVelocity(c) => form!(
            4,
            match c.hold_s {
                None => noise.constant_velocity(1.0)?,
                Some(s) => ConstantVelocity::continuous(noise.density(s))?,
            }
        ),
        ModelConfig::ConstantAcceleration(c) => form!(
            6,
            match (c.hold_s, noise) {
                (None, AccelerationNoise::Discrete(std)) => ConstantAcceleration::discrete(std, std)?,
                (hold_s, _) => {
                    let s = hold_s.unwrap_or(ACCELERATION_LASTS_S);
                    let std = noise.std(s);
                    ConstantAcceleration::continuous(std * std / s, std)?
                }
            }
        ),
        ModelConfig::ConstantTurn(c) => form!(4, ConstantTurn::new(c.rate_rad_per_s, noise.density(c.hold_s))?),
        ModelConfig::NearlyConstantTurn(c) => {
            let drift = c.rate_drift_rad_per_s * c.rate_drift_rad_per_s;
            form!(5, NearlyConstantTurn::new(noise.density(c.hold_s), drift, c.start_rate_std_rad_per_s)?)
        }
        ModelConfig::Singer(c) => form!(6, Singer::new(noise.std(2.0 * c.manoeuvre_s), c.manoeuvre_s)?),
        ModelConfig::OrnsteinUhlenbeck(c) => form!(4, OrnsteinUhlenbeck::new(c.speed_std_px_per_s, c.memory_s)?),
        ModelConfig::RandomWalk(c) => form!(2, RandomWalk::new(c.diffusion_px2_per_s)?),
    })
}

fn boxed<F, const N: usize>(filter: F) -> Box<dyn ScaledFilter>
where
    F: GaussianFilter<N> + ScaleNoise<f64> + Send + Sync + 'static,
{
    Box::new(Tracked(filter))
}
