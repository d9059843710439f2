//! The few values that cross a filter's border: beliefs, measurements, weighted measurements.

use crate::linalg::invert_pair;
use crate::{FilterError, Real};
use nalgebra::{Matrix2, SMatrix, SVector, Vector2};

/// A Gaussian belief: mean N x 1 and covariance N x N.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gaussian<const N: usize, T = f64> {
    /// Mean, N x 1.
    pub mean: SVector<T, N>,
    /// Covariance, N x N, symmetric.
    pub cov: SMatrix<T, N, N>,
}

/// A position measurement with its own covariance (px and px², or m and m²).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Measurement<T = f64> {
    /// Position (x, y).
    pub position: Vector2<T>,
    /// Covariance of the position, 2 x 2, symmetric positive definite.
    pub cov: Matrix2<T>,
}

/// One hypothesis of an update: a measurement and the probability that it is the target's own.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Weighted<T = f64> {
    /// The measurement.
    pub measurement: Measurement<T>,
    /// Its probability, 0..=1; the weights of one update sum to at most 1.
    pub weight: T,
}

impl<const N: usize, T: Real> Gaussian<N, T> {
    /// Returns the belief of a mean and its covariance.
    pub fn new(mean: SVector<T, N>, cov: SMatrix<T, N, N>) -> Self {
        Self { mean, cov }
    }

    /// Returns the belief in another number type.
    #[inline(always)]
    pub fn cast<U: Real>(&self) -> Gaussian<N, U> {
        Gaussian { mean: self.mean.map(|v| U::of(v.as_f64())), cov: self.cov.map(|v| U::of(v.as_f64())) }
    }
}

impl<T: Real> Measurement<T> {
    /// Returns the measurement of a position and its covariance.
    pub fn new(position: Vector2<T>, cov: Matrix2<T>) -> Self {
        Self { position, cov }
    }

    /// Returns a measurement with the same standard deviation (px) in both axes, uncorrelated.
    pub fn isotropic(x: T, y: T, std: T) -> Self {
        Self { position: Vector2::new(x, y), cov: Matrix2::identity() * (std * std) }
    }

    /// Returns the measurement in another number type.
    #[inline(always)]
    pub fn cast<U: Real>(&self) -> Measurement<U> {
        Measurement { position: self.position.map(|v| U::of(v.as_f64())), cov: self.cov.map(|v| U::of(v.as_f64())) }
    }
}

impl<T: Real> Weighted<T> {
    /// Returns a measurement that is surely the target's own.
    pub fn sure(measurement: Measurement<T>) -> Self {
        Self { measurement, weight: T::one() }
    }

    /// Returns the hypothesis in another number type.
    #[inline(always)]
    pub fn cast<U: Real>(&self) -> Weighted<U> {
        Weighted { measurement: self.measurement.cast(), weight: U::of(self.weight.as_f64()) }
    }
}

/// Returns the marginal of a belief at the two position states.
#[inline(always)]
pub(crate) fn position_of<T: Real, const N: usize>(b: &Gaussian<N, T>, at: [usize; 2]) -> Gaussian<2, T> {
    let [i, j] = at;
    Gaussian {
        mean: Vector2::new(b.mean[i], b.mean[j]),
        cov: Matrix2::new(b.cov[(i, i)], b.cov[(i, j)], b.cov[(j, i)], b.cov[(j, j)]),
    }
}

/// Returns the log-likelihood of a measurement (density per px²) under a predicted position.
pub(crate) fn log_likelihood<T: Real>(p: &Gaussian<2, T>, m: &Measurement<T>) -> Result<T, FilterError> {
    let s = invert_pair(&(p.cov + m.cov), "the innovation covariance")?;
    Ok(s.log_likelihood(&(m.position - p.mean)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Matrix4, Vector4};

    #[test]
    fn a_measurement_of_a_deviation_has_its_square_as_variance() {
        let m = Measurement::isotropic(3.0, -4.0, 0.5);
        assert_eq!(m, Measurement::new(Vector2::new(3.0, -4.0), Matrix2::new(0.25, 0.0, 0.0, 0.25)));
        assert_eq!(Weighted::sure(m), Weighted { measurement: m, weight: 1.0 });
        assert_eq!(Weighted::sure(m).cast::<f32>().cast::<f64>(), Weighted::sure(m));
    }

    #[test]
    fn the_marginal_takes_the_rows_and_columns_of_the_position() {
        let cov = Matrix4::from_fn(|r, c| (10 * r + c) as f64);
        let p = position_of(&Gaussian::new(Vector4::new(1.0, 2.0, 3.0, 4.0), cov), [0, 2]);
        assert_eq!(p, Gaussian::new(Vector2::new(1.0, 3.0), Matrix2::new(0.0, 2.0, 20.0, 22.0)));
    }

    /// ln N(ν; 0, S) for S = 2 I: -ln(2π) - ln 2 - |ν|²/4.
    #[test]
    fn the_likelihood_is_the_density_of_the_innovation() {
        let p = Gaussian::<2>::new(Vector2::new(10.0, 20.0), Matrix2::identity());
        let at = |x: f64, y: f64| log_likelihood(&p, &Measurement::isotropic(x, y, 1.0)).unwrap();
        assert!((at(10.0, 20.0) + 2.531_024_246_969_290_7).abs() < 1e-14);
        assert!((at(12.0, 23.0) + 2.531_024_246_969_290_7 + 3.25).abs() < 1e-14);
        let sure = Gaussian { cov: Matrix2::zeros(), ..p };
        assert!(log_likelihood(&sure, &Measurement::isotropic(0.0, 0.0, 0.0)).is_err());
    }
}
