//! The association probabilities of probabilistic data association: which measurement in the gate is the target's own.
//!
//! Source: `docs/theory/association.md`, with the corrections to the thesis: e_i = exp(-d_i²/2),
//! b = λ sqrt(det 2πS) (1 - P_D P_G)/P_D, p_i = e_i/(b + Σ e), p_0 = b/(b + Σ e). The weights go to [`crate::Filter::update`], which makes the
//! PDA update.
//! Differs from it: with measurements of different covariance, e_i is divided by sqrt(det S_i) and b becomes
//! 2π λ (1 - P_D P_G)/P_D, which is the same for equal covariances. The exponents are shifted by the smallest d², so
//! far measurements do not underflow to 0/0.
//! Symbols: λ clutter density (false measurements per px²); P_D, P_G probabilities of detection and of the gate.
//! Limits: one target; the sum runs over gated measurements only. Cost: about 30 flops and one exponential a
//! measurement.

use crate::linalg::invert_pair;
use crate::{FilterError, Gaussian, Measurement, Real};

/// What the scene says about detection and clutter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Clutter<T = f64> {
    /// False measurements per px², at least 0.
    pub density: T,
    /// Probability that the target is detected, in (0, 1].
    pub detection_probability: T,
    /// Probability that the target's measurement falls into the gate, in (0, 1].
    pub gate_probability: T,
}

/// Writes the probability of each measurement to `out` and returns p0, the probability that none is the target's own.
///
/// `out` must be as long as the measurements; only measurements inside the gate belong here.
/// The worked example of `docs/theory/association.md`:
/// ```
/// use boresight_filters::{Gaussian, Measurement, pda::{Clutter, association_probabilities}};
/// use nalgebra::{Matrix2, Vector2};
/// let predicted = Gaussian { mean: Vector2::new(30.0, 20.0), cov: Matrix2::identity() };
/// let z = [(30.8, 19.6), (28.9, 21.2)]
///     .map(|(x, y)| Measurement { position: Vector2::new(x, y), cov: Matrix2::identity() * 0.5 });
/// let clutter = Clutter { density: 0.02, detection_probability: 0.9, gate_probability: 0.99 };
/// let mut p = [0.0; 2];
/// let p0 = association_probabilities(&predicted, &z, &clutter, &mut p).unwrap();
/// assert!((p0 - 0.018989909403364_f64).abs() < 1e-12);
/// assert!((p[0] - 0.63712686724844_f64).abs() < 1e-12 && (p[1] - 0.3438832233482).abs() < 1e-12);
/// ```
/// # Errors
/// [`FilterError`] for probabilities outside their range, measurements that are not finite, or lengths that differ.
pub fn association_probabilities<T: Real>(
    predicted: &Gaussian<2, T>,
    measurements: &[Measurement<T>],
    clutter: &Clutter<T>,
    out: &mut [T],
) -> Result<T, FilterError> {
    let (pd, pg) = (clutter.detection_probability, clutter.gate_probability);
    if !(pd > T::zero() && pd <= T::one() && pg > T::zero() && pg <= T::one()) {
        return Err(FilterError::OutOfRange("detection and gate probabilities in (0, 1]"));
    }
    if !(clutter.density >= T::zero() && clutter.density <= T::MAX) {
        return Err(FilterError::OutOfRange("a clutter density of at least 0 per px²"));
    }
    if out.len() != measurements.len() {
        return Err(FilterError::OutOfRange("as many places for probabilities as measurements"));
    }
    // Log of e_i / sqrt(det S_i), then the largest is taken off before exp.
    let half = T::of(0.5);
    let mut largest = -T::MAX;
    for (m, o) in measurements.iter().zip(out.iter_mut()) {
        crate::check::check_measurement(m)?;
        let s = invert_pair(&(predicted.cov + m.cov), "the innovation covariance")?;
        *o = -half * (s.distance2(&(m.position - predicted.mean)) + s.det.ln());
        largest = largest.max(*o);
    }
    let none = T::two_pi() * clutter.density * (T::one() - pd * pg) / pd;
    if measurements.is_empty() {
        return Ok(T::one());
    }
    // Weighed against e^largest; if that overflows, clutter explains everything.
    let b = none * (-largest).exp();
    if !(b <= T::MAX) {
        out.fill(T::zero());
        return Ok(T::one());
    }
    let mut sum = b;
    for o in out.iter_mut() {
        *o = (*o - largest).exp();
        sum += *o;
    }
    for o in out.iter_mut() {
        *o /= sum;
    }
    Ok(b / sum)
}
