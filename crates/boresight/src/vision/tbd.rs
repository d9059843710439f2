//! Track before detect: a density over positions and velocities on the pixel grid, fed with likelihood-ratio scores.
//!
//! Source: `docs/theory/likelihood-ratio.md`. Per frame: each velocity component changes by one with probability p_v/2
//! each way (reflected at the ends; y first, then x), positions move by the velocity (what leaves the grid is lost),
//! the density is multiplied by exp(score - max), a floor of 1e-12 / size of the total is added, and it is normalised.
//! It holds one target that no single frame shows. Limits: one target; whole-pixel velocities; memory and time
//! proportional to positions x (2v+1)². Symbols: v largest velocity component (px/frame); p_v probability of a velocity change.

use super::llr::ScoreImage;
use nalgebra::Vector2;

/// What the density says after a frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GridEstimate {
    /// Most likely position of the target's centre, px.
    pub map: Vector2<f64>,
    /// Mean position, px.
    pub mean: Vector2<f64>,
    /// Probability of the most likely position.
    pub peak: f64,
}

/// Density over position (window) and velocity.
#[derive(Clone, Debug)]
pub struct TrackBeforeDetect {
    v_max: usize,
    p_change: f64,
    width: usize,
    height: usize,
    /// `[vy][vx][row][column]`, normalised.
    density: Vec<f64>,
    next: Vec<f64>,
    marginal: Vec<f64>,
}

impl TrackBeforeDetect {
    /// Builds a uniform density for velocities up to `v_max` px/frame and a probability of velocity change in [0, 1].
    pub fn new(v_max: usize, p_change: f64) -> Self {
        Self { v_max, p_change, width: 0, height: 0, density: Vec::new(), next: Vec::new(), marginal: Vec::new() }
    }

    /// Takes the scores of one frame; `None` if there are none. A change of size starts anew.
    pub fn step(&mut self, scores: &ScoreImage) -> Option<GridEstimate> {
        let (_, max) = scores.best()?;
        let (w, h) = (scores.scores.width(), scores.scores.height());
        let side = 2 * self.v_max + 1;
        let size = side * side * w * h;
        if (w, h) != (self.width, self.height) {
            (self.width, self.height) = (w, h);
            self.density.clear();
            self.density.resize(size, 1.0 / size as f64);
            self.next.clear();
            self.next.resize(size, 0.0);
        }
        // Before the first frame too: the uniform density then lacks what would have come from outside the grid.
        self.change_velocities();
        self.shift();
        let likelihood: Vec<f64> = scores.scores.as_slice().iter().map(|s| (s - max).exp()).collect();
        let mut total = 0.0;
        for plane in self.density.chunks_mut(w * h) {
            for (d, l) in plane.iter_mut().zip(&likelihood) {
                *d *= l;
                total += *d;
            }
        }
        // A density that has lost all its mass starts anew from the floor.
        let floor = 1e-12 / size as f64 * if total > 0.0 { total } else { 1.0 };
        let norm = 1.0 / (total + floor * size as f64);
        self.marginal.clear();
        self.marginal.resize(w * h, 0.0);
        for plane in self.density.chunks_mut(w * h) {
            for (d, m) in plane.iter_mut().zip(&mut self.marginal) {
                *d = (*d + floor) * norm;
                *m += *d;
            }
        }
        Some(self.estimate(scores))
    }

    fn estimate(&self, scores: &ScoreImage) -> GridEstimate {
        let (mut peak, mut at, mut mean) = (f64::NEG_INFINITY, 0, Vector2::zeros());
        for (k, &p) in self.marginal.iter().enumerate() {
            if p > peak {
                (peak, at) = (p, k);
            }
            mean += scores.centre(k % self.width, k / self.width) * p;
        }
        GridEstimate { map: scores.centre(at % self.width, at / self.width), mean, peak }
    }

    /// Each axis: stay with 1 - p, step with p/2 each way; a step past the end stays.
    fn change_velocities(&mut self) {
        let side = 2 * self.v_max + 1;
        let plane = self.width * self.height;
        let (stay, step) = (1.0 - self.p_change, self.p_change / 2.0);
        for stride in [side, 1] {
            for v in 0..side * side {
                let along = (v / stride) % side;
                let lower = if along == 0 { v } else { v - stride };
                let upper = if along + 1 == side { v } else { v + stride };
                for i in 0..plane {
                    self.next[v * plane + i] = stay * self.density[v * plane + i]
                        + step * (self.density[lower * plane + i] + self.density[upper * plane + i]);
                }
            }
            std::mem::swap(&mut self.density, &mut self.next);
        }
    }

    fn shift(&mut self) {
        let (w, h) = (self.width as isize, self.height as isize);
        let side = 2 * self.v_max + 1;
        let plane = self.width * self.height;
        self.next.fill(0.0);
        for v in 0..side * side {
            let vy = (v / side) as isize - self.v_max as isize;
            let vx = (v % side) as isize - self.v_max as isize;
            for y in vy.max(0)..h.min(h + vy) {
                let (from, to) = (vx.max(0), w.min(w + vx));
                if from >= to {
                    continue;
                }
                let n = (to - from) as usize;
                let target = v * plane + (y * w + from) as usize;
                let source = v * plane + ((y - vy) * w + from - vx) as usize;
                self.next[target..target + n].copy_from_slice(&self.density[source..source + n]);
            }
        }
        std::mem::swap(&mut self.density, &mut self.next);
    }
}
