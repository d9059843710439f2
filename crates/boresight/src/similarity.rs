//! A similarity of the plane: rotation, zoom and shift, `p' = z R p + t`.
//!
//! Source: R. Hartley, A. Zisserman, *Multiple View Geometry in Computer Vision*, 2nd ed., 2004, section 2.4.2.
//! Symbols: `c = z cos(angle)`, `s = z sin(angle)`; z R = `[c -s; s c]`; t (px). The angle turns +x towards +y.
//! A shift alone has c = 1 and s = 0, and stays exactly so when it is composed with shifts and inverted.
//! Limits: no mirror images; a zoom of 0 has no inverse.

use nalgebra::{Matrix2, Vector2};

/// A rotation, zoom and shift of the plane.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Similarity {
    cos: f64,
    sin: f64,
    shift_px: Vector2<f64>,
}

impl Default for Similarity {
    fn default() -> Self {
        Self::identity()
    }
}

impl Similarity {
    /// Leaves every point where it is.
    pub fn identity() -> Self {
        Self::shift(Vector2::zeros())
    }

    /// Moves every point by the same vector, px.
    pub fn shift(shift_px: Vector2<f64>) -> Self {
        Self { cos: 1.0, sin: 0.0, shift_px }
    }

    /// Turns by an angle and zooms about a point, then moves that point by `shift_px`.
    pub fn about(centre_px: Vector2<f64>, shift_px: Vector2<f64>, angle_rad: f64, zoom: f64) -> Self {
        if angle_rad == 0.0 && zoom == 1.0 {
            return Self::shift(shift_px);
        }
        Self::with_linear(zoom * angle_rad.cos(), zoom * angle_rad.sin(), centre_px, centre_px + shift_px)
    }

    /// With `c` and `s` of the linear part `[c -s; s c]`, taking the point `from` to the point `to` (px).
    pub fn with_linear(cos: f64, sin: f64, from: Vector2<f64>, to: Vector2<f64>) -> Self {
        let turned = Vector2::new(cos * from.x - sin * from.y, sin * from.x + cos * from.y);
        Self { cos, sin, shift_px: to - turned }
    }

    /// Where a point comes to lie.
    #[inline]
    pub fn apply(&self, p: Vector2<f64>) -> Vector2<f64> {
        self.turn(p) + self.shift_px
    }

    /// What becomes of a difference of two points: turned and zoomed, not shifted.
    #[inline]
    pub fn turn(&self, v: Vector2<f64>) -> Vector2<f64> {
        Vector2::new(self.cos * v.x - self.sin * v.y, self.sin * v.x + self.cos * v.y)
    }

    /// What becomes of a covariance of positions: `z² R P Rᵀ`.
    pub fn turn_cov(&self, cov: &Matrix2<f64>) -> Matrix2<f64> {
        if self.is_shift() {
            return *cov;
        }
        let a = self.linear();
        a * cov * a.transpose()
    }

    /// The linear part z R.
    pub fn linear(&self) -> Matrix2<f64> {
        Matrix2::new(self.cos, -self.sin, self.sin, self.cos)
    }

    /// First this one, then `next`.
    #[must_use]
    pub fn then(&self, next: &Self) -> Self {
        Self {
            cos: next.cos * self.cos - next.sin * self.sin,
            sin: next.sin * self.cos + next.cos * self.sin,
            shift_px: next.apply(self.shift_px),
        }
    }

    /// The way back.
    #[must_use]
    pub fn inverse(&self) -> Self {
        let square = self.cos * self.cos + self.sin * self.sin;
        let (cos, sin) = (self.cos / square, -self.sin / square);
        let back = Self { cos, sin, shift_px: Vector2::zeros() };
        Self { shift_px: -back.turn(self.shift_px), ..back }
    }

    /// Angle of the rotation, rad, in (-π, π].
    pub fn angle_rad(&self) -> f64 {
        self.sin.atan2(self.cos)
    }

    /// Growth of lengths, 1 for none.
    pub fn zoom(&self) -> f64 {
        if self.sin == 0.0 { self.cos.abs() } else { self.cos.hypot(self.sin) }
    }

    /// How far a point moves, px.
    pub fn shift_at(&self, p: Vector2<f64>) -> Vector2<f64> {
        if self.is_shift() { self.shift_px } else { self.apply(p) - p }
    }

    /// Whether it neither turns nor zooms.
    pub fn is_shift(&self) -> bool {
        self.cos == 1.0 && self.sin == 0.0
    }

    /// Whether it leaves every point where it is.
    pub fn is_identity(&self) -> bool {
        self.is_shift() && self.shift_px == Vector2::zeros()
    }

    /// Whether all its numbers are finite and it has an inverse.
    pub fn is_sound(&self) -> bool {
        let zoom = self.zoom();
        zoom.is_finite() && zoom > 0.0 && self.shift_px.iter().all(|v| v.is_finite())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn any() -> impl Strategy<Value = Similarity> {
        let number = -500.0..500.0f64;
        (number.clone(), number.clone(), number.clone(), number, -3.1..3.1f64, 0.2..5.0f64).prop_map(
            |(x, y, dx, dy, angle, zoom)| Similarity::about(Vector2::new(x, y), Vector2::new(dx, dy), angle, zoom),
        )
    }

    proptest! {
        #[test]
        fn the_way_there_and_back_is_no_way(a in any(), x in -500.0..500.0f64, y in -500.0..500.0f64) {
            let p = Vector2::new(x, y);
            prop_assert!((a.inverse().apply(a.apply(p)) - p).norm() < 1e-8);
            let none = a.then(&a.inverse());
            prop_assert!((none.zoom() - 1.0).abs() < 1e-12 && none.angle_rad().abs() < 1e-12);
            prop_assert!(none.shift_at(p).norm() < 1e-8);
        }

        #[test]
        fn one_after_the_other_is_their_composition(a in any(), b in any(), x in -500.0..500.0f64, y in -500.0..500.0f64) {
            let p = Vector2::new(x, y);
            prop_assert!((a.then(&b).apply(p) - b.apply(a.apply(p))).norm() < 1e-8);
            prop_assert!((a.then(&b).zoom() - a.zoom() * b.zoom()).abs() < 1e-10);
            // Covariances go through as the differences that they are squares of.
            let (u, v) = (Vector2::new(x, 1.0), Vector2::new(2.0, y));
            let cov = u * u.transpose() + v * v.transpose();
            let (tu, tv) = (a.turn(u), a.turn(v));
            let turned = tu * tu.transpose() + tv * tv.transpose();
            prop_assert!((a.turn_cov(&cov) - turned).norm() < 1e-9 * (1.0 + turned.norm()));
        }
    }

    #[test]
    fn shifts_stay_exactly_shifts() {
        let (a, b) = (Similarity::shift(Vector2::new(0.1, -0.7)), Similarity::shift(Vector2::new(3.3, 1.9)));
        let there_and_back = a.then(&b).then(&b.inverse());
        assert!(there_and_back.is_shift() && a.inverse().is_shift());
        assert_eq!(a.then(&a.inverse()), Similarity::identity());
        assert_eq!(
            Similarity::about(Vector2::new(7.0, 9.0), Vector2::new(1.0, 2.0), 0.0, 1.0).shift_at(Vector2::zeros()),
            Vector2::new(1.0, 2.0)
        );
    }

    #[test]
    fn a_quarter_turn_takes_x_to_y() {
        let turn = Similarity::about(Vector2::new(10.0, 10.0), Vector2::zeros(), std::f64::consts::FRAC_PI_2, 2.0);
        assert!((turn.apply(Vector2::new(11.0, 10.0)) - Vector2::new(10.0, 12.0)).norm() < 1e-12);
        assert!((turn.angle_rad() - std::f64::consts::FRAC_PI_2).abs() < 1e-12);
    }
}
