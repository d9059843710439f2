//! What every associator owes on any table of gates.

use super::associators;
use boresight::associate::{Assignment, AssociatorConfig, Gates, Pair, Prior};
use proptest::prelude::*;

/// A random table: for each track its miss cost and the costs of its gated detections.
type Rows = Vec<(f64, Vec<(u32, f64)>)>;

const N_DETECTIONS: u32 = 7;

fn rows() -> impl Strategy<Value = Rows> {
    let pairs = prop::collection::btree_map(0..N_DETECTIONS, 0.0..9.0f64, 0..6);
    prop::collection::vec((1.0..12.0f64, pairs.prop_map(|m| m.into_iter().collect())), 0..7)
}

fn gates(rows: &Rows, existence: f64) -> Gates {
    let mut gates = Gates::new();
    gates.reset(N_DETECTIONS as usize, 1e-3);
    for (miss_cost, pairs) in rows {
        for (detection, cost) in pairs {
            gates.push(Pair { detection: *detection, cost: *cost, log_likelihood: -0.5 * cost - 2.0 });
        }
        gates.end_row(Prior { p_detection: 0.9, p_gate: 0.99, existence, miss_cost: *miss_cost });
    }
    gates
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]

    #[test]
    fn no_detection_is_used_twice_and_no_row_weighs_more_than_one(rows in rows(), existence in 0.01..1.0f64) {
        let gates = gates(&rows, existence);
        for config in associators() {
            let mut answer = Assignment::new();
            config.build().associate(&gates, &mut answer);
            prop_assert_eq!(answer.n_tracks(), rows.len());
            let mut taken = [0.0; N_DETECTIONS as usize];
            for (i, row) in rows.iter().enumerate() {
                let shares = answer.row(i);
                let total: f64 = shares.iter().map(|s| s.weight).sum();
                prop_assert!((0.0..=1.0 + 1e-9).contains(&total), "{:?}: row {} weighs {}", config, i, total);
                for s in shares {
                    prop_assert!((0.0..=1.0).contains(&s.weight));
                    prop_assert!(row.1.iter().any(|p| p.0 == s.detection), "{:?} leaves the gate", config);
                    taken[s.detection as usize] += s.weight;
                }
                prop_assert!(config.is_soft() || shares.len() <= 1);
            }
            // PDA looks at each track alone; all others give a detection away once. Belief propagation bounds rows only.
            let bounded = match &config {
                AssociatorConfig::Pda(_) => false,
                AssociatorConfig::Jpda(c) => c.max_states > 1,
                _ => true,
            };
            if bounded {
                for (j, t) in taken.iter().enumerate() {
                    prop_assert!(*t <= 1.0 + 1e-9, "{:?}: detection {} is used {} times", config, j, t);
                }
            }
        }
    }

    #[test]
    fn permuting_the_detections_permutes_the_answer(
        rows in rows(),
        order in Just((0..N_DETECTIONS).collect::<Vec<u32>>()).prop_shuffle(),
    ) {
        let renumbered: Rows = rows
            .iter()
            .map(|(miss, pairs)| {
                let mut pairs: Vec<_> = pairs.iter().map(|(j, c)| (order[*j as usize], *c)).collect();
                pairs.sort_by_key(|p| p.0);
                (*miss, pairs)
            })
            .collect();
        let (plain, other) = (gates(&rows, 0.9), gates(&renumbered, 0.9));
        for config in associators() {
            let (mut a, mut b) = (Assignment::new(), Assignment::new());
            config.build().associate(&plain, &mut a);
            config.build().associate(&other, &mut b);
            for i in 0..rows.len() {
                let mut moved: Vec<(u32, f64)> =
                    a.row(i).iter().map(|s| (order[s.detection as usize], s.weight)).collect();
                moved.sort_by_key(|s| s.0);
                let answer: Vec<(u32, f64)> = b.row(i).iter().map(|s| (s.detection, s.weight)).collect();
                prop_assert_eq!(moved.len(), answer.len(), "{:?}", config);
                for (x, y) in moved.iter().zip(&answer) {
                    // Belief propagation stops when it has converged, not at the last bit.
                    prop_assert!(x.0 == y.0 && (x.1 - y.1).abs() < 1e-6, "{:?}: {:?} {:?}", config, x, y);
                }
            }
        }
    }
}
