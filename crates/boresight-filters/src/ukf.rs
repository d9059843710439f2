//! Unscented Kalman filter: nonlinear motion and sensors through 2N + 1 sigma points, no Jacobians.
//!
//! Source: S. J. Julier, J. K. Uhlmann, "Unscented filtering and nonlinear estimation", Proc. IEEE 92(3), 2004; scaled
//! weights as in E. A. Wan, R. van der Merwe, 2000 with α = 1, β = 0, κ chosen by the caller (default 3 - N, at least 0).
//! Symbols: χ_i = x ± column i of sqrt((N + κ) P), L Lᵀ = P by Cholesky; w_0 = κ/(N + κ), w_i = 1/(2(N + κ)).
//! Differs from it: κ is kept at 0 or above, so no weight is negative, and P - K S Kᵀ is summed as the spread of the points
//! χ - K h(χ) with K R Kᵀ: covariances stay positive semi-definite.
//! Linear models and position measurements give the Kalman answer. Cost: 2N + 1 motions, N³ for each root and product.
//! Limits: a posterior bent within one standard deviation (range known far better than azimuth) is still no Gaussian.

use crate::check::{check_belief, check_dt, check_measurement};
use crate::linalg::{Cholesky, symmetrize};
use crate::linear::LinearUpdate;
use crate::mixture::mixture_update;
use crate::model::Model;
use crate::real::all_finite;
use crate::sensor::{Position, Sensor};
use crate::{FilterError, Gaussian, GaussianFilter, Measurement, Real, Start, Weighted};
use nalgebra::{Matrix2, SMatrix, SVector};

/// Unscented Kalman filter of a model with N states.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ukf<M, const N: usize, T: Real = f64> {
    model: M,
    belief: Gaussian<N, T>,
    kappa: T,
}

impl<M: Model<N, T>, const N: usize, T: Real> Ukf<M, N, T> {
    /// Returns the filter with another spread κ of the sigma points.
    /// # Errors
    /// [`FilterError::OutOfRange`] if it is negative or not finite.
    pub fn with_kappa(mut self, kappa: T) -> Result<Self, FilterError> {
        if !(kappa >= T::zero() && kappa <= T::MAX) {
            return Err(FilterError::OutOfRange("a spread kappa of at least 0"));
        }
        self.kappa = kappa;
        Ok(self)
    }

    /// Returns centre, columns of sqrt((N + κ) P), centre weight and side weight.
    fn spread(&self) -> Result<(SMatrix<T, N, N>, T, T), FilterError> {
        let n = T::of(N as f64) + self.kappa;
        let l = Cholesky::semi_definite(&self.belief.cov, "the state covariance")?.l;
        Ok((l * n.sqrt(), self.kappa / n, T::of(0.5) / n))
    }

    /// Corrects by a nonlinear sensor.
    /// # Errors
    /// [`FilterError`] for NaN, infinity or a singular innovation; the state is then unchanged.
    pub fn correct_by<S: Sensor<N, K, T>, const K: usize>(
        &mut self,
        sensor: &S,
        z: &SVector<T, K>,
        r: &SMatrix<T, K, K>,
    ) -> Result<LinearUpdate<N, K, T>, FilterError> {
        if !(all_finite(z) & all_finite(r)) {
            return Err(FilterError::NotFinite("the measurement"));
        }
        let (l, w0, w) = self.spread()?;
        let x = self.belief.mean;
        let h0 = sensor.measure(&x);
        // Differences to the centre's measurement: angles are averaged on the near side of it.
        let side = |i: usize, sign: T| sensor.residual(&sensor.measure(&(x + l.column(i) * sign)), &h0);
        let signs = [T::one(), -T::one()];
        let sides: [[SVector<T, K>; 2]; N] = core::array::from_fn(|i| signs.map(|sign| side(i, sign)));
        let mut mean = SVector::<T, K>::zeros();
        for [plus, minus] in &sides {
            mean += (plus + minus) * w;
        }
        let mut s = *r + mean * mean.transpose() * w0;
        let mut cross = SMatrix::<T, N, K>::zeros();
        for (i, both) in sides.iter().enumerate() {
            for (d, sign) in both.iter().zip(signs) {
                let d = d - mean;
                s += d * d.transpose() * w;
                cross += l.column(i) * d.transpose() * (w * sign);
            }
        }
        symmetrize(&mut s);
        let chol = Cholesky::new(&s, "the innovation covariance")?;
        let gain = chol.solve(&cross.transpose()).transpose();
        let innovation = sensor.residual(z, &(h0 + mean));
        // P - K S Kᵀ as the spread of χ - K h(χ) with K R Kᵀ: a sum of squares keeps its sign where P far exceeds R.
        let off = gain * mean;
        let mut cov = gain * r * gain.transpose() + off * off.transpose() * w0;
        for (i, both) in sides.iter().enumerate() {
            for (d, sign) in both.iter().zip(signs) {
                let kept = l.column(i) * sign - gain * (d - mean);
                cov += kept * kept.transpose() * w;
            }
        }
        symmetrize(&mut cov);
        let belief = Gaussian { mean: x + gain * innovation, cov };
        let white = chol.whiten(&innovation);
        self.accept(belief)?;
        Ok(LinearUpdate { belief, innovation, innovation_cov: s, gain, distance2: white.dot(&white) })
    }

    fn accept(&mut self, next: Gaussian<N, T>) -> Result<(), FilterError> {
        if !(all_finite(&next.mean) & all_finite(&next.cov)) {
            return Err(FilterError::NotFinite("the result of the step"));
        }
        // The next step needs a root.
        Cholesky::semi_definite(&next.cov, "the state covariance")?;
        self.belief = next;
        Ok(())
    }
}

impl<M: Model<N, T>, const N: usize, T: Real> Start<M, N> for Ukf<M, N, T> {
    fn start(model: M, belief: Gaussian<N, T>) -> Result<Self, FilterError> {
        check_belief(&belief)?;
        Cholesky::semi_definite(&belief.cov, "the state covariance")?;
        Ok(Self { model, belief, kappa: (T::of(3.0) - T::of(N as f64)).max(T::zero()) })
    }
    fn model(&self) -> &M {
        &self.model
    }
    fn model_mut(&mut self) -> &mut M {
        &mut self.model
    }
}

impl<M: Model<N, T>, const N: usize, T: Real> GaussianFilter<N> for Ukf<M, N, T> {
    type Real = T;

    fn predict(&mut self, dt_s: T) -> Result<(), FilterError> {
        check_dt(dt_s)?;
        if dt_s == T::zero() {
            return Ok(());
        }
        let (l, w0, w) = self.spread()?;
        let x = self.belief.mean;
        let centre = self.model.moved(dt_s, &x);
        let side = |i: usize, sign: T| self.model.moved(dt_s, &(x + l.column(i) * sign));
        let mut mean = centre * w0;
        for i in 0..N {
            mean += (side(i, T::one()) + side(i, -T::one())) * w;
        }
        let d = centre - mean;
        let mut cov = self.model.process_noise(dt_s) + d * d.transpose() * w0;
        for i in 0..N {
            for sign in [T::one(), -T::one()] {
                let d = side(i, sign) - mean;
                cov += d * d.transpose() * w;
            }
        }
        symmetrize(&mut cov);
        self.accept(Gaussian { mean, cov })
    }

    fn correct(&mut self, m: &Measurement<T>) -> Result<(), FilterError> {
        check_measurement(m)?;
        let r: Matrix2<T> = m.cov;
        self.correct_by(&Position { position_at: M::POSITION }, &m.position, &r).map(|_| ())
    }

    fn correct_weighted<I>(&mut self, hypotheses: I) -> Result<(), FilterError>
    where
        I: Iterator<Item = Weighted<T>> + Clone,
    {
        let next = mixture_update(&self.belief, M::POSITION, hypotheses)?;
        self.accept(next)
    }

    fn belief(&self) -> Gaussian<N, T> {
        self.belief
    }

    fn set_belief(&mut self, belief: &Gaussian<N, T>) -> Result<(), FilterError> {
        check_belief(belief)?;
        self.accept(*belief)
    }

    fn position_at(&self) -> [usize; 2] {
        M::POSITION
    }

    fn kinematics(&self) -> Gaussian<4, T> {
        self.model.kinematics(&self.belief)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Ud;
    use crate::model::ConstantVelocity;

    #[test]
    fn a_sharp_measurement_of_a_target_known_in_one_direction_only_is_taken() {
        // The place is known, the velocity is not, and nothing disturbs it: after a step P has rank one an axis.
        let cv = ConstantVelocity::continuous(0.0).unwrap();
        for (velocity_var, variance, dt) in [(100.0, 1.0, 10.0), (1e4, 1e-2, 3.0), (1.0, 1e-6, 700.0), (0.3, 1e-3, 1e4)]
        {
            let cov =
                SMatrix::<f64, 4, 4>::from_diagonal(&SVector::<f64, 4>::new(0.0, velocity_var, 0.0, velocity_var));
            let prior = Gaussian { mean: SVector::zeros(), cov };
            let (mut ukf, mut ud) = (Ukf::start(cv, prior).unwrap(), Ud::start(cv, prior).unwrap());
            for k in 1..=3 {
                let position = nalgebra::Vector2::new(dt * f64::from(k), -dt * f64::from(k));
                let z = Measurement { position, cov: Matrix2::identity() * variance };
                ukf.predict(dt).unwrap();
                ud.predict(dt).unwrap();
                ukf.correct(&z).unwrap();
                ud.correct(&z).unwrap();
            }
            let (a, b) = (ukf.belief().cov, ud.belief().cov);
            for i in 0..4 {
                assert!((a[(i, i)] / b[(i, i)] - 1.0).abs() < 1e-6, "{dt}: {a} instead of {b}");
            }
        }
    }

    #[test]
    fn any_spread_gives_the_kalman_filter_of_a_linear_problem() {
        let cv = ConstantVelocity::continuous(2.0).unwrap();
        let cov = SMatrix::<f64, 4, 4>::from_diagonal(&SVector::<f64, 4>::new(4.0, 9.0, 1.0, 25.0));
        let prior = Gaussian { mean: SVector::<f64, 4>::new(1.0, -2.0, 3.0, 0.5), cov };
        for kappa in [0.0, 0.5, 1.0, 7.0] {
            let mut ukf = Ukf::start(cv, prior).unwrap().with_kappa(kappa).unwrap();
            let mut kf = crate::Kf::<_, 4>::start(cv, prior).unwrap();
            for k in 0..5 {
                let position = nalgebra::Vector2::new(f64::from(k), 3.0 - f64::from(k));
                let z = Measurement { position, cov: Matrix2::new(2.0, 0.3, 0.3, 0.7) };
                ukf.predict(0.3).unwrap();
                kf.predict(0.3).unwrap();
                ukf.correct(&z).unwrap();
                kf.correct(&z).unwrap();
            }
            assert!((ukf.belief().mean - kf.belief().mean).amax() < 1e-9, "{kappa}");
            assert!((ukf.belief().cov - kf.belief().cov).amax() < 1e-9, "{kappa}");
        }
    }
}
