//! A homography of the plane: what a camera that moves before a plane, or turns on the spot, makes of points.
//!
//! Source: R. Hartley, A. Zisserman, *Multiple View Geometry in Computer Vision*, 2nd ed., 2004, section 2.3.
//! Symbols: `p' ~ M p` in homogeneous coordinates, M scaled so that its last entry is 1 (px); A the local linear part dp'/dp at a point.
//! Limits: points on the line that goes to infinity have no image (`apply` then gives what is not finite).

use crate::Similarity;
use nalgebra::{Matrix2, Matrix3, Vector2, Vector3};

/// A projective transform of the plane.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Homography(Matrix3<f64>);

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

    /// The same motion as a similarity's.
    pub fn of_similarity(s: &Similarity) -> Self {
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

    /// First this one, then `next`.
    #[must_use]
    pub fn then(&self, next: &Self) -> Self {
        Self::of_matrix(next.0 * self.0).unwrap_or(*next)
    }

    /// The way back.
    #[must_use]
    pub fn inverse(&self) -> Self {
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
    fn a_similarity_stays_what_it_is() {
        let s = Similarity::about(Vector2::new(30.0, 20.0), Vector2::new(3.0, -1.0), 0.2, 1.1);
        let p = Vector2::new(12.0, 70.0);
        assert!((Homography::of_similarity(&s).apply(p) - s.apply(p)).norm() < 1e-12);
        assert!(Homography::of_matrix(Matrix3::zeros()).is_none());
    }
}
