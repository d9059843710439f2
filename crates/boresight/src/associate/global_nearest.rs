//! Global nearest neighbour: the one-to-one pairing of least total cost, exact, group by group.
//!
//! Source: `docs/theory/association.md`: minimise Σ d² over paired + γ (number of unpaired tracks), pairs only with
//! d² ≤ γ.
//! Method: connected groups are solved apart; one track, two tracks and one contested detection in closed form, the rest
//! by shortest augmenting paths on the sparse graph ([`super::assignment::sparse`]).
//! Limits: a group so dense that its exact solution would need more than about 10⁹ steps (10⁵ detections in a few pixels)
//! is finished greedily; every ordinary scan is exact.

use super::assignment::group_wise::GroupWise;
use super::assignment::table::{SparseTable, UNASSIGNED};
use super::{Assignment, Associator, Gates};
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

/// A certain detection makes a miss impossible: its cost stays finite.
const LEAST_LOG_MISS: f64 = -700.0;

/// The global-nearest-neighbour associator.
#[derive(Clone, Debug, Default)]
pub struct GlobalNearest {
    cost: CostKind,
    solver: GroupWise,
    /// The same table with likelihood costs, when asked for.
    by_likelihood: SparseTable,
}

impl GlobalNearest {
    /// Builds the associator.
    pub fn new(config: &GlobalNearestConfig) -> Self {
        Self { cost: config.cost, ..Self::default() }
    }
}

impl Associator for GlobalNearest {
    fn needs_likelihood(&self) -> bool {
        self.cost == CostKind::Likelihood
    }

    fn associate(&mut self, gates: &Gates, out: &mut Assignment) {
        let choice = if self.cost == CostKind::Likelihood {
            let table = &mut self.by_likelihood;
            table.reset(gates.n_detections());
            for i in 0..gates.n_tracks() {
                for p in gates.row(i) {
                    table.push(p.detection, -gates.log_weight(i, p));
                }
                table.end_row(-gates.log_miss(i).max(LEAST_LOG_MISS));
            }
            self.solver.solve(table)
        } else {
            self.solver.solve(gates)
        };
        out.reset();
        for c in choice {
            if *c != UNASSIGNED {
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

    fn chosen(cost: CostKind, density: f64, p_detection: f64, rows: &[&[(u32, f64, f64)]]) -> Vec<Option<u32>> {
        let mut gates = Gates::new();
        gates.reset(4, density);
        for row in rows {
            for &(detection, cost, log_likelihood) in *row {
                gates.push(Pair { detection, cost, log_likelihood });
            }
            gates.end_row(Prior { p_detection, p_gate: 0.99, existence: 1.0, miss_cost: 9.0 });
        }
        let mut answer = Assignment::new();
        let mut solver = GlobalNearest::new(&GlobalNearestConfig { cost });
        assert_eq!(solver.needs_likelihood(), cost == CostKind::Likelihood);
        solver.associate(&gates, &mut answer);
        (0..rows.len()).map(|i| answer.row(i).first().map(|s| s.detection)).collect()
    }

    #[test]
    fn at_equal_distance_the_likelihood_decides_for_the_sharp_track() {
        // Both want detection 0; the second row is the sharper one.
        let rows: [&[(u32, f64, f64)]; 2] = [&[(0, 1.0, -6.0)], &[(0, 1.0, -2.0)]];
        assert_eq!(chosen(CostKind::Distance, 1e-6, 0.9, &rows), [Some(0), None]);
        assert_eq!(chosen(CostKind::Likelihood, 1e-6, 0.9, &rows), [None, Some(0)]);
    }

    #[test]
    fn a_pair_less_likely_than_clutter_is_left_unless_the_target_is_surely_detected() {
        // ln(P_D l / λ) = ln 0.9 − 8 + ln 10; a miss ln(1 − 0.891) = −2.2 is likelier.
        let rows: [&[(u32, f64, f64)]; 1] = [&[(0, 1.0, -8.0)]];
        assert_eq!(chosen(CostKind::Likelihood, 0.1, 0.9, &rows), [None]);
        // Surely detected, it could only lie outside of the gate: −ln 0.01 = 4.6 against 4.2.
        let sure: [&[(u32, f64, f64)]; 1] = [&[(0, 1.0, -6.5)]];
        assert_eq!(chosen(CostKind::Likelihood, 0.1, 0.9, &sure), [None]);
        assert_eq!(chosen(CostKind::Likelihood, 0.1, 1.0, &sure), [Some(0)]);
    }
}
