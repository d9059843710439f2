//! Singer's manoeuvre model: acceleration is a zero-mean process with memory, correlation e^(-|dt|/τ).
//!
//! Source: R. A. Singer, "Estimating optimal tracking filter performance for manned maneuvering targets", IEEE
//! Trans. AES 6(4), 1970; Bar-Shalom, Li, Kirubarajan 2001, 8.2.3.
//! Differs from it: the noise of a step is integrated numerically for dt < τ/4, where the closed form cancels.
//! Symbols: state `[x, vx, ax, y, vy, ay]`; α = 1/τ (1/s); σ_m acceleration standard deviation (px/s²).
//! Limits: the mean acceleration is 0: a long turn is followed with a lag. τ → ∞ is constant acceleration, τ → 0
//! constant velocity with white acceleration of density 2 σ_m² τ.
//! Cost: an exponential, and five quadrature points where the closed form would cancel.

use super::Model;
use super::axes::{both_axes, decay1, decay2, noise_integral};
use super::constant_acceleration::lift_to_acceleration;
use crate::check::check_strength;
use crate::{FilterError, Gaussian, Real};
use nalgebra::{SMatrix, SVector};

/// Singer's model.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Singer<T = f64> {
    alpha: T,
    acceleration_std: T,
}

impl<T: Real> Singer<T> {
    /// Acceleration of standard deviation `acceleration_std` (px/s²) that lasts for about `manoeuvre_s` seconds.
    /// # Errors
    /// [`FilterError::OutOfRange`] if the time is not above 0 or the deviation is negative or not finite.
    pub fn new(acceleration_std: T, manoeuvre_s: T) -> Result<Self, FilterError> {
        check_strength(acceleration_std, "an acceleration standard deviation of at least 0")?;
        let alpha = T::one() / manoeuvre_s;
        if !(manoeuvre_s > T::zero() && alpha > T::zero() && alpha <= T::MAX) {
            return Err(FilterError::OutOfRange("a manoeuvre time above 0 s"));
        }
        Ok(Self { alpha, acceleration_std })
    }

    /// Response of (position, velocity, acceleration) to an acceleration s seconds ago.
    fn response(&self, s: T) -> [T; 3] {
        let z = self.alpha * s;
        [s * s * decay2(z), s * decay1(z), (-z).exp()]
    }
}

impl<T: Real> Model<6, T> for Singer<T> {
    const POSITION: [usize; 2] = [0, 3];
    const VELOCITY: Option<[usize; 2]> = Some([1, 4]);
    const AXES: bool = true;

    fn transition(&self, dt: T, _at: &SVector<T, 6>) -> SMatrix<T, 6, 6> {
        let (o, z) = (T::one(), T::zero());
        let [p, v, a] = self.response(dt);
        both_axes(&[[o, dt, p], [z, o, v], [z, z, a]])
    }

    fn process_noise(&self, dt: T) -> SMatrix<T, 6, 6> {
        let a = self.alpha;
        let var = self.acceleration_std * self.acceleration_std;
        let z = a * dt;
        // Below, the closed form loses z⁻⁵ ulp; above, the quadrature more than 1e-12.
        if z < T::of(0.25) {
            return both_axes(&noise_integral(var * a * T::of(2.0), dt, |s| self.response(s)));
        }
        let (one, two) = (T::one(), T::of(2.0));
        let (e, e2) = ((-z).exp(), (-z * two).exp());
        let q00 =
            var / a.powi(4) * (one - e2 + two * z + z * z * z * T::of(2.0 / 3.0) - two * z * z - T::of(4.0) * z * e);
        let q01 = var / a.powi(3) * (e2 + one - two * e + two * z * e - two * z + z * z);
        let q02 = var / a.powi(2) * (one - e2 - two * z * e);
        let q11 = var / a.powi(2) * (T::of(4.0) * e - T::of(3.0) - e2 + two * z);
        let q12 = var / a * (e2 + one - two * e);
        let q22 = var * (one - e2);
        both_axes(&[[q00, q01, q02], [q01, q11, q12], [q02, q12, q22]])
    }

    fn lift(&self, kinematics: &Gaussian<4, T>) -> Gaussian<6, T> {
        lift_to_acceleration(kinematics, self.acceleration_std)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_closed_form_and_the_integral_agree_where_both_hold() {
        let m = Singer::new(2.0_f64, 0.999_999_99).unwrap();
        let below = Singer::new(2.0_f64, 1.000_000_01).unwrap();
        let (a, b) = (m.process_noise(0.25), below.process_noise(0.25));
        assert!((a - b).norm() < 1e-7 * a.norm(), "closed {a} integral {b}");
        // Relative to each entry, with the smooth dependence on τ taken out.
        let exact = noise_integral(2.0 * 4.0 * m.alpha, 0.25, |s| m.response(s));
        for r in 0..3 {
            for c in 0..3 {
                assert!((a[(r, c)] - exact[r][c]).abs() < 1e-11 * exact[r][c]);
            }
        }
    }

    #[test]
    fn two_steps_are_one_step_of_both_times() {
        let m = Singer::new(2.0, 3.0).unwrap();
        let at = SVector::zeros();
        let phi = m.transition(2.0, &at);
        let twice = phi * m.process_noise(0.3) * phi.transpose() + m.process_noise(2.0);
        assert!((twice - m.process_noise(2.3)).norm() < 1e-12 * twice.norm());
        assert!((phi * m.transition(0.3, &at) - m.transition(2.3, &at)).norm() < 1e-14);
    }
}
