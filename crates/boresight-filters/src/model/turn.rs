//! Turns: a constant known rate (4 states, linear), and a nearly constant unknown rate (5 states, nonlinear).
//!
//! Source: Bar-Shalom, Li, Kirubarajan 2001, 11.7.1-11.7.2. Positive rates turn x towards y (clockwise on a screen
//! whose y points down). Symbols: state `[x, vx, y, vy]` or `[x, vx, y, vy, ω]` (px, px/s, rad/s); white acceleration
//! q (px²/s³) per axis; the rate diffuses by q_ω (rad²/s³).
//! Differs from it: the noise is that of [`ConstantVelocity`] in each axis (continuous): the exact covariance of a turn
//! differs by terms of (ω dt)², which the tuning of q swallows.
//! Limits: [`NearlyConstantTurn`] is linearised (or taken by sigma points, [`crate::Ukf`]): ω dt below about 1 rad.
//! Cost: one sine and cosine a step; dense 4 x 4 or 5 x 5 products.

use super::{ConstantVelocity, Model, NoiseVisitor};
use crate::check::check_strength;
use crate::{FilterError, Gaussian, Real};
use nalgebra::{SMatrix, SVector};

/// Returns sin z / z and (1 - cos z)/z, good at z = 0.
fn sinc_cosc<T: Real>(z: T) -> (T, T) {
    if z.abs() < T::of(1e-2) {
        let z2 = z * z;
        let s = T::one()
            - z2 * T::of(1.0 / 6.0) * (T::one() - z2 * T::of(1.0 / 20.0) * (T::one() - z2 * T::of(1.0 / 42.0)));
        let c = z * T::of(0.5) * (T::one() - z2 * T::of(1.0 / 12.0) * (T::one() - z2 * T::of(1.0 / 30.0)));
        (s, c)
    } else {
        // 1 - cos z = 2 sin²(z/2) does not cancel.
        let h = (z * T::of(0.5)).sin();
        (z.sin() / z, T::of(2.0) * h * h / z)
    }
}

/// Derivatives of dt sinc(ω dt) and dt cosc(ω dt) by ω.
fn rate_derivatives<T: Real>(w: T, dt: T) -> (T, T) {
    let z = w * dt;
    let dt2 = dt * dt;
    if z.abs() < T::of(1e-2) {
        (-z * dt2 * T::of(1.0 / 3.0), dt2 * (T::of(0.5) - z * z * T::of(1.0 / 8.0)))
    } else {
        let (s, c) = sinc_cosc(z);
        (dt2 * (z.cos() - s) / z, dt2 * (z.sin() - c) / z)
    }
}

fn turned<T: Real>(w: T, dt: T) -> SMatrix<T, 4, 4> {
    let z = w * dt;
    let (s, c) = sinc_cosc(z);
    let (sin, cos) = (z.sin(), z.cos());
    let (o, n) = (T::one(), T::zero());
    SMatrix::<T, 4, 4>::new(o, dt * s, n, -dt * c, n, cos, n, -sin, n, dt * c, o, dt * s, n, sin, n, cos)
}

/// Turn of a known constant rate; rate 0 is constant velocity. The building block of an [`crate::Imm`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ConstantTurn<T = f64> {
    rate: T,
    noise: ConstantVelocity<T>,
}

impl<T: Real> ConstantTurn<T> {
    /// Turn of `rate_rad_per_s` with white acceleration of power density `density` (px²/s³).
    /// # Errors
    /// [`FilterError`] if the rate is not finite or the density is negative or not finite.
    pub fn new(rate_rad_per_s: T, density: T) -> Result<Self, FilterError> {
        if !(rate_rad_per_s.abs() <= T::MAX) {
            return Err(FilterError::NotFinite("the turn rate"));
        }
        Ok(Self { rate: rate_rad_per_s, noise: ConstantVelocity::continuous(density)? })
    }
}

impl<T: Real> Model<4, T> for ConstantTurn<T> {
    const POSITION: [usize; 2] = [0, 2];
    const VELOCITY: Option<[usize; 2]> = Some([1, 3]);

    fn transition(&self, dt: T, _at: &SVector<T, 4>) -> SMatrix<T, 4, 4> {
        turned(self.rate, dt)
    }

    fn inverse_transition(&self, dt: T, _at: &SVector<T, 4>) -> Result<SMatrix<T, 4, 4>, FilterError> {
        Ok(turned(self.rate, -dt))
    }

    fn process_noise(&self, dt: T) -> SMatrix<T, 4, 4> {
        self.noise.process_noise(dt)
    }

    fn with_noise_factor<V: NoiseVisitor<4, T>>(&self, dt: T, visitor: V) -> Result<V::Out, FilterError> {
        self.noise.with_noise_factor(dt, visitor)
    }

    fn lift(&self, kinematics: &Gaussian<4, T>) -> Gaussian<4, T> {
        *kinematics
    }
}

/// Turn whose rate is a state of its own.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NearlyConstantTurn<T = f64> {
    noise: ConstantVelocity<T>,
    rate_density: T,
    start_rate_std: T,
}

impl<T: Real> NearlyConstantTurn<T> {
    /// White acceleration of power density `density` (px²/s³), a turn rate that diffuses by `rate_density` (rad²/s³)
    /// and starts at 0 with standard deviation `start_rate_std` (rad/s).
    /// # Errors
    /// [`FilterError::OutOfRange`] if one is negative or not finite.
    pub fn new(density: T, rate_density: T, start_rate_std: T) -> Result<Self, FilterError> {
        Ok(Self {
            noise: ConstantVelocity::continuous(density)?,
            rate_density: check_strength(rate_density, "a turn-rate density of at least 0")?,
            start_rate_std: check_strength(start_rate_std, "a turn-rate standard deviation of at least 0")?,
        })
    }
}

impl<T: Real> Model<5, T> for NearlyConstantTurn<T> {
    const POSITION: [usize; 2] = [0, 2];
    const VELOCITY: Option<[usize; 2]> = Some([1, 3]);
    const LINEAR: bool = false;

    fn transition(&self, dt: T, at: &SVector<T, 5>) -> SMatrix<T, 5, 5> {
        let w = at[4];
        let f = turned(w, dt);
        let mut phi = SMatrix::<T, 5, 5>::identity();
        for r in 0..4 {
            for c in 0..4 {
                phi[(r, c)] = f[(r, c)];
            }
        }
        let (ds, dc) = rate_derivatives(w, dt);
        let (vx, vy) = (at[1], at[3]);
        let (sin, cos) = ((w * dt).sin() * dt, (w * dt).cos() * dt);
        phi[(0, 4)] = ds * vx - dc * vy;
        phi[(1, 4)] = -sin * vx - cos * vy;
        phi[(2, 4)] = dc * vx + ds * vy;
        phi[(3, 4)] = cos * vx - sin * vy;
        phi
    }

    fn moved(&self, dt: T, x: &SVector<T, 5>) -> SVector<T, 5> {
        let next = turned(x[4], dt) * x.fixed_rows::<4>(0);
        SVector::<T, 5>::new(next[0], next[1], next[2], next[3], x[4])
    }

    fn process_noise(&self, dt: T) -> SMatrix<T, 5, 5> {
        let (a, b, c) = self.noise.axis_noise(dt);
        let mut q = SMatrix::zeros();
        for i in [0, 2] {
            q[(i, i)] = a;
            q[(i, i + 1)] = b;
            q[(i + 1, i)] = b;
            q[(i + 1, i + 1)] = c;
        }
        q[(4, 4)] = self.rate_density * dt;
        q
    }

    fn lift(&self, k: &Gaussian<4, T>) -> Gaussian<5, T> {
        let mut b = Gaussian { mean: SVector::zeros(), cov: SMatrix::zeros() };
        for r in 0..4 {
            b.mean[r] = k.mean[r];
            for c in 0..4 {
                b.cov[(r, c)] = k.cov[(r, c)];
            }
        }
        b.cov[(4, 4)] = self.start_rate_std * self.start_rate_std;
        b
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_full_circle_comes_back() {
        let m = ConstantTurn::new(core::f64::consts::TAU, 0.1).unwrap();
        let x = SVector::<f64, 4>::new(1.0, 2.0, 3.0, 4.0);
        assert!((m.moved(1.0, &x) - x).norm() < 1e-14);
    }

    #[test]
    fn a_new_track_turns_by_nothing_with_the_deviation_given() {
        let m = NearlyConstantTurn::new(0.1, 0.1, 0.3).unwrap();
        let k = Gaussian { mean: SVector::<f64, 4>::new(1.0, 2.0, 3.0, 4.0), cov: SMatrix::<f64, 4, 4>::identity() };
        let b = m.lift(&k);
        assert_eq!((b.mean[4], b.cov[(3, 3)], b.cov[(0, 4)]), (0.0, 1.0, 0.0));
        assert!((b.cov[(4, 4)] - 0.09).abs() < 1e-15);
    }

    #[test]
    fn the_jacobian_is_the_slope_of_the_motion() {
        let m = NearlyConstantTurn::new(0.1, 0.1, 0.1).unwrap();
        for w in [0.0, 1e-3, 0.4, -2.0] {
            let x = SVector::<f64, 5>::new(1.0, 2.0, 3.0, -4.0, w);
            let j = m.transition(0.7, &x);
            for c in 0..5 {
                let mut d = SVector::<f64, 5>::zeros();
                d[c] = 1e-5;
                let slope = (m.moved(0.7, &(x + d)) - m.moved(0.7, &(x - d))) / 2e-5;
                assert!((slope - j.column(c)).norm() < 1e-8, "rate {w}, column {c}: {slope} {}", j.column(c));
            }
        }
    }

    #[test]
    fn the_small_angle_series_meets_the_closed_form() {
        for z in [0.009_999, 0.010_001] {
            let (s, c) = sinc_cosc::<f64>(z);
            assert!((s - libm::sin(z) / z).abs() < 1e-15 && (c - (1.0 - libm::cos(z)) / z).abs() < 1e-13);
        }
    }
}
