//! Nearest neighbour: each track takes the gated detection of least cost.
//!
//! Source: `docs/theory/association.md` (the thesis' NNKF: least d², first index on ties).
//! Differs from it with several tracks: by default no detection is used twice; the cheapest pair of all is taken first
//! (greedy), ties go to the lower track, then the lower detection. `shared = true` lets tracks choose alone, as the paper.
//! Cost: O(P log P) for P pairs.

use super::{Assignment, Associator, Gates};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Nearest neighbour.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct NearestConfig {
    /// Whether two tracks may take the same detection (the papers' single-target filter does not ask); default false.
    pub shared: bool,
}

/// The nearest-neighbour associator.
#[derive(Clone, Debug)]
pub struct Nearest {
    shared: bool,
    order: Vec<(f64, u32, u32)>,
    choice: Vec<u32>,
    used: Vec<bool>,
}

const NONE: u32 = u32::MAX;

impl Nearest {
    /// Builds the associator.
    pub fn new(config: &NearestConfig) -> Self {
        Self { shared: config.shared, order: Vec::new(), choice: Vec::new(), used: Vec::new() }
    }
}

impl Associator for Nearest {
    fn needs_likelihood(&self) -> bool {
        false
    }

    fn associate(&mut self, gates: &Gates, out: &mut Assignment) {
        self.choice.clear();
        self.choice.resize(gates.n_tracks(), NONE);
        self.order.clear();
        for i in 0..gates.n_tracks() {
            let miss = gates.prior(i).miss_cost;
            self.order.extend(gates.row(i).iter().filter(|p| p.cost <= miss).map(|p| (p.cost, i as u32, p.detection)));
        }
        self.order.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)).then(a.2.cmp(&b.2)));
        self.used.clear();
        self.used.resize(gates.n_detections(), false);
        for (_, track, detection) in &self.order {
            let (t, d) = (*track as usize, *detection as usize);
            if self.choice[t] == NONE && (self.shared || !self.used[d]) {
                self.choice[t] = *detection;
                self.used[d] = true;
            }
        }
        out.reset();
        for c in &self.choice {
            if *c != NONE {
                out.push(*c, 1.0);
            }
            out.end_row();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::associate::{Pair, Prior};

    fn chosen(shared: bool, rows: &[(f64, &[(u32, f64)])]) -> Vec<Option<u32>> {
        let mut gates = Gates::new();
        gates.reset(4, 1.0);
        for (miss_cost, pairs) in rows {
            for &(detection, cost) in *pairs {
                gates.push(Pair { detection, cost, log_likelihood: 0.0 });
            }
            gates.end_row(Prior { p_detection: 0.9, p_gate: 0.99, existence: 1.0, miss_cost: *miss_cost });
        }
        let mut answer = Assignment::new();
        Nearest::new(&NearestConfig { shared }).associate(&gates, &mut answer);
        (0..rows.len()).map(|i| answer.row(i).first().map(|s| s.detection)).collect()
    }

    #[test]
    fn the_cheapest_pair_goes_first_and_ties_to_the_lower_numbers() {
        let rows: [(f64, &[(u32, f64)]); 3] =
            [(9.0, &[(0, 2.0), (1, 3.0)]), (9.0, &[(0, 1.0), (1, 4.0)]), (9.0, &[(1, 3.0), (2, 3.0)])];
        assert_eq!(chosen(false, &rows), [Some(1), Some(0), Some(2)]);
        // Tracks that choose alone take their nearest, whoever else does.
        assert_eq!(chosen(true, &rows), [Some(0), Some(0), Some(1)]);
    }

    #[test]
    fn a_pair_dearer_than_a_miss_is_not_taken_one_as_dear_is() {
        assert_eq!(chosen(false, &[(5.0, &[(0, 5.0)]), (5.0, &[(1, 5.1)])]), [Some(0), None]);
    }
}
