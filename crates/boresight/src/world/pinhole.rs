//! A camera of known pose: the ray of a pixel, its azimuth and elevation, and where it meets the ground.
//!
//! Attitude: aerospace's angles in the local frame north, east, down: yaw about down, then pitch about the right side, then roll about the optical axis
//! (B. Stevens, F. Lewis, *Aircraft Control and Simulation*, 2nd ed., 2003, section 1.3). With all of them 0 the camera looks north along the
//! horizontal, its right side is east. Ray of a pixel: `d = R [1, (x - cx) / f, (y - cy) / f]`, forward, right, down.
//! Ground: the surface of one height above the ellipsoid. The ray is cut with the ellipsoid of raised axes, then moved along by Newton's steps on the height.
//! State and covariance go through the homography from the image to the plane that touches the ground there (`fuse/plane.rs`), which has the ground's first
//! derivatives. The camera's errors enter by differences: each parameter is moved by its deviation to both sides, and half of what that moves the state by is
//! a column of its covariance (M. Nørgaard, N. Poulsen, O. Ravn, *Automatica* 36, 2000, with an interval of one deviation).
//! Symbols: c the camera (m, east, north, up of the target); M homography from px about the target to metres east and north of it; u height of the plane.
//! Limits: no distortion of the lens, no refraction of the air; a camera's error is one for all times and tracks, yet it stands in each one's covariance.
//! Where the ray raised by one deviation of its elevation meets no ground, or the deviation exceeds the range, there is a direction only.

use super::config::PinholeConfig;
use super::located::{Bearing, Located, Place, azimuth_deg};
use crate::fuse::PlaneMap;
use crate::geodesy::{Geodetic, raised_axes_m};
use boresight_filters::Gaussian;
use nalgebra::{Matrix2, Matrix3, Rotation3, SMatrix, Vector2, Vector3, Vector4};

/// Least sine of the angle at which a ray meets the ground.
const GRAZING: f64 = 1e-6;
/// Parameters of a pose that may be off: east, north, up (m), yaw, pitch, roll (rad), height of the ground (m).
const N_ERRORS: usize = 7;
/// Number of the first angle among them.
const YAW: usize = 3;

/// A pose.
#[derive(Clone, Debug)]
pub(super) struct Pinhole {
    focal_px: f64,
    principal_px: Vector2<f64>,
    place: Vector3<f64>,
    /// Rows east, north, up.
    axes: Matrix3<f64>,
    angles: Vector3<f64>,
    ground_height_m: Option<f64>,
    ground_height_sd_m: f64,
    sds: [f64; N_ERRORS],
}

/// Takes forward, right, down of the camera to east, north, up.
fn enu_from_camera(angles: Vector3<f64>) -> Matrix3<f64> {
    // nalgebra's Euler angles are roll, pitch, yaw about the fixed axes in this order: the same turns.
    let ned = Rotation3::from_euler_angles(angles.z, angles.y, angles.x).into_inner();
    Matrix3::from_rows(&[ned.row(1).into_owned(), ned.row(0).into_owned(), -ned.row(2).into_owned()])
}

/// Azimuth and elevation of a direction east, north, up, rad.
fn angles_of(d: &Vector3<f64>) -> Vector2<f64> {
    Vector2::new(d.x.atan2(d.y), d.z.atan2(d.x.hypot(d.y)))
}

/// A difference of angles, the short way round, rad.
fn short_way(angle: f64) -> f64 {
    let turn = std::f64::consts::TAU;
    (angle + 0.5 * turn).rem_euclid(turn) - 0.5 * turn
}

impl Pinhole {
    pub fn new(c: &PinholeConfig) -> Self {
        let site = Geodetic::of_degrees(c.latitude_deg, c.longitude_deg, c.height_m);
        let [yaw, pitch, roll] = [c.yaw_sd_deg, c.pitch_sd_deg, c.roll_sd_deg].map(f64::to_radians);
        Self {
            focal_px: c.focal_px,
            principal_px: Vector2::from(c.principal_point_px),
            place: site.ecef(),
            axes: site.local_axes(),
            angles: Vector3::new(c.yaw_deg, c.pitch_deg, c.roll_deg).map(f64::to_radians),
            ground_height_m: c.ground_height_m,
            ground_height_sd_m: c.ground_height_sd_m,
            sds: [c.position_sd_m, c.position_sd_m, c.height_sd_m, yaw, pitch, roll, c.ground_height_sd_m],
        }
    }

    /// Direction of a pixel at an attitude, east, north, up; its forward part has length 1.
    fn ray(&self, pixel: Vector2<f64>, angles: Vector3<f64>) -> Vector3<f64> {
        let p = (pixel - self.principal_px) / self.focal_px;
        enu_from_camera(angles) * Vector3::new(1.0, p.x, p.y)
    }

    /// What is known of a belief `[x, vx, y, vy]` (px, px/s).
    pub fn locate(&self, belief: &Gaussian<4>) -> Located {
        let bearing = self.bearing(belief);
        Located { place: bearing.and_then(|b| self.place(belief, &b)), bearing }
    }

    fn bearing(&self, belief: &Gaussian<4>) -> Option<Bearing> {
        let pixel = Vector2::new(belief.mean[0], belief.mean[2]);
        let at = angles_of(&self.ray(pixel, self.angles));
        let moved = |pixel: Vector2<f64>, angles: Vector3<f64>| {
            let d = angles_of(&self.ray(pixel, angles)) - at;
            Vector2::new(short_way(d.x), d.y)
        };
        let both = |plus: Vector2<f64>, minus: Vector2<f64>| (plus - minus) * 0.5;
        // A tenth of a pixel to both sides is linear, and far above rounding.
        let column =
            |step: Vector2<f64>| both(moved(pixel + step, self.angles), moved(pixel - step, self.angles)) * 10.0;
        let j = Matrix2::from_columns(&[column(Vector2::new(0.1, 0.0)), column(Vector2::new(0.0, 0.1))]);
        let p = &belief.cov;
        let mut cov = j * Matrix2::new(p[(0, 0)], p[(0, 2)], p[(2, 0)], p[(2, 2)]) * j.transpose();
        for axis in 0..3 {
            let mut step = Vector3::zeros();
            step[axis] = self.sds[YAW + axis];
            let c = both(moved(pixel, self.angles + step), moved(pixel, self.angles - step));
            cov += c * c.transpose();
        }
        let sd = |k: usize| cov[(k, k)].max(0.0).sqrt().to_degrees().min(180.0);
        let bearing = Bearing {
            azimuth_deg: azimuth_deg(at.x.sin(), at.x.cos()),
            elevation_deg: at.y.to_degrees(),
            azimuth_sd_deg: sd(0),
            elevation_sd_deg: sd(1),
        };
        (at.iter().chain(cov.iter()).all(|v| v.is_finite())).then_some(bearing)
    }

    /// Where a direction from the camera meets the surface of a height, earth-centred; none above the horizon.
    fn ground(&self, direction: &Vector3<f64>, height_m: f64) -> Option<Vector3<f64>> {
        let u = self.axes.transpose() * direction.normalize();
        let [across, along] = raised_axes_m(height_m);
        let scale = Vector3::new(1.0 / across, 1.0 / across, 1.0 / along);
        let (c, d) = (self.place.component_mul(&scale), u.component_mul(&scale));
        let (a, b, above) = (d.norm_squared(), c.dot(&d), c.norm_squared() - 1.0);
        let root = (b * b - a * above).sqrt();
        // Not a number where the ray passes the earth by; a root behind the camera is none.
        let mut t = above / (root - b);
        for _ in 0..3 {
            let at = Geodetic::of_ecef(&(self.place + u * t));
            let slope = at.local_axes().row(2).dot(&u.transpose());
            let is_met = t > 0.0 && slope < -GRAZING;
            if !is_met {
                return None;
            }
            t -= (at.height_m - height_m) / slope;
        }
        (t > 0.0 && t.is_finite()).then(|| self.place + u * t)
    }

    fn place(&self, belief: &Gaussian<4>, bearing: &Bearing) -> Option<Place> {
        let height_m = self.ground_height_m?;
        let (azimuth, above) = (bearing.azimuth_deg, bearing.elevation_deg + bearing.elevation_sd_deg);
        let ((east, north), (up, out)) = (azimuth.to_radians().sin_cos(), above.to_radians().sin_cos());
        self.ground(&Vector3::new(out * east, out * north, up), height_m)?;
        let pixel = Vector2::new(belief.mean[0], belief.mean[2]);
        let target = self.ground(&self.ray(pixel, self.angles), height_m)?;
        let at = Geodetic::of_ecef(&target);
        let here = at.local_axes();
        let (from, turn) = (here * (self.place - target), here * self.axes.transpose());
        // About the target's pixel, so that the seen side of the horizon is the target's.
        let mut about = *belief;
        (about.mean[0], about.mean[2]) = (0.0, 0.0);
        let map = |error: &[f64; N_ERRORS]| -> Option<PlaneMap> {
            let camera = from + turn * Vector3::new(error[0], error[1], error[2]);
            let angles = self.angles + Vector3::new(error[3], error[4], error[5]);
            let rays = turn * enu_from_camera(angles) * self.camera_from_px(pixel);
            let (down, plane) = (rays.row(2), error[6]);
            // camera + s d meets up = plane at s = (plane - camera.z) / d.z.
            let row = |k: usize| down * camera[k] + rays.row(k) * (plane - camera.z);
            let m = Matrix3::from_rows(&[row(0), row(1), down.into_owned()]);
            // Only where the target's pixel still looks down.
            (m[(2, 2)] < 0.0).then(|| PlaneMap::from_rows(m.transpose().as_slice()).ok())?
        };
        let state = map(&[0.0; N_ERRORS])?.belief(&about)?;
        let mut cov = state.cov;
        for (k, sd) in self.sds.iter().enumerate().filter(|(_, sd)| **sd > 0.0) {
            let side = |sign: f64| -> Option<Vector4<f64>> {
                let mut error = [0.0; N_ERRORS];
                error[k] = sign * sd;
                Some(map(&error)?.belief(&about)?.mean)
            };
            let c = (side(1.0)? - side(-1.0)?) * 0.5;
            cov += c * c.transpose();
        }
        let place = Place {
            latitude_deg: at.latitude.to_degrees(),
            longitude_deg: at.longitude.to_degrees(),
            height_m: Some(height_m),
            height_sd_m: self.ground_height_sd_m,
            velocity_m_per_s: Vector2::new(state.mean[1], state.mean[3]),
            cov,
        };
        let is_known = cov.iter().all(|v| v.is_finite()) && place.position_sd_m() < from.norm();
        is_known.then_some(place)
    }

    /// Takes pixels about `pixel` to forward, right, down.
    fn camera_from_px(&self, pixel: Vector2<f64>) -> SMatrix<f64, 3, 3> {
        let (p, f) = ((pixel - self.principal_px) / self.focal_px, 1.0 / self.focal_px);
        Matrix3::new(0.0, 0.0, 1.0, f, 0.0, p.x, 0.0, f, p.y)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Matrix4;
    use proptest::prelude::*;
    use rand::SeedableRng;
    use rand_distr::{Distribution, StandardNormal};

    fn munich() -> PinholeConfig {
        PinholeConfig {
            focal_px: 1108.5,
            principal_point_px: [639.5, 359.5],
            latitude_deg: 48.137154,
            longitude_deg: 11.576124,
            height_m: 519.0,
            yaw_deg: 35.0,
            pitch_deg: -8.0,
            roll_deg: 3.0,
            ground_height_m: Some(0.0),
            position_sd_m: 0.0,
            height_sd_m: 0.0,
            yaw_sd_deg: 0.0,
            pitch_sd_deg: 0.0,
            roll_sd_deg: 0.0,
            ground_height_sd_m: 0.0,
        }
    }

    fn at(x: f64, y: f64) -> Gaussian<4> {
        Gaussian { mean: Vector4::new(x, 0.0, y, 0.0), cov: Matrix4::identity() }
    }

    #[test]
    fn rays_and_ground_are_those_of_scipy_and_pymap3d() {
        // scipy 1.17 Rotation.from_euler("ZYX") for the ray, pymap3d 3.2.0 los.lookAtSpheroid for its ground point on the ellipsoid.
        for ([x, y, yaw, pitch, roll], [azimuth, elevation, latitude, longitude]) in [
            (
                [100.0, 650.0, 35.0, -8.0, 3.0],
                [7.436176515375228, -19.059035051548936, 48.1505552451629, 11.578737844485355],
            ),
            ([639.5, 359.5, 35.0, -8.0, 3.0], [35.0, -8.0, 48.164411876904474, 11.604657244240649]),
            (
                [1200.0, 500.0, 275.0, -2.5, -1.0],
                [302.0618976258948, -8.22909152848529, 48.1543125608051, 11.535167473055282],
            ),
            ([639.5, 400.0, 10.0, -0.9, 0.0], [10.0, -2.99241983273309, 48.22643394535667, 11.599684619113699]),
        ] {
            let pose = PinholeConfig { yaw_deg: yaw, pitch_deg: pitch, roll_deg: roll, ..munich() };
            let Located { place, bearing } = Pinhole::new(&pose).locate(&at(x, y));
            let (place, bearing) = (place.unwrap(), bearing.unwrap());
            assert!((bearing.azimuth_deg - azimuth).abs() < 1e-9 && (bearing.elevation_deg - elevation).abs() < 1e-9);
            // 1e-9 degrees are 0.1 mm.
            assert!((place.latitude_deg - latitude).abs() < 1e-8, "{} {latitude}", place.latitude_deg);
            assert!((place.longitude_deg - longitude).abs() < 1e-8, "{} {longitude}", place.longitude_deg);
        }
    }

    #[test]
    fn without_a_ground_or_above_the_horizon_there_is_a_direction_only() {
        let blind = PinholeConfig { ground_height_m: None, ..munich() };
        let known = Pinhole::new(&blind).locate(&at(639.5, 359.5));
        assert!(known.place.is_none() && known.bearing.is_some());
        // The optical axis is 8 degrees below the horizontal, the horizon 0.73 degrees below it at 519 m.
        let up = Pinhole::new(&PinholeConfig { roll_deg: 0.0, ..munich() });
        let row = |below_deg: f64| 359.5 + 1108.5 * (below_deg - 8.0).to_radians().tan();
        let sharp = |y: f64| Gaussian { cov: Matrix4::identity() * 1e-8, ..at(639.5, y) };
        assert!(up.locate(&sharp(row(0.70))).place.is_none());
        let far = up.locate(&sharp(row(0.78))).place.expect("just below the horizon");
        assert!(far.latitude_deg > 48.5);
        // A pixel of noise there is more than the range.
        assert!(up.locate(&at(639.5, row(0.78))).place.is_none());
        assert!(up.locate(&at(639.5, row(-20.0))).bearing.unwrap().elevation_deg > 19.9);
    }

    /// A belief off the middle that moves, with correlations.
    fn mover() -> Gaussian<4> {
        let l = Matrix4::new(0.8, 0., 0., 0., 0.5, 2.0, 0., 0., 0.3, 0.1, 0.6, 0., 0.1, 0.4, 0.7, 1.5);
        Gaussian { mean: Vector4::new(300.0, 40.0, 500.0, -25.0), cov: l * l.transpose() }
    }

    /// East, north and their velocities of a belief's mean about a place, by small steps of time.
    fn path(pose: &Pinhole, mean: &Vector4<f64>, zero: &Geodetic) -> Vector4<f64> {
        let on = |s: f64| {
            let pixel = Vector2::new(mean[0] + s * mean[1], mean[2] + s * mean[3]);
            let p = pose.ground(&pose.ray(pixel, pose.angles), pose.ground_height_m.unwrap()).unwrap();
            zero.local_axes() * (p - zero.ecef())
        };
        let (p, v) = (on(0.0), (on(1e-3) - on(-1e-3)) / 2e-3);
        Vector4::new(p.x, v.x, p.y, v.y)
    }

    #[test]
    fn covariance_and_velocity_are_those_of_drawn_cameras_and_targets() {
        let sure = PinholeConfig { ground_height_m: Some(480.0), ..munich() };
        let unsure = PinholeConfig {
            position_sd_m: 0.4,
            height_sd_m: 0.3,
            yaw_sd_deg: 0.1,
            pitch_sd_deg: 0.08,
            roll_sd_deg: 0.2,
            ground_height_sd_m: 0.25,
            ..sure.clone()
        };
        let belief = mover();
        for (config, n) in [(&sure, 20_000), (&unsure, 20_000)] {
            let place = Pinhole::new(config).locate(&belief).place.unwrap();
            let zero = Geodetic::of_degrees(place.latitude_deg, place.longitude_deg, 480.0);
            let exact = path(&Pinhole::new(config), &belief.mean, &zero);
            // The ground's curvature is not in the plane that touches it: a millionth here.
            let said = Vector4::new(0.0, place.velocity_m_per_s.x, 0.0, place.velocity_m_per_s.y);
            assert!((exact - said).amax() < 1e-5, "{exact} {said}");
            let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(7);
            let root = belief.cov.cholesky().unwrap().l();
            let (mut sum, mut squares) = (Vector4::zeros(), Matrix4::zeros());
            for _ in 0..n {
                let mut draw = || -> f64 { StandardNormal.sample(&mut rng) };
                let mean = belief.mean + root * Vector4::from_fn(|_, _| draw());
                let metres = config.position_sd_m * Vector3::new(draw(), draw(), 0.0);
                let mut c = config.clone();
                c.yaw_deg += config.yaw_sd_deg * draw();
                c.pitch_deg += config.pitch_sd_deg * draw();
                c.roll_deg += config.roll_sd_deg * draw();
                c.height_m += config.height_sd_m * draw();
                c.ground_height_m = Some(480.0 + config.ground_height_sd_m * draw());
                let mut pose = Pinhole::new(&c);
                pose.place += pose.axes.transpose() * metres;
                let s = path(&pose, &mean, &zero);
                sum += s;
                squares += s * s.transpose();
            }
            let mean = sum / f64::from(n);
            let drawn = squares / f64::from(n) - mean * mean.transpose();
            for (i, j) in (0..4).flat_map(|i| (0..4).map(move |j| (i, j))) {
                let scale = (drawn[(i, i)] * drawn[(j, j)]).sqrt();
                // 20 000 draws tell a covariance to 1 %; the rest is the curvature that the first order leaves out.
                assert!((drawn[(i, j)] - place.cov[(i, j)]).abs() < 0.05 * scale, "{i} {j}: {drawn} {}", place.cov);
            }
        }
    }

    #[test]
    fn a_bearing_takes_the_errors_of_pixel_and_attitude() {
        let level = PinholeConfig { pitch_deg: 0.0, roll_deg: 0.0, yaw_sd_deg: 0.3, pitch_sd_deg: 0.2, ..munich() };
        let belief = Gaussian { cov: Matrix4::from_diagonal(&Vector4::new(4.0, 0.0, 9.0, 0.0)), ..at(639.5, 359.5) };
        let b = Pinhole::new(&level).locate(&belief).bearing.unwrap();
        // On the axis a pixel is 1 / f rad.
        let (az, el) = ((2.0 / 1108.5f64).to_degrees().hypot(0.3), (3.0 / 1108.5f64).to_degrees().hypot(0.2));
        assert!((b.azimuth_sd_deg - az).abs() < 1e-5 && (b.elevation_sd_deg - el).abs() < 1e-5, "{b:?}");
        let overhead = PinholeConfig { pitch_deg: 90.0, ..level };
        let b = Pinhole::new(&overhead).locate(&belief).bearing.unwrap();
        assert!((b.elevation_deg - 90.0).abs() < 1e-6 && b.azimuth_sd_deg > 30.0, "overhead nothing is known: {b:?}");
    }

    proptest! {
        #[test]
        fn a_place_is_seen_again_at_its_pixel(
            x in 0.0..1280.0f64, y in 0.0..720.0f64, lat in -89.0..89.0f64, lon in -180.0..180.0f64,
            yaw in -180.0..180.0f64, pitch in -80.0..-5.0f64, roll in -30.0..30.0f64, above in 2.0..5000.0f64, ground in -100.0..3000.0f64,
        ) {
            let pose = Pinhole::new(&PinholeConfig {
                latitude_deg: lat, longitude_deg: lon, height_m: ground + above, ground_height_m: Some(ground),
                yaw_deg: yaw, pitch_deg: pitch, roll_deg: roll, ..munich()
            });
            let belief = Gaussian { mean: Vector4::new(x, 30.0, y, 10.0), cov: Matrix4::identity() * 1e-4 };
            if let Some(place) = pose.locate(&belief).place {
                let target = Geodetic::of_degrees(place.latitude_deg, place.longitude_deg, ground).ecef();
                let d = enu_from_camera(pose.angles).transpose() * (pose.axes * (target - pose.place));
                prop_assert!(d.x > 0.0, "before the camera");
                let pixel = pose.principal_px + pose.focal_px * Vector2::new(d.y / d.x, d.z / d.x);
                // A camera 2 m above the ground sees a rounding of the earth's coordinates (1e-9 m) as some 1e-6 px.
                prop_assert!((pixel - Vector2::new(x, y)).norm() < 1e-5, "{pixel}");
                prop_assert!(place.cov.symmetric_eigenvalues().min() > -1e-9 * place.cov.trace());
            }
        }
    }
}
