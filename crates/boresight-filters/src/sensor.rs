//! Measurement functions: radar range and azimuth, bearing alone; with Jacobians, for the extended and unscented filters.
//!
//! Source: Bar-Shalom, Li, Kirubarajan 2001, 10.3, 10.4. Azimuth is atan2(y, x) seen from the sensor: 0 along +x, growing
//! towards +y. Symbols: h(x) M x 1; H = dh/dx M x N; residuals of angles are wrapped to (-π, π].
//! Limits: a target on the sensor has no angle: the Jacobian is refused there. Cost: a root, an arc tangent.

use crate::{FilterError, Real};
use nalgebra::{SMatrix, SVector, Vector2};

/// A measurement of M numbers of a state of N.
pub trait Sensor<const N: usize, const M: usize, T: Real = f64> {
    /// Returns what the sensor would measure without noise.
    fn measure(&self, x: &SVector<T, N>) -> SVector<T, M>;

    /// Returns dh/dx at a state.
    /// # Errors
    /// [`FilterError::OutOfRange`] where it does not exist.
    fn jacobian(&self, x: &SVector<T, N>) -> Result<SMatrix<T, M, N>, FilterError>;

    /// Returns a - b, with angles wrapped.
    fn residual(&self, a: &SVector<T, M>, b: &SVector<T, M>) -> SVector<T, M> {
        a - b
    }
}

/// Range (px or m) and azimuth (rad) from a fixed sensor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RangeAzimuth<T = f64> {
    /// Where the sensor stands.
    pub origin: Vector2<T>,
    /// Where x and y stand in the state.
    pub position_at: [usize; 2],
}

/// Azimuth (rad) alone from a fixed sensor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bearing<T = f64> {
    /// Where the sensor stands.
    pub origin: Vector2<T>,
    /// Where x and y stand in the state.
    pub position_at: [usize; 2],
}

/// Position itself: the linear case behind the same interface.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Position {
    /// Where x and y stand in the state.
    pub position_at: [usize; 2],
}

/// Wraps an angle to (-π, π].
pub fn wrap_angle<T: Real>(angle_rad: T) -> T {
    let turns = ((angle_rad + T::pi()) / T::two_pi()).ceil() - T::one();
    angle_rad - turns * T::two_pi()
}

fn offset<T: Real, const N: usize>(x: &SVector<T, N>, origin: &Vector2<T>, at: [usize; 2]) -> Vector2<T> {
    Vector2::new(x[at[0]], x[at[1]]) - origin
}

/// Refuses a target on the sensor, where an angle has no direction.
fn range2<T: Real>(d: &Vector2<T>) -> Result<T, FilterError> {
    let r2 = d[0] * d[0] + d[1] * d[1];
    if r2 > T::zero() && r2 <= T::MAX { Ok(r2) } else { Err(FilterError::OutOfRange("a target away from the sensor")) }
}

impl<const N: usize, T: Real> Sensor<N, 2, T> for RangeAzimuth<T> {
    fn measure(&self, x: &SVector<T, N>) -> SVector<T, 2> {
        let d = offset(x, &self.origin, self.position_at);
        SVector::<T, 2>::new(d[0].hypot(d[1]), d[1].atan2(d[0]))
    }

    fn jacobian(&self, x: &SVector<T, N>) -> Result<SMatrix<T, 2, N>, FilterError> {
        let d = offset(x, &self.origin, self.position_at);
        let r2 = range2(&d)?;
        let r = r2.sqrt();
        let [i, j] = self.position_at;
        let mut h = SMatrix::zeros();
        (h[(0, i)], h[(0, j)]) = (d[0] / r, d[1] / r);
        (h[(1, i)], h[(1, j)]) = (-d[1] / r2, d[0] / r2);
        Ok(h)
    }

    fn residual(&self, a: &SVector<T, 2>, b: &SVector<T, 2>) -> SVector<T, 2> {
        SVector::<T, 2>::new(a[0] - b[0], wrap_angle(a[1] - b[1]))
    }
}

impl<const N: usize, T: Real> Sensor<N, 1, T> for Bearing<T> {
    fn measure(&self, x: &SVector<T, N>) -> SVector<T, 1> {
        let d = offset(x, &self.origin, self.position_at);
        SVector::<T, 1>::new(d[1].atan2(d[0]))
    }

    fn jacobian(&self, x: &SVector<T, N>) -> Result<SMatrix<T, 1, N>, FilterError> {
        let d = offset(x, &self.origin, self.position_at);
        let r2 = range2(&d)?;
        let [i, j] = self.position_at;
        let mut h = SMatrix::zeros();
        (h[(0, i)], h[(0, j)]) = (-d[1] / r2, d[0] / r2);
        Ok(h)
    }

    fn residual(&self, a: &SVector<T, 1>, b: &SVector<T, 1>) -> SVector<T, 1> {
        SVector::<T, 1>::new(wrap_angle(a[0] - b[0]))
    }
}

impl<const N: usize, T: Real> Sensor<N, 2, T> for Position {
    fn measure(&self, x: &SVector<T, N>) -> SVector<T, 2> {
        offset(x, &Vector2::zeros(), self.position_at)
    }

    fn jacobian(&self, _x: &SVector<T, N>) -> Result<SMatrix<T, 2, N>, FilterError> {
        let mut h = SMatrix::zeros();
        h[(0, self.position_at[0])] = T::one();
        h[(1, self.position_at[1])] = T::one();
        Ok(h)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector4;

    #[test]
    fn jacobians_are_the_slopes_of_the_functions() {
        let radar = RangeAzimuth { origin: Vector2::new(1.0, -2.0), position_at: [0, 2] };
        let x = Vector4::new(-30.0, 1.0, 40.0, 2.0);
        let h: SMatrix<f64, 2, 4> = radar.jacobian(&x).unwrap();
        for c in 0..4 {
            let mut d = Vector4::zeros();
            d[c] = 1e-4;
            let slope = (radar.measure(&(x + d)) - radar.measure(&(x - d))) / 2e-4;
            assert!((slope - h.column(c)).norm() < 1e-9);
        }
    }

    #[test]
    fn angles_wrap_to_the_near_side() {
        let pi = core::f64::consts::PI;
        for (a, want) in [(3.5 * pi, -0.5 * pi), (-1.5 * pi, 0.5 * pi), (0.3, 0.3), (pi, pi), (-pi, pi)] {
            assert!((wrap_angle(a) - want).abs() < 1e-12, "{a}");
        }
    }

    #[test]
    fn a_target_on_the_sensor_is_refused() {
        let bearing = Bearing { origin: Vector2::zeros(), position_at: [0, 2] };
        assert!(Sensor::<4, 1>::jacobian(&bearing, &Vector4::zeros()).is_err());
    }
}
