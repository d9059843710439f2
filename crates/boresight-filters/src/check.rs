//! What a filter refuses: time steps, measurements, weights, beliefs and strengths that are no such things.

use crate::linalg::is_symmetric;
use crate::real::all_finite;
use crate::{FilterError, Gaussian, Measurement, Real, Weighted};

/// Refuses a time step that is negative or not finite.
#[inline(always)]
pub(crate) fn check_dt<T: Real>(dt_s: T) -> Result<(), FilterError> {
    if dt_s >= T::zero() && dt_s <= T::MAX {
        Ok(())
    } else if dt_s < T::zero() {
        Err(FilterError::OutOfRange("a time step of at least 0 s"))
    } else {
        Err(FilterError::NotFinite("the time step"))
    }
}

/// Refuses a measurement that is not finite or whose covariance is not symmetric positive semi-definite.
#[inline(always)]
pub(crate) fn check_measurement<T: Real>(m: &Measurement<T>) -> Result<(), FilterError> {
    if !all_finite(&m.position) {
        return Err(FilterError::NotFinite("the measured position"));
    }
    let (a, b, c) = (m.cov[(0, 0)], m.cov[(1, 0)], m.cov[(1, 1)]);
    if a >= T::zero() && c >= T::zero() && a + c <= T::MAX && b == T::zero() && m.cov[(0, 1)] == T::zero() {
        return Ok(());
    }
    check_full_covariance(m)
}

#[cold]
fn check_full_covariance<T: Real>(m: &Measurement<T>) -> Result<(), FilterError> {
    if !all_finite(&m.cov) {
        return Err(FilterError::NotFinite("the measurement covariance"));
    }
    let (a, b, c) = (m.cov[(0, 0)], m.cov[(1, 0)], m.cov[(1, 1)]);
    // One rounding error of slack: a covariance made of products may be singular by its own rounding.
    let slack = T::one() + T::EPSILON * T::of(8.0);
    if !is_symmetric(&m.cov) || a < T::zero() || c < T::zero() || b.abs() > (a.sqrt() * c.sqrt()) * slack {
        return Err(FilterError::NotPositiveDefinite("the measurement covariance"));
    }
    Ok(())
}

/// Refuses a belief that is not finite, not symmetric or has a negative variance.
pub(crate) fn check_belief<T: Real, const N: usize>(b: &Gaussian<N, T>) -> Result<(), FilterError> {
    if !all_finite(&b.mean) {
        return Err(FilterError::NotFinite("the state"));
    }
    if !all_finite(&b.cov) {
        return Err(FilterError::NotFinite("the state covariance"));
    }
    if !is_symmetric(&b.cov) || (0..N).any(|i| b.cov[(i, i)] < T::zero()) {
        return Err(FilterError::NotPositiveDefinite("the state covariance"));
    }
    Ok(())
}

/// Weights may exceed 1 by their rounding.
fn weight_slack<T: Real>() -> T {
    T::EPSILON * T::of(64.0)
}

/// Checks all hypotheses and returns the sum of weights and how many have a weight above 0.
pub(crate) fn check_weighted<T: Real>(
    hypotheses: impl Iterator<Item = Weighted<T>>,
) -> Result<(T, usize), FilterError> {
    // In f64 for f32 too: a hundred thousand small weights must not add up to more than 1 by rounding.
    let (mut sum, mut n) = (0.0, 0);
    for h in hypotheses {
        check_measurement(&h.measurement)?;
        if !(h.weight >= T::zero() && h.weight <= T::one() + weight_slack()) {
            return Err(FilterError::OutOfRange("weights in 0..=1"));
        }
        sum += h.weight.as_f64();
        n += usize::from(h.weight > T::zero());
    }
    if sum > 1.0 + weight_slack::<T>().as_f64() + f64::EPSILON * n as f64 {
        Err(FilterError::OutOfRange("weights that sum to at most 1"))
    } else {
        Ok((T::of(sum), n))
    }
}

/// Returns whether a noise strength is usable: finite and at least 0.
pub(crate) fn check_strength<T: Real>(value: T, what: &'static str) -> Result<T, FilterError> {
    if value >= T::zero() && value <= T::MAX { Ok(value) } else { Err(FilterError::OutOfRange(what)) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Matrix2, Vector2};

    fn measured(cov: Matrix2<f64>) -> Result<(), FilterError> {
        check_measurement(&Measurement::new(Vector2::new(1.0, 2.0), cov))
    }

    #[test]
    fn a_time_step_is_any_ordinary_number_of_at_least_0() {
        assert!(check_dt(0.0).is_ok() && check_dt(f64::MAX).is_ok());
        assert!(matches!(check_dt(-1e-300), Err(FilterError::OutOfRange(_))));
        assert!(matches!(check_dt(f64::NEG_INFINITY), Err(FilterError::OutOfRange(_))));
        assert!(matches!(check_dt(f64::INFINITY), Err(FilterError::NotFinite(_))));
        assert!(matches!(check_dt(f64::NAN), Err(FilterError::NotFinite(_))));
    }

    #[test]
    fn a_measurement_covariance_may_be_singular_but_not_indefinite() {
        for fine in [Matrix2::zeros(), Matrix2::new(4.0, 6.0, 6.0, 9.0), Matrix2::new(4.0, -6.0, -6.0, 9.0)] {
            assert!(measured(fine).is_ok(), "{fine}");
        }
        // 6 is sqrt(4 * 9): a part in 1e13 more is no rounding error.
        let more = 6.0 * (1.0 + 1e-13);
        let wrong = [
            Matrix2::new(4.0, more, more, 9.0),
            Matrix2::new(4.0, -more, -more, 9.0),
            Matrix2::new(-4.0, 0.0, 0.0, 9.0),
            Matrix2::new(4.0, 0.0, 0.0, -9.0),
            Matrix2::new(-4.0, 1.0, 1.0, -9.0),
            Matrix2::new(4.0, 1.0, 0.0, 9.0),
            Matrix2::new(4.0, 0.0, 1.0, 9.0),
        ];
        for cov in wrong {
            assert!(matches!(measured(cov), Err(FilterError::NotPositiveDefinite(_))), "{cov}");
        }
        assert!(matches!(measured(Matrix2::repeat(f64::NAN)), Err(FilterError::NotFinite(_))));
        let nowhere = Measurement::isotropic(f64::NAN, 0.0, 1.0);
        assert_eq!(check_measurement(&nowhere), Err(FilterError::NotFinite("the measured position")));
    }

    #[test]
    fn a_belief_is_refused_for_the_part_that_is_wrong() {
        let good = Gaussian::<2>::new(Vector2::new(1.0, 2.0), Matrix2::new(2.0, 0.5, 0.5, 0.0));
        assert!(check_belief(&good).is_ok());
        let mean = Gaussian { mean: Vector2::new(1.0, f64::INFINITY), ..good };
        assert_eq!(check_belief(&mean), Err(FilterError::NotFinite("the state")));
        let cov = Gaussian { cov: good.cov * f64::NAN, ..good };
        assert_eq!(check_belief(&cov), Err(FilterError::NotFinite("the state covariance")));
        for cov in [Matrix2::new(2.0, 0.5, 0.4, 1.0), Matrix2::new(2.0, 0.0, 0.0, -1e-12)] {
            assert!(
                matches!(check_belief(&Gaussian { cov, ..good }), Err(FilterError::NotPositiveDefinite(_))),
                "{cov}"
            );
        }
    }

    #[test]
    fn weights_sum_to_at_most_1_and_those_of_0_do_not_count() {
        let of = |weights: &[f64]| {
            let m = Measurement::isotropic(0.0, 0.0, 1.0);
            check_weighted(weights.iter().map(|&weight| Weighted { measurement: m, weight }))
        };
        assert_eq!(of(&[]), Ok((0.0, 0)));
        assert_eq!(of(&[0.25, 0.0, 0.5]), Ok((0.75, 2)));
        assert!(of(&[1.0 + 32.0 * f64::EPSILON]).is_ok(), "a rounding error above 1");
        for wrong in [&[1.0 + 1e-12][..], &[-1e-12], &[f64::NAN], &[0.5, 0.5, 1e-12]] {
            assert!(matches!(of(wrong), Err(FilterError::OutOfRange(_))), "{wrong:?}");
        }
    }

    #[test]
    fn a_strength_is_a_finite_number_of_at_least_0() {
        assert_eq!(check_strength(0.0, "a strength"), Ok(0.0));
        assert_eq!(check_strength(f64::MAX, "a strength"), Ok(f64::MAX));
        for wrong in [-1e-300, f64::INFINITY, f64::NAN] {
            assert_eq!(check_strength(wrong, "a strength"), Err(FilterError::OutOfRange("a strength")));
        }
    }
}
