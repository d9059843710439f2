//! The camera's course: what its next motion will be, and how surely.
//!
//! Source: an autoregression of order 1 of the motion of a frame, as the Singer model has it for targets (R. Singer, *IEEE Trans. AES* 6, 1970);
//! its correlation and spread are learnt from the last frames. A pan goes on (correlation 1), a shake does not (0).
//! Symbols: v = `[dx, dy, angle, ln zoom]` of a frame (reduced px, rad); v' = ρ v + e, Var(e) = σ²; while nothing is measured the errors of v and of the
//! place p grow by `P' = F P Fᵀ + σ² [1 1; 1 1]`, F = `[1 ρ; 0 ρ]`.
//! Limits: x and y share ρ and σ; a camera that never moved is expected not to.

use crate::Similarity;
use nalgebra::{Matrix4, Vector2, Vector4};

/// What one frame leaves of the frames before in ρ and σ: a memory of 10 frames.
const MEMORY: f64 = 0.9;

/// Sums over the last frames, for one kind of motion.
#[derive(Clone, Copy, Debug, Default)]
struct Kind {
    /// Of v v', of v², of (v' - ρ v)², each with its weight.
    lagged: f64,
    square: f64,
    change: f64,
    weight: f64,
    /// Variance of v and of p, and their covariance, since the last measurement.
    var_v: f64,
    cov_pv: f64,
    var_p: f64,
}

impl Kind {
    fn correlation(&self) -> f64 {
        if self.square > 0.0 { (self.lagged / self.square).clamp(0.0, 1.0) } else { 0.0 }
    }

    fn learn(&mut self, before: &[f64], now: &[f64]) {
        let rho = self.correlation();
        let dot = |f: &dyn Fn(f64, f64) -> f64| before.iter().zip(now).map(|(&b, &n)| f(b, n)).sum::<f64>();
        self.lagged = MEMORY * self.lagged + dot(&|b, n| b * n);
        self.square = MEMORY * self.square + dot(&|b, _| b * b);
        self.change = MEMORY * self.change + dot(&|b, n| (n - rho * b).powi(2)) / now.len() as f64;
        self.weight = MEMORY * self.weight + 1.0;
        self.found();
    }

    fn found(&mut self) {
        (self.var_v, self.cov_pv, self.var_p) = (0.0, 0.0, 0.0);
    }

    fn hold(&mut self) {
        let rho = self.correlation();
        let drive = if self.weight > 0.0 { self.change / self.weight } else { 0.0 };
        let (v, pv) = (self.var_v, self.cov_pv);
        self.var_p += 2.0 * rho * pv + rho * rho * v + drive;
        self.cov_pv = rho * pv + rho * rho * v + drive;
        self.var_v = rho * rho * v + drive;
    }
}

/// The motion of the last frame, and what is known of how it goes on.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Course {
    last: Vector4<f64>,
    shift: Kind,
    turn: Kind,
    zoom: Kind,
}

impl Course {
    /// Takes the motion of a frame in that was measured.
    pub fn learn(&mut self, motion: &Similarity, middle: Vector2<f64>) {
        let shift = motion.shift_at(middle);
        let now = Vector4::new(shift.x, shift.y, motion.angle_rad(), motion.zoom().ln());
        let before = self.last;
        self.shift.learn(&[before.x, before.y], &[now.x, now.y]);
        self.turn.learn(&[before.z], &[now.z]);
        self.zoom.learn(&[before.w], &[now.w]);
        self.last = now;
    }

    /// The place is known again, by a motion over several frames that tells nothing of one frame's.
    pub fn found(&mut self) {
        [&mut self.shift, &mut self.turn, &mut self.zoom].into_iter().for_each(Kind::found);
    }

    /// The motion expected of the next frame.
    pub fn next(&self, middle: Vector2<f64>) -> Similarity {
        let v = self.expected();
        Similarity::about(middle, Vector2::new(v.x, v.y), v.z, v.w.exp())
    }

    fn expected(&self) -> Vector4<f64> {
        let (s, t, z) = (self.shift.correlation(), self.turn.correlation(), self.zoom.correlation());
        self.last.component_mul(&Vector4::new(s, s, t, z))
    }

    /// Goes on over a frame that was not measured; returns the covariance of the place since the last one that was.
    pub fn hold(&mut self) -> Matrix4<f64> {
        self.last = self.expected();
        [&mut self.shift, &mut self.turn, &mut self.zoom].into_iter().for_each(Kind::hold);
        let var = self.shift.var_p;
        Matrix4::from_diagonal(&Vector4::new(var, var, self.turn.var_p, self.zoom.var_p))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MIDDLE: Vector2<f64> = Vector2::new(100.0, 80.0);

    fn learnt(shifts: impl Iterator<Item = f64>) -> Course {
        let mut course = Course::default();
        shifts.for_each(|x| course.learn(&Similarity::shift(Vector2::new(x, 0.0)), MIDDLE));
        course
    }

    #[test]
    fn a_pan_goes_on_and_a_shake_does_not() {
        let pan = learnt((0..30).map(|_| 4.0));
        assert!((pan.next(MIDDLE).shift_at(MIDDLE).x - 4.0).abs() < 0.1 && pan.next(MIDDLE).is_shift());
        let shake = learnt((0..30).map(|k| if k % 2 == 0 { 3.0 } else { -3.0 }));
        assert_eq!(shake.next(MIDDLE).shift_at(MIDDLE).x, 0.0);
    }

    #[test]
    fn what_is_held_is_known_less_and_less() {
        let mut pan = learnt((0..30).map(|k| 4.0 + 0.1 * f64::from(k % 3)));
        let spreads: Vec<f64> = (0..6).map(|_| pan.hold()[(0, 0)].sqrt()).collect();
        assert!(spreads.windows(2).all(|w| w[1] > 1.2 * w[0]) && spreads[0] > 0.02, "{spreads:?}");
        pan.found();
        assert!((pan.hold()[(0, 0)].sqrt() / spreads[0] - 1.0).abs() < 1e-12, "found again, it is as sure as at first");
        let mut still = learnt((0..30).map(|_| 0.0));
        assert_eq!(still.hold(), Matrix4::zeros(), "what never moved is expected not to");
    }
}
