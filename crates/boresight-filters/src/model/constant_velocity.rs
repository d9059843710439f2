//! Constant velocity in two axes, driven by white acceleration: discrete or continuous.
//!
//! Source: Y. Bar-Shalom, X. R. Li, T. Kirubarajan, *Estimation with Applications to Tracking and
//! Navigation*, 2001, 6.2.2 (continuous), 6.3.2 (discrete).
//! Symbols: state `[x, vx, y, vy]` (px, px/s); discrete: G = [dt²/2, dt] per axis, acceleration variance q (px²/s⁴)
//! constant over a step; continuous: q [[dt³/3, dt²/2], [dt²/2, dt]] per axis, q a power density (px²/s³).
//! Limits: the discrete form is not the same for one step of 2 dt as for two of dt; the continuous form is: take it for
//! uneven frame times. Cost: [`Model::propagate`] uses the two 2 x 2 blocks, about 60 flops.

use super::{Model, NoiseVisitor};
use crate::check::check_strength;
use crate::{FilterError, Gaussian, Real};
use nalgebra::{Matrix2, SMatrix, SVector};

/// Constant velocity with white acceleration.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ConstantVelocity<T = f64> {
    noise: Noise<T>,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Noise<T> {
    Discrete(T),
    Continuous(T),
    Given(AxisNoise<T>),
}

/// Process covariance [[q00, q01], [q01, q11]] of one axis over one step (px², px²/s, px²/s²).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AxisNoise<T = f64> {
    /// Variance of the position.
    pub q00: T,
    /// Covariance of position and velocity.
    pub q01: T,
    /// Variance of the velocity.
    pub q11: T,
}

impl<T: Real> ConstantVelocity<T> {
    /// Acceleration constant within each step, with standard deviation `acceleration_std` (px/s²).
    /// # Errors
    /// [`FilterError::OutOfRange`] if it is negative or not finite.
    pub fn discrete(acceleration_std: T) -> Result<Self, FilterError> {
        check_strength(acceleration_std, "an acceleration standard deviation of at least 0")?;
        Ok(Self { noise: Noise::Discrete(acceleration_std * acceleration_std) })
    }

    /// White acceleration with power density `density` (px²/s³).
    /// # Errors
    /// [`FilterError::OutOfRange`] if it is negative or not finite.
    pub fn continuous(density: T) -> Result<Self, FilterError> {
        Ok(Self { noise: Noise::Continuous(check_strength(density, "a power density of at least 0")?) })
    }

    /// Noise known as numbers for the one step time that is used; it does not change with dt.
    /// # Errors
    /// [`FilterError::NotPositiveDefinite`] if it is not a covariance.
    pub fn for_step(noise: AxisNoise<T>) -> Result<Self, FilterError> {
        let AxisNoise { q00, q01, q11 } = noise;
        let fine = q00 >= T::zero() && q11 >= T::zero() && q00 <= T::MAX && q11 <= T::MAX;
        if !(fine && q01.abs() <= (q00.sqrt() * q11.sqrt()) * (T::one() + T::EPSILON * T::of(8.0))) {
            return Err(FilterError::NotPositiveDefinite("process noise"));
        }
        Ok(Self { noise: Noise::Given(noise) })
    }

    /// Returns the process covariance of one axis over a step of `dt_s` seconds.
    #[inline]
    pub fn noise_of_step(&self, dt_s: T) -> AxisNoise<T> {
        let (q00, q01, q11) = self.axis_noise(dt_s);
        AxisNoise { q00, q01, q11 }
    }

    /// Returns q00, q01, q11 of one axis.
    #[inline(always)]
    pub(crate) fn axis_noise(&self, dt: T) -> (T, T, T) {
        match self.noise {
            Noise::Given(AxisNoise { q00, q01, q11 }) => (q00, q01, q11),
            Noise::Discrete(q) => {
                let g = dt * dt * T::of(0.5);
                (g * g * q, g * dt * q, dt * dt * q)
            }
            Noise::Continuous(q) => {
                let qdt = q * dt;
                (q * (dt * dt * dt) / T::of(3.0), qdt * dt * T::of(0.5), qdt)
            }
        }
    }
}

impl<T: Real> Model<4, T> for ConstantVelocity<T> {
    const POSITION: [usize; 2] = [0, 2];
    const VELOCITY: Option<[usize; 2]> = Some([1, 3]);
    const AXES: bool = true;

    #[inline]
    fn transition(&self, dt: T, _at: &SVector<T, 4>) -> SMatrix<T, 4, 4> {
        let mut phi = SMatrix::identity();
        phi[(0, 1)] = dt;
        phi[(2, 3)] = dt;
        phi
    }

    #[inline]
    fn inverse_transition(&self, dt: T, at: &SVector<T, 4>) -> Result<SMatrix<T, 4, 4>, FilterError> {
        Ok(self.transition(-dt, at))
    }

    #[inline]
    fn process_noise(&self, dt: T) -> SMatrix<T, 4, 4> {
        let (a, b, c) = self.axis_noise(dt);
        let mut q = SMatrix::zeros();
        for i in [0, 2] {
            q[(i, i)] = a;
            q[(i, i + 1)] = b;
            q[(i + 1, i)] = b;
            q[(i + 1, i + 1)] = c;
        }
        q
    }

    #[inline]
    fn moved(&self, dt: T, x: &SVector<T, 4>) -> SVector<T, 4> {
        SVector::<T, 4>::new(x[0] + dt * x[1], x[1], x[2] + dt * x[3], x[3])
    }

    #[inline]
    fn transition_times(&self, dt: T, _at: &SVector<T, 4>, a: &SMatrix<T, 4, 4>) -> SMatrix<T, 4, 4> {
        let mut out = *a;
        for c in 0..4 {
            out[(0, c)] = a[(0, c)] + dt * a[(1, c)];
            out[(2, c)] = a[(2, c)] + dt * a[(3, c)];
        }
        out
    }

    #[inline]
    fn times_inverse_transition(
        &self,
        dt: T,
        _at: &SVector<T, 4>,
        a: &SMatrix<T, 4, 4>,
    ) -> Result<SMatrix<T, 4, 4>, FilterError> {
        let mut out = *a;
        for r in 0..4 {
            out[(r, 1)] = a[(r, 1)] - dt * a[(r, 0)];
            out[(r, 3)] = a[(r, 3)] - dt * a[(r, 2)];
        }
        Ok(out)
    }

    #[inline(always)]
    fn propagate_axes(&self, dt: T, x: &mut SVector<T, 4>, p: &mut SMatrix<T, 4, 4>) {
        let (q00, q01, q11) = self.axis_noise(dt);
        for axis in 0..2 {
            let moved = x[axis] + dt * x[2 + axis];
            x[axis] = moved;
        }
        // Each 2 x 2 block B of P becomes F B Fᵀ with F = [[1, dt], [0, 1]].
        for axis in 0..2 {
            let (b, c) = (p[(axis, 1)], p[(2 + axis, 1)]);
            let v = b + dt * c;
            p[(axis, 0)] += dt * (b + v) + q00;
            p[(axis, 1)] = v + q01;
            p[(2 + axis, 1)] = c + q11;
        }
    }

    #[inline]
    fn propagate(&self, dt: T, x: &mut SVector<T, 4>, p: &mut SMatrix<T, 4, 4>) {
        *x = self.moved(dt, x);
        let (q00, q01, q11) = self.axis_noise(dt);
        for i in [0, 2] {
            let v = p[(i, i + 1)] + dt * p[(i + 1, i + 1)];
            let more = dt * (p[(i, i + 1)] + v) + q00;
            p[(i, i)] += more;
            p[(i, i + 1)] = v + q01;
            p[(i + 1, i)] = v + q01;
            p[(i + 1, i + 1)] += q11;
        }
        let cross = Matrix2::new(p[(0, 2)], p[(0, 3)], p[(1, 2)], p[(1, 3)]);
        let top = [cross[(0, 0)] + dt * cross[(1, 0)], cross[(0, 1)] + dt * cross[(1, 1)]];
        let block = [top[0] + dt * top[1], top[1], cross[(1, 0)] + dt * cross[(1, 1)], cross[(1, 1)]];
        for (v, (r, c)) in block.into_iter().zip([(0, 2), (0, 3), (1, 2), (1, 3)]) {
            p[(r, c)] = v;
            p[(c, r)] = v;
        }
    }

    #[inline]
    fn with_noise_factor<V: NoiseVisitor<4, T>>(&self, dt: T, visitor: V) -> Result<V::Out, FilterError> {
        let half = T::of(0.5);
        match self.noise {
            Noise::Discrete(q) => {
                let mut g = SMatrix::<T, 4, 2>::zeros();
                g[(0, 0)] = dt * dt * half;
                g[(1, 0)] = dt;
                g[(2, 1)] = dt * dt * half;
                g[(3, 1)] = dt;
                Ok(visitor.visit(&g, &SVector::<T, 2>::repeat(q)))
            }
            Noise::Continuous(q) => {
                // q [[dt³/3, dt²/2], [dt²/2, dt]] = U diag(q dt³/12, q dt) Uᵀ with U01 = dt/2.
                let mut g = SMatrix::<T, 4, 4>::identity();
                g[(0, 1)] = dt * half;
                g[(2, 3)] = dt * half;
                let (a, b) = (q * dt * dt * dt * T::of(1.0 / 12.0), q * dt);
                Ok(visitor.visit(&g, &SVector::<T, 4>::new(a, b, a, b)))
            }
            Noise::Given(AxisNoise { q00, q01, q11 }) => {
                let u = if q11 > T::zero() { q01 / q11 } else { T::zero() };
                let mut g = SMatrix::<T, 4, 4>::identity();
                g[(0, 1)] = u;
                g[(2, 3)] = u;
                let a = (q00 - u * q01).max(T::zero());
                Ok(visitor.visit(&g, &SVector::<T, 4>::new(a, q11, a, q11)))
            }
        }
    }

    fn lift(&self, kinematics: &Gaussian<4, T>) -> Gaussian<4, T> {
        *kinematics
    }

    fn kinematics(&self, belief: &Gaussian<4, T>) -> Gaussian<4, T> {
        *belief
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::linalg::{mul, mul_transposed};
    use crate::model::Dense;

    struct Product;
    impl NoiseVisitor<4, f64> for Product {
        type Out = SMatrix<f64, 4, 4>;
        fn visit<const W: usize>(self, g: &SMatrix<f64, 4, W>, q: &SVector<f64, W>) -> Self::Out {
            g * SMatrix::<f64, W, W>::from_diagonal(q) * g.transpose()
        }
    }

    fn models() -> [ConstantVelocity; 3] {
        let given = AxisNoise { q00: 0.3, q01: -0.1, q11: 0.2 };
        let given = ConstantVelocity::for_step(given).unwrap();
        [ConstantVelocity::discrete(0.7).unwrap(), ConstantVelocity::continuous(0.3).unwrap(), given]
    }

    #[test]
    fn the_factored_noise_multiplies_back_to_q() {
        for m in models() {
            let q = m.process_noise(0.4);
            assert!((m.with_noise_factor(0.4, Product).unwrap() - q).norm() < 1e-16);
        }
    }

    #[test]
    fn the_structured_step_equals_the_dense_one() {
        let a = SMatrix::<f64, 4, 4>::from_fn(|r, c| ((r * 7 + c * 3) % 5) as f64 * 0.3 + f64::from(u8::from(r == c)));
        let p = mul_transposed(&a, &a);
        for m in models() {
            let (mut x1, mut p1) = (SVector::<f64, 4>::new(1.0, -2.0, 3.0, 0.5), p);
            let (mut x2, mut p2) = (x1, p);
            m.propagate(0.3, &mut x1, &mut p1);
            Dense(m).propagate(0.3, &mut x2, &mut p2);
            assert!((x1 - x2).norm() < 1e-14 && (p1 - p2).norm() < 1e-13);
        }
    }

    #[test]
    fn two_continuous_steps_are_one_step_of_both_times() {
        let m = ConstantVelocity::continuous(0.3).unwrap();
        let phi = m.transition(0.5, &SVector::zeros());
        let twice = mul_transposed(&mul(&phi, &m.process_noise(0.2)), &phi) + m.process_noise(0.5);
        assert!((twice - m.process_noise(0.7)).norm() < 1e-15);
    }

    #[test]
    fn a_negative_or_nan_strength_is_refused() {
        for bad in [-1.0, f64::NAN, f64::INFINITY] {
            assert!(ConstantVelocity::discrete(bad).is_err() && ConstantVelocity::continuous(bad).is_err());
        }
    }
}
