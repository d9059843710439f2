//! Frames of reference: a plane map (affine or homography) brings one sensor's positions, velocities and covariances into another's.
//!
//! Map: p' = N / D with `[N; D] = M [x; y; 1]`; J = ∂p'/∂p = (A − p' cᵀ)/D, v' = J v, ∂v'/∂p = −((c·v) J + v' cᵀ)/D, where A is the
//! upper left of M and c = (m31, m32). Covariances go through these derivatives (first order); exact for affine maps.
//! Estimated from points known in both frames: the linear solution (DLT: R. Hartley, A. Zisserman, *Multiple View Geometry*, 2nd
//! ed., 2004, 4.1, with their normalisation 4.4.4), then Gauss-Newton on the distances in the second frame.
//! Symbols: M 3 x 3, scale fixed by m33 = 1 (affine) or the largest entry (homography). Units: of the two frames (px, m).
//! A homography has a horizon, D = 0, and sees one side of it: that of the points it is estimated from; of one that is given that of the image's corner, (0, 0).
//! Limits: points must not lie on one line; a homography must not bring them near its horizon.

use super::timeline::Timeline;
use crate::{Detection, Error, ErrorKind, Result};
use boresight_filters::Gaussian;
use nalgebra::{DMatrix, DVector, Matrix2, Matrix3, Matrix4, Vector2, Vector3, Vector4};

/// A map from one plane to another.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlaneMap {
    m: Matrix3<f64>,
    /// Sign of D on the side of the horizon that is seen.
    side: f64,
}

/// Which map is estimated.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MapKind {
    /// Six parameters, three points or more.
    Affine,
    /// Eight parameters, four points or more.
    Homography,
}

/// An estimated map.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MapEstimate {
    /// The map.
    pub map: PlaneMap,
    /// Root mean square distance of the mapped points from their partners, in units of the second frame.
    pub rms: f64,
    /// Number of points.
    pub n_points: usize,
}

impl Default for PlaneMap {
    fn default() -> Self {
        Self::IDENTITY
    }
}

impl PlaneMap {
    /// Leaves everything as it is.
    pub const IDENTITY: Self = Self { m: Matrix3::new(1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0), side: 1.0 };

    /// Takes the rows of the matrix: 6 numbers (affine) or 9 (homography).
    /// # Errors
    /// [`ErrorKind::Config`] for another count, numbers that are not finite, or a map that has no inverse.
    pub fn from_rows(rows: &[f64]) -> Result<Self> {
        let m = match rows {
            [a, b, c, d, e, f] => Matrix3::new(*a, *b, *c, *d, *e, *f, 0.0, 0.0, 1.0),
            [_, _, _, _, _, _, _, _, _] => Matrix3::from_row_slice(rows),
            _ => {
                let e = Error::new(ErrorKind::Config, format!("expected 6 or 9 numbers, not {}", rows.len()));
                return Err(e
                    .at("plane map")
                    .hint("affine: a, b, tx, c, d, ty (x' = a x + b y + tx); homography: 3 x 3, row by row"));
            }
        };
        // Scaled, so that the test of the determinant does not depend on units.
        let scale = m.amax();
        if !(m.iter().all(|v| v.is_finite()) && scale > 0.0 && m.determinant() != 0.0) {
            return Err(
                Error::new(ErrorKind::Config, "the map has no inverse, or a number is not finite").at("plane map")
            );
        }
        Ok(Self { m, side: m[(2, 2)].signum() })
    }

    /// The same map, seen where D has this sign.
    pub(crate) fn on_side(self, side: f64) -> Self {
        Self { side, ..self }
    }

    /// Sign of D on the side of the horizon that is seen.
    pub(crate) fn side(&self) -> f64 {
        self.side
    }

    /// The matrix.
    pub fn matrix(&self) -> &Matrix3<f64> {
        &self.m
    }

    /// Maps a point and gives the derivative there; none on or behind the horizon.
    fn at(&self, p: &Vector2<f64>) -> Option<(Vector2<f64>, Matrix2<f64>, f64)> {
        let h = self.m * Vector3::new(p.x, p.y, 1.0);
        let d = h.z;
        if !(d.is_finite() && d * self.side > 0.0) {
            return None;
        }
        let q = Vector2::new(h.x / d, h.y / d);
        let a = self.m.fixed_view::<2, 2>(0, 0);
        let c = self.m.fixed_view::<1, 2>(2, 0);
        let j = (a - q * c) / d;
        (q.iter().chain(j.iter()).all(|v| v.is_finite())).then_some((q, j, d))
    }

    /// Maps a point; none beyond the horizon.
    pub fn point(&self, p: &Vector2<f64>) -> Option<Vector2<f64>> {
        self.at(p).map(|(q, _, _)| q)
    }

    /// Derivative of the map at a point, 2×2; none beyond the horizon.
    pub(crate) fn derivative(&self, p: &Vector2<f64>) -> Option<Matrix2<f64>> {
        self.at(p).map(|(_, j, _)| j)
    }

    /// Maps a belief `[x, vx, y, vy]` with its covariance; none beyond the horizon.
    pub fn belief(&self, b: &Gaussian<4>) -> Option<Gaussian<4>> {
        let (p, v) = (Vector2::new(b.mean[0], b.mean[2]), Vector2::new(b.mean[1], b.mean[3]));
        let (q, j, d) = self.at(&p)?;
        let w = j * v;
        let c = Vector2::new(self.m[(2, 0)], self.m[(2, 1)]);
        let bend = -(j * c.dot(&v) + w * c.transpose()) / d;
        let mut full = Matrix4::zeros();
        for r in 0..2 {
            for k in 0..2 {
                full[(2 * r, 2 * k)] = j[(r, k)];
                full[(2 * r + 1, 2 * k + 1)] = j[(r, k)];
                full[(2 * r + 1, 2 * k)] = bend[(r, k)];
            }
        }
        let cov = full * b.cov * full.transpose();
        Some(Gaussian { mean: Vector4::new(q.x, w.x, q.y, w.y), cov: (cov + cov.transpose()) * 0.5 })
    }

    /// Maps a track; points beyond the horizon are left out.
    pub fn timeline(&self, t: &Timeline) -> Timeline {
        let points: Vec<_> = t.points.iter().filter_map(|(s, b)| Some((*s, self.belief(b)?))).collect();
        let scale = points.last().and_then(|(_, b)| self.scale_back(b)).unwrap_or(1.0);
        Timeline { id: t.id, points, size: t.size.map(|v| v * scale) }
    }

    /// Maps a detection with its covariance and box; none beyond the horizon.
    pub fn detection(&self, d: &Detection) -> Option<Detection> {
        let (q, j, _) = self.at(&d.position)?;
        let scale = j.determinant().abs().sqrt();
        let mut out = d.clone();
        out.position = q;
        out.cov = j * d.cov * j.transpose();
        out.extent.width_px *= scale;
        out.extent.height_px *= scale;
        out.extent.left_px = q.x - 0.5 * out.extent.width_px;
        out.extent.top_px = q.y - 0.5 * out.extent.height_px;
        Some(out)
    }

    /// Length scale of the map where it led to this belief.
    fn scale_back(&self, b: &Gaussian<4>) -> Option<f64> {
        // M⁻¹ [p'; 1] = [p; 1] / D.
        let back = Self { m: self.m.try_inverse()?, side: self.side };
        let (_, j, _) = back.at(&Vector2::new(b.mean[0], b.mean[2]))?;
        Some(1.0 / j.determinant().abs().sqrt())
    }

    /// Estimates the map that brings each first point to its second one.
    /// # Errors
    /// [`ErrorKind::Numeric`] for too few points, or points that do not determine the map (on one line).
    pub fn estimate(pairs: &[(Vector2<f64>, Vector2<f64>)], kind: MapKind) -> Result<MapEstimate> {
        let (least, name) = match kind {
            MapKind::Affine => (3, "an affine map"),
            MapKind::Homography => (4, "a homography"),
        };
        let refuse = |what: String| {
            Error::new(ErrorKind::Numeric, what)
                .at("plane map")
                .hint("give points spread over the field, not on one line; affine needs 3, a homography 4")
        };
        if pairs.len() < least {
            return Err(refuse(format!("{} points, {name} needs {least}", pairs.len())));
        }
        let (from, to) = (normaliser(pairs.iter().map(|p| p.0)), normaliser(pairs.iter().map(|p| p.1)));
        let (Some(from), Some(to)) = (from, to) else { return Err(refuse("the points are one point".into())) };
        let unit: Vec<_> = pairs.iter().map(|(a, b)| (apply(&from, a), apply(&to, b))).collect();
        let mut m = linear(&unit, kind).ok_or_else(|| refuse("the points do not determine the map".into()))?;
        for _ in 0..20 {
            let Some(step) = gauss_newton(&unit, &m, kind) else { break };
            m += step;
            if step.amax() < 1e-13 {
                break;
            }
        }
        let back = to.try_inverse().ok_or_else(|| refuse("the points are one point".into()))?;
        let mut m = back * m * from;
        m /= if kind == MapKind::Affine { m[(2, 2)] } else { m[(2, 2)].signum() * m.amax() };
        let seen = (m * Vector3::new(pairs[0].0.x, pairs[0].0.y, 1.0)).z.signum();
        let map = Self::from_rows(m.transpose().as_slice())?.on_side(seen);
        let mut sum = 0.0;
        for (a, b) in pairs {
            let q = map.point(a).ok_or_else(|| refuse("the map's horizon runs between the points".into()))?;
            sum += (q - b).norm_squared();
        }
        Ok(MapEstimate { map, rms: (sum / pairs.len() as f64).sqrt(), n_points: pairs.len() })
    }
}

/// Positions of two tracks of one target at the first one's times: points for [`PlaneMap::estimate`] from the second to the first.
pub fn common_points(a: &Timeline, b: &Timeline, max_gap_s: f64) -> Vec<(Vector2<f64>, Vector2<f64>)> {
    let here = |g: &Gaussian<4>| Vector2::new(g.mean[0], g.mean[2]);
    a.points.iter().filter_map(|(t, g)| Some((b.between(*t, max_gap_s)?.0, here(g)))).collect()
}

fn apply(m: &Matrix3<f64>, p: &Vector2<f64>) -> Vector2<f64> {
    let h = m * Vector3::new(p.x, p.y, 1.0);
    Vector2::new(h.x / h.z, h.y / h.z)
}

/// Moves the centre of the points to 0 and their mean distance from it to √2.
fn normaliser(points: impl Iterator<Item = Vector2<f64>> + Clone) -> Option<Matrix3<f64>> {
    let n = points.clone().count() as f64;
    let c = points.clone().sum::<Vector2<f64>>() / n;
    let mean = points.map(|p| (p - c).norm()).sum::<f64>() / n;
    let s = std::f64::consts::SQRT_2 / mean;
    s.is_finite().then(|| Matrix3::new(s, 0.0, -s * c.x, 0.0, s, -s * c.y, 0.0, 0.0, 1.0))
}

/// The linear solution with m33 = 1 (points are normalised: the horizon is far from their centre).
fn linear(pairs: &[(Vector2<f64>, Vector2<f64>)], kind: MapKind) -> Option<Matrix3<f64>> {
    let n = if kind == MapKind::Affine { 6 } else { 8 };
    let mut a = DMatrix::zeros(2 * pairs.len(), n);
    let mut b = DVector::zeros(2 * pairs.len());
    for (i, (p, q)) in pairs.iter().enumerate() {
        for axis in 0..2 {
            let row = 2 * i + axis;
            (a[(row, 3 * axis)], a[(row, 3 * axis + 1)], a[(row, 3 * axis + 2)]) = (p.x, p.y, 1.0);
            if n == 8 {
                (a[(row, 6)], a[(row, 7)]) = (-q[axis] * p.x, -q[axis] * p.y);
            }
            b[row] = q[axis];
        }
    }
    let svd = a.svd(true, true);
    // Points on one line leave a direction without information.
    if svd.singular_values.min() < 1e-9 * svd.singular_values.max() {
        return None;
    }
    let x = svd.solve(&b, 0.0).ok()?;
    let at = |i: usize| x.get(i).copied().unwrap_or(0.0);
    Some(Matrix3::new(at(0), at(1), at(2), at(3), at(4), at(5), at(6), at(7), 1.0))
}

/// One step on the distances in the second frame.
fn gauss_newton(pairs: &[(Vector2<f64>, Vector2<f64>)], m: &Matrix3<f64>, kind: MapKind) -> Option<Matrix3<f64>> {
    let n = if kind == MapKind::Affine { 6 } else { 8 };
    let (mut information, mut gradient) = (DMatrix::zeros(n, n), DVector::zeros(n));
    for (p, q) in pairs {
        let d = (m * Vector3::new(p.x, p.y, 1.0)).z;
        let at = apply(m, p);
        for axis in 0..2 {
            let mut j = DVector::zeros(n);
            (j[3 * axis], j[3 * axis + 1], j[3 * axis + 2]) = (p.x / d, p.y / d, 1.0 / d);
            if n == 8 {
                (j[6], j[7]) = (-at[axis] * p.x / d, -at[axis] * p.y / d);
            }
            gradient += &j * (q[axis] - at[axis]);
            information += &j * j.transpose();
        }
    }
    let x = information.cholesky()?.solve(&gradient);
    let at = |i: usize| x.get(i).copied().unwrap_or(0.0);
    let step = Matrix3::new(at(0), at(1), at(2), at(3), at(4), at(5), at(6), at(7), 0.0);
    step.iter().all(|v| v.is_finite()).then_some(step)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn camera() -> PlaneMap {
        PlaneMap::from_rows(&[1.2, 0.3, 40.0, -0.2, 0.9, 15.0, 2e-4, 5e-4, 1.0]).unwrap()
    }

    fn grid() -> Vec<Vector2<f64>> {
        (0..25).map(|i| Vector2::new(f64::from(i % 5) * 60.0, f64::from(i / 5) * 45.0)).collect()
    }

    #[test]
    fn a_map_of_points_sees_their_side_of_the_horizon_where_the_corner_is_beyond_it() {
        // Row 100 is the horizon; the corner of the image is sky.
        let road = PlaneMap::from_rows(&[1.0, 0.0, -300.0, 0.0, 0.0, 900.0, 0.0, 0.01, -1.0]).unwrap().on_side(1.0);
        let pixels = [[50.0, 200.0], [600.0, 220.0], [580.0, 470.0], [20.0, 450.0], [300.0, 320.0]].map(Vector2::from);
        let pairs: Vec<_> = pixels.iter().map(|p| (*p, road.point(p).unwrap())).collect();
        let found = PlaneMap::estimate(&pairs, MapKind::Homography).unwrap();
        assert!(found.rms < 1e-8, "{}", found.rms);
        let b = Gaussian { mean: Vector4::new(400.0, 3.0, 300.0, -2.0), cov: Matrix4::identity() };
        let [want, got] = [road, found.map].map(|m| m.belief(&b).unwrap());
        assert!((want.mean - got.mean).amax() < 1e-6 && (want.cov - got.cov).amax() < 1e-6);
        assert_eq!(found.map.point(&Vector2::new(300.0, 50.0)), None, "the sky");
    }

    #[test]
    fn derivatives_are_those_of_differences() {
        let map = camera();
        let b = Gaussian { mean: Vector4::new(80.0, 3.0, 60.0, -2.0), cov: Matrix4::identity() };
        let mapped = map.belief(&b).unwrap();
        // Each column of the derivative by central differences; with the identity as covariance, cov = F Fᵀ.
        let f = Matrix4::from_fn(|r, c| {
            let moved = |h: f64| {
                let mut x = b;
                x.mean[c] += h;
                map.belief(&x).unwrap().mean[r]
            };
            (moved(1e-4) - moved(-1e-4)) / 2e-4
        });
        assert!((mapped.cov - f * f.transpose()).amax() < 1e-6, "{}", mapped.cov - f * f.transpose());
        // The velocity is that of the mapped path.
        let at = |s: f64| map.point(&Vector2::new(80.0 + 3.0 * s, 60.0 - 2.0 * s)).unwrap();
        let v = (at(1e-4) - at(-1e-4)) / 2e-4;
        assert!((v - Vector2::new(mapped.mean[1], mapped.mean[3])).norm() < 1e-7);
    }

    #[test]
    fn maps_are_found_again_from_points() {
        for (kind, map) in [
            (MapKind::Homography, camera()),
            (MapKind::Affine, PlaneMap::from_rows(&[0.5, -1.5, 300.0, 2.0, 0.1, -7.0]).unwrap()),
        ] {
            let pairs: Vec<_> = grid().into_iter().map(|p| (p, map.point(&p).unwrap())).collect();
            let found = PlaneMap::estimate(&pairs, kind).unwrap();
            assert!(found.rms < 1e-9, "{kind:?} {}", found.rms);
            let far = Vector2::new(300.0, 10.0);
            assert!((found.map.point(&far).unwrap() - map.point(&far).unwrap()).norm() < 1e-7);
        }
    }

    #[test]
    fn noise_is_averaged_by_least_squares_in_the_second_frame() {
        use rand::SeedableRng;
        use rand_distr::{Distribution, StandardNormal};
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(3);
        let map = camera();
        let (mut sum, n) = (0.0, 60);
        for _ in 0..n {
            let pairs: Vec<_> = grid()
                .into_iter()
                .map(|p| {
                    let z: [f64; 2] = std::array::from_fn(|_| StandardNormal.sample(&mut rng));
                    (p, map.point(&p).unwrap() + Vector2::from(z))
                })
                .collect();
            sum += PlaneMap::estimate(&pairs, MapKind::Homography).unwrap().rms.powi(2);
        }
        // 50 residuals, 8 parameters: the mean square distance of a point is 2 (50 - 8) / 50.
        let expected = 2.0 * 42.0 / 50.0;
        assert!((sum / f64::from(n) - expected).abs() < 0.2, "{}", sum / f64::from(n));
    }

    #[test]
    fn what_does_not_determine_a_map_is_refused() {
        let line: Vec<_> =
            (0..8).map(|i| (Vector2::new(f64::from(i), 2.0 * f64::from(i)), Vector2::new(f64::from(i), 0.0))).collect();
        for kind in [MapKind::Affine, MapKind::Homography] {
            assert!(PlaneMap::estimate(&line, kind).unwrap_err().to_string().contains("hint"));
            assert!(PlaneMap::estimate(&line[..2], kind).is_err());
        }
        assert!(PlaneMap::from_rows(&[1.0; 9]).is_err() && PlaneMap::from_rows(&[1.0; 7]).is_err());
        assert_eq!(camera().point(&Vector2::new(-6000.0, 0.0)), None, "behind the horizon");
    }
}
