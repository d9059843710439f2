//! The fuzzy correlator in front of any Gaussian filter: the innovation is corrected before the filter sees it.
//!
//! Source: `docs/theory/adaptive.md`; Parimala and Raol, eq. 7. z is replaced by H x~ + r_flc(ν, ν - ν_last, S); the
//! covariance update is that of the plain filter. Departures: see [`crate::fuzzy`].
//! Weighted hypotheses (PDA): each is corrected by itself; ν_last is then their mean innovation by weight.
//! Symbols: ν = z - H x~ 2 x 1 (px); S = H P~ Hᵀ + R 2 x 2 (px²). Cost: two inferences, about 200 flops an update.
//! Limits: the covariance does not widen, so a filter that is too stiff stays over-confident.

use crate::check::check_measurement;
use crate::check::check_weighted;
use crate::fuzzy::Correlator;
use crate::{FilterError, Gaussian, GaussianFilter, Measurement, Real, Weighted};
use nalgebra::Vector2;

/// The correlator with what it remembers of the last update.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FuzzyInnovation<T = f64> {
    correlator: Correlator<T>,
    last: Option<Vector2<T>>,
}

impl<T: Real> FuzzyInnovation<T> {
    /// Starts without a last innovation: the first difference is 0.
    /// # Errors
    /// [`FilterError::OutOfRange`] if the correlator is not valid.
    pub fn new(correlator: Correlator<T>) -> Result<Self, FilterError> {
        correlator.validate()?;
        Ok(Self { correlator, last: None })
    }

    /// Returns the corrected innovation of a measurement (px), given the predicted position.
    /// # Errors
    /// [`FilterError`] for a measurement that is not finite or an innovation covariance that is not positive.
    pub fn corrected(&self, predicted: &Gaussian<2, T>, m: &Measurement<T>) -> Result<Vector2<T>, FilterError> {
        check_measurement(m)?;
        let s = predicted.cov + m.cov;
        let nu = m.position - predicted.mean;
        let mut out = Vector2::zeros();
        for i in 0..2 {
            let std = s[(i, i)].sqrt();
            if !(std > T::zero() && std <= T::MAX) {
                return Err(FilterError::NotPositiveDefinite("the innovation covariance"));
            }
            let difference = self.last.map_or(T::zero(), |last| nu[i] - last[i]);
            out[i] = self.correlator.correct(nu[i], difference, std);
        }
        Ok(out)
    }

    /// Returns the measurement with the corrected innovation.
    /// # Errors
    /// As [`FuzzyInnovation::corrected`].
    pub fn moved(&self, predicted: &Gaussian<2, T>, m: &Measurement<T>) -> Result<Measurement<T>, FilterError> {
        Ok(Measurement { position: predicted.mean + self.corrected(predicted, m)?, cov: m.cov })
    }

    /// Notes the innovation of an update (px), for the difference of the next one.
    pub fn remember(&mut self, innovation: Vector2<T>) {
        self.last = Some(innovation);
    }
}

/// A filter whose innovation passes the fuzzy correlator.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fuzzy<F, T = f64> {
    filter: F,
    innovation: FuzzyInnovation<T>,
}

impl<F, T: Real> Fuzzy<F, T> {
    /// Wraps a filter.
    /// # Errors
    /// [`FilterError::OutOfRange`] if the correlator is not valid.
    pub fn new(filter: F, correlator: Correlator<T>) -> Result<Self, FilterError> {
        Ok(Self { filter, innovation: FuzzyInnovation::new(correlator)? })
    }

    /// Returns the filter inside.
    pub fn inner(&self) -> &F {
        &self.filter
    }

    pub(crate) fn inner_mut(&mut self) -> &mut F {
        &mut self.filter
    }

    /// Returns the corrected innovation of a measurement (px).
    /// # Errors
    /// As [`FuzzyInnovation::corrected`].
    pub fn corrected_innovation<const N: usize>(&self, m: &Measurement<T>) -> Result<Vector2<T>, FilterError>
    where
        F: GaussianFilter<N, Real = T>,
    {
        self.innovation.corrected(&self.filter.predicted(), m)
    }
}

impl<F: GaussianFilter<N, Real = T>, const N: usize, T: Real> GaussianFilter<N> for Fuzzy<F, T> {
    type Real = T;
    fn predict(&mut self, dt_s: T) -> Result<(), FilterError> {
        self.filter.predict(dt_s)
    }
    fn correct(&mut self, m: &Measurement<T>) -> Result<(), FilterError> {
        let predicted = self.filter.predicted();
        self.filter.correct(&self.innovation.moved(&predicted, m)?)?;
        self.innovation.remember(m.position - predicted.mean);
        Ok(())
    }
    fn correct_weighted<I>(&mut self, hypotheses: I) -> Result<(), FilterError>
    where
        I: Iterator<Item = Weighted<T>> + Clone,
    {
        let (sum, _) = check_weighted(hypotheses.clone())?;
        if sum == T::zero() {
            return Ok(());
        }
        let predicted = self.filter.predicted();
        // The next difference is taken from the mean innovation of the likely measurements.
        let mut mean = Vector2::zeros();
        for h in hypotheses.clone() {
            self.innovation.corrected(&predicted, &h.measurement)?;
            mean += (h.measurement.position - predicted.mean) * (h.weight / sum);
        }
        let before = self.innovation;
        self.filter.correct_weighted(hypotheses.map(move |h| Weighted {
            // Checked above: the fallback is never taken.
            measurement: before.moved(&predicted, &h.measurement).unwrap_or(h.measurement),
            weight: h.weight,
        }))?;
        self.innovation.remember(mean);
        Ok(())
    }

    crate::filter::belief_of_the_filter_inside!();
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::ConstantVelocity;
    use crate::{Kf, Start};

    #[test]
    fn a_first_near_measurement_is_used_as_by_the_plain_filter_and_a_far_one_saturates() {
        let cv = ConstantVelocity::discrete(0.5).unwrap();
        let kf = Kf::<_, 4>::from_point(cv, &Measurement::isotropic(0.0, 0.0, 1.0), 1.0).unwrap();
        let (mut plain, mut fuzzy) = (kf, Fuzzy::new(kf, Correlator::default()).unwrap());
        let near = Measurement::isotropic(0.5, -0.5, 1.0);
        plain.correct(&near).unwrap();
        fuzzy.correct(&near).unwrap();
        assert!((plain.belief().mean - fuzzy.belief().mean).norm() < 1e-12_f64);
        assert_eq!(plain.belief().cov, fuzzy.belief().cov);
        let far = Fuzzy::new(kf, Correlator::default()).unwrap();
        let nu = far.corrected_innovation(&Measurement::isotropic(1e6, 0.0, 1.0)).unwrap();
        // S = 1 + 1, and the correlator saturates at two of its standard deviations.
        assert!((nu[0] - 2.0 * 2.0_f64.sqrt()).abs() < 1e-12, "{nu}");
    }
}
