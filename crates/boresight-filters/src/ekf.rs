//! Extended Kalman update with a nonlinear sensor, on any Gaussian filter.
//!
//! Source: A. H. Jazwinski, *Stochastic Processes and Filtering Theory*, 1970, 8.3; iterated form: B. M. Bell,
//! F. W. Cathey, "The iterated Kalman filter update as a Gauss-Newton method", IEEE Trans. AC 38(2), 1993.
//! H is the Jacobian at the prediction; each further iteration linearises at the corrected mean. Prediction with a
//! nonlinear model is done by the filters themselves (Jacobian at the mean).
//! Limits: range and azimuth with σ_θ r over σ_r above about 3, or a poor prior: take [`crate::Ukf`] or
//! [`crate::converted`]; bearing alone needs a manoeuvring sensor or several sensors to be observable.
//! Symbols: z, h(x) M x 1; H = dh/dx M x N; R M x M. Cost: per iteration a Jacobian and about 2 N³ flops.

use crate::linear::{LinearUpdate, correct_linear};
use crate::real::all_finite;
use crate::sensor::Sensor;
use crate::{FilterError, GaussianFilter, Real};
use nalgebra::{SMatrix, SVector};

/// Corrects a filter by a nonlinear measurement; `iterations` 1 is the plain extended update.
/// # Errors
/// [`FilterError`] for NaN, infinity, a singular innovation, or a state where the sensor has no Jacobian; the filter is
/// then unchanged.
pub fn correct_extended<F, S, T, const N: usize, const M: usize>(
    filter: &mut F,
    sensor: &S,
    z: &SVector<T, M>,
    r: &SMatrix<T, M, M>,
    iterations: usize,
) -> Result<LinearUpdate<N, M, T>, FilterError>
where
    F: GaussianFilter<N, Real = T>,
    S: Sensor<N, M, T>,
    T: Real,
{
    if !(all_finite(z) & all_finite(r)) {
        return Err(FilterError::NotFinite("the measurement"));
    }
    let prior = filter.belief();
    let mut at = prior.mean;
    let mut update = None;
    for _ in 0..iterations.max(1) {
        let h = sensor.jacobian(&at)?;
        // z - h(at) - H (prior - at): the innovation of the measurement linearised at `at`.
        let innovation = sensor.residual(z, &sensor.measure(&at)) - h * (prior.mean - at);
        let step = correct_linear(&prior, &h, &innovation, r)?;
        at = step.belief.mean;
        update = Some(step);
    }
    let update = update.ok_or(FilterError::OutOfRange("at least one iteration"))?;
    if !(all_finite(&update.belief.mean) & all_finite(&update.belief.cov)) {
        return Err(FilterError::NotFinite("the result of the step"));
    }
    filter.set_belief(&update.belief)?;
    Ok(update)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::ConstantVelocity;
    use crate::sensor::Bearing;
    use crate::{Gaussian, Kf, Start};
    use nalgebra::{Matrix1, Matrix4, Vector1, Vector2, Vector4};

    #[test]
    fn a_measurement_or_a_noise_that_is_no_number_is_refused_as_such() {
        let start = Gaussian { mean: Vector4::new(3.0, 0.0, 4.0, 0.0), cov: Matrix4::identity() };
        let mut filter = Kf::<_, 4>::start(ConstantVelocity::continuous(1.0).unwrap(), start).unwrap();
        let sensor = Bearing { origin: Vector2::zeros(), position_at: [0, 2] };
        for (z, r) in [(f64::NAN, 0.1), (0.5, f64::NAN), (f64::INFINITY, 0.1), (0.5, f64::INFINITY)] {
            let e = correct_extended(&mut filter, &sensor, &Vector1::new(z), &Matrix1::new(r), 1).unwrap_err();
            assert_eq!(e, FilterError::NotFinite("the measurement"));
            assert_eq!(filter.belief(), start);
        }
    }
}
