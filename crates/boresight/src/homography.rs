//! A homography of the plane: what a camera that moves before a plane, or turns on the spot, makes of points.
//!
//! Source: R. Hartley, A. Zisserman, *Multiple View Geometry in Computer Vision*, 2nd ed., 2004, section 2.3.
//! Symbols: `p' ~ M p` in homogeneous coordinates, M scaled so that its last entry is 1 (px); A the local linear part dp'/dp at a point.
//! A shift alone stays exactly one when it is composed with shifts and inverted.
//! Limits: points on the line that goes to infinity have no image (`apply` then gives what is not finite).

use crate::Similarity;
use nalgebra::{Matrix2, Matrix3, Vector2, Vector3};

/// A projective transform of the plane.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Homography(Matrix3<f64>);

impl Default for Homography {
    fn default() -> Self {
        Self::identity()
    }
}

impl Homography {
    /// Leaves every point where it is.
    pub fn identity() -> Self {
        Self(Matrix3::identity())
    }

    /// Of a matrix; `None` where it is not finite or has no inverse.
    pub fn of_matrix(m: Matrix3<f64>) -> Option<Self> {
        let scale = m[(2, 2)];
        let m = m / scale;
        let sound = m.iter().all(|v| v.is_finite()) && m.determinant().abs() > 1e-12;
        sound.then_some(Self(m))
    }

    /// Moves every point by the same vector, px.
    pub fn shift(shift_px: Vector2<f64>) -> Self {
        Self(Matrix3::new(1.0, 0.0, shift_px.x, 0.0, 1.0, shift_px.y, 0.0, 0.0, 1.0))
    }

    /// The matrix, its last entry 1.
    pub fn matrix(&self) -> &Matrix3<f64> {
        &self.0
    }

    /// The same motion as a similarity's.
    pub fn of_similarity(s: &Similarity) -> Self {
        if s.is_shift() {
            return Self::shift(s.shift_at(Vector2::zeros()));
        }
        let (a, t) = (s.linear(), s.apply(Vector2::zeros()));
        Self(Matrix3::new(a[(0, 0)], a[(0, 1)], t.x, a[(1, 0)], a[(1, 1)], t.y, 0.0, 0.0, 1.0))
    }

    /// From the pixels of an image of means over blocks of that side to those of the image itself: the middle of one is that of its block.
    pub fn of_blocks(side: usize) -> Self {
        let (side, first) = (side as f64, 0.5 * (side as f64 - 1.0));
        Self(Matrix3::new(side, 0.0, first, 0.0, side, first, 0.0, 0.0, 1.0))
    }

    /// Where a point comes to lie.
    #[inline]
    pub fn apply(&self, p: Vector2<f64>) -> Vector2<f64> {
        let q = self.0 * Vector3::new(p.x, p.y, 1.0);
        Vector2::new(q.x / q.z, q.y / q.z)
    }

    /// The local linear part at a point.
    pub fn linear_at(&self, p: Vector2<f64>) -> Matrix2<f64> {
        let m = &self.0;
        let q = m * Vector3::new(p.x, p.y, 1.0);
        let at = Vector2::new(q.x / q.z, q.y / q.z);
        let row = |i: usize, v: f64| [(m[(i, 0)] - v * m[(2, 0)]) / q.z, (m[(i, 1)] - v * m[(2, 1)]) / q.z];
        let (x, y) = (row(0, at.x), row(1, at.y));
        Matrix2::new(x[0], x[1], y[0], y[1])
    }

    /// What becomes of a small difference of two points there.
    pub fn turn_at(&self, at: Vector2<f64>, v: Vector2<f64>) -> Vector2<f64> {
        if self.is_shift() { v } else { self.linear_at(at) * v }
    }

    /// What becomes of a covariance of a position there, to first order.
    pub fn turn_cov_at(&self, at: Vector2<f64>, cov: &Matrix2<f64>) -> Matrix2<f64> {
        if self.is_shift() {
            return *cov;
        }
        let a = self.linear_at(at);
        let turned = a * cov * a.transpose();
        0.5 * (turned + turned.transpose())
    }

    /// How far a point moves, px.
    pub fn shift_at(&self, p: Vector2<f64>) -> Vector2<f64> {
        if self.is_shift() { Vector2::new(self.0[(0, 2)], self.0[(1, 2)]) } else { self.apply(p) - p }
    }

    /// Growth of lengths at a point, the square root of that of areas; 1 for none.
    pub fn zoom_at(&self, p: Vector2<f64>) -> f64 {
        if self.is_shift() { 1.0 } else { self.linear_at(p).determinant().abs().sqrt() }
    }

    /// Angle of the rotation at a point, rad, from +x towards +y.
    pub fn angle_rad_at(&self, p: Vector2<f64>) -> f64 {
        let a = self.linear_at(p);
        (a[(1, 0)] - a[(0, 1)]).atan2(a[(0, 0)] + a[(1, 1)])
    }

    /// The similarity that is nearest to it around a point.
    pub fn similarity_at(&self, p: Vector2<f64>) -> Similarity {
        if self.is_shift() {
            return Similarity::shift(self.shift_at(p));
        }
        let a = self.linear_at(p);
        let (cos, sin) = (0.5 * (a[(0, 0)] + a[(1, 1)]), 0.5 * (a[(1, 0)] - a[(0, 1)]));
        Similarity::with_linear(cos, sin, p, self.apply(p))
    }

    /// Whether it only shifts.
    pub fn is_shift(&self) -> bool {
        let m = &self.0;
        m[(0, 0)] == 1.0 && m[(1, 1)] == 1.0 && [m[(0, 1)], m[(1, 0)], m[(2, 0)], m[(2, 1)]] == [0.0; 4]
    }

    /// Whether it leaves every point where it is.
    pub fn is_identity(&self) -> bool {
        self.is_shift() && self.shift_at(Vector2::zeros()) == Vector2::zeros()
    }

    /// Whether all its numbers are finite and it has an inverse.
    pub fn is_sound(&self) -> bool {
        self.0.iter().all(|v| v.is_finite()) && self.0.determinant().abs() > 1e-12
    }

    /// First this one, then `next`.
    #[must_use]
    pub fn then(&self, next: &Self) -> Self {
        if self.is_shift() && next.is_shift() {
            return Self::shift(self.shift_at(Vector2::zeros()) + next.shift_at(Vector2::zeros()));
        }
        Self::of_matrix(next.0 * self.0).unwrap_or(*next)
    }

    /// The way back.
    #[must_use]
    pub fn inverse(&self) -> Self {
        if self.is_shift() {
            return Self::shift(-self.shift_at(Vector2::zeros()));
        }
        self.0.try_inverse().and_then(Self::of_matrix).unwrap_or_else(Self::identity)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn any() -> impl Strategy<Value = Homography> {
        let small = -1e-4..1e-4f64;
        (-0.3..0.3f64, -0.3..0.3f64, -50.0..50.0f64, -50.0..50.0f64, small.clone(), small).prop_map(
            |(a, b, x, y, g, h)| Homography::of_matrix(Matrix3::new(1.0 + a, -b, x, b, 1.0 - a, y, g, h, 1.0)).unwrap(),
        )
    }

    proptest! {
        #[test]
        fn there_and_back_and_one_after_the_other(a in any(), b in any(), x in 0.0..500.0f64, y in 0.0..500.0f64) {
            let p = Vector2::new(x, y);
            prop_assert!((a.inverse().apply(a.apply(p)) - p).norm() < 1e-8);
            prop_assert!((a.then(&b).apply(p) - b.apply(a.apply(p))).norm() < 1e-7);
            let (turned, v) = (a.turn_at(p, Vector2::new(3.0, -2.0)), a.linear_at(p) * Vector2::new(3.0, -2.0));
            prop_assert!((turned - v).norm() < 1e-12 && a.is_sound());
            // Of a similarity the nearest one is itself, whatever the point.
            let s = a.similarity_at(p);
            prop_assert!((Homography::of_similarity(&s).similarity_at(Vector2::new(y, x)).apply(p) - s.apply(p)).norm() < 1e-7);
            prop_assert!((s.zoom() - Homography::of_similarity(&s).zoom_at(p)).abs() < 1e-9);
            prop_assert!((s.angle_rad() - Homography::of_similarity(&s).angle_rad_at(p)).abs() < 1e-9);
            // The linear part is the limit of difference quotients.
            let d = 1e-4;
            let quotient = (a.apply(p + Vector2::new(d, 0.0)) - a.apply(p - Vector2::new(d, 0.0))) / (2.0 * d);
            prop_assert!((a.linear_at(p) * Vector2::new(1.0, 0.0) - quotient).norm() < 1e-6);
        }
    }

    #[test]
    fn the_middle_of_a_mean_is_that_of_its_block() {
        let p = Homography::of_blocks(4).apply(Vector2::new(2.0, 0.0));
        // Columns 8 to 11 and rows 0 to 3.
        assert_eq!(p, Vector2::new(9.5, 1.5));
    }

    #[test]
    fn shifts_stay_exactly_shifts() {
        let (a, b) = (Homography::shift(Vector2::new(0.1, -0.7)), Homography::shift(Vector2::new(3.3, 1.9)));
        assert!(a.then(&b).then(&b.inverse()).is_shift());
        assert_eq!(a.then(&a.inverse()), Homography::identity());
        assert_eq!(a.shift_at(Vector2::new(1e6, 3.0)), Vector2::new(0.1, -0.7));
        assert!(Homography::identity().is_identity() && !a.is_identity());
    }

    #[test]
    fn a_similarity_stays_what_it_is() {
        let s = Similarity::about(Vector2::new(30.0, 20.0), Vector2::new(3.0, -1.0), 0.2, 1.1);
        let p = Vector2::new(12.0, 70.0);
        assert!((Homography::of_similarity(&s).apply(p) - s.apply(p)).norm() < 1e-12);
        assert!(Homography::of_matrix(Matrix3::zeros()).is_none());
    }
}
