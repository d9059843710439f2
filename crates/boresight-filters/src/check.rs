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
