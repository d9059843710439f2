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
    // Without clutter nothing else explains them, and 0 * e^∞ would be no number.
    let b = if none > T::zero() { none * (-largest).exp() } else { T::zero() };
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

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Matrix2, Vector2};

    const CLUTTER: Clutter = Clutter { density: 0.02, detection_probability: 0.9, gate_probability: 0.99 };

    fn predicted() -> Gaussian<2> {
        Gaussian::new(Vector2::new(30.0, 20.0), Matrix2::new(1.0, 0.3, 0.3, 2.0))
    }

    fn probabilities(z: &[Measurement], clutter: &Clutter) -> Result<(f64, [f64; 2]), FilterError> {
        let mut p = [0.5; 2];
        association_probabilities(&predicted(), z, clutter, &mut p[..z.len()]).map(|p0| (p0, p))
    }

    /// The sum that Bayes' rule gives, with the densities themselves.
    #[test]
    fn measurements_of_different_covariance_are_weighed_by_their_densities() {
        let z = [Measurement::isotropic(30.8, 19.6, 0.7), Measurement::isotropic(28.9, 21.2, 1.5)];
        let density = |m: &Measurement| {
            let (s, nu) = (predicted().cov + m.cov, m.position - predicted().mean);
            let d2 = (s.try_inverse().unwrap() * nu).dot(&nu);
            (-0.5 * d2).exp() / (core::f64::consts::TAU * s.determinant().sqrt())
        };
        let none = 0.02 * (1.0 - 0.9 * 0.99) / 0.9;
        let sum = none + density(&z[0]) + density(&z[1]);
        let (p0, p) = probabilities(&z, &CLUTTER).unwrap();
        assert!((p0 - none / sum).abs() < 1e-14);
        assert!((p[0] - density(&z[0]) / sum).abs() < 1e-14 && (p[1] - density(&z[1]) / sum).abs() < 1e-14);
    }

    #[test]
    fn without_clutter_one_of_the_measurements_is_the_target_however_far() {
        let z = [Measurement::isotropic(1e5, 0.0, 1.0), Measurement::isotropic(-1e6, 0.0, 1.0)];
        let (p0, p) = probabilities(&z, &Clutter { density: 0.0, ..CLUTTER }).unwrap();
        assert_eq!((p0, p), (0.0, [1.0, 0.0]));
    }

    #[test]
    fn clutter_explains_what_is_too_far() {
        let (p0, p) = probabilities(&[Measurement::isotropic(1e5, 0.0, 1.0); 2], &CLUTTER).unwrap();
        assert_eq!((p0, p), (1.0, [0.0, 0.0]));
        assert_eq!(probabilities(&[], &CLUTTER).unwrap().0, 1.0);
    }

    #[test]
    fn probabilities_lie_above_0_up_to_1_and_densities_at_least_at_0() {
        let z = [Measurement::isotropic(30.0, 20.0, 1.0)];
        assert!(probabilities(&z, &Clutter { detection_probability: 1.0, gate_probability: 1.0, ..CLUTTER }).is_ok());
        for wrong in [0.0, -0.1, 1.1, f64::NAN] {
            assert!(probabilities(&z, &Clutter { detection_probability: wrong, ..CLUTTER }).is_err(), "P_D {wrong}");
            assert!(probabilities(&z, &Clutter { gate_probability: wrong, ..CLUTTER }).is_err(), "P_G {wrong}");
        }
        for wrong in [-1e-9, f64::INFINITY, f64::NAN] {
            assert!(probabilities(&z, &Clutter { density: wrong, ..CLUTTER }).is_err(), "density {wrong}");
        }
        let mut short = [0.0; 0];
        assert!(association_probabilities(&predicted(), &z, &CLUTTER, &mut short).is_err());
    }
}
