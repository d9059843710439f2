//! A polar measurement linearised at the prediction: the second-order extended update with range and azimuth, as a position that every filter takes.
//!
//! Source: Y. Bar-Shalom, X. R. Li, T. Kirubarajan, *Estimation with Applications to Tracking and Navigation*, 2001, 10.3.2 (the second-order extended filter); why the
//! covariance must not follow the measurement: S. V. Bordonaro, P. Willett, Y. Bar-Shalom, IEEE Trans. AES 50(2), 2014.
//! Differs from it: the Jacobian J of h(x) = (range, azimuth) by position is square and has an inverse, so x̂ + J⁻¹(z - E h) with noise J⁻¹ R J⁻ᵀ as a measured position gives the
//! same gain, the same belief and the same νᵀ S⁻¹ ν as the extended update does.
//! With u along the predicted line of sight, t across it and P = H P Hᵀ there: E r = r̂ + P_tt/(2 r̂), E θ = θ̂ - P_ut/r̂²; what second order adds to S stands in the noise:
//! P_tt²/(2 r̂²) along, (P_ut² + P_uu P_tt)/r̂² across, -P_ut P_tt/r̂² between.
//! What third order would add to S (across -2 P_tt²/r̂², a small share of P_tt) is left out, as it is there.
//! Symbols: r̂ (px or m), θ̂ rad, prediction seen from the sensor. Limits: r̂ at least three deviations of the prediction; the innovation of the azimuth below some 0.5 rad.
//! Cost: a root, an arc tangent, a sine and a cosine, about 60 flops.

use crate::converted::Polar;
use crate::sensor::wrap_angle;
use crate::{FilterError, Gaussian, Measurement, Real};
use nalgebra::{Matrix2, Vector2};

/// Returns a polar measurement as a position linearised at the predicted one, for a sensor at `origin`.
/// # Errors
/// [`FilterError`] if a value is not finite, a deviation is negative, or the prediction is nearer to the sensor than three of its standard deviations: take
/// [`crate::converted`] there.
pub fn linearised<T: Real>(
    polar: &Polar<T>,
    origin: &Vector2<T>,
    predicted: &Gaussian<2, T>,
) -> Result<Measurement<T>, FilterError> {
    let Polar { range, azimuth_rad, range_std: sr, azimuth_std_rad: sa } = *polar;
    let (d, p) = (predicted.mean - origin, &predicted.cov);
    let all = [range, azimuth_rad, sr, sa, d[0], d[1], p[(0, 0)], p[(0, 1)], p[(1, 1)]];
    if !all.iter().all(|v| v.abs() <= T::MAX) {
        return Err(FilterError::NotFinite("the polar measurement"));
    }
    if !(range > T::zero() && sr >= T::zero() && sa >= T::zero()) {
        return Err(FilterError::OutOfRange("a range above 0, deviations of at least 0"));
    }
    let r2 = d.dot(&d);
    if !(r2 > T::of(9.0) * (p[(0, 0)] + p[(1, 1)]) && r2 > T::zero()) {
        return Err(FilterError::OutOfRange("a prediction three of its deviations away from the sensor"));
    }
    let r = r2.sqrt();
    let (u, t) = (d / r, Vector2::new(-d[1], d[0]) / r);
    let (uu, ut, tt) = (u.dot(&(p * u)), u.dot(&(p * t)), t.dot(&(p * t)));
    let half = T::of(0.5);
    let along = range - r - half * tt / r;
    let across = r * wrap_angle(azimuth_rad - d[1].atan2(d[0])) + ut / r;
    let noise = Matrix2::new(
        sr * sr + half * tt * tt / r2,
        -ut * tt / r2,
        -ut * tt / r2,
        r2 * sa * sa + (ut * ut + uu * tt) / r2,
    );
    let turn = Matrix2::from_columns(&[u, t]);
    let mut cov = turn * noise * turn.transpose();
    let between = half * (cov[(0, 1)] + cov[(1, 0)]);
    (cov[(0, 1)], cov[(1, 0)]) = (between, between);
    Ok(Measurement { position: predicted.mean + u * along + t * across, cov })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ekf::correct_extended;
    use crate::model::ConstantVelocity;
    use crate::sensor::{RangeAzimuth, Sensor};
    use crate::{GaussianFilter, Kf, Start};
    use nalgebra::{Matrix4, Vector4};

    fn belief(std: f64) -> Gaussian<4> {
        let p = Matrix4::new(
            4.0, 1.0, 1.5, 0.2, //
            1.0, 2.0, 0.1, 0.3, //
            1.5, 0.1, 9.0, 2.0, //
            0.2, 0.3, 2.0, 3.0,
        );
        Gaussian { mean: Vector4::new(-3000.0, 4.0, 4000.0, -5.0), cov: p * (std * std) }
    }

    #[test]
    fn the_update_is_that_of_the_extended_filter_where_the_second_order_is_nothing() {
        let origin = Vector2::new(100.0, -200.0);
        // 5 000 m away to a millimetre: second order is 1e-10 m.
        let start = belief(1e-3);
        let sensor = RangeAzimuth { origin, position_at: [0, 2] };
        let seen: Vector2<f64> = Sensor::<4, 2>::measure(&sensor, &start.mean);
        // Beyond the cut at π, where angles must be wrapped.
        for add in [0.0, core::f64::consts::TAU, -core::f64::consts::TAU] {
            let z = Vector2::new(seen[0] + 2e-3, seen[1] + 3e-7 + add);
            let r = Matrix2::new(1e-6, 0.0, 0.0, 4e-14);
            let mut extended = Kf::<_, 4>::start(ConstantVelocity::continuous(1.0).unwrap(), start).unwrap();
            let mut by_position = extended;
            let update = correct_extended(&mut extended, &sensor, &z, &r, 1).unwrap();
            let polar = Polar { range: z[0], azimuth_rad: z[1], range_std: 1e-3, azimuth_std_rad: 2e-7 };
            let m = linearised(&polar, &origin, &by_position.predicted()).unwrap();
            let s = by_position.predicted().cov + m.cov;
            let nu = m.position - by_position.predicted().mean;
            let distance2 = nu.dot(&(s.try_inverse().unwrap() * nu));
            by_position.correct(&m).unwrap();
            assert!((distance2 - update.distance2).abs() < 1e-5 * update.distance2, "{distance2}");
            let (a, b) = (extended.belief(), by_position.belief());
            assert!((a.mean - b.mean).norm() < 1e-8, "{}", (a.mean - b.mean).norm());
            assert!((a.cov - b.cov).norm() < 1e-6 * a.cov.norm());
        }
    }

    /// Moments of what is measured without noise, of a position drawn from a Gaussian, by summing over a grid: mean of (range, azimuth) and their covariance, in the frame
    /// along and across the predicted line of sight (azimuth times the predicted range).
    fn summed(predicted: &Gaussian<2>, origin: &Vector2<f64>) -> (Vector2<f64>, Matrix2<f64>) {
        let d = predicted.mean - origin;
        let (r, a) = (d.norm(), d[1].atan2(d[0]));
        let root = predicted.cov.cholesky().unwrap().l();
        let (mut weight, mut mean, mut square) = (0.0, Vector2::zeros(), Matrix2::zeros());
        for i in -60..=60 {
            for j in -60..=60 {
                let n = Vector2::new(f64::from(i), f64::from(j)) * 0.1;
                let w = (-0.5 * n.norm_squared()).exp();
                let p = d + root * n;
                let off = Vector2::new(p.norm() - r, r * wrap_angle(p[1].atan2(p[0]) - a));
                weight += w;
                mean += off * w;
                square += off * off.transpose() * w;
            }
        }
        mean /= weight;
        (mean, square / weight - mean * mean.transpose())
    }

    #[test]
    fn the_second_order_is_the_bias_and_the_spread_of_what_is_measured() {
        let origin = Vector2::new(-7.0, 3.0);
        let mean = Vector2::new(600.0, 500.0);
        let d: Vector2<f64> = mean - origin;
        let turn = Matrix2::from_columns(&[d.normalize(), Vector2::new(-d[1], d[0]).normalize()]);
        // Known well along the line of sight and badly across, as of a radar.
        let cov = turn * Matrix2::new(100.0, 150.0, 150.0, 10_000.0) * turn.transpose();
        let predicted = Gaussian { mean, cov };
        let polar = Polar { range: d.norm(), azimuth_rad: d[1].atan2(d[0]), range_std: 0.0, azimuth_std_rad: 0.0 };
        let m = linearised(&polar, &origin, &predicted).unwrap();
        let (mean, spread) = summed(&predicted, &origin);
        // A plot in the prediction's own direction seems too near by what the mean lies behind it: P_tt/(2 r) = 6.4 m.
        let bias = -turn.transpose() * (m.position - predicted.mean);
        assert!((bias - mean).norm() < 0.03 * mean.norm() && mean[0] > 6.0, "{bias} {mean}");
        // The variance along the line of sight, 100 m² of the first order and P_tt²/(2 r²) = 81 m²; third order, which is left out, takes 2 m² off.
        let s = turn.transpose() * (cov + m.cov) * turn;
        assert!((s[(0, 0)] - spread[(0, 0)]).abs() < 0.03 * spread[(0, 0)] && spread[(0, 0)] > 170.0, "{s} {spread}");
    }

    #[test]
    fn a_target_near_the_sensor_and_what_is_no_number_are_refused() {
        let predicted = Gaussian { mean: Vector2::new(10.0, 0.0), cov: Matrix2::identity() * 20.0 };
        let polar = Polar { range: 10.0, azimuth_rad: 0.0, range_std: 1.0, azimuth_std_rad: 0.01 };
        assert!(matches!(linearised(&polar, &Vector2::zeros(), &predicted), Err(FilterError::OutOfRange(_))));
        let near = Gaussian { cov: Matrix2::identity(), ..predicted };
        assert!(linearised(&polar, &Vector2::zeros(), &near).is_ok());
        let none = Polar { range: f64::NAN, ..polar };
        assert!(matches!(linearised(&none, &Vector2::zeros(), &near), Err(FilterError::NotFinite(_))));
    }
}
