//! Scalar AR(1) recursion per coordinate: the next coordinate is α times this one, α learnt by least squares.
//!
//! Source: F. Cai, J. Cui 2014, 3.5, corrected (`docs/theory/adaptive.md`): K = P μ/(1 + P μ²), e = z - α μ, α += K e,
//! P -= K μ P, prediction α z; α_0 = 1, P_0 = 1, μ the coordinate before. Closed form: least squares without
//! forgetting.
//! Differs from it: a tracker needs a covariance, which the paper does not give. The predicted variance returned for
//! gating is the larger of the measurement variance r and the running mean square of the
//! prediction error e (time constant 10 updates) less r, so that the gate follows the filter's own lag.
//! The velocity reported is the last predicted step over its time, with variance 2 r/dt².
//! Limits: depends on the origin of the coordinates; lags a steady motion by up to half a step for ever and a reversal
//! for dozens of frames (figures in the chapter); a step is one frame whatever its length. For comparison with the
//! paper.
//! Symbols: μ, z px; α, P no unit and px⁻². Cost: about 30 flops a coordinate.

use crate::check::check_weighted;
use crate::check::{check_dt, check_measurement};
use crate::{Filter, FilterError, Gaussian, Measurement, Real, Weighted};
use nalgebra::{Matrix2, Matrix4, Vector2, Vector4};

/// The recursion of one coordinate.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Ar1Axis<T = f64> {
    /// Regression coefficient α.
    pub alpha: T,
    /// Its scaled variance P.
    pub p: T,
    /// The coordinate before (px).
    pub last: T,
}

impl<T: Real> Ar1Axis<T> {
    /// Starts at the first observation.
    pub fn new(first: T) -> Self {
        Self { alpha: T::one(), p: T::one(), last: first }
    }

    /// Takes an observation and returns the prediction for the next frame.
    ///
    /// The worked example of `docs/theory/adaptive.md`:
    /// ```
    /// let mut axis = boresight_filters::ar1::Ar1Axis::new(100.0);
    /// assert!((axis.observe(104.0) - 108.1595840416_f64).abs() < 1e-9);
    /// assert!((axis.observe(108.5) - 113.02409088726_f64).abs() < 1e-9);
    /// assert!((axis.alpha - 1.0416966902051).abs() < 1e-12 && (axis.p - 4.8037661526615e-05).abs() < 1e-17);
    /// ```
    pub fn observe(&mut self, z: T) -> T {
        let mu = self.last;
        let gain = self.p * mu / (T::one() + self.p * mu * mu);
        self.alpha += gain * (z - self.alpha * mu);
        self.p -= gain * mu * self.p;
        self.last = z;
        self.alpha * z
    }
}

/// AR(1) filter of two coordinates.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ar1 {
    axes: [Ar1Axis; 2],
    /// Predicted (or, before a predict, observed) position, px.
    position: Vector2<f64>,
    /// Mean square of the prediction error, px².
    error2: Vector2<f64>,
    /// Measurement variance of the last update, px².
    r: Vector2<f64>,
    step: Vector2<f64>,
    last_dt_s: f64,
    predicted: bool,
}

impl Ar1 {
    /// Starts at a first measured position; `frame_s` is the expected time between frames (s), for the velocity.
    /// # Errors
    /// [`FilterError`] if the measurement is not usable or the time is not above 0.
    pub fn new(first: &Measurement, frame_s: f64) -> Result<Self, FilterError> {
        check_measurement(first)?;
        if !(frame_s > 0.0 && frame_s <= f64::MAX) {
            return Err(FilterError::OutOfRange("a frame time above 0 s"));
        }
        let r = Vector2::new(first.cov[(0, 0)], first.cov[(1, 1)]);
        Ok(Self {
            axes: [Ar1Axis::new(first.position[0]), Ar1Axis::new(first.position[1])],
            position: first.position,
            // One frame of unknown motion: nothing is known yet beyond the measurement itself.
            error2: r * 4.0,
            r,
            step: Vector2::zeros(),
            last_dt_s: frame_s,
            predicted: false,
        })
    }

    fn variance(&self) -> Vector2<f64> {
        if self.predicted { self.r.sup(&(self.error2 - self.r)) } else { self.r }
    }
}

impl Filter for Ar1 {
    fn predict(&mut self, dt_s: f64) -> Result<(), FilterError> {
        check_dt(dt_s)?;
        if dt_s == 0.0 {
            return Ok(());
        }
        let next = Vector2::new(self.axes[0].alpha * self.position[0], self.axes[1].alpha * self.position[1]);
        if !next.iter().all(|v| v.abs() <= f64::MAX) {
            return Err(FilterError::NotFinite("the result of the step"));
        }
        if self.predicted {
            // A missed frame: the error of the last prediction is carried into this one.
            self.error2 += self.r;
        }
        self.step = next - self.position;
        self.position = next;
        self.last_dt_s = dt_s;
        self.predicted = true;
        Ok(())
    }

    fn predicted(&self) -> Gaussian<2> {
        Gaussian { mean: self.position, cov: Matrix2::from_diagonal(&self.variance()) }
    }

    fn update(&mut self, hypotheses: &[Weighted]) -> Result<(), FilterError> {
        let (sum, _) = check_weighted(hypotheses.iter().copied())?;
        if sum == 0.0 {
            return Ok(());
        }
        // The recursion takes one observation: the mean of the mixture, in which "none" stands for the prediction.
        let mut z = self.position * (1.0 - sum).max(0.0);
        let mut r = Vector2::zeros();
        for h in hypotheses {
            z += h.measurement.position * h.weight;
            r += Vector2::new(h.measurement.cov[(0, 0)], h.measurement.cov[(1, 1)]) * (h.weight / sum);
        }
        let mut next = *self;
        for i in 0..2 {
            let e = z[i] - self.position[i];
            // 1/10: mean over about ten updates.
            next.error2[i] += (e * e - next.error2[i]) * 0.1;
            next.axes[i].observe(z[i]);
        }
        next.position = z;
        next.r = r;
        next.predicted = false;
        let finite = next.axes.iter().all(|a| a.alpha.abs() <= f64::MAX && a.p.abs() <= f64::MAX);
        if !(finite && next.error2.iter().all(|v| *v <= f64::MAX)) {
            return Err(FilterError::NotFinite("the result of the step"));
        }
        *self = next;
        Ok(())
    }

    fn kinematics(&self) -> Gaussian<4> {
        let v = self.variance();
        let var_v = self.r * (2.0 / (self.last_dt_s * self.last_dt_s));
        let velocity = if self.predicted {
            self.step / self.last_dt_s
        } else {
            Vector2::new((self.axes[0].alpha - 1.0) * self.position[0], (self.axes[1].alpha - 1.0) * self.position[1])
                / self.last_dt_s
        };
        Gaussian {
            mean: Vector4::new(self.position[0], velocity[0], self.position[1], velocity[1]),
            cov: Matrix4::from_diagonal(&Vector4::new(v[0], var_v[0], v[1], var_v[1])),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// α after the worked example of `docs/theory/adaptive.md`: 100, then 104.
    const ALPHA: f64 = 108.159_584_041_6 / 104.0;

    fn started() -> Ar1 {
        Ar1::new(&Measurement::isotropic(100.0, 200.0, 0.5), 0.04).unwrap()
    }

    fn sure(x: f64, y: f64, std: f64) -> Weighted {
        Weighted::sure(Measurement::isotropic(x, y, std))
    }

    #[test]
    fn a_start_knows_the_measurement_and_no_velocity() {
        let k = started().kinematics();
        assert_eq!(k.mean, Vector4::new(100.0, 0.0, 200.0, 0.0));
        // Two measurements 0.04 s apart: 2 r / dt².
        assert!((k.cov[(1, 1)] - 0.5 / 0.0016).abs() < 1e-12 && k.cov[(0, 0)] == 0.25 && k.cov[(2, 2)] == 0.25);
        let m = Measurement::isotropic(0.0, 0.0, 1.0);
        for wrong in [0.0, -1.0, f64::INFINITY, f64::NAN] {
            assert!(Ar1::new(&m, wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn the_error_of_a_prediction_is_a_mean_over_ten_and_grows_by_a_missed_frame() {
        let mut f = started();
        f.predict(0.04).unwrap();
        // 4 r - r before anything is known.
        assert_eq!(f.predicted().cov, Matrix2::from_diagonal_element(0.75));
        assert_eq!(f.predicted().mean, Vector2::new(100.0, 200.0));
        f.predict(0.04).unwrap();
        assert_eq!(f.predicted().cov, Matrix2::from_diagonal_element(1.0));
        f.update(&[sure(104.0, 200.0, 0.5)]).unwrap();
        assert_eq!(f.predicted(), Gaussian::new(Vector2::new(104.0, 200.0), Matrix2::from_diagonal_element(0.25)));
        let k = f.kinematics();
        assert!((k.mean[1] - (ALPHA - 1.0) * 104.0 / 0.04).abs() < 1e-7, "{}", k.mean[1]);
        f.predict(0.08).unwrap();
        let k = f.kinematics();
        assert!((k.mean[0] - 108.159_584_041_6).abs() < 1e-9);
        assert!((k.mean[1] - (108.159_584_041_6 - 104.0) / 0.08).abs() < 1e-7);
        assert!((k.cov[(1, 1)] - 0.5 / 0.0064).abs() < 1e-12);
        // 5 r = 1.25, then a tenth of the way to 4²: 2.725, less r.
        assert!((k.cov[(0, 0)] - 2.475).abs() < 1e-14, "{}", k.cov[(0, 0)]);
        // No error at all: 1.25 - 0.125 - 0.25.
        assert!((k.cov[(2, 2)] - 0.875).abs() < 1e-14, "{}", k.cov[(2, 2)]);
    }

    #[test]
    fn doubtful_measurements_are_mixed_with_the_prediction() {
        let mut f = started();
        f.predict(0.04).unwrap();
        let [near, far] = [sure(104.0, 200.0, 0.5), sure(110.0, 200.0, 1.0)];
        f.update(&[Weighted { weight: 0.5, ..near }, Weighted { weight: 0.25, ..far }]).unwrap();
        // 0.25 * 100 + 0.5 * 104 + 0.25 * 110, variance (0.5 * 0.25 + 0.25 * 1)/0.75.
        assert_eq!(f.predicted().mean, Vector2::new(104.5, 200.0));
        assert!((f.predicted().cov[(0, 0)] - 0.5).abs() < 1e-15);
        let mut twin = Ar1Axis::new(100.0);
        twin.observe(104.5);
        assert_eq!(f.axes[0], twin);
    }

    #[test]
    fn a_step_that_overflows_is_refused() {
        let mut f = Ar1::new(&Measurement::isotropic(1e300, 0.0, 1.0), 0.04).unwrap();
        let before = f;
        assert!(f.update(&[sure(-1e300, 0.0, 1.0)]).is_err());
        assert_eq!(f, before);
    }
}
