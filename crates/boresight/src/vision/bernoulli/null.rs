//! The null: how many places of noise are expected to come newly, in a frame, to a sum as high as one.
//!
//! How: noise that stands out does so for a while, and is one false target, not one for each of its frames: what is counted is how often a height is newly reached. The density of the negative frames, in
//! which no target is, is carried along. Each block of two boxes by two has one highest box, c. A height is *held* in a block from when it is reached until c is [`DROP`] below it, and *free* where no
//! block around holds it. The highest block of its surroundings whose c goes from below a free height to above it is an arrival at that height. Arrivals over free blocks are the rate
//! of arrivals (occurrences over exposure), whatever part of the blocks is held.
//! Tail: the density is a product of random factors and births, f ← l (s f + 1 − s). Of such a recursion the heights have a power law, P(f > c) ~ c^(−κ), and excursions above c last
//! as long at every c, so that arrivals have the same power; κ solves E[(s l)^κ] = 1. Under noise E l = 1, so κ = 1 but for what s adds: at most 1 is taken (Markov's inequality says that no
//! tail is heavier for independent frames). Ground that stands still, and pixels that an encoder copies, have a smaller one: κ is the maximum-likelihood index of the arrivals from the lowest height that is free in half of all blocks, over
//! [`DROP`] (what goes higher is known to, not by how much: a few outliers move nothing), with [`PRIOR`] arrivals of the index 1. All fades as background and noise do.
//! What moves slowly is for a while in its own background and leaves a ghost of the other sign: where the other sign has been surer within the memory nothing is counted and nothing is free, nor does a
//! target begin there where both signs are looked for.
//! Source: H. Kesten, Acta Math. 131, 207 (1973); excursions: L. de Haan, S. Resnick, H. Rootzén & C. de Vries, Stoch. Proc. Appl. 32, 213 (1989); arrivals apart from one another: A. Davison & R. Smith,
//! J. R. Stat. Soc. B 52, 393 (1990). Limits: noise that is correlated from frame to frame (`docs/limit.md`); ground whose bright side differs from its dark one is not in the null; targets that cross a block in less than a frame are counted anew.

/// Nats below a height from which on it is no longer held: one in twenty, as a target is given up at odds of one to twenty.
const DROP: f32 = 3.0;
/// Nats between neighbouring heights, and their number: up to e^64.
const APART: f32 = 0.25;
const HEIGHTS: usize = 256;
/// Heights over which the index is taken.
const SPAN: usize = (DROP / APART) as usize;
/// Share of the blocks that have to be free.
const FREE: f64 = 0.5;
/// Arrivals that the index 1 counts for.
const PRIOR: f64 = 12.0;
/// Least index: nearly every height is as frequent.
const LEAST_TAIL: f64 = 0.02;

/// Arrivals of noise by their sum.
#[derive(Clone, Debug)]
pub(super) struct Null {
    /// Cells across, and of a block; blocks across.
    width: usize,
    block: usize,
    across: usize,
    /// ln of the highest box of each block in this frame, the highest within the memory, and the highest that it holds.
    now: Vec<f32>,
    past: Vec<f32>,
    held: Vec<f32>,
    /// What of this frame's is above the other sign's.
    seen: Vec<f32>,
    /// The highest of a block and those around, of what is held and of what is seen.
    held_near: Vec<f32>,
    seen_near: Vec<f32>,
    row: Vec<f32>,
    /// Arrivals, and free blocks, by height, each less those of the height below; frames. They fade.
    arrivals: Vec<f64>,
    free: Vec<f64>,
    weight: f64,
    /// The rate in a frame at a height (nats), and the index from there on.
    level: f64,
    rate: f64,
    tail: f64,
}

/// The lowest height above one, nats.
fn above(v: f32) -> usize {
    // A float becomes the nearest number of a `usize`, 0 of what is below.
    ((v / APART).floor() + 1.0).max(0.0) as usize
}

impl Null {
    /// For a frame of `w` x `h` cells, and boxes of half side `half`.
    pub(super) fn new(w: usize, h: usize, half: usize) -> Self {
        let block = 2 * (2 * half + 1);
        let across = w.div_ceil(block);
        let blocks = across * h.div_ceil(block);
        let none = vec![f32::NEG_INFINITY; blocks];
        Self {
            width: w,
            block,
            across,
            now: none.clone(),
            past: vec![0.0; blocks],
            held: none.clone(),
            held_near: none.clone(),
            seen_near: none.clone(),
            seen: none.clone(),
            row: none,
            arrivals: vec![0.0; HEIGHTS + 1],
            free: vec![0.0; HEIGHTS + 1],
            weight: 0.0,
            // Markov's inequality: at most so many places, new or not.
            level: 0.0,
            rate: (w * h) as f64,
            tail: 1.0,
        }
    }

    /// Looks at the boxes of a frame; `kept` is what is left of the older ones.
    pub(super) fn look(&mut self, boxes: &[f32], kept: f64) {
        for (rows, now) in boxes.chunks(self.block * self.width).zip(self.now.chunks_exact_mut(self.across)) {
            now.fill(f32::MIN_POSITIVE);
            for row in rows.chunks_exact(self.width) {
                for (cells, most) in row.chunks(self.block).zip(now.iter_mut()) {
                    *most = cells.iter().fold(*most, |m, v| m.max(*v));
                }
            }
        }
        for (now, past) in self.now.iter_mut().zip(&mut self.past) {
            *now = now.ln();
            *past = (kept as f32 * *past).max(*now);
        }
    }

    /// Says that something as sure as `ln_sum` is at a cell.
    pub(super) fn mark(&mut self, x: usize, y: usize, ln_sum: f64) {
        if let Some(past) = self.past.get_mut(y / self.block * self.across + x / self.block) {
            *past = past.max(ln_sum as f32);
        }
    }

    /// Whether a box there may be the ghost of what was seen with the other sign, whose blocks these are.
    pub(super) fn has_been_surer(&self, x: usize, y: usize, ln_sum: f64) -> bool {
        self.past.get(y / self.block * self.across + x / self.block).is_some_and(|p| f64::from(*p) > ln_sum)
    }

    /// Learns from the frame that was looked at; `other` is the other sign's.
    pub(super) fn learn(&mut self, other: &[f32], kept: f64) {
        for ((seen, now), other) in self.seen.iter_mut().zip(&self.now).zip(other) {
            *seen = if now > other { *now } else { f32::NEG_INFINITY };
        }
        most_near(&self.held, self.across, &mut self.row, &mut self.held_near);
        most_near(&self.seen, self.across, &mut self.row, &mut self.seen_near);
        self.arrivals.iter_mut().chain(&mut self.free).for_each(|v| *v *= kept);
        self.weight = kept * self.weight + 1.0;
        let around = self.held_near.iter().zip(&self.seen_near);
        for ((seen, other), (held_near, seen_near)) in self.seen.iter().zip(other).zip(around) {
            let (from, to) = (above(held_near.max(*other)).min(HEIGHTS), above(*seen).min(HEIGHTS));
            self.free[from] += 1.0;
            if seen >= seen_near && to > from {
                self.arrivals[from] += 1.0;
                self.arrivals[to] -= 1.0;
            }
        }
        // What leaves a block in this frame is held there until the next one, so that where it goes it is not new.
        for ((held, seen), now) in self.held.iter_mut().zip(&self.seen).zip(&self.now) {
            *held = held.min(now + DROP).max(*seen);
        }
        self.fit();
    }

    /// The tail of what was counted.
    fn fit(&mut self) {
        let blocks = self.now.len() as f64;
        let needed = FREE * self.weight * blocks;
        let (mut free, mut arrivals) = (0.0, 0.0);
        // Where hardly anything is free (the other sign is surer nearly everywhere), nothing is learnt.
        let Some(first) = self.free.iter().zip(&self.arrivals).position(|(f, a)| {
            (free, arrivals) = (free + f, arrivals + a);
            free >= needed
        }) else {
            return;
        };
        if first + SPAN > HEIGHTS {
            return;
        }
        // What would have arrived at each height, had as much been free as at the first; the sum is by trapezoids.
        let (begin, exposed) = (arrivals, free);
        let (mut last, mut sum) = (begin, 0.0);
        for (f, a) in self.free.iter().zip(&self.arrivals).skip(first + 1).take(SPAN) {
            (free, arrivals) = (free + f, arrivals + a);
            let here = arrivals * exposed / free;
            sum += 0.5 * (last + here) * f64::from(APART);
            last = here;
        }
        self.tail = ((begin - last + PRIOR) / (sum + PRIOR)).clamp(LEAST_TAIL, 1.0);
        self.level = f64::from(APART) * first as f64;
        // One more than was seen: what was not seen yet is not impossible (Laplace's rule).
        self.rate = blocks * (begin.max(0.0) + 1.0) / exposed;
    }

    /// Whether that sum is above all heights that the index is taken over.
    pub(super) fn is_above(&self, sum: f64) -> bool {
        sum.max(f64::MIN_POSITIVE).ln() > self.level + f64::from(DROP)
    }

    /// The highest of each block within the memory.
    pub(super) fn past(&self) -> &[f32] {
        &self.past
    }

    /// Expected number of places of noise that newly come to at least that sum, in a frame.
    pub(super) fn number(&self, sum: f64) -> f64 {
        self.rate * (-self.tail * (sum.max(f64::MIN_POSITIVE).ln() - self.level)).exp()
    }
}

/// The most of each block and of the eight around it.
fn most_near(of: &[f32], across: usize, row: &mut [f32], to: &mut [f32]) {
    for (of, row) in of.chunks_exact(across).zip(row.chunks_exact_mut(across)) {
        for (x, r) in row.iter_mut().enumerate() {
            let near = &of[x.saturating_sub(1)..(x + 2).min(across)];
            *r = near.iter().fold(f32::NEG_INFINITY, |m, v| m.max(*v));
        }
    }
    let down = of.len() / across;
    for (y, to) in to.chunks_exact_mut(across).enumerate() {
        to.fill(f32::NEG_INFINITY);
        for row in row.chunks_exact(across).take((y + 2).min(down)).skip(y.saturating_sub(1)) {
            to.iter_mut().zip(row).for_each(|(t, r)| *t = t.max(*r));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    const SIDE: usize = 120;
    const BLOCKS: usize = 400;

    /// Boxes of a frame from the heights of its blocks.
    fn boxes(of: impl Fn(usize) -> f32) -> Vec<f32> {
        let block = |i: usize| (i % SIDE, i / SIDE);
        (0..SIDE * SIDE)
            .map(block)
            .map(|(x, y)| if x % 6 == 2 && y % 6 == 3 { of(y / 6 * 20 + x / 6) } else { 0.0 })
            .collect()
    }

    /// A height with P(c) = c^-tail above 1.
    fn drawn(tail: f32, rng: &mut ChaCha8Rng) -> f32 {
        (1.0 - rng.random::<f32>()).powf(-1.0 / tail)
    }

    #[test]
    fn a_tail_that_was_drawn_is_extrapolated() {
        let mut rng = ChaCha8Rng::seed_from_u64(3);
        for tail in [1.0, 0.5] {
            let mut null = Null::new(SIDE, SIDE, 1);
            // As many as make an index known to some hundredths.
            for _ in 0..400 {
                let heights: Vec<f32> = (0..BLOCKS).map(|_| drawn(tail, &mut rng)).collect();
                null.look(&boxes(|i| heights[i]), 0.998);
                null.learn(&[f32::NEG_INFINITY; BLOCKS], 0.998);
            }
            for c in [1e3, 1e6f64] {
                let ratio = null.number(c) / (BLOCKS as f64 * c.powf(-f64::from(tail)));
                assert!((0.3..3.3).contains(&ratio), "{tail} {c}: {ratio}");
            }
        }
    }

    #[test]
    fn what_stays_for_a_while_has_come_once() {
        let mut rng = ChaCha8Rng::seed_from_u64(4);
        // Two come in each frame anywhere, stay for 25 frames, wander to a neighbouring block and flicker by a nat.
        let (a_frame, life) = (2, 25usize);
        let mut there: Vec<(usize, f32, usize)> = Vec::new();
        let mut null = Null::new(SIDE, SIDE, 1);
        for _ in 0..400 {
            there.iter_mut().for_each(|t| {
                let goes = rng.random::<f32>() < 0.1 && t.0 % 20 < 19;
                t.0 += usize::from(goes);
                t.2 -= 1;
            });
            there.retain(|t| t.2 > 0);
            there.extend(
                (0..a_frame).map(|_| {
                    ((rng.random::<f32>() * BLOCKS as f32) as usize % BLOCKS, 20.0 * drawn(1.0, &mut rng), life)
                }),
            );
            let mut heights = [1.0f32; BLOCKS];
            for (i, height, _) in &there {
                heights[*i] = heights[*i].max(height * (-rng.random::<f32>()).exp());
            }
            null.look(&boxes(|i| heights[i]), 0.99);
            null.learn(&[f32::NEG_INFINITY; BLOCKS], 0.99);
        }
        for c in [1e3, 1e5] {
            // They flicker: not all reach their height.
            let ratio = null.number(c) / (f64::from(a_frame) * 20.0 / c);
            assert!((0.4..2.5).contains(&ratio), "{c}: {ratio}");
        }
    }

    #[test]
    fn ghosts_of_the_other_sign_are_not_counted_and_hide_nothing_else() {
        let mut rng = ChaCha8Rng::seed_from_u64(5);
        let mut null = Null::new(SIDE, SIDE, 1);
        let mut other = [f32::NEG_INFINITY; BLOCKS];
        other.iter_mut().step_by(3).for_each(|o| *o = 60.0);
        for k in 0..400 {
            // As high as anything, with gaps: each would be an arrival.
            let ghost = if k % 2 == 0 { 1e20 } else { 1.0 };
            let heights: Vec<f32> =
                (0..BLOCKS).map(|i| if i % 3 == 0 { ghost } else { drawn(1.0, &mut rng) }).collect();
            null.look(&boxes(|i| heights[i]), 0.998);
            null.learn(&other, 0.998);
        }
        for c in [1e3, 1e6] {
            let ratio = null.number(c) / (BLOCKS as f64 / c);
            assert!((0.3..3.3).contains(&ratio), "{c}: {ratio}");
        }
    }
}
