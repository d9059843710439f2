//! Detections by score: in that order, or only the strongest of them; memory is used again.

use crate::Detection;

/// Puts detections into an order, or keeps some; holds the places between frames.
#[derive(Clone, Debug, Default)]
pub(super) struct Strongest {
    places: Vec<usize>,
}

impl Strongest {
    /// The places of the detections, the largest score first; of equals the first.
    fn rank(&mut self, detections: &[Detection]) {
        self.places.clear();
        self.places.extend(0..detections.len());
        let score = |i: usize| detections[i].score;
        self.places.sort_unstable_by(|&a, &b| score(b).total_cmp(&score(a)).then(a.cmp(&b)));
    }

    /// Sorts by score, the largest first; equals keep their order.
    pub(super) fn sort(&mut self, detections: &mut [Detection]) {
        self.rank(detections);
        for i in 0..detections.len() {
            // What belongs here may have been swapped away before: follow it.
            let mut from = self.places[i];
            while from < i {
                from = self.places[from];
            }
            detections.swap(i, from);
        }
    }

    /// Keeps the `limit` detections with the largest score, in their order.
    pub(super) fn keep(&mut self, detections: &mut Vec<Detection>, limit: Option<u32>) {
        let Some(limit) = limit.map(|l| l as usize).filter(|l| *l < detections.len()) else { return };
        self.rank(detections);
        self.places.truncate(limit);
        self.places.sort_unstable();
        for (to, &from) in self.places.iter().enumerate() {
            detections.swap(to, from);
        }
        detections.truncate(limit);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Matrix2, Vector2};
    use proptest::prelude::*;

    /// Detections of these scores whose area is their number.
    fn detections(scores: &[u8]) -> Vec<Detection> {
        let one = |(i, s): (usize, &u8)| {
            Detection::at(Vector2::zeros(), Matrix2::identity())
                .with_area_px(i as u32)
                .with_peak(0.0)
                .with_sum(0.0)
                .with_score(f32::from(*s))
        };
        scores.iter().enumerate().map(one).collect()
    }

    proptest! {
        #[test]
        fn the_order_is_that_of_a_stable_sort(scores in prop::collection::vec(0u8..6, 0..40)) {
            let (mut ours, mut stable) = (detections(&scores), detections(&scores));
            Strongest::default().sort(&mut ours);
            stable.sort_by(|a, b| b.score.total_cmp(&a.score));
            prop_assert_eq!(ours, stable);
        }

        #[test]
        fn the_strongest_are_kept_in_their_order(scores in prop::collection::vec(0u8..6, 0..40), limit in 0u32..50) {
            let mut ours = detections(&scores);
            Strongest::default().keep(&mut ours, Some(limit));
            let mut order: Vec<usize> = (0..scores.len()).collect();
            order.sort_by_key(|i| std::cmp::Reverse(scores[*i]));
            order.truncate(limit as usize);
            order.sort_unstable();
            let kept: Vec<usize> = ours.iter().map(|d| d.area_px as usize).collect();
            prop_assert_eq!(kept, order);
        }
    }
}
