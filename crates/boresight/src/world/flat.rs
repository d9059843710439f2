//! A plane on Earth: image positions through a plane map to metres east and north of an origin, and from there to latitude and longitude.
//!
//! The plane touches the ellipsoid's shape at its origin; a point of it is taken to Earth exactly, through earth-centred coordinates, and velocity and
//! covariance are turned into the axes east and north of that point. Position, velocity and their covariance go through the plane map's derivatives
//! (`fuse/plane.rs`). A map from points is fitted in metres about their middle.
//! A homography alone does not say on which side of its horizon the ground is, and the sky may hold the image's corner. A camera above the ground sees it
//! in one sense of turning: x to the right and y down become east and north with det J = det M / D³ < 0, so the ground is where D has the sign of -det M.
//! Symbols: e, n metres east and north of the origin; M the map from px to them; D what it divides by; J its derivative.
//! Limits: a plane: [`FARTHEST_M`] from its origin it lies 200 m above the ellipsoid, and what is farther has no place; the height is the one given.

use super::config::{PlaneConfig, PointsConfig};
use super::located::{Located, Place};
use crate::fuse::{MapKind, PlaneMap};
use crate::geodesy::Geodetic;
use crate::{Error, ErrorKind, Result};
use boresight_filters::Gaussian;
use nalgebra::{Matrix2, Matrix3, Matrix4, Vector2, Vector3};

/// Farthest from the origin, and largest deviation, that a plane is believed at, m.
const FARTHEST_M: f64 = 50_000.0;
/// Least ratio of the smaller to the larger scale of a map at its points: what is flatter is a map onto a line. (A camera 1 m above the ground sees 1 km away with 1e-3.)
const LEAST_SPREAD: f64 = 1e-5;

/// A map from the image to a plane on Earth.
#[derive(Clone, Debug)]
pub(super) struct Flat {
    origin: Vector3<f64>,
    /// Rows east, north, up at the origin.
    axes: Matrix3<f64>,
    /// From px to metres east and north of the origin.
    map: PlaneMap,
    height_m: Option<f64>,
    position_sd_m: f64,
}

/// A 4×4 matrix on `[x, vx, y, vy]` that does the same to positions and velocities.
fn for_both(j: &Matrix2<f64>) -> Matrix4<f64> {
    Matrix4::from_fn(|r, c| if r % 2 == c % 2 { j[(r / 2, c / 2)] } else { 0.0 })
}

impl Flat {
    /// Of a map that is given.
    /// # Errors
    /// A map without an inverse.
    pub fn of_plane(c: &PlaneConfig) -> Result<Self> {
        let map = PlaneMap::from_rows(&c.homography).map_err(|e| e.at("world.plane.homography"))?;
        let (sin, cos) = c.bearing_deg.to_radians().sin_cos();
        let turn = Matrix3::new(cos, sin, 0.0, -sin, cos, 0.0, 0.0, 0.0, 1.0);
        let m = turn * map.matrix();
        let map = PlaneMap::from_rows(m.transpose().as_slice())?.on_side(-m.determinant().signum());
        // An affine map has no other side.
        let is_affine = m[(2, 0)] == 0.0 && m[(2, 1)] == 0.0;
        if is_affine && m[(2, 2)] * map.side() <= 0.0 {
            let e = Error::new(ErrorKind::Config, "the map mirrors: no camera above the ground sees it so");
            return Err(e.at("world.plane.homography").hint("seen from above the plane's y axis must point to the left of its x axis; turn the sign of y (the second row)"));
        }
        let origin = Geodetic::of_degrees(c.latitude_deg, c.longitude_deg, c.height_m.unwrap_or(0.0));
        Ok(Self::at(&origin, map, c.height_m, c.position_sd_m))
    }

    /// Fitted to points; also the root mean square of their distances from it, m.
    /// # Errors
    /// Points that do not determine the map: on a line, or in an order that no camera sees.
    pub fn of_points(c: &PointsConfig) -> Result<(Self, f64)> {
        let height_m = c.height_m.unwrap_or(0.0);
        let places: Vec<_> = c.points.iter().map(|p| Geodetic::of_degrees(p[2], p[3], height_m).ecef()).collect();
        let middle = Geodetic::of_ecef(&(places.iter().sum::<Vector3<f64>>() / places.len().max(1) as f64));
        let origin = Geodetic { height_m, ..middle };
        let (axes, zero) = (origin.local_axes(), origin.ecef());
        let local = places.iter().map(|p| (axes * (p - zero)).xy());
        let pairs: Vec<_> = c.points.iter().map(|p| Vector2::new(p[0], p[1])).zip(local).collect();
        let refuse = |what: &str| {
            let e = Error::new(ErrorKind::Config, what).at("world.points.points");
            e.hint("four points or more, spread over the ground that is seen, no three of four on a line, each [x, y, latitude, longitude] of one and the same spot")
        };
        if pairs.iter().any(|(_, p)| p.norm() > FARTHEST_M) {
            return Err(refuse("the points lie more than 50 km from their middle"));
        }
        let fit = PlaneMap::estimate(&pairs, MapKind::Homography)
            .map_err(|e| refuse("the points do not determine where the ground is").because(e))?;
        let is_a_view = pairs.iter().all(|(p, _)| {
            let s = fit.map.derivative(p).map(|j| j.singular_values());
            s.is_some_and(|s| s.min() > LEAST_SPREAD * s.max())
        });
        if !is_a_view {
            return Err(refuse("the points do not determine where the ground is: three of them lie on a line"));
        }
        if fit.map.matrix().determinant() * fit.map.side() > 0.0 {
            return Err(refuse(
                "the points are mirrored: no camera above the ground sees them so. Are latitude and longitude, or x and y, changed over?",
            ));
        }
        // Each point has two residuals; eight of them the map takes up.
        let n_free = 2 * pairs.len() - 8;
        let residual_sd_m = if n_free > 0 { fit.rms * (pairs.len() as f64 / n_free as f64).sqrt() } else { 0.0 };
        Ok((Self::at(&origin, fit.map, c.height_m, c.position_sd_m.unwrap_or(residual_sd_m)), fit.rms))
    }

    fn at(origin: &Geodetic, map: PlaneMap, height_m: Option<f64>, position_sd_m: f64) -> Self {
        Self { origin: origin.ecef(), axes: origin.local_axes(), map, height_m, position_sd_m }
    }

    /// The place of a belief `[x, vx, y, vy]` (px, px/s); none beyond the horizon or too far away.
    pub fn locate(&self, belief: &Gaussian<4>) -> Located {
        Located { place: self.place(belief), bearing: None }
    }

    fn place(&self, belief: &Gaussian<4>) -> Option<Place> {
        let on_plane = self.map.belief(belief)?;
        let [e, n] = [on_plane.mean[0], on_plane.mean[2]];
        let is_near = e.hypot(n) <= FARTHEST_M;
        if !is_near {
            return None;
        }
        let at = Geodetic::of_ecef(&(self.origin + self.axes.transpose() * Vector3::new(e, n, 0.0)));
        // From the origin's axes to those of the place.
        let turn: Matrix2<f64> = (at.local_axes() * self.axes.transpose()).fixed_view::<2, 2>(0, 0).into_owned();
        let both = for_both(&turn);
        let mut cov = both * on_plane.cov * both.transpose();
        (0..2).for_each(|axis| cov[(2 * axis, 2 * axis)] += self.position_sd_m.powi(2));
        let place = Place {
            latitude_deg: at.latitude.to_degrees(),
            longitude_deg: at.longitude.to_degrees(),
            height_m: self.height_m,
            height_sd_m: 0.0,
            velocity_m_per_s: turn * Vector2::new(on_plane.mean[1], on_plane.mean[3]),
            cov,
        };
        let is_known = cov.iter().all(|v| v.is_finite()) && place.position_sd_m() <= FARTHEST_M;
        is_known.then_some(place)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector4;
    use proptest::prelude::*;

    fn plane() -> PlaneConfig {
        PlaneConfig {
            // y of an image points down.
            homography: vec![1.0, 0.0, 0.0, 0.0, -1.0, 0.0],
            latitude_deg: 48.137154,
            longitude_deg: 11.576124,
            height_m: Some(519.0),
            bearing_deg: 0.0,
            position_sd_m: 0.0,
        }
    }

    fn belief(x: f64, vx: f64, y: f64, vy: f64) -> Gaussian<4> {
        Gaussian { mean: Vector4::new(x, vx, y, vy), cov: Matrix4::from_diagonal(&Vector4::new(4.0, 1.0, 9.0, 2.0)) }
    }

    #[test]
    fn metres_of_a_plane_are_placed_as_pymap3d_does() {
        // pymap3d 3.2.0: enu2geodetic(1234.5, -678.9, 0, 48.137154, 11.576124, 519).
        let place = Flat::of_plane(&plane()).unwrap().locate(&belief(1234.5, 3.0, 678.9, -4.0)).place.unwrap();
        assert!((place.latitude_deg - 48.13104769702107).abs() < 1e-10);
        assert!((place.longitude_deg - 11.592707333608951).abs() < 1e-10);
        assert_eq!((place.height_m, place.height_sd_m), (Some(519.0), 0.0));
        // North is turned by the meridians' convergence, 0.0166 degrees of longitude times the sine of the latitude.
        assert!((place.course_deg() - 36.86990 - 0.01235).abs() < 1e-4, "{}", place.course_deg());
        assert!((place.speed_m_per_s() - 5.0).abs() < 1e-6);
    }

    #[test]
    fn a_plane_is_turned_by_its_bearing_and_its_own_error_is_added() {
        let turned = PlaneConfig { bearing_deg: 90.0, position_sd_m: 2.0, ..plane() };
        // y points east, x south.
        let place = Flat::of_plane(&turned).unwrap().locate(&belief(0.0, 3.0, 0.0, -4.0)).place.unwrap();
        assert!((place.velocity_m_per_s - Vector2::new(4.0, -3.0)).norm() < 1e-9);
        let variances = [0, 1, 2, 3].map(|k| place.cov[(k, k)]);
        [9.0 + 4.0, 2.0, 4.0 + 4.0, 1.0].iter().zip(variances).for_each(|(a, b)| assert!((a - b).abs() < 1e-9));
        assert!((place.position_sd_m() - 13f64.sqrt()).abs() < 1e-9);
        let far = Flat::of_plane(&plane()).unwrap();
        assert!(far.locate(&belief(60_000.0, 0.0, 0.0, 0.0)).place.is_none(), "no plane reaches that far");
    }

    /// Five spots of a car park and where a camera sees them.
    fn points() -> Vec<[f64; 4]> {
        let h = PlaneMap::from_rows(&[0.08, 0.01, -40.0, -0.005, -0.12, 90.0, 1e-5, 6e-4, 1.0]).unwrap();
        let zero = Geodetic::of_degrees(48.2, 16.3, 170.0);
        let spots = [[100.0, 200.0], [1150.0, 220.0], [1200.0, 680.0], [60.0, 650.0], [600.0, 400.0]];
        let place = |p: [f64; 2]| {
            let q = h.point(&Vector2::from(p)).unwrap();
            let g = Geodetic::of_ecef(&(zero.ecef() + zero.local_axes().transpose() * Vector3::new(q.x, q.y, 0.0)));
            [p[0], p[1], g.latitude.to_degrees(), g.longitude.to_degrees()]
        };
        spots.map(place).to_vec()
    }

    fn of(points: Vec<[f64; 4]>) -> Result<(Flat, f64)> {
        Flat::of_points(&PointsConfig { points, height_m: Some(170.0), position_sd_m: None })
    }

    #[test]
    fn a_map_through_points_finds_them_again_and_says_what_does_not_fit() {
        let all = points();
        let (flat, rms) = of(all[..4].to_vec()).unwrap();
        assert!(rms < 1e-6);
        let place = flat.locate(&belief(all[4][0], 0.0, all[4][1], 0.0)).place.unwrap();
        // 1e-9 degrees are 0.1 mm.
        assert!((place.latitude_deg - all[4][2]).abs() < 1e-9 && (place.longitude_deg - all[4][3]).abs() < 1e-9);
        let mut off = all.clone();
        off[4][2] += 2e-5;
        let (flat, rms) = of(off).unwrap();
        // 2.2 m, of which the fit takes a part; 10 residuals and 8 numbers.
        assert!(rms > 0.2 && rms < 1.0, "{rms}");
        assert!((flat.position_sd_m - rms * 2.5f64.sqrt()).abs() < 1e-12);
    }

    /// A camera 8 m above flat ground, 30 degrees down, whose horizon crosses the image: px to metres to the right and ahead.
    fn road() -> [f64; 9] {
        let (f, (sin, cos)) = (600.0, 30f64.to_radians().sin_cos());
        // The ray of (x, y) about the middle of 1280 x 960: right x, ahead f cos - y sin, up -(f sin + y cos); it meets the ground at 8 / -up.
        let (cx, cy) = (640.0, 480.0);
        let row = |x: f64, y: f64, one: f64| [x, y, one - x * cx - y * cy];
        let (right, ahead, down) = (row(8.0, 0.0, 0.0), row(0.0, -8.0 * sin, 8.0 * f * cos), row(0.0, cos, f * sin));
        [right, ahead, down].concat().try_into().unwrap()
    }

    #[test]
    fn the_ground_is_found_where_the_sky_holds_the_images_corner() {
        let ahead = |y: f64| {
            let down = (30f64.to_radians()) + ((y - 480.0) / 600.0).atan();
            8.0 / down.tan()
        };
        // The horizon is at row 480 - 600 tan(30 degrees) = 133.6.
        for scale in [1.0, -1.0, 1e-3] {
            let homography = road().map(|v| v * scale).to_vec();
            let flat = Flat::of_plane(&PlaneConfig { homography, ..plane() }).unwrap();
            let zero = Geodetic::of_degrees(48.137154, 11.576124, 519.0);
            for y in [300.0, 480.0, 900.0] {
                let place = flat.locate(&belief(640.0, 0.0, y, 0.0)).place.unwrap();
                let at = Geodetic::of_degrees(place.latitude_deg, place.longitude_deg, 519.0);
                let local = zero.local_axes() * (at.ecef() - zero.ecef());
                assert!((local.xy() - Vector2::new(0.0, ahead(y))).norm() < 1e-3, "{y}: {local}");
            }
            assert!(flat.locate(&belief(640.0, 0.0, 100.0, 0.0)).place.is_none(), "the sky");
        }
        // And through points of the same ground.
        let map = Flat::of_plane(&PlaneConfig { homography: road().to_vec(), ..plane() }).unwrap();
        let spots = [[200.0, 300.0], [1000.0, 320.0], [1200.0, 900.0], [30.0, 800.0]];
        let points = spots.map(|[x, y]| {
            let place = map.locate(&belief(x, 0.0, y, 0.0)).place.unwrap();
            [x, y, place.latitude_deg, place.longitude_deg]
        });
        let (flat, _) = of(points.to_vec()).unwrap();
        let [a, b] = [&map, &flat].map(|m| m.locate(&belief(500.0, 9.0, 450.0, 4.0)).place.unwrap());
        assert!((a.latitude_deg - b.latitude_deg).abs() < 1e-8 && (a.longitude_deg - b.longitude_deg).abs() < 1e-8);
        assert!((a.velocity_m_per_s - b.velocity_m_per_s).norm() < 1e-3, "the heights differ by 349 m: 5e-5");
        assert!(flat.locate(&belief(640.0, 0.0, 100.0, 0.0)).place.is_none(), "the sky");
    }

    #[test]
    fn a_map_that_mirrors_is_refused() {
        let mirrored = PlaneConfig { homography: vec![1.0, 0.0, 0.0, 0.0, 1.0, 0.0], ..plane() };
        assert!(Flat::of_plane(&mirrored).unwrap_err().to_string().contains("the sign of y"));
    }

    #[test]
    fn points_that_determine_nothing_are_refused() {
        let all = points();
        let on_a_line = |p: &[f64; 4]| [p[0], 300.0, p[2], p[3]];
        let said = |points: Vec<[f64; 4]>| of(points).unwrap_err().to_string();
        assert!(said(all.iter().map(on_a_line).collect()).contains("do not determine"));
        assert!(said(vec![all[0]; 4]).contains("do not determine"));
        // Three of four on a line in the image, not on Earth.
        let three = [[100.0, 100.0], [200.0, 200.0], [300.0, 300.0], [500.0, 100.0]];
        let three = three.iter().zip(&all).map(|(a, b)| [a[0], a[1], b[2], b[3]]).collect();
        assert!(said(three).contains("hint: four points or more"));
        // Two spots changed over: no camera sees the ground like that.
        let crossed = vec![
            [0.0, 0.0, all[0][2], all[0][3]],
            [9.0, 0.0, all[2][2], all[2][3]],
            [9.0, 9.0, all[1][2], all[1][3]],
            [0.0, 9.0, all[3][2], all[3][3]],
        ];
        assert!(of(crossed).is_err());
        let swapped = all.iter().map(|p| [p[0], p[1], p[3], p[2]]).collect();
        assert!(said(swapped).contains("changed over"));
        let mut far = all;
        far[0][2] -= 5.0;
        assert!(said(far).contains("50 km"));
    }

    proptest! {
        #[test]
        fn a_place_leads_back_to_the_metres_of_its_plane(x in -5e3..5e3f64, y in -5e3..5e3f64, lat in -85.0..85.0f64, lon in -180.0..180.0f64, bearing in -180.0..180.0f64) {
            let config = PlaneConfig { latitude_deg: lat, longitude_deg: lon, height_m: None, bearing_deg: bearing, ..plane() };
            let flat = Flat::of_plane(&config).unwrap();
            let place = flat.locate(&belief(x, 0.0, -y, 0.0)).place.unwrap();
            prop_assert_eq!(place.height_m, None);
            // Straight down to the plane from the place's latitude and longitude.
            let at = Geodetic::of_degrees(place.latitude_deg, place.longitude_deg, 0.0);
            let local = flat.axes * (at.ecef() - flat.origin);
            let (sin, cos) = bearing.to_radians().sin_cos();
            // The plane lies up to 4 m above the ellipsoid there: 4 m times the angle between the normals, 1e-3.
            prop_assert!((local.x * cos - local.y * sin - x).hypot(local.x * sin + local.y * cos - y) < 0.01);
            prop_assert!((place.cov.trace() - 16.0).abs() < 1e-3);
        }
    }
}
