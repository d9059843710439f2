//! How simulated targets move: the exact state `[x, vx, y, vy]` at any sequence of times.
//!
//! Constant velocity with white acceleration (X(k+1) = Φ X(k) + G w(k)), coordinated turn, sinusoids about a line,
//! Singer acceleration (R. A. Singer, *IEEE Trans. AES* 6, 1970: da/dt = -a/τ + white, stationary std σ), way points.
//! Symbols: t seconds from the scene's start; positions px, velocities px/s. Randomness: stream (Motion, target) of the seed.
//! Departure: Singer's acceleration is an exact AR(1) on steps of dt/16, its integrals are trapezoids.
//! Limits: times must not run back; a time equal to the last one gives the same state.

use super::random::{Purpose, Seed};
use crate::Result;
use crate::validate::check_shown;
use nalgebra::Vector4;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A target's motion; its start state is the target's own.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub enum MotionConfig {
    /// Straight on, with white acceleration noise if wanted.
    ConstantVelocity(ConstantVelocity),
    /// A coordinated turn: constant speed, constant rate of turn.
    Turn(Turn),
    /// Sinusoids about the straight line of the start state.
    Sinusoid(Sinusoid),
    /// Singer manoeuvres: exponentially correlated acceleration.
    Singer(Singer),
    /// Straight lines between given points; the start state is ignored.
    WayPoints(Vec<WayPoint>),
}

impl Default for MotionConfig {
    fn default() -> Self {
        Self::ConstantVelocity(ConstantVelocity::default())
    }
}

/// Parameters of [`MotionConfig::ConstantVelocity`].
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct ConstantVelocity {
    /// Standard deviation of the acceleration of each axis in each step, px/s², 0 or more. 0 (the default) is a straight line.
    pub acceleration_std_px_per_s2: f64,
}

/// Parameters of [`MotionConfig::Turn`].
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct Turn {
    /// Rate of turn, degrees/s; positive turns from +x towards +y (clockwise on the screen).
    pub rate_deg_per_s: f64,
}

/// Parameters of [`MotionConfig::Sinusoid`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct Sinusoid {
    /// Amplitude along x and y, px.
    pub amplitude_px: [f64; 2],
    /// Period along x and y, s, above 0.
    pub period_s: [f64; 2],
    /// Phase at the start along x and y, degrees.
    pub phase_deg: [f64; 2],
}

impl Default for Sinusoid {
    fn default() -> Self {
        Self { amplitude_px: [10.0, 10.0], period_s: [20.0, 20.0], phase_deg: [0.0, 90.0] }
    }
}

/// Parameters of [`MotionConfig::Singer`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct Singer {
    /// Stationary standard deviation of the acceleration of each axis, px/s², 0 or more.
    pub acceleration_std_px_per_s2: f64,
    /// Correlation time of the acceleration, s, above 0. Longer means steadier manoeuvres.
    pub time_constant_s: f64,
}

impl Default for Singer {
    fn default() -> Self {
        Self { acceleration_std_px_per_s2: 1.0, time_constant_s: 10.0 }
    }
}

/// One point of [`MotionConfig::WayPoints`].
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub struct WayPoint {
    /// Time, s from the scene's start; points must be in order of time.
    pub time_s: f64,
    /// Column, px.
    pub x_px: f64,
    /// Row, px.
    pub y_px: f64,
}

impl MotionConfig {
    /// Checks the parameters; `at` names the place in messages.
    /// # Errors
    /// [`crate::ErrorKind::Config`] that names the parameter.
    pub fn validate(&self, at: &str) -> Result<()> {
        let bad = |key: &str, value: &dyn std::fmt::Debug, want: &str| check_shown(false, at, key, value, want);
        match self {
            Self::ConstantVelocity(c)
                if !(c.acceleration_std_px_per_s2 >= 0.0 && c.acceleration_std_px_per_s2.is_finite()) =>
            {
                bad(
                    "constant-velocity.acceleration-std-px-per-s2",
                    &c.acceleration_std_px_per_s2,
                    "a number, 0 or more",
                )
            }
            Self::Turn(t) if !t.rate_deg_per_s.is_finite() => {
                bad("turn.rate-deg-per-s", &t.rate_deg_per_s, "a finite number")
            }
            Self::Sinusoid(s) if !s.period_s.iter().all(|p| *p > 0.0 && p.is_finite()) => {
                bad("sinusoid.period-s", &s.period_s, "periods above 0")
            }
            Self::Sinusoid(s) if !s.amplitude_px.iter().chain(&s.phase_deg).all(|v| v.is_finite()) => {
                bad("sinusoid.amplitude-px", &s.amplitude_px, "finite numbers")
            }
            Self::Singer(s) if !(s.acceleration_std_px_per_s2 >= 0.0 && s.acceleration_std_px_per_s2.is_finite()) => {
                bad("singer.acceleration-std-px-per-s2", &s.acceleration_std_px_per_s2, "a number, 0 or more")
            }
            Self::Singer(s) if !(s.time_constant_s > 0.0 && s.time_constant_s.is_finite()) => {
                bad("singer.time-constant-s", &s.time_constant_s, "a time above 0")
            }
            Self::WayPoints(p) if p.len() < 2 => bad("way-points", &p.len(), "two points or more"),
            Self::WayPoints(p) if !p.windows(2).all(|w| w[0].time_s < w[1].time_s) => {
                bad("way-points", &"times", "times that grow from point to point")
            }
            Self::WayPoints(p)
                if !p.iter().all(|p| p.time_s.is_finite() && p.x_px.is_finite() && p.y_px.is_finite()) =>
            {
                bad("way-points", &"points", "finite numbers")
            }
            _ => Ok(()),
        }
    }
}

/// A target on its way.
#[derive(Clone, Debug)]
pub struct Mover {
    config: MotionConfig,
    start: Vector4<f64>,
    state: Vector4<f64>,
    acceleration: [f64; 2],
    time_s: f64,
    rng: ChaCha8Rng,
}

impl Mover {
    /// Puts target `index` on its start state `[x, vx, y, vy]` (px, px/s) at time `start_s`.
    pub fn new(config: &MotionConfig, start: Vector4<f64>, start_s: f64, seed: Seed, index: u64) -> Self {
        let mut rng = seed.stream(Purpose::Motion, index);
        let mut acceleration = [0.0; 2];
        if let MotionConfig::Singer(s) = config {
            for a in &mut acceleration {
                let z: f64 = StandardNormal.sample(&mut rng);
                *a = s.acceleration_std_px_per_s2 * z;
            }
        }
        Self { config: config.clone(), start, state: start, acceleration, time_s: start_s, rng }
    }

    /// Moves on to `time_s` and returns `[x, vx, y, vy]` there.
    pub fn at(&mut self, time_s: f64) -> Vector4<f64> {
        let dt = (time_s - self.time_s).max(0.0);
        let t = self.time_s + dt;
        match &self.config {
            MotionConfig::ConstantVelocity(c) => {
                for axis in [0, 2] {
                    let mut a = 0.0;
                    if c.acceleration_std_px_per_s2 > 0.0 && dt > 0.0 {
                        let z: f64 = StandardNormal.sample(&mut self.rng);
                        a = c.acceleration_std_px_per_s2 * z;
                    }
                    self.state[axis] += self.state[axis + 1] * dt + 0.5 * a * dt * dt;
                    self.state[axis + 1] += a * dt;
                }
            }
            MotionConfig::Turn(turn) => {
                let w = turn.rate_deg_per_s.to_radians();
                let (vx, vy) = (self.state[1], self.state[3]);
                let (s, c) = (w * dt).sin_cos();
                // sin(w dt)/w and (1 - cos(w dt))/w, whole for w → 0 too.
                let half = 0.5 * w * dt;
                let sinc = if half.abs() < 1e-8 { 1.0 } else { half.sin() / half };
                let (along, across) = (dt * sinc * half.cos(), dt * sinc * half.sin());
                self.state[0] += along * vx - across * vy;
                self.state[2] += across * vx + along * vy;
                self.state[1] = c * vx - s * vy;
                self.state[3] = s * vx + c * vy;
            }
            MotionConfig::Sinusoid(sin) => {
                for (i, axis) in [0, 2].into_iter().enumerate() {
                    let w = std::f64::consts::TAU / sin.period_s[i];
                    let phase = sin.phase_deg[i].to_radians();
                    let v = self.start[axis + 1];
                    self.state[axis] =
                        self.start[axis] + v * t + sin.amplitude_px[i] * ((w * t + phase).sin() - phase.sin());
                    self.state[axis + 1] = v + sin.amplitude_px[i] * w * (w * t + phase).cos();
                }
            }
            MotionConfig::Singer(s) => {
                // Steps between two frames; within each the acceleration is taken as a straight line.
                const SUB_STEPS: usize = 16;
                let h = dt / SUB_STEPS as f64;
                if h > 0.0 {
                    let rho = (-h / s.time_constant_s).exp();
                    let drive = s.acceleration_std_px_per_s2 * (1.0 - rho * rho).sqrt();
                    for _ in 0..SUB_STEPS {
                        for (i, axis) in [0, 2].into_iter().enumerate() {
                            let z: f64 = StandardNormal.sample(&mut self.rng);
                            let (a0, v0) = (self.acceleration[i], self.state[axis + 1]);
                            let a1 = rho * a0 + drive * z;
                            let v1 = v0 + 0.5 * (a0 + a1) * h;
                            self.state[axis] += 0.5 * (v0 + v1) * h;
                            self.state[axis + 1] = v1;
                            self.acceleration[i] = a1;
                        }
                    }
                }
            }
            MotionConfig::WayPoints(points) => self.state = between(points, t),
        }
        self.time_s = t;
        self.state
    }
}

/// The state on the line between way points at `t`; before the first and after the last the target rests there.
fn between(points: &[WayPoint], t: f64) -> Vector4<f64> {
    let rest = |p: &WayPoint| Vector4::new(p.x_px, 0.0, p.y_px, 0.0);
    for w in points.windows(2) {
        let (a, b) = (&w[0], &w[1]);
        if t >= a.time_s && t < b.time_s {
            let span = b.time_s - a.time_s;
            let (vx, vy) = ((b.x_px - a.x_px) / span, (b.y_px - a.y_px) / span);
            let dt = t - a.time_s;
            return Vector4::new(a.x_px + vx * dt, vx, a.y_px + vy * dt, vy);
        }
    }
    match (points.first(), points.last()) {
        (Some(first), Some(last)) => rest(if t < first.time_s { first } else { last }),
        _ => Vector4::zeros(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn path(config: MotionConfig, start: [f64; 4], times: impl Iterator<Item = f64>, run: u64) -> Vec<Vector4<f64>> {
        let mut m = Mover::new(&config, Vector4::from(start), 0.0, Seed::new(9).of_run(run), 0);
        times.map(|t| m.at(t)).collect()
    }

    #[test]
    fn a_quarter_turn_ends_a_quarter_circle_on() {
        let p = path(MotionConfig::Turn(Turn { rate_deg_per_s: 90.0 }), [0.0, 10.0, 0.0, 0.0], [1.0].into_iter(), 0);
        let r = 10.0 / std::f64::consts::FRAC_PI_2;
        assert!((p[0] - Vector4::new(r, 0.0, r, 10.0)).norm() < 1e-12, "{}", p[0]);
    }

    #[test]
    fn velocities_are_the_derivative_of_positions() {
        let h = 1e-6;
        let ways = vec![WayPoint { time_s: 0.0, x_px: 0.0, y_px: 5.0 }, WayPoint { time_s: 2.0, x_px: 8.0, y_px: 1.0 }];
        for c in [
            MotionConfig::Turn(Turn { rate_deg_per_s: 20.0 }),
            MotionConfig::Sinusoid(Sinusoid::default()),
            MotionConfig::WayPoints(ways),
        ] {
            let p = path(c.clone(), [1.0, 2.0, 3.0, -1.0], [1.0, 1.0 + h].into_iter(), 0);
            assert!(((p[1][0] - p[0][0]) / h - p[0][1]).abs() < 1e-4, "{c:?}");
            assert!(((p[1][2] - p[0][2]) / h - p[0][3]).abs() < 1e-4, "{c:?}");
        }
    }

    #[test]
    fn singer_acceleration_has_its_stationary_spread_and_correlation() {
        let (std, tau) = (2.0, 3.0);
        let config = MotionConfig::Singer(Singer { acceleration_std_px_per_s2: std, time_constant_s: tau });
        let (mut var, mut cov, n) = (0.0, 0.0, 4000);
        for run in 0..n {
            let mut m = Mover::new(&config, Vector4::zeros(), 0.0, Seed::new(9).of_run(run), 0);
            m.at(1.0);
            let a = m.acceleration[0];
            m.at(4.0);
            var += m.acceleration[0] * m.acceleration[0] / n as f64;
            cov += a * m.acceleration[0] / n as f64;
        }
        assert!((var / (std * std) - 1.0).abs() < 0.1, "variance {var}");
        assert!((cov / (std * std) - (-3.0 / tau).exp()).abs() < 0.07, "correlation {cov}");
    }

    #[test]
    fn the_same_time_gives_the_same_state() {
        let p = path(
            MotionConfig::ConstantVelocity(ConstantVelocity { acceleration_std_px_per_s2: 1.0 }),
            [0.0; 4],
            [2.0, 2.0].into_iter(),
            0,
        );
        assert_eq!(p[0], p[1]);
    }
}
