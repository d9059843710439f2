//! Constant acceleration in two axes, driven by white jerk (continuous) or by acceleration steps (discrete).
//!
//! Source: Y. Bar-Shalom, X. R. Li, T. Kirubarajan, *Estimation with Applications to Tracking and Navigation*, 2001,
//! 6.2.3 (continuous white jerk), 6.3.3 (discrete, Wiener sequence acceleration).
//! Symbols: state `[x, vx, ax, y, vy, ay]` (px, px/s, px/s²); discrete: G = [dt²/2, dt, 1], q variance of the step of the
//! acceleration (px²/s⁴); continuous: q power density of the jerk (px²/s⁵).
//! Limits: follows manoeuvres, at two to four times the noise of a constant-velocity filter in straight flight.
//! Cost: two dense 3 x 3 blocks, about 100 flops to predict.

use super::axes::both_axes;
use super::{Model, NoiseVisitor};
use crate::check::check_strength;
use crate::{FilterError, Gaussian, Real};
use nalgebra::{SMatrix, SVector};

/// Constant acceleration with white jerk or white acceleration steps.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ConstantAcceleration<T = f64> {
    noise: Noise<T>,
    start_std: T,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Noise<T> {
    Discrete(T),
    Continuous(T),
}

impl<T: Real> ConstantAcceleration<T> {
    /// The acceleration takes a step of standard deviation `step_std` (px/s²) each frame; `start_std` (px/s²) is how
    /// well the acceleration of a new track is known.
    /// # Errors
    /// [`FilterError::OutOfRange`] if one is negative or not finite.
    pub fn discrete(step_std: T, start_std: T) -> Result<Self, FilterError> {
        check_strength(step_std, "an acceleration step of at least 0")?;
        check_strength(start_std, "an acceleration standard deviation of at least 0")?;
        Ok(Self { noise: Noise::Discrete(step_std * step_std), start_std })
    }

    /// White jerk of power density `density` (px²/s⁵); `start_std` as in [`ConstantAcceleration::discrete`].
    /// # Errors
    /// [`FilterError::OutOfRange`] if one is negative or not finite.
    pub fn continuous(density: T, start_std: T) -> Result<Self, FilterError> {
        check_strength(density, "a power density of at least 0")?;
        check_strength(start_std, "an acceleration standard deviation of at least 0")?;
        Ok(Self { noise: Noise::Continuous(density), start_std })
    }
}

/// Widens `[x, vx, y, vy]` to `[x, vx, ax, y, vy, ay]` with zero mean acceleration.
pub(crate) fn lift_to_acceleration<T: Real>(k: &Gaussian<4, T>, start_std: T) -> Gaussian<6, T> {
    let at = [0, 1, 3, 4];
    let mut b = Gaussian { mean: SVector::zeros(), cov: SMatrix::zeros() };
    for r in 0..4 {
        b.mean[at[r]] = k.mean[r];
        for c in 0..4 {
            b.cov[(at[r], at[c])] = k.cov[(r, c)];
        }
    }
    for i in [2, 5] {
        b.cov[(i, i)] = start_std * start_std;
    }
    b
}

impl<T: Real> Model<6, T> for ConstantAcceleration<T> {
    const POSITION: [usize; 2] = [0, 3];
    const VELOCITY: Option<[usize; 2]> = Some([1, 4]);
    const AXES: bool = true;

    fn transition(&self, dt: T, _at: &SVector<T, 6>) -> SMatrix<T, 6, 6> {
        let (o, z) = (T::one(), T::zero());
        both_axes(&[[o, dt, dt * dt * T::of(0.5)], [z, o, dt], [z, z, o]])
    }

    fn inverse_transition(&self, dt: T, at: &SVector<T, 6>) -> Result<SMatrix<T, 6, 6>, FilterError> {
        Ok(self.transition(-dt, at))
    }

    fn process_noise(&self, dt: T) -> SMatrix<T, 6, 6> {
        let block = match self.noise {
            Noise::Discrete(q) => {
                let g = [dt * dt * T::of(0.5), dt, T::one()];
                g.map(|a| g.map(|b| q * a * b))
            }
            Noise::Continuous(q) => {
                let p = |n: i32, d: f64| q * dt.powi(n) * T::of(1.0 / d);
                [
                    [p(5, 20.0), p(4, 8.0), p(3, 6.0)],
                    [p(4, 8.0), p(3, 3.0), p(2, 2.0)],
                    [p(3, 6.0), p(2, 2.0), p(1, 1.0)],
                ]
            }
        };
        both_axes(&block)
    }

    fn with_noise_factor<V: NoiseVisitor<6, T>>(&self, dt: T, visitor: V) -> Result<V::Out, FilterError> {
        match self.noise {
            Noise::Discrete(q) => {
                let mut g = SMatrix::<T, 6, 2>::zeros();
                for axis in 0..2 {
                    g[(3 * axis, axis)] = dt * dt * T::of(0.5);
                    g[(3 * axis + 1, axis)] = dt;
                    g[(3 * axis + 2, axis)] = T::one();
                }
                Ok(visitor.visit(&g, &SVector::<T, 2>::repeat(q)))
            }
            // U-D factors of the block above in closed form.
            Noise::Continuous(q) => {
                let (o, z, half) = (T::one(), T::zero(), T::of(0.5));
                let g: SMatrix<T, 6, 6> =
                    both_axes(&[[o, dt * half, dt * dt / T::of(6.0)], [z, o, dt * half], [z, z, o]]);
                let d = [q * dt.powi(5) / T::of(720.0), q * dt.powi(3) / T::of(12.0), q * dt];
                Ok(visitor.visit(&g, &SVector::<T, 6>::new(d[0], d[1], d[2], d[0], d[1], d[2])))
            }
        }
    }

    fn lift(&self, kinematics: &Gaussian<4, T>) -> Gaussian<6, T> {
        lift_to_acceleration(kinematics, self.start_std)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// p + v dt + a dt²/2, v + a dt, a, with dt = 1/4 s.
    #[test]
    fn a_step_is_that_of_a_constant_acceleration() {
        let m = ConstantAcceleration::<f64>::continuous(0.4, 1.0).unwrap();
        let at = SVector::from([1.0, 2.0, 16.0, -3.0, 4.0, -32.0]);
        assert_eq!(m.moved(0.25, &at), SVector::from([2.0, 6.0, 16.0, -3.0, -4.0, -32.0]));
        assert_eq!(m.inverse_transition(0.25, &at).unwrap() * m.moved(0.25, &at), at);
    }

    #[test]
    fn two_steps_of_white_jerk_are_one_step_of_both_times() {
        let m = ConstantAcceleration::<f64>::continuous(0.4, 1.0).unwrap();
        let phi = m.transition(0.7, &SVector::zeros());
        let twice = phi * m.process_noise(0.2) * phi.transpose() + m.process_noise(0.7);
        assert!((twice - m.process_noise(0.9)).norm() < 1e-14 * twice.norm());
    }

    /// dt²/2, dt, 1 of one jump of the acceleration, times its variance 9.
    #[test]
    fn a_jump_of_the_acceleration_moves_all_three_states() {
        let q = ConstantAcceleration::<f64>::discrete(3.0, 1.0).unwrap().process_noise(0.5);
        for (i, j, want) in
            [(0, 0, 9.0 / 64.0), (0, 1, 9.0 / 16.0), (1, 2, 4.5), (5, 5, 9.0), (3, 5, 1.125), (0, 3, 0.0)]
        {
            assert_eq!(q[(i, j)], want, "{i} {j}");
        }
    }
}
