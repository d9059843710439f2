//! Motion models: how a target's state moves in a real time step, and where in the state position and velocity stand.
//!
//! A model is data, not a matrix: it makes Phi(dt) and its process noise for the dt of each step. Filters ask for the
//! matrices ([`Model::transition`], [`Model::process_noise`]), for the factored noise ([`Model::with_noise_factor`]),
//! or let the model move the covariance itself ([`Model::propagate`]), where its structure saves work.
//! Symbols: x state N x 1; Phi N x N; Q N x N process covariance of one step; G N x W and q (W): Q = G diag(q) Gᵀ.

mod axes;
mod constant_acceleration;
mod constant_velocity;
mod dense;
mod ornstein_uhlenbeck;
mod random_walk;
mod scaled;
mod singer;
mod turn;

pub use constant_acceleration::ConstantAcceleration;
pub use constant_velocity::{AxisNoise, ConstantVelocity};
pub use dense::Dense;
pub use ornstein_uhlenbeck::OrnsteinUhlenbeck;
pub use random_walk::RandomWalk;
pub use scaled::Scaled;
pub use singer::Singer;
pub use turn::{ConstantTurn, NearlyConstantTurn};

use crate::linalg::{invert, mul, mul_transposed, symmetrize, ud_factorize};
use crate::{FilterError, Gaussian, Measurement, Real};
use nalgebra::{SMatrix, SVector};

/// A motion model with N states.
pub trait Model<const N: usize, T: Real = f64>: Clone {
    /// Where x and y stand in the state.
    const POSITION: [usize; 2];
    /// Where the velocities of x and y stand in the state; `None` for a model without velocity.
    const VELOCITY: Option<[usize; 2]>;
    /// Whether Phi is the same at every state.
    const LINEAR: bool = true;
    /// Whether the state is two independent axes, x in the first half and y, alike, in the second, and the noise factor
    /// has the columns of x first and as many of y after them; Phi of an axis is upper triangular. Filters then skip the
    /// zeros between uncorrelated axes.
    const AXES: bool = false;

    /// Returns Phi for a step of `dt_s` seconds; a nonlinear model linearises at the state `at`.
    fn transition(&self, dt_s: T, at: &SVector<T, N>) -> SMatrix<T, N, N>;

    /// Returns Phi⁻¹ of the same step; a model that knows it (often Phi(-dt)) saves the solving.
    /// # Errors
    /// [`FilterError::NotPositiveDefinite`] if Phi is singular.
    #[inline]
    fn inverse_transition(&self, dt_s: T, at: &SVector<T, N>) -> Result<SMatrix<T, N, N>, FilterError> {
        invert(&self.transition(dt_s, at))
    }

    /// Returns the process covariance Q of a step of `dt_s` seconds.
    fn process_noise(&self, dt_s: T) -> SMatrix<T, N, N>;

    /// Returns the state after `dt_s` seconds without noise.
    #[inline]
    fn moved(&self, dt_s: T, x: &SVector<T, N>) -> SVector<T, N> {
        mul(&self.transition(dt_s, x), x)
    }

    /// Replaces x by f(x) and P by Phi P Phiᵀ + Q.
    #[inline]
    fn propagate(&self, dt_s: T, x: &mut SVector<T, N>, p: &mut SMatrix<T, N, N>) {
        let phi = self.transition(dt_s, x);
        *x = self.moved(dt_s, x);
        *p = mul_transposed(&mul(&phi, p), &phi) + self.process_noise(dt_s);
        symmetrize(p);
    }

    /// Returns Phi A.
    #[inline]
    fn transition_times(&self, dt_s: T, at: &SVector<T, N>, a: &SMatrix<T, N, N>) -> SMatrix<T, N, N> {
        mul(&self.transition(dt_s, at), a)
    }

    /// Returns A Phi⁻¹.
    /// # Errors
    /// As [`Model::inverse_transition`].
    #[inline]
    fn times_inverse_transition(
        &self,
        dt_s: T,
        at: &SVector<T, N>,
        a: &SMatrix<T, N, N>,
    ) -> Result<SMatrix<T, N, N>, FilterError> {
        Ok(mul(a, &self.inverse_transition(dt_s, at)?))
    }

    /// [`Model::propagate`] of two uncorrelated axes side by side: state i of axis a at 2 i + a of x, entry (i, j), i <= j,
    /// of its block at row 2 i + a of column j of P. Only called where [`Model::AXES`] holds.
    #[inline]
    fn propagate_axes(&self, dt_s: T, x: &mut SVector<T, N>, p: &mut SMatrix<T, N, N>) {
        let half = N / 2;
        let (phi, q, before) = (self.transition(dt_s, x), self.process_noise(dt_s), *x);
        // F P of both axes, all entries.
        let mut fp = SMatrix::<T, N, N>::zeros();
        *x = SVector::zeros();
        for i in 0..half {
            for k in 0..half {
                for axis in 0..2 {
                    x[2 * i + axis] += phi[(i, k)] * before[2 * k + axis];
                    for j in 0..half {
                        fp[(2 * i + axis, j)] += phi[(i, k)] * p[(2 * k.min(j) + axis, k.max(j))];
                    }
                }
            }
        }
        for j in 0..half {
            for i in 0..=j {
                for axis in 0..2 {
                    let mut v = q[(i, j)];
                    for k in 0..half {
                        v += fp[(2 * i + axis, k)] * phi[(j, k)];
                    }
                    p[(2 * i + axis, j)] = v;
                }
            }
        }
    }

    /// Hands the factored process noise Q = G diag(q) Gᵀ to the visitor; the default factors Q with W = N.
    /// # Errors
    /// [`FilterError::NotPositiveDefinite`] if Q has a negative direction.
    #[inline]
    fn with_noise_factor<V: NoiseVisitor<N, T>>(&self, dt_s: T, visitor: V) -> Result<V::Out, FilterError> {
        let f =
            ud_factorize(&self.process_noise(dt_s)).map_err(|_| FilterError::NotPositiveDefinite("process noise"))?;
        Ok(visitor.visit(&f.u, &f.d))
    }

    /// Returns a full state for a first belief in position and velocity; further states take the model's own prior.
    fn lift(&self, kinematics: &Gaussian<4, T>) -> Gaussian<N, T>;

    /// Returns position and velocity `[x, vx, y, vy]` of a belief.
    fn kinematics(&self, belief: &Gaussian<N, T>) -> Gaussian<4, T> {
        let v = Self::VELOCITY;
        let at = [Some(Self::POSITION[0]), v.map(|v| v[0]), Some(Self::POSITION[1]), v.map(|v| v[1])];
        let mut k = Gaussian { mean: SVector::zeros(), cov: SMatrix::zeros() };
        for (r, from_r) in at.iter().enumerate() {
            let Some(i) = *from_r else { continue };
            k.mean[r] = belief.mean[i];
            for (c, from_c) in at.iter().enumerate() {
                let Some(j) = *from_c else { continue };
                k.cov[(r, c)] = belief.cov[(i, j)];
            }
        }
        k
    }
}

/// Receives a factored process noise of any width W (see [`Model::with_noise_factor`]).
pub trait NoiseVisitor<const N: usize, T> {
    /// What the visit returns.
    type Out;
    /// Uses G (N x W) and q (W variances).
    fn visit<const W: usize>(self, g: &SMatrix<T, N, W>, q: &SVector<T, W>) -> Self::Out;
}

/// Returns the kinematic belief of one position measurement and a velocity of unknown direction.
/// # Errors
/// [`FilterError`] if the measurement is not finite or `velocity_std` is not positive and finite.
pub fn kinematics_from_point<T: Real>(m: &Measurement<T>, velocity_std: T) -> Result<Gaussian<4, T>, FilterError> {
    crate::check::check_measurement(m)?;
    if !(velocity_std > T::zero() && velocity_std <= T::MAX.sqrt()) {
        return Err(FilterError::OutOfRange("a velocity standard deviation above 0"));
    }
    let mut k = Gaussian { mean: SVector::zeros(), cov: SMatrix::zeros() };
    k.mean[0] = m.position[0];
    k.mean[2] = m.position[1];
    for (r, i) in [(0, 0), (1, 2)] {
        for (c, j) in [(0, 0), (1, 2)] {
            k.cov[(i, j)] = m.cov[(r, c)];
        }
    }
    k.cov[(1, 1)] = velocity_std * velocity_std;
    k.cov[(3, 3)] = velocity_std * velocity_std;
    Ok(k)
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Matrix2, Vector2};

    #[test]
    fn a_velocity_deviation_out_of_its_range_is_refused() {
        let m = Measurement { position: Vector2::new(1.0, 2.0), cov: Matrix2::identity() };
        for wrong in [0.0, -1.0, f64::NAN, f64::INFINITY, 1e300] {
            assert!(kinematics_from_point(&m, wrong).is_err(), "{wrong}");
        }
        assert_eq!(kinematics_from_point(&m, 3.0).unwrap().cov[(1, 1)], 9.0);
    }
}
