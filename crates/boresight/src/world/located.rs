//! What is known of a track's place: a place on Earth, a line of bearing, or both.

use nalgebra::{Matrix2, Matrix4, Vector2};

/// A place that is given: a camera's.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Site {
    /// Latitude (WGS 84), degrees, north positive.
    pub latitude_deg: f64,
    /// Longitude, degrees, east positive.
    pub longitude_deg: f64,
    /// Height above the ellipsoid, m.
    pub height_m: f64,
}

/// Where a target is, and how it moves over ground.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Place {
    /// Latitude (WGS 84), degrees, north positive.
    pub latitude_deg: f64,
    /// Longitude, degrees, east positive.
    pub longitude_deg: f64,
    /// Height above the ellipsoid, m; `None` if it is not known.
    pub height_m: Option<f64>,
    /// Standard deviation of the height, m.
    pub height_sd_m: f64,
    /// Velocity east and north, m/s.
    pub velocity_m_per_s: Vector2<f64>,
    /// Covariance of `[east, velocity east, north, velocity north]`, m and m/s, 4×4.
    pub cov: Matrix4<f64>,
}

impl Place {
    /// Covariance of the position east and north, m², 2×2.
    pub fn position_cov(&self) -> Matrix2<f64> {
        let c = &self.cov;
        Matrix2::new(c[(0, 0)], c[(0, 2)], c[(2, 0)], c[(2, 2)])
    }

    /// Standard deviation of the position in its worst direction, m.
    pub fn position_sd_m(&self) -> f64 {
        self.position_cov().symmetric_eigenvalues().max().max(0.0).sqrt()
    }

    /// Speed over ground, m/s.
    pub fn speed_m_per_s(&self) -> f64 {
        self.velocity_m_per_s.norm()
    }

    /// Course over ground, degrees clockwise from north, 0 to 360.
    pub fn course_deg(&self) -> f64 {
        azimuth_deg(self.velocity_m_per_s.x, self.velocity_m_per_s.y)
    }
}

/// The direction from the camera to a target.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bearing {
    /// Azimuth, degrees clockwise from north, 0 to 360.
    pub azimuth_deg: f64,
    /// Elevation above the horizontal plane of the camera's place, degrees.
    pub elevation_deg: f64,
    /// Standard deviation of the azimuth, degrees, at most 180.
    pub azimuth_sd_deg: f64,
    /// Standard deviation of the elevation, degrees.
    pub elevation_sd_deg: f64,
}

/// What is known of a track's place.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Located {
    /// The place; `None` where the range is not known.
    pub place: Option<Place>,
    /// The direction; `None` where the camera's place is not known.
    pub bearing: Option<Bearing>,
}

/// Direction of a vector east and north, degrees clockwise from north, in [0, 360).
pub(super) fn azimuth_deg(east: f64, north: f64) -> f64 {
    let deg = east.atan2(north).to_degrees().rem_euclid(360.0);
    // The remainder of a tiny negative number rounds to 360.
    if deg >= 360.0 { 0.0 } else { deg }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn directions_count_clockwise_from_north() {
        let cases = [(0.0, 1.0, 0.0), (1.0, 0.0, 90.0), (0.0, -1.0, 180.0), (-1.0, 0.0, 270.0), (-1e-300, 1.0, 0.0)];
        for (east, north, deg) in cases {
            assert_eq!(azimuth_deg(east, north), deg);
        }
    }
}
