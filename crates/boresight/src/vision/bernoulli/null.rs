//! The null: how many places of noise are expected to be at least as sure, from the same density of the frames' other sign.
//!
//! How: by Markov's inequality at most (cells) / c boxes of independent noise hold a sum of c or more (`density`); ground that stands still, and pixels that an encoder
//! copies, are not independent from frame to frame. So the density of the negative frames, in which no target is, is carried along, and its highest boxes are
//! counted: N(c) = m (c / c_m)^(−κ), c_m the m-th highest of a frame (geometric mean over the frames so far, fading as background and noise do), κ from ln c_{m/4} − ln c_m, at
//! most 1, which is what independent noise has: m is a quarter of all blocks, and
//! fewer than m / 4 outliers do not move it. Each block of two boxes by two has one highest box.
//! What moves slowly is for a while in its own background and leaves a ghost of the other sign: a block in which the other sign has been surer within the memory is not counted, nor does a
//! target begin there where both signs are looked for.
//! Source: tail index by two quantiles: J. Pickands, Annals of Statistics 3, 119 (1975), here of a power law. Limits: ground whose bright side differs from its dark one is not in the null; neighbouring frames say nearly the same.

/// One in how many blocks is fitted, and the fewest of them.
const SHARE: usize = 4;
const FEWEST: usize = 12;
/// Frames that Markov's inequality counts for.
const PRIOR: f64 = 4.0;
/// Least κ: nearly every height is as frequent.
const LEAST_TAIL: f64 = 0.02;

/// Number of places of noise by their sum.
#[derive(Clone, Debug)]
pub(super) struct Null {
    /// Cells across, and of a block; blocks across.
    width: usize,
    block: usize,
    across: usize,
    fitted: usize,
    /// ln of the highest box of each block in this frame, and the highest within the memory.
    now: Vec<f32>,
    past: Vec<f32>,
    counted: Vec<f32>,
    /// Means over the frames so far: ln c_m, and 1 / κ.
    level: f64,
    excess: f64,
    weight: f64,
}

impl Null {
    /// For a frame of `w` x `h` cells, and boxes of half side `half`.
    pub(super) fn new(w: usize, h: usize, half: usize) -> Self {
        let block = 2 * (2 * half + 1);
        let across = w.div_ceil(block);
        let blocks = across * h.div_ceil(block);
        let fitted = (blocks / SHARE).max(FEWEST).min(blocks);
        let level = ((w * h) as f64 / fitted as f64).ln();
        let none = vec![0.0; blocks];
        let counted = Vec::with_capacity(blocks);
        Self {
            width: w,
            block,
            across,
            fitted,
            now: none.clone(),
            past: none,
            counted,
            level,
            excess: 1.0,
            weight: PRIOR,
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
        self.counted.clear();
        self.counted
            .extend(self.now.iter().zip(other).map(|(now, past)| if past > now { f32::NEG_INFINITY } else { *now }));
        let m = self.fitted;
        self.counted.select_nth_unstable_by(m - 1, |a, b| b.total_cmp(a));
        let level = f64::from(self.counted[m - 1]);
        let upper = m.div_ceil(4);
        self.counted[..m].select_nth_unstable_by(upper - 1, |a, b| b.total_cmp(a));
        // Where the other sign is surer nearly everywhere, nothing is learnt.
        if !level.is_finite() {
            return;
        }
        // What is expected of their order in an exponential law of ln c.
        let apart: f64 = (upper..m).map(|i| 1.0 / i as f64).sum();
        let excess = if apart > 0.0 { (f64::from(self.counted[upper - 1]) - level) / apart } else { 1.0 };
        self.weight = kept * self.weight + 1.0;
        self.level += (level - self.level) / self.weight;
        self.excess += (excess - self.excess) / self.weight;
    }

    /// The highest of each block within the memory.
    pub(super) fn past(&self) -> &[f32] {
        &self.past
    }

    /// Expected number of places of noise in a frame with at least that sum.
    pub(super) fn number(&self, sum: f64) -> f64 {
        let tail = (1.0 / self.excess.max(1e-9)).clamp(LEAST_TAIL, 1.0);
        self.fitted as f64 * (-tail * (sum.max(f64::MIN_POSITIVE).ln() - self.level)).exp()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    #[test]
    fn a_tail_that_was_drawn_is_extrapolated() {
        let mut rng = ChaCha8Rng::seed_from_u64(3);
        for tail in [1.0, 0.5] {
            let (w, h, half) = (120, 120, 1);
            let mut null = Null::new(w, h, half);
            for _ in 0..60 {
                // Each block's highest has P(c) = c^-tail above 1.
                let boxes: Vec<f32> = (0..w * h)
                    .map(|i| {
                        if i % w % 6 == 0 && i / w % 6 == 0 {
                            (1.0 - rng.random::<f32>()).powf(-1.0 / tail)
                        } else {
                            0.0
                        }
                    })
                    .collect();
                null.look(&boxes, 0.99);
                null.learn(&[f32::NEG_INFINITY; 400], 0.99);
            }
            let blocks = 400.0;
            for c in [1e3, 1e6f64] {
                let ratio = null.number(c) / (blocks * c.powf(-f64::from(tail)));
                assert!((0.3..3.3).contains(&ratio), "{tail} {c}: {ratio}");
            }
        }
    }
}
