//! Converted measurements: radar range and azimuth to an unbiased Cartesian position with its covariance.
//!
//! Source: D. Lerro, Y. Bar-Shalom, IEEE Trans. AES 29(3), 1993 (the bias); M. Longbin, S. Xiaoquan, Z. Yiyu, S. Z.
//! Kang, Y. Bar-Shalom, "Unbiased converted measurements for tracking", IEEE Trans. AES 34(3), 1998 (this form).
//! z = λ⁻¹ r (cos θ, sin θ), λ = E[cos ε] = e^(-σ_θ²/2) for Gaussian azimuth noise ε. Covariance, given the measurement:
//! E[(z - x)(z - x)ᵀ] with x = (r - w)(cos(θ - ε), sin(θ - ε)).
//! Symbols: r (px or m), θ rad, σ_r, σ_θ. Limits: σ_θ below about 0.5 rad; r well above σ_r. Without the factor λ⁻¹ the
//! cross-range noise shortens every range by r σ_θ²/2: at 100 km and 20 mrad by 20 m.
//! Cost: one sine and cosine, three exponentials, about 40 flops.

use crate::{FilterError, Measurement, Real};
use nalgebra::{Matrix2, Vector2};

/// Range and azimuth as a radar gives them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Polar<T = f64> {
    /// Range, px or m, above 0.
    pub range: T,
    /// Azimuth from +x towards +y, rad.
    pub azimuth_rad: T,
    /// Standard deviation of the range.
    pub range_std: T,
    /// Standard deviation of the azimuth, rad.
    pub azimuth_std_rad: T,
}

/// Returns the unbiased Cartesian measurement of a polar one, for a sensor at `origin`.
/// # Errors
/// [`FilterError`] if a value is not finite, a deviation is negative, the range is not above 0, or the azimuth deviation
/// is above 1 rad.
pub fn converted<T: Real>(polar: &Polar<T>, origin: &Vector2<T>) -> Result<Measurement<T>, FilterError> {
    let Polar { range: r, azimuth_rad: a, range_std: sr, azimuth_std_rad: sa } = *polar;
    if ![r, a, sr, sa, origin[0], origin[1]].iter().all(|v| v.abs() <= T::MAX) {
        return Err(FilterError::NotFinite("the polar measurement"));
    }
    if !(r > T::zero() && sr >= T::zero() && sa >= T::zero() && sa <= T::one()) {
        return Err(FilterError::OutOfRange("a range above 0, deviations of at least 0 and at most 1 rad"));
    }
    let (s, c) = (a.sin(), a.cos());
    let half = T::of(0.5);
    let u = sa * sa;
    // λ⁻² - 2 + 1 etc. cancel for small σ_θ; split into the part along and across the line of sight, where with
    // v = 1 - λ²: λ⁻² - 2 + (1 + λ⁴)/2 = v ((λ⁻² - 1) + v/2) and 1 - λ⁴ = v (2 - v), sums of what is positive.
    let v = -(-u).exp_m1();
    let shrink = v * (T::of(2.0) - v);
    let along = r * r * v * (u.exp_m1() + half * v) + sr * sr * half * (T::of(2.0) - shrink);
    let across = (r * r + sr * sr) * half * shrink;
    let cross = (along - across) * s * c;
    let cov = Matrix2::new(along * c * c + across * s * s, cross, cross, along * s * s + across * c * c);
    let z = Vector2::new(c, s) * (r * (u * half).exp());
    Ok(Measurement { position: origin + z, cov })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_covariance_is_that_of_the_printed_formula() {
        let p = Polar { range: 1000.0_f64, azimuth_rad: 0.7, range_std: 5.0, azimuth_std_rad: 0.1 };
        let m = converted(&p, &Vector2::zeros()).unwrap();
        let l = libm::exp(-0.005);
        let (c, c2) = (libm::cos(0.7), libm::cos(1.4));
        let (r2, s2) = (1e6, 25.0);
        let r11 = (1.0 / (l * l) - 2.0) * r2 * c * c + 0.5 * (r2 + s2) * (1.0 + libm::pow(l, 4.0) * c2);
        let s = libm::sin(0.7);
        let r12 = (1.0 / (l * l) - 2.0) * r2 * c * s + 0.5 * (r2 + s2) * libm::pow(l, 4.0) * libm::sin(1.4);
        assert!((m.cov[(0, 0)] - r11).abs() < 1e-8 * r11, "{} {r11}", m.cov[(0, 0)]);
        assert!((m.cov[(0, 1)] - r12).abs() < 1e-8 * r11);
    }

    #[test]
    fn a_perfect_range_still_has_a_covariance_that_filters_take() {
        for k in 0..2000 {
            let azimuth_std_rad = libm::pow(10.0, -8.0 * f64::from(k) / 2000.0) as f32;
            let p = Polar { range: 5e4_f32, azimuth_rad: 0.01 * k as f32, range_std: 0.0, azimuth_std_rad };
            let m = converted(&p, &Vector2::zeros()).unwrap();
            assert!(crate::check::check_measurement(&m).is_ok(), "{p:?}: {}", m.cov);
            // E[(z - x)²] along the line of sight is r² 1.5 σ⁴ to leading order.
            let straight = converted(&Polar { azimuth_rad: 0.0, ..p }, &Vector2::zeros()).unwrap().cov[(0, 0)];
            if azimuth_std_rad < 0.01 {
                let want = 1.5 * 2.5e9 * azimuth_std_rad.powi(4);
                assert!((straight - want).abs() < 1e-3 * want, "{p:?}: {straight}, not {want}");
            }
        }
    }

    #[test]
    fn small_angles_give_the_plain_rotation_of_the_variances() {
        let p = Polar { range: 100.0_f64, azimuth_rad: 0.0, range_std: 2.0, azimuth_std_rad: 1e-6 };
        let m = converted(&p, &Vector2::new(5.0, 6.0)).unwrap();
        assert!((m.position - Vector2::new(105.0, 6.0)).norm() < 1e-9);
        assert!((m.cov[(0, 0)] - 4.0).abs() < 1e-9 && (m.cov[(1, 1)] - 1e-8).abs() < 1e-10);
    }
}
