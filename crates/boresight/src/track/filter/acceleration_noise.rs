//! The white acceleration that drives a motion model: in continuous time, or constant within each scan interval.
//!
//! Source: Y. Bar-Shalom, X. R. Li, T. Kirubarajan, *Estimation with Applications to Tracking and Navigation*, 2001, 6.2.2, 6.3.2.
//! The continuous form is the default: two short steps are one long step, so a configuration means the same at every frame rate, with
//! dropped frames and with uneven times. The discrete form grows with the square of the interval.
//! Symbols: density q̃ (px²/s³); σ acceleration (px/s²); T the time over which an acceleration is taken to last, s.
//! A model that wants the other number gets it by q̃ = σ² T.

use crate::validate::positive;
use boresight_filters::FilterError;
use boresight_filters::model::ConstantVelocity;

/// White acceleration, continuous or discrete.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum AccelerationNoise {
    /// White in continuous time: power density, px²/s³.
    Continuous(f64),
    /// Constant within each scan interval: standard deviation, px/s².
    Discrete(f64),
}

impl Default for AccelerationNoise {
    /// That of the tracker without options.
    fn default() -> Self {
        Self::Continuous(DEFAULT_DENSITY_PX2_PER_S3)
    }
}

/// Density without options, px²/s³: the velocity changes by 5 px/s within one second.
pub const DEFAULT_DENSITY_PX2_PER_S3: f64 = 25.0;

impl AccelerationNoise {
    /// Checks the number; `at` names the place in the configuration.
    /// # Errors
    /// A number that is not above 0, or not finite.
    pub(in crate::track) fn validate(self, at: &str) -> crate::Result<()> {
        match self {
            Self::Continuous(q) => positive(at, "acceleration-density-px2-per-s3", q, "as in the tracker"),
            Self::Discrete(std) => positive(at, "acceleration-std-px-per-s2", std, "as in the tracker"),
        }
    }

    /// Power density, px²/s³, if an acceleration lasts `lasts_s`.
    pub fn density(self, lasts_s: f64) -> f64 {
        match self {
            Self::Continuous(density) => density,
            Self::Discrete(std) => std * std * lasts_s,
        }
    }

    /// Standard deviation of an acceleration that lasts `lasts_s`, px/s².
    pub fn std(self, lasts_s: f64) -> f64 {
        match self {
            Self::Continuous(density) => (density / lasts_s).sqrt(),
            Self::Discrete(std) => std,
        }
    }

    /// The constant-velocity model that it drives; `factor` multiplies the acceleration.
    pub(in crate::track) fn constant_velocity(self, factor: f64) -> Result<ConstantVelocity, FilterError> {
        match self {
            Self::Continuous(density) => ConstantVelocity::continuous(density * factor * factor),
            Self::Discrete(std) => ConstantVelocity::discrete(std * factor),
        }
    }
}

impl std::fmt::Display for AccelerationNoise {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Continuous(density) => write!(f, "white acceleration of {density} px²/s³"),
            Self::Discrete(std) => write!(f, "acceleration {std} px/s²"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_acceleration_that_lasts_as_long_as_the_scan_interval_has_the_same_effect_on_the_velocity() {
        let (discrete, dt) = (AccelerationNoise::Discrete(30.0), 0.04);
        let continuous = AccelerationNoise::Continuous(discrete.density(dt));
        let noise = |n: AccelerationNoise| n.constant_velocity(1.0).unwrap().noise_of_step(dt);
        assert!((noise(discrete).q11 - noise(continuous).q11).abs() < 1e-12);
        assert!((continuous.std(dt) - 30.0).abs() < 1e-12);
        let twice = discrete.constant_velocity(2.0).unwrap().noise_of_step(dt);
        assert!((twice.q00 - 4.0 * noise(discrete).q00).abs() < 1e-12);
    }
}
