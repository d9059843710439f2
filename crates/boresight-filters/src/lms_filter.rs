//! The LMS filter as trackers use it: two axes behind [`Filter`].
//!
//! Source: `docs/theory/adaptive.md`; the code is in [`crate::lms`]. Axes are independent, so the off-diagonal of a
//! measurement's covariance is not used. Covariance for gating: the axis' own P_pp after predict.
//! Several weighted hypotheses are taken as one measurement: their mean by weight, with variance r/Σw + spread, which
//! is the plain update for one sure hypothesis and a weak one for doubtful ones.
//! Limits: a missed scan leaves the second differences with a longer step, in real time.
//! Symbols: per axis s = (p, v, a_1 …), px, px/s, px/s². Cost: two axes of [`crate::lms`], about 24 S³ flops.

use crate::check::check_weighted;
use crate::check::{check_dt, check_measurement};
use crate::lms::{LmsAxis, LmsRule};
use crate::{Filter, FilterError, Gaussian, Measurement, Weighted};
use nalgebra::{Matrix2, Matrix4, Vector2, Vector4};

/// LMS filter of two axes with S = N + 3 states each: `Lms<5>` is the paper's window N = 2.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lms<const S: usize> {
    axes: [LmsAxis<S>; 2],
    since_s: f64,
}

impl<const S: usize> Lms<S> {
    /// Starts from position and velocity; `acceleration_std` (px/s²) is how well the first acceleration is known.
    /// # Errors
    /// [`FilterError`] if a value is not finite or out of range, or S < 5.
    pub fn from_kinematics(k: &Gaussian<4>, acceleration_std: f64, rule: LmsRule) -> Result<Self, FilterError> {
        crate::check::check_belief(k)?;
        let axis = |i: usize| {
            let var = [k.cov[(i, i)], k.cov[(i + 1, i + 1)]];
            let mut a = LmsAxis::new(k.mean[i], k.mean[i + 1], var, acceleration_std * acceleration_std, rule)?;
            a.remember(k.mean[i], 0.0);
            Ok(a)
        };
        Ok(Self { axes: [axis(0)?, axis(2)?], since_s: 0.0 })
    }

    /// Starts from one measured position and a velocity known only by its standard deviation (px/s).
    /// # Errors
    /// As [`Lms::from_kinematics`].
    pub fn from_point(
        m: &Measurement,
        velocity_std: f64,
        acceleration_std: f64,
        rule: LmsRule,
    ) -> Result<Self, FilterError> {
        Self::from_kinematics(&crate::model::kinematics_from_point(m, velocity_std)?, acceleration_std, rule)
    }

    /// Returns the two axes.
    pub fn axes(&self) -> &[LmsAxis<S>; 2] {
        &self.axes
    }
}

impl<const S: usize> Filter for Lms<S> {
    fn predict(&mut self, dt_s: f64) -> Result<(), FilterError> {
        check_dt(dt_s)?;
        if dt_s == 0.0 {
            return Ok(());
        }
        let mut next = *self;
        for axis in &mut next.axes {
            axis.predict(dt_s)?;
        }
        next.since_s += dt_s;
        *self = next;
        Ok(())
    }

    fn predicted(&self) -> Gaussian<2> {
        let [x, y] = &self.axes;
        Gaussian {
            mean: Vector2::new(x.state[0], y.state[0]),
            cov: Matrix2::new(x.cov[(0, 0)], 0.0, 0.0, y.cov[(0, 0)]),
        }
    }

    fn update(&mut self, hypotheses: &[Weighted]) -> Result<(), FilterError> {
        let (sum, _) = check_weighted(hypotheses.iter().copied())?;
        if sum == 0.0 {
            return Ok(());
        }
        if self.since_s == 0.0 {
            // Second differences need time between the samples.
            return Err(FilterError::OutOfRange("a predict of more than 0 s between updates of the LMS filter"));
        }
        let mut next = *self;
        for (i, axis) in next.axes.iter_mut().enumerate() {
            let mean = hypotheses.iter().map(|h| h.weight * h.measurement.position[i]).sum::<f64>() / sum;
            let var = |h: &Weighted| {
                let off = h.measurement.position[i] - mean;
                h.weight * (h.measurement.cov[(i, i)] / sum + off * off)
            };
            let r = hypotheses.iter().map(var).sum::<f64>() / sum;
            axis.correct(mean, r, self.since_s)?;
        }
        next.since_s = 0.0;
        *self = next;
        Ok(())
    }

    fn kinematics(&self) -> Gaussian<4> {
        let [x, y] = &self.axes;
        let mut cov = Matrix4::zeros();
        for (at, axis) in [(0, x), (2, y)] {
            for r in 0..2 {
                for c in 0..2 {
                    cov[(at + r, at + c)] = axis.cov[(r, c)];
                }
            }
        }
        Gaussian { mean: Vector4::new(x.state[0], x.state[1], y.state[0], y.state[1]), cov }
    }

    fn log_likelihood(&self, measurement: &Measurement) -> Result<f64, FilterError> {
        check_measurement(measurement)?;
        crate::gaussian::log_likelihood(&self.predicted(), measurement)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn start() -> Gaussian<4> {
        let mut cov = Matrix4::from_diagonal(&Vector4::new(0.5, 0.3, 0.6, 0.2));
        (cov[(0, 1)], cov[(1, 0)]) = (0.1, 0.1);
        Gaussian::new(Vector4::new(10.0, 1.0, 20.0, -2.0), cov)
    }

    fn filter() -> Lms<5> {
        Lms::from_kinematics(&start(), 3.0, LmsRule::Guarded).unwrap()
    }

    fn at(x: f64, y: f64, variance: f64, weight: f64) -> Weighted {
        let cov = Matrix2::from_diagonal_element(variance);
        Weighted { measurement: Measurement::new(Vector2::new(x, y), cov), weight }
    }

    #[test]
    fn a_start_has_the_acceleration_of_its_deviation() {
        let f = filter();
        let [x, y] = f.axes();
        assert_eq!((x.state[0], x.state[1], y.state[0], y.state[1]), (10.0, 1.0, 20.0, -2.0));
        assert_eq!(
            (x.cov[(0, 0)], x.cov[(1, 1)], x.cov[(2, 2)], y.cov[(1, 1)], y.cov[(4, 4)]),
            (0.5, 0.3, 9.0, 0.2, 9.0)
        );
        let point = Lms::<5>::from_point(&Measurement::isotropic(10.0, 20.0, 0.5), 4.0, 3.0, LmsRule::Guarded).unwrap();
        assert_eq!(point.kinematics().cov, Matrix4::from_diagonal(&Vector4::new(0.25, 16.0, 0.25, 16.0)));
    }

    /// Two axes by hand, with the time since the last measured sample.
    #[test]
    fn the_filter_is_two_axes_and_the_time_between_their_samples() {
        let mut f = filter();
        let mut axes = *f.axes();
        for (k, steps) in [1, 2, 1, 1, 3, 1].into_iter().enumerate() {
            let (x, y) = (10.5 + k as f64, 20.0 - 1.7 * k as f64);
            for _ in 0..steps {
                f.predict(0.5).unwrap();
                axes.iter_mut().for_each(|a| a.predict(0.5).unwrap());
            }
            f.update(&[at(x, y, 0.4, 1.0)]).unwrap();
            axes[0].correct(x, 0.4, 0.5 * f64::from(steps)).unwrap();
            axes[1].correct(y, 0.4, 0.5 * f64::from(steps)).unwrap();
            assert_eq!(*f.axes(), axes, "update {k}");
        }
        let k = f.kinematics();
        for (place, axis) in [(0, &axes[0]), (2, &axes[1])] {
            assert_eq!((k.mean[place], k.mean[place + 1]), (axis.state[0], axis.state[1]));
            for (r, c) in [(0, 0), (0, 1), (1, 0), (1, 1)] {
                assert_eq!(k.cov[(place + r, place + c)], axis.cov[(r, c)]);
            }
        }
        assert_eq!((k.cov[(0, 2)], k.cov[(1, 3)]), (0.0, 0.0));
        assert_eq!(f.predicted().cov, Matrix2::new(axes[0].cov[(0, 0)], 0.0, 0.0, axes[1].cov[(0, 0)]));
        let m = at(9.0, 9.0, 1.0, 1.0).measurement;
        assert_eq!(f.log_likelihood(&m), crate::gaussian::log_likelihood(&f.predicted(), &m));
    }

    #[test]
    fn several_hypotheses_are_one_measurement_of_their_mean_and_spread() {
        let update = |hypotheses: &[Weighted]| {
            let mut f = filter();
            f.predict(0.5).unwrap();
            f.update(hypotheses).unwrap();
            f.kinematics()
        };
        let close = |a: Gaussian<4>, b: Gaussian<4>| (a.mean - b.mean).norm() + (a.cov - b.cov).norm() < 1e-12;
        // Half a weight: twice the variance.
        assert!(close(update(&[at(11.0, 19.0, 0.4, 0.5)]), update(&[at(11.0, 19.0, 0.8, 1.0)])));
        // Two halves 2 px apart in both axes: their middle, and 1 px² more.
        let two = [at(10.0, 18.0, 0.4, 0.5), at(12.0, 20.0, 0.4, 0.5)];
        assert!(close(update(&two), update(&[at(11.0, 19.0, 1.4, 1.0)])));
    }

    #[test]
    fn two_updates_of_one_instant_are_refused() {
        let mut f = filter();
        assert!(matches!(f.update(&[at(10.0, 20.0, 0.4, 1.0)]), Err(FilterError::OutOfRange(_))));
        f.predict(0.5).unwrap();
        f.update(&[at(10.0, 20.0, 0.4, 1.0)]).unwrap();
        assert!(f.update(&[at(10.0, 20.0, 0.4, 1.0)]).is_err());
    }
}
