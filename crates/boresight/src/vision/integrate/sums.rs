//! The search: every velocity's sum over all frames at every pixel, by sums shared from level to level; at each pixel the best and the worst.
//!
//! How: a walk through the tree of velocities (`velocities`), depth first. A node of level k holds its T / 2^k sums of 2^k frames; each of its four
//! children joins them pairwise, shifted. On the last level nothing is stored: a row of four children's sums is scored, ψ / √φ, and kept
//! where it beats the best or the worst so far. Work for n velocities: n pairs on the last level, n / 2 + n / 4 + ... = n below it.
//! φ of a path: the noise map at [`SAMPLES`] moments of it, in cells; less than half of it inside the frame: no score.
//! Symbols: ψ, φ as in `memory`; score in steps of 1/[`PER_SCORE`]. Sums are whole numbers that end at 512 deviations: the same in any order.
//! Limits: up to 65 536 velocities; the newest place lies inside the frame. Memory: 4 T bytes a pixel.

use super::memory::{CELL, PER_UNIT, Phi};
use super::velocities::Velocities;

/// Steps of a score in one deviation.
pub(super) const PER_SCORE: f32 = 32.0;
/// Moments at which a path's φ is read: more than one a cell at any speed that crosses half a frame.
const SAMPLES: usize = 8;
/// Part of φ's largest sum that a path must have inside the frame, so that its velocity is known.
const LEAST_INSIDE: f32 = 0.5;

/// The best and the worst at each pixel, with their velocities.
#[derive(Clone, Debug, Default)]
pub(super) struct Extremes {
    pub(super) best: Vec<i16>,
    pub(super) best_at: Vec<u16>,
    pub(super) worst: Vec<i16>,
    pub(super) worst_at: Vec<u16>,
}

/// The sums of all levels.
#[derive(Clone, Debug, Default)]
pub(super) struct Sums {
    width: usize,
    height: usize,
    stride: usize,
    /// Sums of level k, newest first, one after another; those of level 0 are the frames.
    levels: Vec<Vec<Vec<i16>>>,
    /// Axis indices of the velocities of the longest sums, in the order of the walk.
    pub(super) velocities: Vec<(u16, u16)>,
    pub(super) extremes: Extremes,
    /// Weights of the four children, cell by cell.
    weights: [Vec<i16>; 4],
}

impl Sums {
    /// Makes room for sums of 2^top frames and so many velocities.
    pub(super) fn new(width: usize, height: usize, top: usize, n_velocities: usize) -> Self {
        let stride = width.next_multiple_of(CELL);
        let pixels = stride * height;
        Self {
            width,
            height,
            stride,
            levels: (0..top).map(|k| vec![vec![0; pixels]; 1 << (top - k)]).collect(),
            velocities: Vec::with_capacity(n_velocities),
            extremes: Extremes {
                best: vec![0; pixels],
                best_at: vec![0; pixels],
                worst: vec![0; pixels],
                worst_at: vec![0; pixels],
            },
            weights: std::array::from_fn(|_| Vec::with_capacity(height.div_ceil(CELL) * stride / CELL)),
        }
    }

    /// The frames, newest first.
    pub(super) fn frames(&self) -> &[Vec<i16>] {
        &self.levels[0]
    }

    /// The frames to be written.
    pub(super) fn frames_mut(&mut self) -> &mut [Vec<i16>] {
        &mut self.levels[0]
    }

    /// Sums and scores all velocities.
    pub(super) fn search(&mut self, of: &Velocities, times_s: &[f64], phi: &Phi) {
        self.velocities.clear();
        self.extremes.best.fill(0);
        self.extremes.worst.fill(0);
        let geometry = Geometry { width: self.width, height: self.height, stride: self.stride };
        let mut walk = Walk {
            of,
            phi,
            times_s,
            geometry,
            velocities: &mut self.velocities,
            extremes: &mut self.extremes,
            weights: &mut self.weights,
        };
        for i in 0..of.roots {
            for j in 0..of.roots {
                if of.is_wanted(0, i, j) {
                    walk.descend(0, i, j, &mut self.levels);
                }
            }
        }
    }
}

#[derive(Clone, Copy, Debug)]
struct Geometry {
    width: usize,
    height: usize,
    stride: usize,
}

struct Walk<'a> {
    of: &'a Velocities,
    phi: &'a Phi,
    times_s: &'a [f64],
    geometry: Geometry,
    velocities: &'a mut Vec<(u16, u16)>,
    extremes: &'a mut Extremes,
    weights: &'a mut [Vec<i16>; 4],
}

impl Walk<'_> {
    /// Goes through all velocities below node (i, j) of a level, whose sums are `levels[0]`.
    fn descend(&mut self, level: usize, i: usize, j: usize, levels: &mut [Vec<Vec<i16>>]) {
        let Some((sums, below)) = levels.split_first_mut() else { return };
        let up = level + 1;
        if up == self.of.top {
            self.score(i, j, &sums[0], &sums[1]);
            return;
        }
        for (i, j) in [(0, 0), (0, 1), (1, 0), (1, 1)].map(|(a, b)| (2 * i + a, 2 * j + b)) {
            if self.of.is_wanted(up, i, j) {
                for (c, out) in below[0].iter_mut().enumerate() {
                    let shift = (self.of.shift(up, c, i), self.of.shift(up, c, j));
                    join(&sums[2 * c], &sums[2 * c + 1], shift, self.geometry, out);
                }
                self.descend(up, i, j, below);
            }
        }
    }

    /// Scores the four velocities of the last level whose halves are (i, j).
    fn score(&mut self, i: usize, j: usize, newer: &[i16], older: &[i16]) {
        let top = self.of.top;
        let mut children = [(0i32, 0i32, 0u16); 4];
        let mut n = 0;
        for (i, j) in [(0, 0), (0, 1), (1, 0), (1, 1)].map(|(a, b)| (2 * i + a, 2 * j + b)) {
            if self.of.is_wanted(top, i, j) {
                let at = self.velocities.len() as u16;
                self.velocities.push((i as u16, j as u16));
                children[n] = (self.of.shift(top, 0, i), self.of.shift(top, 0, j), at);
                weights_of(self.of, (i, j), self.times_s, self.phi, &mut self.weights[n]);
                n += 1;
            }
        }
        let Geometry { width, height, stride } = self.geometry;
        let cells_x = self.phi.cells_x;
        let e = &mut *self.extremes;
        for y in 0..height {
            let row = y * stride..(y + 1) * stride;
            for (child, weights) in children[..n].iter().zip(self.weights.iter()) {
                let older = row_at(older, y, child.1, self.geometry);
                score_row(
                    &newer[row.clone()],
                    older,
                    child.0,
                    width,
                    &weights[y / CELL * cells_x..][..cells_x],
                    child.2,
                    &mut e.best[row.clone()],
                    &mut e.best_at[row.clone()],
                    &mut e.worst[row.clone()],
                    &mut e.worst_at[row.clone()],
                );
            }
        }
    }
}

/// Row `y + shift` of an image, empty outside.
fn row_at(image: &[i16], y: usize, shift: i32, g: Geometry) -> &[i16] {
    match usize::try_from(y as i64 + i64::from(shift)) {
        Ok(at) if at < g.height => &image[at * g.stride..][..g.stride],
        _ => &[],
    }
}

/// What Σψ is multiplied with (and then divided by 2¹⁶) to be a score, cell by cell; 0 where too little of the path is inside.
fn weights_of(of: &Velocities, at: (usize, usize), times_s: &[f64], phi: &Phi, out: &mut Vec<i16>) {
    let v = (of.velocity(of.top, at.0), of.velocity(of.top, at.1));
    let start = (of.offset(at.0), of.offset(at.1));
    let (cells_x, cells_y) = (phi.cells_x, phi.cells.len() / phi.cells_x.max(1));
    let n = times_s.len();
    let per = n.div_ceil(SAMPLES);
    // φ of the path: cells shifted by whole cells, each moment with the factors of its frames.
    out.clear();
    out.resize(phi.cells.len(), 0);
    let mut moments = [(0i32, 0i32, 0f32); SAMPLES];
    let mut used = 0;
    for (moment, ages) in moments.iter_mut().zip((0..n).step_by(per)) {
        let group = ages..(ages + per).min(n);
        let t = group.clone().map(|a| times_s[a]).sum::<f64>() / group.len() as f64;
        let cells = |start: f64, v: f64| ((start + v * t) / CELL as f64).round() as i32;
        *moment = (cells(start.0, v.0), cells(start.1, v.1), phi.frames[group].iter().sum());
        used += 1;
    }
    let moments = &moments[..used];
    let whole: f32 = moments.iter().map(|m| m.2).sum();
    for cy in 0..cells_y {
        for cx in 0..cells_x {
            let (mut sum, mut inside) = (0.0, 0.0);
            for &(dx, dy, factor) in moments {
                let (x, y) = (cx as i32 + dx, cy as i32 + dy);
                if (0..cells_x as i32).contains(&x) && (0..cells_y as i32).contains(&y) {
                    sum += factor * phi.cells[y as usize * cells_x + x as usize];
                    inside += factor;
                }
            }
            if inside >= LEAST_INSIDE * whole {
                out[cy * cells_x + cx] = (65536.0 * PER_SCORE / PER_UNIT / sum.sqrt()) as i16;
            }
        }
    }
}

/// Joins two sums: out(x, y) = newer(x, y) + older(x + shift, y + shift), nothing outside.
fn join(newer: &[i16], older: &[i16], shift: (i32, i32), g: Geometry, out: &mut [i16]) {
    for y in 0..g.height {
        let row = y * g.stride..(y + 1) * g.stride;
        join_row(&newer[row.clone()], row_at(older, y, shift.1, g), shift.0, g.width, &mut out[row]);
    }
}

/// The columns x of a row of `width` for which x + shift lies inside too.
fn overlap(shift: i32, width: usize) -> std::ops::Range<usize> {
    let d = shift.unsigned_abs() as usize;
    if d >= width {
        0..0
    } else if shift >= 0 {
        0..width - d
    } else {
        d..width
    }
}

widest! {
    fn join_row(newer: &[i16], older: &[i16], shift: i32, width: usize, out: &mut [i16]) {
        out.copy_from_slice(newer);
        let inside = if older.is_empty() { 0..0 } else { overlap(shift, width) };
        // A shift may be longer than the row: then nothing of it is met, and its start is no place in the row.
        if inside.is_empty() {
            return;
        }
        let from = (inside.start as i64 + i64::from(shift)).max(0) as usize;
        let older = &older[from..][..inside.len()];
        for (o, &v) in out[inside].iter_mut().zip(older) {
            *o = o.saturating_add(v);
        }
    }
}

widest! {
    fn score_row(
        newer: &[i16],
        older: &[i16],
        shift: i32,
        width: usize,
        weights: &[i16],
        at: u16,
        best: &mut [i16],
        best_at: &mut [u16],
        worst: &mut [i16],
        worst_at: &mut [u16],
    ) {
        let inside = if older.is_empty() { 0..0 } else { overlap(shift, width) };
        let n = weights.len();
        let newer = &newer.as_chunks::<CELL>().0[..n];
        let (best, best_at) = (&mut best.as_chunks_mut::<CELL>().0[..n], &mut best_at.as_chunks_mut::<CELL>().0[..n]);
        let (worst, worst_at) = (&mut worst.as_chunks_mut::<CELL>().0[..n], &mut worst_at.as_chunks_mut::<CELL>().0[..n]);
        // Whole cells inside the overlap, then those at its ends and beyond, where what lies outside adds nothing.
        let first = inside.start.div_ceil(CELL).min(n);
        let last = (inside.end / CELL).clamp(first, n);
        if last > first {
            let from = ((first * CELL) as i64 + i64::from(shift)).max(0) as usize;
            let older = &older[from..][..(last - first) * CELL].as_chunks::<CELL>().0[..last - first];
            let (newer, weights) = (&newer[first..last], &weights[first..last]);
            let (best, best_at) = (&mut best[first..last], &mut best_at[first..last]);
            let (worst, worst_at) = (&mut worst[first..last], &mut worst_at[first..last]);
            for c in 0..last - first {
                let (best, worst) = ((&mut best[c], &mut best_at[c]), (&mut worst[c], &mut worst_at[c]));
                score_cell(&newer[c], &older[c], weights[c], at, best, worst);
            }
        }
        for c in (0..first).chain(last..n) {
            let mut part = [0i16; CELL];
            for (k, p) in part.iter_mut().enumerate() {
                let x = c * CELL + k;
                if inside.contains(&x) {
                    let from = x as i64 + i64::from(shift);
                    *p = usize::try_from(from).ok().and_then(|i| older.get(i)).copied().unwrap_or(0);
                }
            }
            let (best, worst) = ((&mut best[c], &mut best_at[c]), (&mut worst[c], &mut worst_at[c]));
            score_cell(&newer[c], &part, weights[c], at, best, worst);
        }
    }
}

/// Scores one cell's row of sums.
#[inline(always)]
fn score_cell(
    newer: &[i16; CELL],
    older: &[i16; CELL],
    weight: i16,
    at: u16,
    best: (&mut [i16; CELL], &mut [u16; CELL]),
    worst: (&mut [i16; CELL], &mut [u16; CELL]),
) {
    for k in 0..CELL {
        let sum = newer[k].saturating_add(older[k]);
        let score = ((i32::from(sum) * i32::from(weight)) >> 16) as i16;
        let better = score > best.0[k];
        best.1[k] = if better { at } else { best.1[k] };
        best.0[k] = best.0[k].max(score);
        let worse = score < worst.0[k];
        worst.1[k] = if worse { at } else { worst.1[k] };
        worst.0[k] = worst.0[k].min(score);
    }
}

#[cfg(test)]
mod tests;
