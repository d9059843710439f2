//! From a detector's own score to the probability that a detection is a target's: by what the next and the last scan say of it.
//!
//! A detection that is linked on both sides is supported. The share of supported ones among those of one score, made monotone in the score
//! (pool adjacent violators: R. E. Barlow et al., *Statistical Inference under Order Restrictions*, 1972), lies between the share of false
//! detections and that of the surest ones; how far up is the probability asked for.

/// Scores of one bin at least: its share has a deviation below 0.05.
const BIN: usize = 100;

/// Share of false detections that are supported all the same, where the lowest scores do not show less: detectors repeat their errors. 0.18 to
/// 0.24 at the lowest scores of the six longer ones of the nine public tables (the three short ones have few low scores).
const FALSE_SUPPORT: f64 = 0.2;

/// Probability of a target by score, a step function.
pub(super) struct Calibration {
    /// Least score of each bin and its probability, scores rising.
    steps: Vec<(f32, f64)>,
}

impl Calibration {
    /// Learns from scores and whether each detection is supported; nothing from too few, or if all scores are one.
    pub(super) fn of(mut seen: Vec<(f32, bool)>) -> Option<Self> {
        seen.retain(|s| s.0.is_finite());
        seen.sort_by(|a, b| a.0.total_cmp(&b.0));
        if seen.len() < 2 * BIN || seen[0].0 == seen[seen.len() - 1].0 {
            return None;
        }
        // Blocks of least score, supported, all; a block joins the one below while its share is smaller.
        let mut blocks: Vec<(f32, f64, f64)> = Vec::new();
        for bin in seen.chunks(seen.len().div_ceil(seen.len() / BIN)) {
            let mut block = (bin[0].0, bin.iter().filter(|s| s.1).count() as f64, bin.len() as f64);
            while let Some(below) = blocks.pop_if(|b| b.1 * block.2 >= block.1 * b.2 || b.0 == block.0) {
                block = (below.0, below.1 + block.1, below.2 + block.2);
            }
            blocks.push(block);
        }
        let share = |b: &(f32, f64, f64)| b.1 / b.2;
        let (low, top) = (share(blocks.first()?).min(FALSE_SUPPORT), share(blocks.last()?));
        // Without more support anywhere than false ones have, nothing is said.
        (top > low).then(|| Self { steps: blocks.iter().map(|b| (b.0, (share(b) - low) / (top - low))).collect() })
    }

    /// Least score of detections that are a target's with at least this probability.
    pub(super) fn score_at(&self, probability: f64) -> f32 {
        let step = self.steps.iter().find(|s| s.1 >= probability).or(self.steps.last());
        step.map_or(0.0, |s| s.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_score_of_even_odds_is_found_where_it_was_put() {
        // Supported with probability 0.9 s² at the score s: from 0 for false ones to 0.9 for the surest, even odds at 0.707.
        let mut state = 1u64;
        let mut uniform = move || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 11) as f64 / (1u64 << 53) as f64
        };
        let seen = (0..20_000).map(|_| {
            let s = uniform();
            (s as f32, uniform() < 0.9 * s * s)
        });
        let c = Calibration::of(seen.collect()).unwrap();
        assert!((c.score_at(0.5) - 0.707).abs() < 0.05, "{}", c.score_at(0.5));
        assert!(c.score_at(0.1) < 0.4 && c.score_at(0.0) < 0.01);
    }

    #[test]
    fn one_score_for_all_says_nothing() {
        assert!(Calibration::of(vec![(1.0, true); 1000]).is_none());
        assert!(Calibration::of(vec![(0.1, true), (0.5, false)]).is_none());
        let never = (0..1000).map(|i| (i as f32, false));
        assert!(Calibration::of(never.collect()).is_none(), "nothing is ever supported");
    }
}
