//! Places on the WGS 84 ellipsoid: latitude, longitude and height to earth-centred coordinates and back, local axes, radii of curvature.
//!
//! Source: B. Bowring, *Transformation from spatial to geographical coordinates*, Survey Review 23, 1976 (the way back; repeated until it stands);
//! constants of the U.S. National Geospatial-Intelligence Agency, *World Geodetic System 1984*, NGA.STND.0036.
//! Symbols: φ latitude, λ longitude (rad), h height above the ellipsoid (m); N radius across the meridian, M along it (m); local axes east, north, up.
//! Limits: heights above the ellipsoid, not above the sea (they differ by up to 107 m); within some 50 km of the earth's centre there is no way back.

use nalgebra::{Matrix3, Vector3};

/// Semi-major axis, m, and squared eccentricity.
const WGS84_A_M: f64 = 6_378_137.0;
const WGS84_E2: f64 = 6.694_379_990_14e-3;

/// A place.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Geodetic {
    /// Latitude, rad.
    pub latitude: f64,
    /// Longitude, rad.
    pub longitude: f64,
    /// Height above the ellipsoid, m.
    pub height_m: f64,
}

/// Radii of curvature at a latitude (rad), m: along the meridian and across it.
pub(crate) fn radii_m(latitude: f64) -> [f64; 2] {
    let w2 = 1.0 - WGS84_E2 * latitude.sin().powi(2);
    let across = WGS84_A_M / w2.sqrt();
    [across * (1.0 - WGS84_E2) / w2, across]
}

/// Semi-axes of the ellipsoid raised by a height, m: across and along the earth's axis.
pub(crate) fn raised_axes_m(height_m: f64) -> [f64; 2] {
    [WGS84_A_M + height_m, WGS84_A_M * (1.0 - WGS84_E2).sqrt() + height_m]
}

impl Geodetic {
    /// Of degrees and metres.
    pub fn of_degrees(latitude_deg: f64, longitude_deg: f64, height_m: f64) -> Self {
        Self { latitude: latitude_deg.to_radians(), longitude: longitude_deg.to_radians(), height_m }
    }

    /// Earth-centred, earth-fixed coordinates, m.
    pub fn ecef(&self) -> Vector3<f64> {
        let (across, (sin, cos)) = (radii_m(self.latitude)[1], self.latitude.sin_cos());
        let out = (across + self.height_m) * cos;
        let (y, x) = self.longitude.sin_cos();
        Vector3::new(out * x, out * y, (across * (1.0 - WGS84_E2) + self.height_m) * sin)
    }

    /// The place with these coordinates, m.
    pub fn of_ecef(p: &Vector3<f64>) -> Self {
        let (out, longitude) = (p.x.hypot(p.y), p.y.atan2(p.x));
        let ratio = (1.0 - WGS84_E2).sqrt();
        // Parametric latitude β; each round leaves an error thousands of times smaller.
        let mut beta = p.z.atan2(ratio * out);
        let mut latitude = beta;
        for _ in 0..4 {
            let (sin, cos) = beta.sin_cos();
            let up = p.z + WGS84_E2 / ratio * WGS84_A_M * sin.powi(3);
            latitude = up.atan2(out - WGS84_E2 * WGS84_A_M * cos.powi(3));
            let (sin, cos) = latitude.sin_cos();
            beta = (ratio * sin).atan2(cos);
        }
        let (sin, cos) = latitude.sin_cos();
        // Without a division by a cosine or a sine: it holds at the poles as at the equator.
        let height_m = out * cos + p.z * sin - WGS84_A_M * (1.0 - WGS84_E2 * sin * sin).sqrt();
        Self { latitude, longitude, height_m }
    }

    /// Rows east, north, up: takes differences of earth-centred coordinates to local axes.
    pub fn local_axes(&self) -> Matrix3<f64> {
        let ((sp, cp), (sl, cl)) = (self.latitude.sin_cos(), self.longitude.sin_cos());
        Matrix3::new(-sl, cl, 0.0, -sp * cl, -sp * sl, cp, cp * cl, cp * sl, sp)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn there_and_back(lat in -90.0..90.0f64, lon in -179.9..179.9f64, height in -5e3..2e6f64) {
            let place = Geodetic::of_degrees(lat, lon, height);
            let back = Geodetic::of_ecef(&place.ecef());
            // 1e-15 rad is 6 nm; the longitude is weak at the poles.
            prop_assert!((back.latitude - place.latitude).abs() < 6e-15);
            prop_assert!((back.longitude - place.longitude).abs() * place.latitude.cos().max(1e-9) < 1e-14);
            prop_assert!((back.height_m - height).abs() < 2e-8);
            // The axes are orthonormal, and up is where the height grows.
            let axes = place.local_axes();
            prop_assert!((axes * axes.transpose() - Matrix3::identity()).amax() < 1e-14);
            let higher = Geodetic { height_m: height + 10.0, ..place }.ecef() - place.ecef();
            prop_assert!((axes * higher - Vector3::new(0.0, 0.0, 10.0)).amax() < 1e-8);
        }

        #[test]
        fn the_radii_are_those_of_small_steps(lat in -89.0..89.0f64) {
            let (a, step) = (Geodetic::of_degrees(lat, 10.0, 0.0), 1e-6);
            let [along, across] = radii_m(a.latitude);
            let north = (Geodetic { latitude: a.latitude + step, ..a }.ecef() - a.ecef()).norm() / step;
            let east = (Geodetic { longitude: a.longitude + step, ..a }.ecef() - a.ecef()).norm() / step;
            prop_assert!((north - along).abs() < 0.1 && (east - across * a.latitude.cos()).abs() < 0.1);
        }
    }

    #[test]
    fn places_are_those_of_pyproj() {
        // pyproj 3.7.2 (PROJ), EPSG:4979 to EPSG:4978.
        for (place, ecef) in [
            ([48.137154, 11.576124, 519.0], [4177969.8860344267, 855799.8257209, 4727453.774307899]),
            ([-33.8568, 151.2153, -12.5], [-4646959.539606897, 2553071.921808956, -3533260.1635010545]),
        ] {
            let place = Geodetic::of_degrees(place[0], place[1], place[2]);
            assert!((place.ecef() - Vector3::from(ecef)).amax() < 1e-6, "{}", place.ecef());
        }
    }

    #[test]
    fn the_poles_and_the_date_line() {
        for lat in [-90.0, 90.0] {
            let back = Geodetic::of_ecef(&Geodetic::of_degrees(lat, 0.0, 100.0).ecef());
            assert!((back.latitude.to_degrees() - lat).abs() < 1e-12 && (back.height_m - 100.0).abs() < 1e-8);
        }
        let west = Geodetic::of_ecef(&Geodetic::of_degrees(10.0, 180.0, 0.0).ecef());
        assert!((west.longitude.to_degrees().abs() - 180.0).abs() < 1e-12);
    }
}
