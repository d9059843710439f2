//! How tracks are initiated from unassociated detections: from one point, from two points, or within velocity bounds.
//!
//! Source: two points `docs/theory/track-management.md`: x = [z, Δz/T], P = R[[1, 1/T], [1/T, 2/T²]] per axis; with a
//! covariance of its own on each point this is cov(z₂) = R₂, cov(z₂, v) = R₂/T, cov(v) = (R₁ + R₂)/T². One point:
//! velocity unknown within bounds, its variance that of a uniform density.
//! Symbols: T time between the points, s; R measurement covariance, px².

use crate::validate::{check, positive};
use crate::{DetectedVelocity, Result};
use boresight_filters::Gaussian;
use nalgebra::{Matrix2, Matrix4, Vector2, Vector4};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// How tracks are initiated.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum InitiationConfig {
    /// Every unassociated detection initiates a track at once, with unknown velocity.
    OnePoint(OnePointConfig),
    /// Two unassociated detections of scans in a row initiate a track when the speed between them is possible.
    TwoPoint(TwoPointConfig),
    /// As two points, but the velocity between them must lie in a box (a road, a river, a known approach).
    VelocityBounds(VelocityBoundsConfig),
}

impl Default for InitiationConfig {
    fn default() -> Self {
        Self::TwoPoint(TwoPointConfig::default())
    }
}

/// Every unassociated detection initiates a track at once.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct OnePointConfig {
    /// Standard deviation of the unknown velocity per axis, px/s, above 0.
    pub velocity_std_px_per_s: f64,
}

impl Default for OnePointConfig {
    fn default() -> Self {
        Self { velocity_std_px_per_s: 60.0 }
    }
}

/// Two unassociated detections of scans in a row initiate a track.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct TwoPointConfig {
    /// Standard deviation of the targets' velocities per axis, px/s, above 0, if it is known: first states are then surer and
    /// better told from clutter. Left out: nothing is known but the largest speed.
    pub velocity_std_px_per_s: Option<f64>,
}

/// A box of possible velocities.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct VelocityBoundsConfig {
    /// Least velocity (x, y), px/s.
    pub min_px_per_s: [f64; 2],
    /// Largest velocity (x, y), px/s, above the least.
    pub max_px_per_s: [f64; 2],
}

impl Default for VelocityBoundsConfig {
    fn default() -> Self {
        Self { min_px_per_s: [-150.0; 2], max_px_per_s: [150.0; 2] }
    }
}

impl InitiationConfig {
    /// Checks all values; `at` names the place in the configuration.
    /// # Errors
    /// The first value outside its range.
    pub fn validate(&self, at: &str) -> Result<()> {
        match self {
            Self::TwoPoint(c) => c.velocity_std_px_per_s.map_or(Ok(()), |std| {
                positive(
                    &format!("{at}.two-point"),
                    "velocity-std-px-per-s",
                    std,
                    "a third to a half of the largest speed",
                )
            }),
            Self::OnePoint(c) => positive(
                &format!("{at}.one-point"),
                "velocity-std-px-per-s",
                c.velocity_std_px_per_s,
                "a third to a half of the largest speed",
            ),
            Self::VelocityBounds(c) => {
                for a in 0..2 {
                    let (low, high) = (c.min_px_per_s[a], c.max_px_per_s[a]);
                    check(
                        low.is_finite() && high.is_finite() && low < high,
                        &format!("{at}.velocity-bounds"),
                        "min-px-per-s",
                        low,
                        "a finite velocity below max-px-per-s",
                        "[-10, -10] and [200, 10] let things move right only",
                    )?;
                }
                Ok(())
            }
        }
    }
}

/// Mean and variance of a new target's velocity (px/s, px²/s²), if anything is known of it.
pub(super) type VelocityPrior = Option<(Vector2<f64>, Vector2<f64>)>;

impl InitiationConfig {
    /// What is known of a new target's velocity.
    pub(super) fn velocity_prior(&self) -> VelocityPrior {
        match self {
            Self::OnePoint(c) => Some((Vector2::zeros(), Vector2::repeat(c.velocity_std_px_per_s.powi(2)))),
            Self::TwoPoint(c) => c.velocity_std_px_per_s.map(|std| (Vector2::zeros(), Vector2::repeat(std * std))),
            Self::VelocityBounds(c) => {
                let (low, high) = (Vector2::from(c.min_px_per_s), Vector2::from(c.max_px_per_s));
                // A uniform density over the box.
                Some((0.5 * (low + high), (high - low).map(|w| w * w / 12.0)))
            }
        }
    }
}

/// First belief from one point: velocity zero, variance as given (px²/s²).
pub fn from_one_point(
    z: &Vector2<f64>,
    r: &Matrix2<f64>,
    velocity: Vector2<f64>,
    variance: Vector2<f64>,
) -> Gaussian<4> {
    let mut cov = Matrix4::zeros();
    for a in 0..2 {
        for b in 0..2 {
            cov[(2 * a, 2 * b)] = r[(a, b)];
        }
        cov[(2 * a + 1, 2 * a + 1)] = variance[a];
    }
    Gaussian { mean: Vector4::new(z.x, velocity.x, z.y, velocity.y), cov }
}

/// First belief from a point that comes with its velocity, whose covariances are multiplied by `scale`, as that of the point was.
pub fn from_velocity(z: &Vector2<f64>, r: &Matrix2<f64>, velocity: &DetectedVelocity, scale: f64) -> Gaussian<4> {
    let mut cov = Matrix4::zeros();
    for a in 0..2 {
        for b in 0..2 {
            cov[(2 * a, 2 * b)] = r[(a, b)];
            cov[(2 * a, 2 * b + 1)] = scale * velocity.with_position[(a, b)];
            cov[(2 * b + 1, 2 * a)] = scale * velocity.with_position[(a, b)];
            cov[(2 * a + 1, 2 * b + 1)] = scale * velocity.cov[(a, b)];
        }
    }
    Gaussian { mean: Vector4::new(z.x, velocity.mean.x, z.y, velocity.mean.y), cov }
}

/// First belief from two points `dt_s` apart (above 0).
pub fn from_two_points(
    first: &Vector2<f64>,
    r_first: &Matrix2<f64>,
    z: &Vector2<f64>,
    r: &Matrix2<f64>,
    dt_s: f64,
) -> Gaussian<4> {
    let velocity = (z - first) / dt_s;
    let mut cov = Matrix4::zeros();
    for a in 0..2 {
        for b in 0..2 {
            cov[(2 * a, 2 * b)] = r[(a, b)];
            cov[(2 * a, 2 * b + 1)] = r[(a, b)] / dt_s;
            cov[(2 * a + 1, 2 * b)] = r[(a, b)] / dt_s;
            cov[(2 * a + 1, 2 * b + 1)] = (r[(a, b)] + r_first[(a, b)]) / (dt_s * dt_s);
        }
    }
    Gaussian { mean: Vector4::new(z.x, velocity.x, z.y, velocity.y), cov }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// State [x, vx, y, vy]; the covariance of position i and velocity j stands at (2 i, 2 j + 1) and mirrored.
    #[test]
    fn a_velocity_that_came_with_the_point_brings_its_covariances_scaled() {
        let r = Matrix2::new(1.0, 0.2, 0.2, 2.0);
        let velocity = DetectedVelocity {
            mean: Vector2::new(3.0, -4.0),
            cov: Matrix2::new(5.0, 0.5, 0.5, 6.0),
            with_position: Matrix2::new(0.1, 0.3, 0.4, 0.6),
        };
        let b = from_velocity(&Vector2::new(10.0, 20.0), &r, &velocity, 2.0);
        assert_eq!(b.mean, Vector4::new(10.0, 3.0, 20.0, -4.0));
        #[rustfmt::skip]
        let want = Matrix4::new(
            1.0, 0.2, 0.2, 0.6,
            0.2, 10.0, 0.8, 1.0,
            0.2, 0.8, 2.0, 1.2,
            0.6, 1.0, 1.2, 12.0,
        );
        assert!((b.cov - want).abs().max() < 1e-15, "{}", b.cov);
    }

    /// v = (z₂ - z₁)/dt: Var v = (R₁ + R₂)/dt², Cov(z₂, v) = R₂/dt.
    #[test]
    fn two_points_give_the_covariances_of_their_difference() {
        let (r1, r2) = (Matrix2::new(1.0, 0.1, 0.1, 2.0), Matrix2::new(3.0, 0.3, 0.3, 4.0));
        let b = from_two_points(&Vector2::new(1.0, 2.0), &r1, &Vector2::new(2.0, 4.0), &r2, 0.5);
        assert_eq!(b.mean, Vector4::new(2.0, 2.0, 4.0, 4.0));
        assert_eq!((b.cov[(0, 1)], b.cov[(0, 3)], b.cov[(3, 2)]), (6.0, 0.6, 8.0));
        assert!((b.cov[(1, 1)] - 16.0).abs() < 1e-12 && (b.cov[(1, 3)] - 1.6).abs() < 1e-12);
        assert_eq!(b.cov, b.cov.transpose());
    }
}
