//! The motion model of a track's filter by name.
//!
//! The process noise of every model follows from the tracker's white acceleration, unless said otherwise: a density q̃, or σ of discrete noise;
//! where a model wants the other of the two, q̃ = σ² × the time for which an acceleration lasts.

use crate::Result;
use crate::validate::{check, not_negative, positive};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// How targets move.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum ModelConfig {
    /// Straight motion disturbed by white acceleration: the default, for most targets.
    ConstantVelocity(WhiteNoiseConfig),
    /// Acceleration is a state that drifts: for long, steady manoeuvres; noisier in straight flight.
    ConstantAcceleration(WhiteNoiseConfig),
    /// Turn of a known rate: for targets on a known circle, and to build other filters of.
    ConstantTurn(ConstantTurnConfig),
    /// Turn whose rate is a state: for vehicles and aircraft that turn for seconds. Nonlinear: `ekf` or `ukf`.
    NearlyConstantTurn(NearlyConstantTurnConfig),
    /// Acceleration of standard deviation σ (σ² = q̃ over twice the time constant) that fades with a time constant (Singer 1970): for pilots' manoeuvres.
    Singer(SingerConfig),
    /// Velocity that forgets itself: for cells, pedestrians, long gaps; a coasting track does not explode.
    OrnsteinUhlenbeck(OrnsteinUhlenbeckConfig),
    /// Position that diffuses, without velocity: for particles and slow drift.
    RandomWalk(RandomWalkConfig),
}

impl Default for ModelConfig {
    fn default() -> Self {
        Self::ConstantVelocity(WhiteNoiseConfig::default())
    }
}

/// White process noise of a constant-velocity or constant-acceleration model.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct WhiteNoiseConfig {
    /// How long an acceleration lasts, s, above 0. Of use beside `acceleration-std-px-per-s2`: given, the noise is continuous
    /// with the density σ² × this (of a jerk: σ² over this); left out, it is discrete. With a density it only says how
    /// the jerk of a constant-acceleration model follows from it (1 s where left out).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub hold_s: Option<f64>,
}

/// Turn of a known rate.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct ConstantTurnConfig {
    /// Rate from +x towards +y, rad/s.
    pub rate_rad_per_s: f64,
    /// Beside `acceleration-std-px-per-s2`: the white acceleration has the density σ² × this, s, above 0.
    pub hold_s: f64,
}

impl Default for ConstantTurnConfig {
    fn default() -> Self {
        Self { rate_rad_per_s: 0.5, hold_s: 0.04 }
    }
}

/// Turn whose rate is a state.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct NearlyConstantTurnConfig {
    /// How well the rate of a new track (0) is known, standard deviation, rad/s, 0 or more.
    pub start_rate_std_rad_per_s: f64,
    /// How much the rate drifts within one second, standard deviation, rad/s, 0 or more.
    pub rate_drift_rad_per_s: f64,
    /// Beside `acceleration-std-px-per-s2`: the white acceleration has the density σ² × this, s, above 0.
    pub hold_s: f64,
}

impl Default for NearlyConstantTurnConfig {
    fn default() -> Self {
        Self { start_rate_std_rad_per_s: 0.5, rate_drift_rad_per_s: 0.5, hold_s: 0.04 }
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

/// Velocity that forgets itself.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct OrnsteinUhlenbeckConfig {
    /// Standard deviation of the velocity per axis over long times, px/s, above 0; σ is not used.
    pub speed_std_px_per_s: f64,
    /// How long a velocity is remembered, s, above 0.
    pub memory_s: f64,
}

impl OrnsteinUhlenbeckConfig {
    /// Checks all values; `at` names the place in the configuration.
    /// # Errors
    /// The first value outside its range.
    pub fn validate(&self, at: &str) -> Result<()> {
        positive(at, "speed-std-px-per-s", self.speed_std_px_per_s, "a third of the largest speed")?;
        positive(at, "memory-s", self.memory_s, "1 s suits pedestrians in video")
    }
}

impl Default for OrnsteinUhlenbeckConfig {
    fn default() -> Self {
        Self { speed_std_px_per_s: 50.0, memory_s: 1.0 }
    }
}

/// Diffusing position.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct RandomWalkConfig {
    /// Growth of the position's variance per axis, px²/s, above 0 (2 D of a particle); σ is not used.
    pub diffusion_px2_per_s: f64,
}

impl Default for RandomWalkConfig {
    fn default() -> Self {
        Self { diffusion_px2_per_s: 50.0 }
    }
}

impl ModelConfig {
    pub(super) fn validate(&self, at: &str) -> Result<()> {
        let hold =
            |name: &str, s: f64| positive(&format!("{at}.{name}"), "hold-s", s, "the frame time, 0.04 s at 25 Hz");
        match self {
            Self::ConstantVelocity(c) => c.hold_s.map_or(Ok(()), |s| hold("constant-velocity", s)),
            Self::ConstantAcceleration(c) => c.hold_s.map_or(Ok(()), |s| hold("constant-acceleration", s)),
            Self::ConstantTurn(c) => {
                let (at, rate) = (format!("{at}.constant-turn"), c.rate_rad_per_s);
                check(
                    rate.is_finite(),
                    &at,
                    "rate-rad-per-s",
                    rate,
                    "a finite rate",
                    "0.5 is a full circle in 12.6 s",
                )?;
                hold("constant-turn", c.hold_s)
            }
            Self::NearlyConstantTurn(c) => {
                let (at, usual) = (format!("{at}.nearly-constant-turn"), "0.5 suits turns of some seconds");
                not_negative(&at, "start-rate-std-rad-per-s", c.start_rate_std_rad_per_s, usual)?;
                not_negative(&at, "rate-drift-rad-per-s", c.rate_drift_rad_per_s, usual)?;
                hold("nearly-constant-turn", c.hold_s)
            }
            Self::Singer(c) => positive(&format!("{at}.singer"), "manoeuvre-s", c.manoeuvre_s, "2 s is a slow turn"),
            Self::OrnsteinUhlenbeck(c) => c.validate(&format!("{at}.ornstein-uhlenbeck")),
            Self::RandomWalk(c) => {
                positive(&format!("{at}.random-walk"), "diffusion-px2-per-s", c.diffusion_px2_per_s, "50 is usual")
            }
        }
    }
}
