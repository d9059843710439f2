//! Of nested clusters the one that stands clearest counts; its shape is that of the one at half its height.

use super::blob::Blob;
use super::near::Near;

/// A cluster that stands clear; values times the sign of the side.
#[derive(Clone, Copy, Debug)]
pub struct Candidate {
    pub blob: Blob,
    /// The highest and the lowest level at which the cluster is this one.
    pub level: f64,
    pub until: f64,
    pub background: f64,
    pub peak: f64,
    pub score: f64,
}

impl Candidate {
    /// The level nearest to `value` at which the cluster is this one.
    fn level_near(&self, value: f64) -> f64 {
        value.clamp(self.until, self.level)
    }
}

/// Sorts out which candidates are one thing; keeps its memory.
#[derive(Debug, Default)]
pub struct Nested {
    near: Near,
    taken: Vec<bool>,
}

impl Nested {
    /// Calls `found` with each thing's clearest candidate, the clearest first, and the box and the level of its shape.
    pub fn best_of(
        &mut self,
        (width, height): (usize, usize),
        candidates: &mut [Candidate],
        mut found: impl FnMut(&Candidate, (&Blob, f64)),
    ) {
        // Ties by place, so that the order never depends on anything else.
        candidates.sort_unstable_by(|a, b| {
            let place = |c: &Candidate| (c.blob.top, c.blob.left, c.blob.area);
            b.score.total_cmp(&a.score).then(place(a).cmp(&place(b)))
        });
        let Self { near, taken } = self;
        taken.clear();
        taken.resize(candidates.len(), false);
        near.fill(width, height, candidates.iter().map(|c| &c.blob));
        for (i, best) in candidates.iter().enumerate() {
            if taken[i] {
                continue;
            }
            let half = best.background + 0.5 * (best.peak - best.background);
            let off = |c: &Candidate| (c.level_near(half) - half).abs();
            let mut shape = best;
            // Those before it were better, and did not take it.
            for j in near.of(&best.blob).iter().map(|&j| j as usize).filter(|&j| j >= i) {
                let other = &candidates[j];
                if !taken[j] && best.blob.overlaps(&other.blob) {
                    taken[j] = true;
                    if off(other) < off(shape) && other.blob.holds(&best.blob) {
                        shape = other;
                    }
                }
            }
            found(best, (&shape.blob, shape.level_near(half)));
        }
    }
}
