//! A velocity that is forgotten, axis by axis: what a time does to an axis of a series.
//!
//! Source: `boresight_filters::model::OrnsteinUhlenbeck`, of which this is one axis.
//! Symbols: σ deviation of the velocity per axis (px/s), τ its memory (s); over times longer than τ it diffuses by D = σ² τ (px²/s).

use super::super::digits::round;
use crate::track::ModelConfig;
use crate::track::filter::OrnsteinUhlenbeckConfig;
use crate::track::filter::constant_velocity::Axis;
use boresight_filters::model::{Model, OrnsteinUhlenbeck};
use nalgebra::SVector;

/// Two motions whose logarithms differ by less are the same to the search.
const NEAR: f64 = 0.05;

/// See the head of the file.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Persistence {
    /// Deviation of the velocity per axis, px/s.
    pub speed_std_px_per_s: f64,
    /// How long a velocity is remembered, s.
    pub memory_s: f64,
}

/// What a time does to an axis.
#[derive(Clone, Copy, Debug)]
pub struct Passed {
    pub dt_s: f64,
    /// Response of position and velocity to the velocity before.
    from_v: [f64; 2],
    /// Process covariance.
    q: [f64; 3],
}

impl Persistence {
    /// What it grows by over times that are longer than its memory: D = σ² τ, px²/s an axis, half the growth of the variance.
    pub fn diffusion_px2_per_s(&self) -> f64 {
        self.speed_std_px_per_s * self.speed_std_px_per_s * self.memory_s
    }

    /// Its model in a configuration, with three digits.
    pub fn model(&self) -> ModelConfig {
        let (speed_std_px_per_s, memory_s) = (round(self.speed_std_px_per_s), round(self.memory_s));
        ModelConfig::OrnsteinUhlenbeck(OrnsteinUhlenbeckConfig { speed_std_px_per_s, memory_s })
    }

    /// Whether another differs by no more than the search tells apart.
    pub fn is_nearly(&self, other: &Self) -> bool {
        let near = |a: f64, b: f64| (a / b).ln().abs() <= NEAR;
        near(self.diffusion_px2_per_s(), other.diffusion_px2_per_s()) && near(self.memory_s, other.memory_s)
    }

    /// What so many seconds do; nothing where the two numbers are none of a model.
    pub fn after(&self, dt_s: f64) -> Passed {
        let Ok(model) = OrnsteinUhlenbeck::new(self.speed_std_px_per_s, self.memory_s) else {
            return Passed { dt_s, from_v: [dt_s, 1.0], q: [0.0; 3] };
        };
        let (phi, q) = (model.transition(dt_s, &SVector::zeros()), model.process_noise(dt_s));
        Passed { dt_s, from_v: [phi[(0, 1)], phi[(1, 1)]], q: [q[(0, 0)], q[(0, 1)], q[(1, 1)]] }
    }
}

impl Passed {
    /// What no time has done.
    pub const NEVER: Self = Self { dt_s: f64::NAN, from_v: [0.0; 2], q: [0.0; 3] };

    /// Predicts an axis.
    pub fn predict(&self, axis: &mut Axis) {
        let [p, v] = self.from_v;
        axis.x += p * axis.v;
        axis.xx += p * (2.0 * axis.xv + p * axis.vv) + self.q[0];
        axis.xv = v * (axis.xv + p * axis.vv) + self.q[1];
        axis.vv = v * v * axis.vv + self.q[2];
        axis.v *= v;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Matrix2, Vector2};

    #[test]
    fn a_step_of_the_series_is_a_step_of_the_model() {
        let p = Persistence { speed_std_px_per_s: 3.0, memory_s: 0.2 };
        let model = OrnsteinUhlenbeck::new(3.0, 0.2).unwrap();
        let mut axis = Axis { x: 1.0, v: 2.0, xx: 0.5, xv: 0.1, vv: 4.0 };
        let (phi, q) = (model.transition(0.3, &SVector::zeros()), model.process_noise(0.3));
        let (phi, q) = (phi.fixed_view::<2, 2>(0, 0), q.fixed_view::<2, 2>(0, 0));
        let (mean, cov) = (phi * Vector2::new(1.0, 2.0), phi * Matrix2::new(0.5, 0.1, 0.1, 4.0) * phi.transpose() + q);
        p.after(0.3).predict(&mut axis);
        let of_axis = [axis.x, axis.v, axis.xx, axis.xv, axis.vv];
        let of_model = [mean[0], mean[1], cov[(0, 0)], cov[(0, 1)], cov[(1, 1)]];
        assert!(of_axis.iter().zip(of_model).all(|(a, b)| (a - b).abs() < 1e-12), "{of_axis:?} {of_model:?}");
    }
}
