//! Velocity that forgets: an Ornstein-Uhlenbeck process dv = -v/τ dt + noise, integrated to position.
//!
//! Source: L. D. Stone, T. L. Corwin, C. A. Barlow, *Bayesian Multiple Target Tracking*, 1999, 2.2 (integrated
//! Ornstein-Uhlenbeck); G. E. Uhlenbeck, L. S. Ornstein, Phys. Rev. 36, 1930.
//! Symbols: state `[x, vx, y, vy]`; β = 1/τ (1/s); σ_v stationary velocity standard deviation (px/s); noise density
//! 2 β σ_v² (px²/s³). Over long gaps the velocity variance stays at σ_v², so a coasting track does not explode:
//! the model for cells, particles, pedestrians. Limits: a target on a long straight course is pulled towards rest.
//! Cost: an exponential, and five quadrature points where the closed form would cancel.

use super::Model;
use super::axes::{both_axes, decay1, noise_integral};
use crate::check::check_strength;
use crate::{FilterError, Gaussian, Real};
use nalgebra::{SMatrix, SVector};

/// Integrated Ornstein-Uhlenbeck velocity.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OrnsteinUhlenbeck<T = f64> {
    beta: T,
    velocity_std: T,
}

impl<T: Real> OrnsteinUhlenbeck<T> {
    /// Velocity of standard deviation `velocity_std` (px/s) remembered for about `memory_s` seconds.
    /// # Errors
    /// [`FilterError::OutOfRange`] if the time is not above 0 or the deviation is negative or not finite.
    pub fn new(velocity_std: T, memory_s: T) -> Result<Self, FilterError> {
        check_strength(velocity_std, "a velocity standard deviation of at least 0")?;
        let beta = T::one() / memory_s;
        if !(memory_s > T::zero() && beta > T::zero() && beta <= T::MAX) {
            return Err(FilterError::OutOfRange("a velocity memory above 0 s"));
        }
        Ok(Self { beta, velocity_std })
    }

    fn response(&self, s: T) -> [T; 2] {
        let z = self.beta * s;
        [s * decay1(z), (-z).exp()]
    }
}

impl<T: Real> Model<4, T> for OrnsteinUhlenbeck<T> {
    const POSITION: [usize; 2] = [0, 2];
    const VELOCITY: Option<[usize; 2]> = Some([1, 3]);
    const AXES: bool = true;

    fn transition(&self, dt: T, _at: &SVector<T, 4>) -> SMatrix<T, 4, 4> {
        let [p, v] = self.response(dt);
        both_axes(&[[T::one(), p], [T::zero(), v]])
    }

    fn process_noise(&self, dt: T) -> SMatrix<T, 4, 4> {
        let b = self.beta;
        let var = self.velocity_std * self.velocity_std;
        let z = b * dt;
        if z < T::of(0.5) {
            return both_axes(&noise_integral(var * b * T::of(2.0), dt, |s| self.response(s)));
        }
        let (one, two) = (T::one(), T::of(2.0));
        let e = (-z).exp();
        let q00 = var / (b * b) * (two * z - T::of(3.0) + T::of(4.0) * e - e * e);
        let q01 = var / b * (one - e) * (one - e);
        let q11 = var * (one - e * e);
        both_axes(&[[q00, q01], [q01, q11]])
    }

    fn lift(&self, kinematics: &Gaussian<4, T>) -> Gaussian<4, T> {
        *kinematics
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_steps_are_one_step_of_both_times() {
        let m = OrnsteinUhlenbeck::new(2.0, 0.7).unwrap();
        let at = SVector::zeros();
        let phi = m.transition(0.9, &at);
        let twice = phi * m.process_noise(0.1) * phi.transpose() + m.process_noise(0.9);
        assert!((twice - m.process_noise(1.0)).norm() < 1e-12 * twice.norm());
    }

    /// Two steps by the same closed form would both be wrong by a constant.
    #[test]
    fn the_closed_form_and_the_integral_agree_where_both_hold() {
        let m = OrnsteinUhlenbeck::new(2.0, 0.7).unwrap();
        let closed = m.process_noise(0.42); // z = 0.6, above the limit of 0.5
        let exact: SMatrix<f64, 4, 4> = both_axes(&noise_integral(2.0 * 4.0 / 0.7, 0.42, |s| m.response(s)));
        assert!((closed - exact).abs().max() < 1e-10 * exact.max(), "closed {closed} integral {exact}");
    }

    #[test]
    fn the_velocity_of_a_long_gap_is_the_stationary_one() {
        let m = OrnsteinUhlenbeck::new(2.0, 0.7).unwrap();
        assert!((m.process_noise(100.0)[(1, 1)] - 4.0_f64).abs() < 1e-12);
    }
}
