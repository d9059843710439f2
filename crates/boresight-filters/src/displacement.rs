//! The [2 -1; 1 0] displacement model: the state is the coordinate now and at the frame before.
//!
//! Source: F. Cai, J. Cui 2014, eqs 7-13, corrected (`docs/theory/adaptive.md`). s = (d(t), d(t-1)) per axis,
//! Phi = [[2, -1], [1, 0]], H = [1 0], process noise diag(q, 0), then the Kalman update.
//! Differs from it: for a step of another length than the last, Phi = [[1 + ρ, -ρ], [1, 0]] with ρ = dt/dt_last: the
//! same straight-line extrapolation in real time; q is the variance per frame at any frame time.
//! Symbols: `[x(t), x(t-1), y(t), y(t-1)]` (px); q px². Velocity = (d(t) - d(t-1))/dt_last.
//! Limits: first step needs `frame_s`, the time between the two coordinates of the start.
//! Cost: a dense step of 4 states, about 600 flops.

use crate::check::check_strength;
use crate::check::{check_belief, check_dt};
use crate::linear::{correct_linear, predict_linear};
use crate::mixture::mixture_update;
use crate::real::all_finite;
use crate::{FilterError, Gaussian, GaussianFilter, Measurement, Real, Weighted};
use nalgebra::{SMatrix, SVector};

/// Displacement-model filter of two axes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Displacement<T: Real = f64> {
    belief: Gaussian<4, T>,
    noise: T,
    last_dt: T,
}

impl<T: Real> Displacement<T> {
    /// Starts from a belief in `[x(t), x(t-1), y(t), y(t-1)]`, `frame_s` apart; `noise` is q (px² a frame).
    /// # Errors
    /// [`FilterError`] if a value is not finite, the time is not above 0 or the covariance cannot be factored.
    pub fn start(belief: Gaussian<4, T>, noise: T, frame_s: T) -> Result<Self, FilterError> {
        check_belief(&belief)?;
        crate::linalg::ud_factorize(&belief.cov)?;
        check_strength(noise, "a process noise of at least 0 px²")?;
        if !(frame_s > T::zero() && frame_s <= T::MAX) {
            return Err(FilterError::OutOfRange("a frame time above 0 s"));
        }
        Ok(Self { belief, noise, last_dt: frame_s })
    }

    /// Starts from position and velocity `[x, vx, y, vy]`.
    /// # Errors
    /// As [`Displacement::start`].
    pub fn from_kinematics(k: &Gaussian<4, T>, noise: T, frame_s: T) -> Result<Self, FilterError> {
        let a = positions_from_velocities(frame_s);
        let mut cov = a * k.cov * a.transpose();
        crate::linalg::symmetrize(&mut cov);
        Self::start(Gaussian { mean: a * k.mean, cov }, noise, frame_s)
    }

    fn accept(&mut self, next: Gaussian<4, T>) -> Result<(), FilterError> {
        if !(all_finite(&next.mean) & all_finite(&next.cov)) {
            return Err(FilterError::NotFinite("the result of the step"));
        }
        self.belief = next;
        Ok(())
    }
}

/// (p, v) → (p, p - v dt) per axis.
fn positions_from_velocities<T: Real>(dt: T) -> SMatrix<T, 4, 4> {
    let mut a = SMatrix::zeros();
    for i in [0, 2] {
        a[(i, i)] = T::one();
        a[(i + 1, i)] = T::one();
        a[(i + 1, i + 1)] = -dt;
    }
    a
}

impl<T: Real> GaussianFilter<4> for Displacement<T> {
    type Real = T;

    fn predict(&mut self, dt_s: T) -> Result<(), FilterError> {
        check_dt(dt_s)?;
        if dt_s == T::zero() {
            return Ok(());
        }
        let ratio = dt_s / self.last_dt;
        let (mut phi, mut q) = (SMatrix::zeros(), SMatrix::zeros());
        for i in [0, 2] {
            phi[(i, i)] = T::one() + ratio;
            phi[(i, i + 1)] = -ratio;
            phi[(i + 1, i)] = T::one();
            q[(i, i)] = self.noise;
        }
        self.accept(predict_linear(&self.belief, &phi, &q))?;
        self.last_dt = dt_s;
        Ok(())
    }

    fn correct(&mut self, m: &Measurement<T>) -> Result<(), FilterError> {
        crate::check::check_measurement(m)?;
        let mut h = SMatrix::<T, 2, 4>::zeros();
        h[(0, 0)] = T::one();
        h[(1, 2)] = T::one();
        let innovation = m.position - self.predicted().mean;
        self.accept(correct_linear(&self.belief, &h, &innovation, &m.cov)?.belief)
    }

    fn correct_weighted<I>(&mut self, hypotheses: I) -> Result<(), FilterError>
    where
        I: Iterator<Item = Weighted<T>> + Clone,
    {
        self.accept(mixture_update(&self.belief, [0, 2], hypotheses)?)
    }

    fn belief(&self) -> Gaussian<4, T> {
        self.belief
    }

    fn set_belief(&mut self, belief: &Gaussian<4, T>) -> Result<(), FilterError> {
        check_belief(belief)?;
        self.belief = *belief;
        Ok(())
    }

    fn position_at(&self) -> [usize; 2] {
        [0, 2]
    }

    fn kinematics(&self) -> Gaussian<4, T> {
        let inv = T::one() / self.last_dt;
        let mut a = SMatrix::<T, 4, 4>::zeros();
        for i in [0, 2] {
            a[(i, i)] = T::one();
            a[(i + 1, i)] = inv;
            a[(i + 1, i + 1)] = -inv;
        }
        let mut cov = a * self.belief.cov * a.transpose();
        crate::linalg::symmetrize(&mut cov);
        let mean: SVector<T, 4> = a * self.belief.mean;
        Gaussian { mean, cov }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Matrix2, Matrix4, Vector2, Vector4};

    fn kinematics() -> Gaussian<4> {
        let cov = Matrix4::from_diagonal(&Vector4::new(4.0, 1.0, 9.0, 0.0));
        Gaussian::new(Vector4::new(10.0, 2.0, -5.0, 0.0), cov)
    }

    /// The place a frame ago is p - v dt: variance 4 + 0.5² and covariance 4 with the place now.
    #[test]
    fn velocity_becomes_the_place_a_frame_ago_and_back() {
        let f = Displacement::from_kinematics(&kinematics(), 0.3, 0.5).unwrap();
        let b = f.belief();
        assert_eq!(b.mean, Vector4::new(10.0, 9.0, -5.0, -5.0));
        assert_eq!((b.cov[(0, 0)], b.cov[(0, 1)], b.cov[(1, 1)], b.cov[(3, 3)]), (4.0, 4.0, 4.25, 9.0));
        assert_eq!(f.kinematics(), kinematics());
        assert_eq!(f.predicted(), Gaussian::new(Vector2::new(10.0, -5.0), Matrix2::new(4.0, 0.0, 0.0, 9.0)));
        assert_eq!(f.position_at(), [0, 2]);
    }

    /// Two frames' time after one of 0.5 s: x + v, variance 4 + 1 + q.
    #[test]
    fn a_step_of_another_length_goes_on_with_the_same_velocity() {
        let mut f = Displacement::from_kinematics(&kinematics(), 0.3, 0.5).unwrap();
        f.predict(1.0).unwrap();
        let b = f.belief();
        assert!((b.mean - Vector4::new(12.0, 10.0, -5.0, -5.0)).norm() < 1e-14);
        assert!((b.cov[(0, 0)] - 5.3).abs() < 1e-13 && (b.cov[(0, 1)] - 4.0).abs() < 1e-13 && b.cov[(1, 1)] == 4.0);
        assert!((f.kinematics().mean[1] - 2.0).abs() < 1e-14);
        f.predict(0.5).unwrap();
        assert!((f.belief().mean[0] - 13.0).abs() < 1e-13);
    }

    #[test]
    fn a_sure_measurement_corrects_by_the_gain_of_its_variance() {
        let mut f = Displacement::from_kinematics(&kinematics(), 0.3, 0.5).unwrap();
        let mut weighted = f;
        let m = Measurement::new(Vector2::new(14.0, -5.0), Matrix2::new(4.0, 0.0, 0.0, 9.0));
        f.correct(&m).unwrap();
        // Gain 4/8 on the place now and 4/8 on the one before.
        let b = f.belief();
        assert!((b.mean - Vector4::new(12.0, 11.0, -5.0, -5.0)).norm() < 1e-14);
        assert!((b.cov[(0, 0)] - 2.0).abs() < 1e-14 && (b.cov[(1, 1)] - 2.25).abs() < 1e-14);
        weighted.correct_weighted([Weighted { measurement: m, weight: 0.5 }].into_iter()).unwrap();
        assert!((weighted.belief().mean[0] - 11.0).abs() < 1e-14);
        // Half of 4, half of 2, and the spread of the means 10 and 12.
        assert!((weighted.belief().cov[(0, 0)] - 4.0).abs() < 1e-14);
    }

    #[test]
    fn a_start_out_of_range_is_refused() {
        let start = |noise: f64, frame_s: f64| Displacement::from_kinematics(&kinematics(), noise, frame_s).is_ok();
        assert!(start(0.0, 1e-9));
        for (noise, frame_s) in [(-0.1, 0.5), (f64::INFINITY, 0.5), (0.3, 0.0), (0.3, -0.5), (0.3, f64::INFINITY)] {
            assert!(!start(noise, frame_s), "{noise} {frame_s}");
        }
        let indefinite = Gaussian { cov: Matrix4::from_fn(|r, c| if r == c { 1.0 } else { 2.0 }), ..kinematics() };
        assert!(Displacement::start(indefinite, 0.3, 0.5).is_err());
        let mut f = Displacement::from_kinematics(&kinematics(), 0.3, 0.5).unwrap();
        assert!(f.set_belief(&Gaussian { cov: -kinematics().cov, ..kinematics() }).is_err());
        f.set_belief(&kinematics()).unwrap();
        assert_eq!(f.belief(), kinematics());
    }

    #[test]
    fn a_step_that_overflows_is_refused() {
        let far = Gaussian { mean: Vector4::new(1e300, -1e300, 0.0, 0.0), ..kinematics() };
        let mut f = Displacement::start(far, 0.3, 1e-6).unwrap();
        assert!(f.predict(1e6).is_err());
        assert_eq!(f.belief(), far);
    }
}
