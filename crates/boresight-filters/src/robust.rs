//! Robust innovation on any Gaussian filter: Huber, Student-t, or the fuzzy correlator.
//!
//! Source: P. J. Huber, *Robust Statistics*, 1981 (weight min(1, k/d)); M. Roth, E. Özkan, F. Gustafsson, "A Student's t
//! filter for heavy tailed process and measurement noise", ICASSP 2013 (weight (ν + 2)/(ν + d²)); SPEC G.1 (fuzzy).
//! Huber and Student-t, d² = νᵀ S⁻¹ ν: S is replaced by S/w with w <= 1, that is R by R/w + H P Hᵀ (1/w - 1). The gain
//! and the information of a far measurement both shrink by w, in every form of the filter, and |shift| stays bounded.
//! Fuzzy: z is replaced by H x + r_flc, the covariance update is unchanged (D3's X^ = X~ + K C(k+1)).
//! Differs from it: Roth's growth of all covariances for d² above its mean is left out: the belief stays Gaussian.
//! Limits: a true manoeuvre looks like a row of outliers; with Huber k = 2 the filter follows it later.

use crate::filter::check_measurement;
use crate::fuzzy::Correlator;
use crate::linalg::invert_pair;
use crate::mixture::check_weighted;
use crate::{FilterError, Gaussian, GaussianFilter, Measurement, Real, Weighted};
use nalgebra::Vector2;

/// How a far innovation is held back.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum Innovation<T = f64> {
    /// Taken as it is.
    Plain,
    /// Huber weight min(1, k/d): full trust up to `k` standard deviations. 2 keeps 86 % of true measurements whole.
    Huber {
        /// Threshold k in standard deviations, above 0.
        threshold: T,
    },
    /// Student-t weight (n + 2)/(n + d²), at most 1. 4 is a common choice; infinity is the plain filter.
    StudentT {
        /// Degrees of freedom n, above 0.
        degrees_of_freedom: T,
    },
}

impl<T: Real> Innovation<T> {
    /// Returns the weight of a measurement at squared distance d² (no unit), in (0, 1].
    pub fn weight(&self, distance2: T) -> T {
        match *self {
            Self::Plain => T::one(),
            Self::Huber { threshold } => {
                let d = distance2.sqrt();
                if d > threshold { threshold / d } else { T::one() }
            }
            Self::StudentT { degrees_of_freedom: n } => ((n + T::of(2.0)) / (n + distance2)).min(T::one()),
        }
    }

    fn validate(&self) -> Result<(), FilterError> {
        match *self {
            Self::Plain => Ok(()),
            Self::Huber { threshold: v } | Self::StudentT { degrees_of_freedom: v } if v > T::zero() && v <= T::MAX => {
                Ok(())
            }
            Self::Huber { .. } => Err(FilterError::OutOfRange("a Huber threshold above 0")),
            Self::StudentT { .. } => Err(FilterError::OutOfRange("degrees of freedom above 0")),
        }
    }
}

/// A filter with a robust innovation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Robust<F, T = f64> {
    filter: F,
    innovation: Innovation<T>,
}

impl<F, T: Real> Robust<F, T> {
    /// Wraps a filter.
    /// # Errors
    /// [`FilterError::OutOfRange`] if the parameter of the innovation is not above 0.
    pub fn new(filter: F, innovation: Innovation<T>) -> Result<Self, FilterError> {
        innovation.validate()?;
        Ok(Self { filter, innovation })
    }

    /// Returns the filter inside.
    pub fn inner(&self) -> &F {
        &self.filter
    }
}

/// Returns the measurement with the covariance that gives its innovation the weight of the robust rule.
fn softened<T: Real>(
    innovation: &Innovation<T>,
    predicted: &Gaussian<2, T>,
    m: &Measurement<T>,
) -> Result<Measurement<T>, FilterError> {
    check_measurement(m)?;
    let s = predicted.cov + m.cov;
    let d2 = invert_pair(&s, "the innovation covariance")?.distance2(&(m.position - predicted.mean));
    let w = innovation.weight(d2);
    if w == T::one() {
        return Ok(*m);
    }
    if !(w > T::zero()) {
        return Err(FilterError::NotFinite("the distance of the measurement"));
    }
    Ok(Measurement { position: m.position, cov: m.cov / w + predicted.cov * (T::one() / w - T::one()) })
}

impl<F: GaussianFilter<N, Real = T>, const N: usize, T: Real> GaussianFilter<N> for Robust<F, T> {
    type Real = T;
    fn predict(&mut self, dt_s: T) -> Result<(), FilterError> {
        self.filter.predict(dt_s)
    }
    fn correct(&mut self, m: &Measurement<T>) -> Result<(), FilterError> {
        let soft = softened(&self.innovation, &self.filter.predicted(), m)?;
        self.filter.correct(&soft)
    }
    fn correct_weighted<I>(&mut self, hypotheses: I) -> Result<(), FilterError>
    where
        I: Iterator<Item = Weighted<T>> + Clone,
    {
        check_weighted(hypotheses.clone())?;
        let predicted = self.filter.predicted();
        for h in hypotheses.clone() {
            softened(&self.innovation, &predicted, &h.measurement)?;
        }
        let innovation = self.innovation;
        self.filter.correct_weighted(hypotheses.map(move |h| Weighted {
            // Checked above: the fallback is never taken.
            measurement: softened(&innovation, &predicted, &h.measurement).unwrap_or(h.measurement),
            weight: h.weight,
        }))
    }
    fn belief(&self) -> Gaussian<N, T> {
        self.filter.belief()
    }
    fn set_belief(&mut self, belief: &Gaussian<N, T>) -> Result<(), FilterError> {
        self.filter.set_belief(belief)
    }
    fn position_at(&self) -> [usize; 2] {
        self.filter.position_at()
    }
    fn kinematics(&self) -> Gaussian<4, T> {
        self.filter.kinematics()
    }
    fn predicted(&self) -> Gaussian<2, T> {
        self.filter.predicted()
    }
}

/// A filter whose innovation passes the fuzzy correlator.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fuzzy<F, T = f64> {
    filter: F,
    correlator: Correlator<T>,
    last: Option<Vector2<T>>,
}

impl<F, T: Real> Fuzzy<F, T> {
    /// Wraps a filter.
    /// # Errors
    /// [`FilterError::OutOfRange`] if the correlator is not valid.
    pub fn new(filter: F, correlator: Correlator<T>) -> Result<Self, FilterError> {
        correlator.validate()?;
        Ok(Self { filter, correlator, last: None })
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
    /// [`FilterError`] for a measurement that is not finite or an innovation covariance that is not positive.
    pub fn corrected_innovation<const N: usize>(&self, m: &Measurement<T>) -> Result<Vector2<T>, FilterError>
    where
        F: GaussianFilter<N, Real = T>,
    {
        self.map(&self.filter.predicted(), m)
    }

    fn map(&self, predicted: &Gaussian<2, T>, m: &Measurement<T>) -> Result<Vector2<T>, FilterError> {
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
}

impl<F: GaussianFilter<N, Real = T>, const N: usize, T: Real> GaussianFilter<N> for Fuzzy<F, T> {
    type Real = T;
    fn predict(&mut self, dt_s: T) -> Result<(), FilterError> {
        self.filter.predict(dt_s)
    }
    fn correct(&mut self, m: &Measurement<T>) -> Result<(), FilterError> {
        let predicted = self.filter.predicted();
        let position = predicted.mean + self.map(&predicted, m)?;
        self.filter.correct(&Measurement { position, cov: m.cov })?;
        self.last = Some(m.position - predicted.mean);
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
            self.map(&predicted, &h.measurement)?;
            mean += (h.measurement.position - predicted.mean) * (h.weight / sum);
        }
        let before = Fuzzy { filter: (), correlator: self.correlator, last: self.last };
        self.filter.correct_weighted(hypotheses.map(move |h| Weighted {
            measurement: Measurement {
                // Checked above: the fallback is never taken.
                position:
                    before.map(&predicted, &h.measurement).map_or(h.measurement.position, |nu| predicted.mean + nu),
                cov: h.measurement.cov,
            },
            weight: h.weight,
        }))?;
        self.last = Some(mean);
        Ok(())
    }
    fn belief(&self) -> Gaussian<N, T> {
        self.filter.belief()
    }
    fn set_belief(&mut self, belief: &Gaussian<N, T>) -> Result<(), FilterError> {
        self.filter.set_belief(belief)
    }
    fn position_at(&self) -> [usize; 2] {
        self.filter.position_at()
    }
    fn kinematics(&self) -> Gaussian<4, T> {
        self.filter.kinematics()
    }
    fn predicted(&self) -> Gaussian<2, T> {
        self.filter.predicted()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::ConstantVelocity;
    use crate::{Kf, Start};

    fn kf() -> Kf<ConstantVelocity, 4> {
        let cv = ConstantVelocity::discrete(0.5).unwrap();
        Kf::from_point(cv, &Measurement::isotropic(0.0, 0.0, 1.0), 1.0).unwrap()
    }

    #[test]
    fn a_near_measurement_is_used_as_by_the_plain_filter() {
        let near = Measurement::isotropic(0.5, -0.5, 1.0);
        let mut plain = kf();
        plain.correct(&near).unwrap();
        let mut huber = Robust::new(kf(), Innovation::Huber { threshold: 2.0 }).unwrap();
        huber.correct(&near).unwrap();
        assert_eq!(plain.belief(), huber.belief());
    }

    #[test]
    fn the_pull_of_an_outlier_is_bounded() {
        for rule in [Innovation::Huber { threshold: 2.0 }, Innovation::StudentT { degrees_of_freedom: 4.0 }] {
            let mut f = Robust::new(kf(), rule).unwrap();
            f.correct(&Measurement::isotropic(1e6, 0.0, 1.0)).unwrap();
            assert!(f.belief().mean[0].abs() < 2.0, "{rule:?}: {}", f.belief().mean[0]);
            assert!(f.belief().cov[(0, 0)] > 0.99, "{rule:?}: an outlier carries no information");
        }
    }

    #[test]
    fn the_softened_innovation_covariance_is_the_plain_one_over_the_weight() {
        let p = kf().predicted();
        let m = Measurement::isotropic(8.0, 6.0, 1.0);
        let rule = Innovation::Huber { threshold: 2.0 };
        let w = rule.weight(100.0 / 2.0);
        let soft = softened(&rule, &p, &m).unwrap();
        assert!(((p.cov + soft.cov) - (p.cov + m.cov) / w).norm() < 1e-12);
    }
}
