//! The density of what may be there: over places, velocities and strengths, carried from frame to frame.
//!
//! Source: the Bernoulli filter on a grid, B. Ristic, B.-T. Vo, B.-N. Vo & A. Farina, IEEE T-SP 61, 3406 (2013), and track before detect by likelihood ratios, L. D. Stone,
//! C. A. Barlow & T. L. Corwin, *Bayesian Multiple Target Tracking*, 1999, ch. 7; grids of velocities as our own.
//! Step: a velocity component goes to each neighbour with the probability p/2 (at the ends it stays), places move by the velocity, what is there stays
//! with the probability s and comes anew with 1 − s, all is multiplied by the ratio of the place (`likelihood`):
//! f ← l (s · moved(mixed f) + (1 − s)). Beyond the border, and where all begins, f = 1. Under noise alone l has the mean 1 and so has f, always: of frames that are independent, by Markov's inequality
//! the expected number of boxes that do not overlap and hold a sum of at least c is then at most (number of cells) / c, however neighbours depend on each other. `null` begins with it.
//! Velocities lie dv = 2 δ / T apart, δ the target's resolution (`shape`; σ of a spot) and T the straight time: half of that for T is δ, and paths change over between them. A random walk of the density q has p = q dt / dv². A velocity's plane moves by whole cells: what
//! v t leaves beside them is the same for all its cells and known, so nothing is blurred by it.
//! Departures: f is no probability but odds against noise for each cell (the exact Bernoulli recursion divides by the odds that all of it is one target: `target`
//! does, where one is). Numbers are kept in 16 bits with 8 of fraction: random steps of 0.2 % a frame.
//! Limits: memory 4 bytes a place, velocity and strength. Symbols: f odds; l ratio; s survival.

use super::likelihood::STRENGTHS;
use super::shape::{Profile, straight_s};
use nalgebra::{Matrix2, Vector2};

/// Distance of neighbouring velocities times the straight time, in resolutions.
const APART: f64 = 2.0;
/// Most that a component changes in one mixing.
const MOST_MIXED: f64 = 0.5;

/// Distance of neighbouring velocities, px/s.
pub(super) fn apart(config: &super::BernoulliConfig) -> f64 {
    APART * Profile::new(config).resolution() / straight_s(config)
}

/// Velocities, and how they move and mix in the step to this frame.
#[derive(Clone, Debug)]
pub(super) struct Motion {
    /// Components along an axis, cells/s.
    velocities: Vec<f64>,
    density: f64,
    apart: f64,
    time_s: f64,
    /// Whole cells that each component has come, and what is left beside them.
    come: Vec<i64>,
    beside: Vec<f64>,
    /// Cells that it moves by now.
    shifts: Vec<i64>,
    passes: usize,
    mixed: f32,
    life_s: f64,
    survival: f32,
}

impl Motion {
    /// `step` px make a cell.
    pub(super) fn new(config: &super::BernoulliConfig, step: usize) -> Self {
        let cell = step as f64;
        let apart = apart(config);
        let n = (config.max_speed_px_per_s / apart).ceil().min(1e6) as i64;
        let velocities: Vec<f64> = (-n..=n).map(|i| i as f64 * apart / cell).collect();
        let count = velocities.len();
        Self {
            velocities,
            density: config.acceleration_density_px2_per_s3,
            apart,
            time_s: 0.0,
            come: vec![0; count],
            beside: vec![0.0; count],
            shifts: vec![0; count],
            passes: 1,
            mixed: 0.0,
            life_s: config.mean_life_s,
            survival: 1.0,
        }
    }

    /// Components along an axis.
    pub(super) const fn count(&self) -> usize {
        self.velocities.len()
    }

    /// Goes on by a time, s.
    pub(super) fn advance(&mut self, dt_s: f64) {
        self.time_s += dt_s;
        for (((v, come), beside), shift) in
            self.velocities.iter().zip(&mut self.come).zip(&mut self.beside).zip(&mut self.shifts)
        {
            let way = v * self.time_s;
            let whole = way.round();
            *shift = whole as i64 - *come;
            (*come, *beside) = (whole as i64, way - whole);
        }
        let p = self.density * dt_s / (self.apart * self.apart);
        self.passes = ((p / MOST_MIXED).ceil() as usize).max(1);
        self.mixed = (p / self.passes as f64) as f32;
        self.survival = (-dt_s / self.life_s).exp() as f32;
    }

    /// Variance of a component within its step, (cells/s)².
    pub(super) fn within_step(&self) -> f64 {
        let step = self.velocities.windows(2).next().map_or(0.0, |v| v[1] - v[0]);
        step * step / 12.0
    }

    /// Probability that what was there still is.
    pub(super) const fn survival(&self) -> f32 {
        self.survival
    }
}

/// What a density, or a part of it, amounts to.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Moments {
    pub(super) total: f64,
    /// Cells, and cells/s.
    pub(super) place: Vector2<f64>,
    pub(super) velocity: Vector2<f64>,
    /// Of places, of velocities, and of velocity with place; each about the mean.
    pub(super) cov: Matrix2<f64>,
    pub(super) velocity_cov: Matrix2<f64>,
    pub(super) cross: Matrix2<f64>,
}

/// Odds of every place, velocity and strength of a window of the grid.
#[derive(Clone, Debug)]
pub(super) struct Density {
    pub(super) w: usize,
    pub(super) h: usize,
    /// Of the window on the grid, cells.
    pub(super) origin: [i64; 2],
    nv: usize,
    /// `[strength][y][vy][vx][x]`.
    f: Vec<u16>,
    next: Vec<u16>,
    /// Most odds of a cell.
    most: f32,
    /// Mean over velocities and strengths of each place.
    pub(super) marginal: Vec<f32>,
    mixed: Vec<f32>,
    other: Vec<f32>,
}

#[inline(always)]
fn wide(v: u16) -> f32 {
    f32::from_bits(u32::from(v) << 16)
}

/// The nearest number of 16 bits; values are finite and not below 0.
#[inline(always)]
fn narrow(v: f32) -> u16 {
    ((v.to_bits() + 0x8000) >> 16) as u16
}

impl Density {
    /// A window of `w` x `h` cells with `value` everywhere, and never more than `most`.
    pub(super) fn new(w: usize, h: usize, origin: [i64; 2], nv: usize, value: f32, most: f32) -> Self {
        let n = Self::cells(w, h, nv);
        Self {
            w,
            h,
            origin,
            nv,
            f: vec![narrow(value); n],
            next: vec![0; n],
            most,
            marginal: vec![value; w * h],
            mixed: vec![0.0; nv * nv * w],
            other: vec![0.0; nv * nv * w],
        }
    }

    /// Places, velocities and strengths of a window.
    pub(super) fn cells(w: usize, h: usize, nv: usize) -> usize {
        STRENGTHS.len() * w * h * nv * nv
    }

    /// Everything at one value.
    pub(super) fn fill(&mut self, value: f32) {
        self.f.fill(narrow(value));
        self.marginal.fill(value);
    }

    /// One step. `ratios` holds one image of the window for each strength, `outside` is what comes in over the border and `births` what comes anew; `moved` cells are
    /// what the window itself moves by.
    pub(super) fn step(&mut self, motion: &Motion, ratios: &[Vec<f32>], births: f32, outside: f32, moved: [i64; 2]) {
        let (w, h, nv) = (self.w, self.h, self.nv);
        let block = nv * nv * w;
        let (wi, hi) = (w as i64, h as i64);
        self.marginal.fill(0.0);
        let keep = motion.survival;
        for (strength, ratios) in ratios.iter().enumerate() {
            let from = &self.f[strength * h * block..][..h * block];
            let to = &mut self.next[strength * h * block..][..h * block];
            let entering = keep * outside + births;
            // Rows that nothing of the window moves to.
            for (vy, shift) in motion.shifts.iter().enumerate() {
                let shift = shift - moved[1];
                for y in (0..shift.min(hi)).chain((hi + shift).max(0)..hi) {
                    let y = y as usize;
                    for vx in 0..nv {
                        let to = &mut to[y * block + (vy * nv + vx) * w..][..w];
                        put_even(entering, &ratios[y * w..][..w], to, &mut self.marginal[y * w..][..w]);
                    }
                }
            }
            for y in 0..hi {
                mix(&from[y as usize * block..][..block], nv * w, motion.mixed, &mut self.mixed);
                for _ in 1..motion.passes {
                    mix(&self.mixed, nv * w, motion.mixed, &mut self.other);
                    std::mem::swap(&mut self.mixed, &mut self.other);
                    for (from, to) in self.mixed.chunks_exact(nv * w).zip(self.other.chunks_exact_mut(nv * w)) {
                        mix(from, w, motion.mixed, to);
                    }
                    std::mem::swap(&mut self.mixed, &mut self.other);
                }
                for vy in 0..nv {
                    let at = y + motion.shifts[vy] - moved[1];
                    if !(0..hi).contains(&at) {
                        continue;
                    }
                    let at = at as usize;
                    let (ratios, marginal) = (&ratios[at * w..][..w], &mut self.marginal[at * w..][..w]);
                    let mixed = &self.mixed[vy * nv * w..][..nv * w];
                    for vx in 0..nv {
                        let shift = motion.shifts[vx] - moved[0];
                        let to = &mut to[at * block + (vy * nv + vx) * w..][..w];
                        let (begin, end) = (shift.clamp(0, wi) as usize, (wi + shift).clamp(0, wi) as usize);
                        let source = (begin as i64 - shift).clamp(0, wi) as usize;
                        let n = end.saturating_sub(begin);
                        let row = |v: usize| &mixed[v * w..][..w][source..source + n];
                        let below = row(vx.saturating_sub(1));
                        let above = row((vx + 1).min(nv - 1));
                        let range = begin..begin + n;
                        put(
                            [below, row(vx), above],
                            [0.5 * keep * motion.mixed, keep * (1.0 - motion.mixed), births, self.most],
                            &ratios[range.clone()],
                            &mut to[range.clone()],
                            &mut marginal[range],
                        );
                        for part in [0..begin, begin + n..w] {
                            put_even(entering, &ratios[part.clone()], &mut to[part.clone()], &mut marginal[part]);
                        }
                    }
                }
            }
        }
        let by = 1.0 / (STRENGTHS.len() * nv * nv) as f32;
        self.marginal.iter_mut().for_each(|m| *m *= by);
        std::mem::swap(&mut self.f, &mut self.next);
    }

    /// Multiplies everything.
    pub(super) fn scale(&mut self, by: f32) {
        self.f.iter_mut().for_each(|v| *v = narrow(by * wide(*v)));
    }

    /// Copies a rectangle of another window over; what it lacks stays.
    pub(super) fn copy_from(&mut self, other: &Self) {
        let (dx, dy) = (other.origin[0] - self.origin[0], other.origin[1] - self.origin[1]);
        let span = |d: i64, n: usize, m: usize| (d.clamp(0, n as i64), (d + m as i64).clamp(0, n as i64));
        let ((x0, x1), (y0, y1)) = (span(dx, self.w, other.w), span(dy, self.h, other.h));
        let (nv, w, h) = (self.nv, self.w, self.h);
        for s in 0..STRENGTHS.len() {
            for y in y0..y1 {
                for v in 0..nv * nv {
                    let from = ((s * other.h + (y - dy) as usize) * nv * nv + v) * other.w;
                    let to = ((s * h + y as usize) * nv * nv + v) * w;
                    self.f[to + x0 as usize..to + x1 as usize]
                        .copy_from_slice(&other.f[from + (x0 - dx) as usize..from + (x1 - dx) as usize]);
                }
            }
        }
    }

    /// Nothing in a window is more than `most`.
    pub(super) fn flatten(&mut self, [x0, y0, x1, y1]: [usize; 4], most: f32) {
        let (nv, w, h) = (self.nv, self.w, self.h);
        let most_narrow = narrow(most);
        for s in 0..STRENGTHS.len() {
            for y in y0..y1 {
                for v in 0..nv * nv {
                    let row = &mut self.f[((s * h + y) * nv * nv + v) * w..][x0..x1];
                    // Numbers not below 0 are ordered as their bits are.
                    row.iter_mut().for_each(|f| *f = (*f).min(most_narrow));
                }
            }
            self.marginal.chunks_exact_mut(w).take(y1).skip(y0).for_each(|row| {
                row[x0..x1].iter_mut().for_each(|m| *m = m.min(most));
            });
        }
    }

    /// Sum, mean and covariance; places are those of the grid.
    pub(super) fn moments(&self, motion: &Motion) -> Moments {
        let (mut total, mut first, mut second) = (0.0, [0.0; 4], [[0.0; 4]; 4]);
        for (i, row) in self.f.chunks_exact(self.w).enumerate() {
            let (vx, vy, y) = (i % self.nv, i / self.nv % self.nv, i / (self.nv * self.nv) % self.h);
            let (mut s0, mut s1, mut s2) = (0.0f32, 0.0f32, 0.0f32);
            for (i, v) in row.iter().enumerate() {
                let (v, x) = (wide(*v), i as f32);
                s0 += v;
                s1 += v * x;
                s2 += v * x * x;
            }
            if s0 <= 0.0 {
                continue;
            }
            let (s0, s1, s2) = (f64::from(s0), f64::from(s1), f64::from(s2));
            let left = motion.beside[vx];
            let of = [0.0, y as f64 + motion.beside[vy], motion.velocities[vx], motion.velocities[vy]];
            total += s0;
            let sum_x = s1 + left * s0;
            first[0] += sum_x;
            second[0][0] += s2 + 2.0 * left * s1 + left * left * s0;
            for (i, value) in of.iter().enumerate().skip(1) {
                first[i] += s0 * value;
                second[0][i] += sum_x * value;
                for (j, other) in of.iter().enumerate().skip(i) {
                    second[i][j] += s0 * value * other;
                }
            }
        }
        if total <= 0.0 {
            return Moments::default();
        }
        let mean = first.map(|v| v / total);
        let cov = |i: usize, j: usize| second[i.min(j)][i.max(j)] / total - mean[i] * mean[j];
        Moments {
            total,
            place: Vector2::new(mean[0] + self.origin[0] as f64, mean[1] + self.origin[1] as f64),
            velocity: Vector2::new(mean[2], mean[3]),
            cov: Matrix2::new(cov(0, 0), cov(0, 1), cov(0, 1), cov(1, 1)),
            velocity_cov: Matrix2::new(cov(2, 2), cov(2, 3), cov(2, 3), cov(3, 3)),
            cross: Matrix2::new(cov(0, 2), cov(0, 3), cov(1, 2), cov(1, 3)),
        }
    }
}

/// A number of the density, in 16 bits or wide.
trait Odds: Copy {
    fn of(self) -> f32;
}

impl Odds for u16 {
    #[inline(always)]
    fn of(self) -> f32 {
        wide(self)
    }
}

impl Odds for f32 {
    #[inline(always)]
    fn of(self) -> f32 {
        self
    }
}

widest! {
    /// Each plane of `stride` values with its two neighbours.
    fn mix<T: Odds>(from: &[T], stride: usize, p: f32, to: &mut [f32]) {
        let n = from.len() / stride;
        for v in 0..n {
            let (below, above) = (v.saturating_sub(1), (v + 1).min(n - 1));
            let [below, here, above] = [below, v, above].map(|i| &from[i * stride..][..stride]);
            let to = &mut to[v * stride..][..stride];
            for (((t, b), m), a) in to.iter_mut().zip(below).zip(here).zip(above) {
                *t = (1.0 - p) * m.of() + 0.5 * p * (b.of() + a.of());
            }
        }
    }
}

widest! {
    /// Three rows mixed, moved, born and weighed.
    fn put(rows: [&[f32]; 3], by: [f32; 4], ratios: &[f32], to: &mut [u16], marginal: &mut [f32]) {
        let [below, here, above] = rows;
        let [side, middle, births, most] = by;
        for (((((t, m), l), b), h), a) in to.iter_mut().zip(marginal).zip(ratios).zip(below).zip(here).zip(above) {
            let v = (l * (middle * h + side * (b + a) + births)).min(most);
            *t = narrow(v);
            *m += v;
        }
    }
}

widest! {
    /// The same of a value that is everywhere.
    fn put_even(value: f32, ratios: &[f32], to: &mut [u16], marginal: &mut [f32]) {
        for ((t, m), l) in to.iter_mut().zip(marginal).zip(ratios) {
            let v = l * value;
            *t = narrow(v);
            *m += v;
        }
    }
}

#[cfg(test)]
mod tests;
