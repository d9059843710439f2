//! Robust innovation on any Gaussian filter: Huber or Student-t.
//!
//! Source: P. J. Huber, *Robust Statistics*, 1981 (weight min(1, k/d)); M. Roth, E. Özkan, F. Gustafsson, "A Student's t
//! filter for heavy tailed process and measurement noise", ICASSP 2013 (weight (ν + 2)/(ν + d²)).
//! d² = νᵀ S⁻¹ ν: S is replaced by S/w with w <= 1, that is R by R/w + H P Hᵀ (1/w - 1). The gain
//! and the information of a far measurement both shrink by w, in every form of the filter, and |shift| stays bounded.
//! Differs from it: Roth's growth of all covariances for d² above its mean is left out: the belief stays Gaussian.
//! Symbols: ν 2 x 1 (px); S, R 2 x 2 (px²); w, k, n no unit. Cost: about 40 flops on top of the filter's.
//! Limits: a true manoeuvre looks like a row of outliers; with Huber k = 2 the filter follows it later.

use crate::check::check_measurement;
use crate::check::check_weighted;
use crate::linalg::invert_pair;
use crate::{FilterError, Gaussian, GaussianFilter, Measurement, Real, Weighted};

/// How a far innovation is held back.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum InnovationRule<T = f64> {
    /// Taken as it is.
    Plain,
    /// Huber weight min(1, k/d): full trust up to `k` standard deviations. 2 keeps 86 % of true measurements whole.
    Huber {
        /// Threshold k in standard deviations, above 0.
        threshold: T,
    },
    /// Student-t weight (n + 2)/(n + d²), at most 1. 4 is a common choice; the larger, the nearer to the plain filter.
    StudentT {
        /// Degrees of freedom n, above 0.
        degrees_of_freedom: T,
    },
}

impl<T: Real> InnovationRule<T> {
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

    /// Returns the measurement with the covariance that gives its innovation the weight of the rule.
    /// # Errors
    /// [`FilterError`] for a measurement that is not finite or an innovation covariance that cannot be factored.
    pub fn soften(&self, predicted: &Gaussian<2, T>, m: &Measurement<T>) -> Result<Measurement<T>, FilterError> {
        check_measurement(m)?;
        let s = predicted.cov + m.cov;
        let d2 = invert_pair(&s, "the innovation covariance")?.distance2(&(m.position - predicted.mean));
        let w = self.weight(d2);
        if w == T::one() {
            return Ok(*m);
        }
        if !(w > T::zero()) {
            return Err(FilterError::NotFinite("the distance of the measurement"));
        }
        Ok(Measurement { position: m.position, cov: m.cov / w + predicted.cov * (T::one() / w - T::one()) })
    }

    /// Checks the parameter of the rule.
    /// # Errors
    /// [`FilterError::OutOfRange`] if it is not above 0.
    pub fn validate(&self) -> Result<(), FilterError> {
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
    innovation: InnovationRule<T>,
}

impl<F, T: Real> Robust<F, T> {
    /// Wraps a filter.
    /// # Errors
    /// [`FilterError::OutOfRange`] if the parameter of the innovation is not above 0.
    pub fn new(filter: F, innovation: InnovationRule<T>) -> Result<Self, FilterError> {
        innovation.validate()?;
        Ok(Self { filter, innovation })
    }

    /// Returns the filter inside.
    pub fn inner(&self) -> &F {
        &self.filter
    }
}

impl<F: GaussianFilter<N, Real = T>, const N: usize, T: Real> GaussianFilter<N> for Robust<F, T> {
    type Real = T;
    fn predict(&mut self, dt_s: T) -> Result<(), FilterError> {
        self.filter.predict(dt_s)
    }
    fn correct(&mut self, m: &Measurement<T>) -> Result<(), FilterError> {
        let soft = self.innovation.soften(&self.filter.predicted(), m)?;
        self.filter.correct(&soft)
    }
    fn correct_weighted<I>(&mut self, hypotheses: I) -> Result<(), FilterError>
    where
        I: Iterator<Item = Weighted<T>> + Clone,
    {
        check_weighted(hypotheses.clone())?;
        let predicted = self.filter.predicted();
        for h in hypotheses.clone() {
            self.innovation.soften(&predicted, &h.measurement)?;
        }
        let innovation = self.innovation;
        self.filter.correct_weighted(hypotheses.map(move |h| Weighted {
            // Checked above: the fallback is never taken.
            measurement: innovation.soften(&predicted, &h.measurement).unwrap_or(h.measurement),
            weight: h.weight,
        }))
    }

    crate::filter::belief_of_the_filter_inside!();
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::ConstantVelocity;
    use crate::{Kf, Start};
    use nalgebra::Matrix2;

    fn kf() -> Kf<ConstantVelocity, 4> {
        let cv = ConstantVelocity::discrete(0.5).unwrap();
        Kf::from_point(cv, &Measurement::isotropic(0.0, 0.0, 1.0), 1.0).unwrap()
    }

    #[test]
    fn a_near_measurement_is_used_as_by_the_plain_filter() {
        let near = Measurement::isotropic(0.5, -0.5, 1.0);
        let mut plain = kf();
        plain.correct(&near).unwrap();
        let mut huber = Robust::new(kf(), InnovationRule::Huber { threshold: 2.0 }).unwrap();
        huber.correct(&near).unwrap();
        assert_eq!(plain.belief(), huber.belief());
    }

    #[test]
    fn the_pull_of_an_outlier_is_bounded() {
        for rule in [InnovationRule::Huber { threshold: 2.0 }, InnovationRule::StudentT { degrees_of_freedom: 4.0 }] {
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
        let rule = InnovationRule::Huber { threshold: 2.0 };
        let w = rule.weight(100.0 / 2.0);
        let soft = rule.soften(&p, &m).unwrap();
        assert!(((p.cov + soft.cov) - (p.cov + m.cov) / w).norm() < 1e-12);
    }

    #[test]
    fn the_weights_are_those_of_the_sources() {
        let huber = InnovationRule::Huber { threshold: 2.0 };
        for (d2, w) in [(0.0, 1.0), (4.0, 1.0), (16.0, 0.5), (100.0, 0.2)] {
            assert_eq!(huber.weight(d2), w, "Huber at {d2}");
        }
        let student = InnovationRule::StudentT { degrees_of_freedom: 4.0 };
        for (d2, w) in [(0.0, 1.0), (2.0, 1.0), (8.0, 0.5), (26.0, 0.2)] {
            assert_eq!(student.weight(d2), w, "Student-t at {d2}");
        }
        assert_eq!(InnovationRule::Plain.weight(1e9), 1.0);
    }

    #[test]
    fn a_parameter_is_above_0() {
        assert!(InnovationRule::<f64>::Plain.validate().is_ok());
        for (v, fine) in [(0.5, true), (0.0, false), (-1.0, false), (f64::NAN, false), (f64::INFINITY, false)] {
            assert_eq!(InnovationRule::Huber { threshold: v }.validate().is_ok(), fine, "threshold {v}");
            assert_eq!(InnovationRule::StudentT { degrees_of_freedom: v }.validate().is_ok(), fine, "degrees {v}");
            assert_eq!(Robust::new(kf(), InnovationRule::Huber { threshold: v }).is_ok(), fine);
        }
    }

    #[test]
    fn a_measurement_infinitely_far_is_refused() {
        let far = Measurement::isotropic(1e200, 0.0, 1e-100);
        let sharp = Gaussian { cov: Matrix2::identity() * 1e-200, ..kf().predicted() };
        assert!(InnovationRule::Huber { threshold: 2.0 }.soften(&sharp, &far).is_err());
    }
}
