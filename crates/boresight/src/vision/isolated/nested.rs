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

    /// Half way between its ground and its peak.
    fn half(&self) -> f64 {
        self.background + 0.5 * (self.peak - self.background)
    }

    /// How far from such a half way it is the cluster.
    fn off(&self, half: f64) -> f64 {
        (self.level_near(half) - half).abs()
    }
}

/// The clearest cluster of one peak so far, each of the next ones holding those before it.
#[derive(Clone, Copy, Debug)]
pub struct Clearest {
    pub score: f64,
    half: f64,
    /// How far from half its height the nearest of them is.
    off: f64,
}

impl Clearest {
    /// Of those of `before`, if there were any, and the next one, or the last one again where its levels go on.
    pub fn of(before: Option<Self>, next: &Candidate) -> Self {
        match before {
            Some(best) if best.score >= next.score => Self { off: best.off.min(next.off(best.half)), ..best },
            _ => Self { score: next.score, half: next.half(), off: next.off(next.half()) },
        }
    }

    /// Whether no cluster below that level is nearer to half its height, so that only one which stands clearer could still count.
    pub fn has_its_shape(&self, level: f64) -> bool {
        level <= self.half - self.off
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
            let half = best.half();
            let mut shape = best;
            // Those before it were better, and did not take it.
            for j in near.of(&best.blob).iter().map(|&j| j as usize).filter(|&j| j >= i) {
                let other = &candidates[j];
                if !taken[j] && best.blob.overlaps(&other.blob) {
                    taken[j] = true;
                    if other.off(half) < shape.off(half) && other.blob.holds(&best.blob) {
                        shape = other;
                    }
                }
            }
            found(best, (&shape.blob, shape.level_near(half)));
        }
    }
}
