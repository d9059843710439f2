//! One target: a window of the density that is its own, with the odds that it is there.
//!
//! Source: the Bernoulli recursion (`density`): the predicted density keeps the share s, what leaves the window is gone; with L = Σ l p the odds become
//! (s r / (1 − s r)) L and the density is normalised. The window goes with the target, in whole cells.
//! Strength: the frame's deviations at the place, as a mean over a straight time; it is what the target is taken to show to others.
//! What a tracker may believe: places of neighbouring frames hold the same frames. A straight line of n frames is known at its end to 4 R / n where each frame knows R, so a
//! tracker that sums over as many is as sure as the density if each report is given n / 4 times the density's covariance.

use super::density::{Density, Moments, Motion};
use super::likelihood::{Levels, STRENGTHS};
use nalgebra::{Matrix2, Vector2};

/// Most odds: a target that is gone is given up within some frames.
const MOST_ODDS: f64 = 1e6;
/// Least odds at which it is reported: it is rather there than not.
pub(super) const LEAST_ODDS: f64 = 1.0;
/// Odds at which it is given up.
const GIVEN_UP: f64 = 0.05;

/// A target and what is known of it.
#[derive(Clone, Debug)]
pub(super) struct Target {
    density: Density,
    pub(super) odds: f64,
    pub(super) moments: Moments,
    /// Deviations of the noise at its peak in the matched frame.
    pub(super) snr: f64,
    /// Half side of the window, cells.
    half: i64,
    /// Deviations in the window, and their ratios.
    z: Vec<f32>,
    ratios: [Vec<f32>; STRENGTHS.len()],
}

impl Target {
    /// One that nothing is known of, with a window of that half side, cells.
    pub(super) fn empty(motion: &Motion, half: i64) -> Self {
        let side = (2 * half + 1) as usize;
        let empty = || vec![0.0; side * side];
        Self {
            density: Density::new(side, side, [0, 0], motion.count(), 0.0, f32::MAX),
            odds: 0.0,
            moments: Moments::default(),
            snr: 0.0,
            half,
            z: empty(),
            ratios: [empty(), empty()],
        }
    }

    /// Takes the surroundings of a place over from the frame's density; false if nothing is there.
    pub(super) fn begin(&mut self, frame: &Density, motion: &Motion, at: [i64; 2], odds: f64, snr: f64) -> bool {
        self.density.origin = [at[0] - self.half, at[1] - self.half];
        self.density.fill(0.0);
        self.density.copy_from(frame);
        (self.odds, self.snr) = (odds.min(MOST_ODDS), snr);
        self.normalise(motion)
    }

    /// The window on the grid: left, top, right, bottom, as far as it lies within `size`.
    pub(super) fn window(&self, size: (usize, usize)) -> [usize; 4] {
        let [x, y] = self.density.origin;
        let inside = |v: i64, n: usize| v.clamp(0, n as i64) as usize;
        let (w, h) = (self.density.w as i64, self.density.h as i64);
        [inside(x, size.0), inside(y, size.1), inside(x + w, size.0), inside(y + h, size.1)]
    }

    /// Where it is expected after a time, cells.
    pub(super) fn expected(&self, dt_s: f64) -> Vector2<f64> {
        self.moments.place + self.moments.velocity * dt_s
    }

    /// Probability that it is there.
    pub(super) fn existence(&self) -> f64 {
        self.odds / (1.0 + self.odds)
    }

    /// Divides by the sum; false if nothing is left.
    fn normalise(&mut self, motion: &Motion) -> bool {
        let m = self.density.moments(motion);
        if !(m.total > 0.0 && m.total.is_finite()) {
            return false;
        }
        self.density.scale((1.0 / m.total) as f32);
        self.moments = m;
        true
    }

    /// One frame on; false if it is given up. `z` is the frame's deviation at a cell of the grid, −∞ outside of it: nothing is there.
    pub(super) fn step(&mut self, motion: &Motion, levels: &Levels, dt_s: f64, z: impl Fn(i64, i64) -> f32) -> bool {
        let expected = self.expected(dt_s);
        let [x, y] = [expected.x.round() as i64 - self.half, expected.y.round() as i64 - self.half];
        let moved = [x - self.density.origin[0], y - self.density.origin[1]];
        self.density.origin = [x, y];
        for (row, of) in (y..).zip(self.z.chunks_exact_mut(self.density.w)) {
            (x..).zip(of).for_each(|(x, of)| *of = z(x, row));
        }
        for (strength, ratios) in self.ratios.iter_mut().enumerate() {
            levels.ratios(strength, &self.z, ratios);
        }
        // The density was normalised: its sum after the step, but for survival, is L.
        self.density.step(motion, &self.ratios, 0.0, 0.0, moved);
        if !self.normalise(motion) {
            return false;
        }
        let survival = f64::from(motion.survival());
        let stays = survival * self.odds / (1.0 + (1.0 - survival) * self.odds);
        self.odds = (stays * self.moments.total / survival).min(MOST_ODDS);
        self.odds > GIVEN_UP
    }

    /// Covariances for a tracker, of place, velocity and both, px and s: `frames` make a straight time, `step` px a cell.
    pub(super) fn covariances(&self, motion: &Motion, frames: f64, step: f64) -> [Matrix2<f64>; 3] {
        let as_independent = (0.25 * frames).max(1.0);
        // What a cell hides of the place within it, and a step of what lies between two velocities.
        let cov = self.moments.cov + Matrix2::identity() / 12.0;
        let velocity_cov = self.moments.velocity_cov + Matrix2::identity() * motion.within_step();
        let by = step * step;
        [cov * (by * as_independent), velocity_cov * by, self.moments.cross * by]
    }
}
