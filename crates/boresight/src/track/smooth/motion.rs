//! How targets move between the rows of a finished table: as the filter did that made it.
//!
//! Source: the models of [`boresight_filters::model`]; each call is the model's own.
//! Limits: those two that the state `[x, vx, y, vy]` of a table's row tells all of.

use crate::Result;
use crate::track::AccelerationNoise;
use crate::track::filter::OrnsteinUhlenbeckConfig;
use boresight_filters::model::{ConstantVelocity, Model, NoiseVisitor, OrnsteinUhlenbeck};
use boresight_filters::{FilterError, Gaussian};
use nalgebra::{SMatrix, SVector};

/// See the head of the file.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(in crate::track) enum RowModel {
    Driven(ConstantVelocity),
    Forgetful(OrnsteinUhlenbeck),
}

/// Calls the same function of the model that it is.
macro_rules! of {
    ($motion:expr, $m:ident => $call:expr) => {
        match $motion {
            RowModel::Driven($m) => $call,
            RowModel::Forgetful($m) => $call,
        }
    };
}

impl RowModel {
    /// Velocities that are forgotten if that is given, else driven by a white acceleration.
    /// # Errors
    /// A value out of its range.
    pub fn of(acceleration: AccelerationNoise, forgetting: Option<&OrnsteinUhlenbeckConfig>) -> Result<Self> {
        Ok(match forgetting {
            Some(c) => Self::Forgetful(OrnsteinUhlenbeck::new(c.speed_std_px_per_s, c.memory_s)?),
            None => Self::Driven(acceleration.constant_velocity(1.0)?),
        })
    }
}

impl Model<4> for RowModel {
    const POSITION: [usize; 2] = <ConstantVelocity as Model<4>>::POSITION;
    const VELOCITY: Option<[usize; 2]> = <ConstantVelocity as Model<4>>::VELOCITY;
    const AXES: bool = <ConstantVelocity as Model<4>>::AXES && <OrnsteinUhlenbeck as Model<4>>::AXES;

    fn transition(&self, dt_s: f64, at: &SVector<f64, 4>) -> SMatrix<f64, 4, 4> {
        of!(self, m => m.transition(dt_s, at))
    }

    fn inverse_transition(&self, dt_s: f64, at: &SVector<f64, 4>) -> Result<SMatrix<f64, 4, 4>, FilterError> {
        of!(self, m => m.inverse_transition(dt_s, at))
    }

    fn process_noise(&self, dt_s: f64) -> SMatrix<f64, 4, 4> {
        of!(self, m => m.process_noise(dt_s))
    }

    fn propagate(&self, dt_s: f64, x: &mut SVector<f64, 4>, p: &mut SMatrix<f64, 4, 4>) {
        of!(self, m => m.propagate(dt_s, x, p));
    }

    fn propagate_axes(&self, dt_s: f64, x: &mut SVector<f64, 4>, p: &mut SMatrix<f64, 4, 4>) {
        of!(self, m => m.propagate_axes(dt_s, x, p));
    }

    fn with_noise_factor<V: NoiseVisitor<4, f64>>(&self, dt_s: f64, visitor: V) -> Result<V::Out, FilterError> {
        of!(self, m => m.with_noise_factor(dt_s, visitor))
    }

    fn lift(&self, kinematics: &Gaussian<4>) -> Gaussian<4> {
        *kinematics
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Timestamp;
    use crate::track::smooth::{SmoothConfig, filter_track, smooth_track};
    use nalgebra::{Matrix4, Vector4};
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use rand_distr::StandardNormal;

    #[test]
    fn a_table_whose_velocities_are_forgotten_is_smoothed_by_its_own_law() {
        let forgetting = OrnsteinUhlenbeckConfig { speed_std_px_per_s: 30.0, memory_s: 0.05 };
        let law = OrnsteinUhlenbeck::new(30.0, 0.05).unwrap();
        let config = SmoothConfig { forgetting: Some(forgetting), ..SmoothConfig::default() };
        let mut rng = ChaCha8Rng::seed_from_u64(23);
        let mut normal = || rng.sample::<f64, _>(StandardNormal);
        let (mut nees, mut n, mut filtered, mut smoothed) = (0.0, 0.0, 0.0, 0.0);
        for _ in 0..40 {
            let dt = 0.04;
            let root = law.process_noise(dt).cholesky().unwrap().l();
            let mut truth = Vector4::new(50.0, 30.0 * normal(), 50.0, 30.0 * normal());
            let (mut times, mut rows, mut truths) = (Vec::new(), Vec::new(), Vec::new());
            for k in 0..60 {
                let at = truth + Vector4::new(0.5 * normal(), 0.0, 0.5 * normal(), 0.0);
                let mean = Vector4::new(at[0], 0.0, at[2], 0.0);
                times.push(Timestamp::from_secs_f64(f64::from(k) * dt));
                rows.push(Gaussian { mean, cov: Matrix4::from_diagonal(&Vector4::new(0.25, 1.0, 0.25, 1.0)) });
                truths.push(truth);
                truth = law.transition(dt, &truth) * truth + root * Vector4::from_fn(|_, _| normal());
            }
            filter_track(&times, &mut rows, 30.0, &config).unwrap();
            let before = rows.clone();
            assert_eq!(smooth_track(&times, &mut rows, &config).unwrap(), 1, "every row follows");
            for k in [20, 40] {
                let (e, b) = (rows[k].mean - truths[k], before[k].mean - truths[k]);
                filtered += b[0] * b[0] + b[2] * b[2];
                smoothed += e[0] * e[0] + e[2] * e[2];
                nees += (e.transpose() * rows[k].cov.try_inverse().unwrap() * e)[0] / 4.0;
                n += 1.0;
            }
        }
        assert!(smoothed < 0.9 * filtered, "{smoothed} {filtered}");
        // The mean of 80 samples of χ²(4)/4, 99.9 %.
        assert!((nees / n - 1.0).abs() < 3.3 * f64::sqrt(2.0 / (4.0 * n)), "NEES/4 {}", nees / n);
    }
}
