//! Global nearest neighbour: the one-to-one pairing of least total cost, exact, group by group.
//!
//! Source: `docs/theory/association.md`: minimise Σ d² over paired + γ (number of unpaired tracks), pairs only with
//! d² ≤ γ.
//! Method: connected groups are solved apart; one track, two tracks and one contested detection in closed form, the rest
//! by shortest augmenting paths on the sparse graph ([`super::assignment::sparse`]).
//! Limits: a group so dense that its exact solution would need more than about 10⁹ steps (10⁵ detections in a few pixels)
//! is finished greedily; every ordinary scan is exact.

use super::assignment::sparse::{SparseSolver, UNASSIGNED};
use super::groups::Groups;
use super::{Assignment, Associator, Gates, Pair};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// What the global nearest neighbour adds up.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum CostKind {
    /// Squared Mahalanobis distances, as the papers: a track with a wide gate is not put at a disadvantage.
    #[default]
    Distance,
    /// Log-likelihood ratios against clutter: a sharp track wins over a vague one at equal distance.
    Likelihood,
}

/// Global nearest neighbour.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct GlobalNearestConfig {
    /// What is added up: `distance` (default) or `likelihood`.
    pub cost: CostKind,
}

/// The global-nearest-neighbour associator.
#[derive(Clone, Debug, Default)]
pub struct GlobalNearest {
    cost: CostKind,
    groups: Groups,
    solver: SparseSolver,
    choice: Vec<u32>,
    /// The same table with likelihood costs, when asked for.
    by_likelihood: Gates,
}

impl GlobalNearest {
    /// Builds the associator.
    pub fn new(config: &GlobalNearestConfig) -> Self {
        Self { cost: config.cost, ..Self::default() }
    }

    fn solve(&mut self, gates: &Gates) {
        self.choice.clear();
        self.choice.resize(gates.n_tracks(), UNASSIGNED);
        self.groups.find(gates);
        for group in self.groups.iter() {
            match *group {
                [a] => self.choice[a as usize] = best_two(gates, a)[0].0,
                [a, b] => {
                    let (ca, cb) = pair_of_tracks(gates, a, b);
                    self.choice[a as usize] = ca;
                    self.choice[b as usize] = cb;
                }
                _ => self.solver.solve(gates, group, &mut self.choice),
            }
        }
    }
}

impl Associator for GlobalNearest {
    fn needs_likelihood(&self) -> bool {
        self.cost == CostKind::Likelihood
    }

    fn associate(&mut self, gates: &Gates, out: &mut Assignment) {
        if self.cost == CostKind::Likelihood {
            let mut table = std::mem::take(&mut self.by_likelihood);
            table.reset(gates.n_detections(), 1.0);
            for i in 0..gates.n_tracks() {
                let miss = gates.log_miss(i).max(-700.0);
                for p in gates.row(i) {
                    table.push(Pair { cost: -gates.log_weight(i, p), ..*p });
                }
                table.end_row(super::Prior { miss_cost: -miss, ..*gates.prior(i) });
            }
            self.solve(&table);
            self.by_likelihood = table;
        } else {
            self.solve(gates);
        }
        out.reset();
        for c in &self.choice {
            if *c != UNASSIGNED {
                out.push(*c, 1.0);
            }
            out.end_row();
        }
    }
}

/// The two cheapest ends of a track, a miss among them.
#[inline]
fn best_two(gates: &Gates, track: u32) -> [(u32, f64); 2] {
    let mut best = [(UNASSIGNED, gates.prior(track as usize).miss_cost), (UNASSIGNED, f64::INFINITY)];
    for p in gates.row(track as usize) {
        // `<=` only against a miss: a pair at the very edge of the gate is taken, ties between pairs go to the first.
        if p.cost < best[0].1 || (p.cost == best[0].1 && best[0].0 == UNASSIGNED) {
            best[1] = best[0];
            best[0] = (p.detection, p.cost);
        } else if p.cost < best[1].1 {
            best[1] = (p.detection, p.cost);
        }
    }
    best
}

/// Two tracks in closed form: if both want the same detection, the cheaper of the two ways to give in.
#[inline]
fn pair_of_tracks(gates: &Gates, a: u32, b: u32) -> (u32, u32) {
    let (best_a, best_b) = (best_two(gates, a), best_two(gates, b));
    if best_a[0].0 == UNASSIGNED || best_a[0].0 != best_b[0].0 {
        return (best_a[0].0, best_b[0].0);
    }
    if best_a[0].1 + best_b[1].1 <= best_a[1].1 + best_b[0].1 {
        (best_a[0].0, best_b[1].0)
    } else {
        (best_a[1].0, best_b[0].0)
    }
}
