//! A connected group of tracks in local numbers, as the sums over joint events read it.

use crate::associate::Gates;

/// One group in local numbers: rows with their weights, columns renumbered.
#[derive(Clone, Debug, Default)]
pub struct Problem {
    /// Weight of a miss of each row, scaled as its pairs.
    pub miss: Vec<f64>,
    /// Its logarithm, where the weight itself may be too small for f64.
    pub ln_miss: Vec<f64>,
    /// Start of each row's pairs, one more than rows.
    pub starts: Vec<usize>,
    /// Local column of each pair.
    pub column: Vec<u32>,
    /// Weight of each pair, scaled by row so that the largest of a row, the miss among them, is 1.
    pub weight: Vec<f64>,
    /// Its logarithm.
    pub ln_weight: Vec<f64>,
    /// Number of local columns.
    pub n_columns: usize,
    /// The answer: probability of each pair.
    pub probability: Vec<f64>,
}

impl Problem {
    /// Number of rows.
    pub fn n_rows(&self) -> usize {
        self.miss.len()
    }

    /// The pairs of a row, as places in `column`, `weight` and `probability`.
    pub fn row(&self, row: usize) -> std::ops::Range<usize> {
        self.starts[row]..self.starts[row + 1]
    }

    pub(super) fn load(&mut self, gates: &Gates, group: &[u32], local: &mut [u32]) {
        self.ln_miss.clear();
        self.starts.clear();
        self.starts.push(0);
        self.column.clear();
        self.ln_weight.clear();
        self.n_columns = 0;
        for row in group {
            for p in gates.row(*row as usize) {
                local[p.detection as usize] = u32::MAX;
            }
        }
        for row in group {
            let row = *row as usize;
            let miss = gates.log_miss(row);
            let from = self.ln_weight.len();
            let mut top = miss;
            for p in gates.row(row) {
                let w = gates.log_weight(row, p);
                top = top.max(w);
                let c = &mut local[p.detection as usize];
                if *c == u32::MAX {
                    *c = self.n_columns as u32;
                    self.n_columns += 1;
                }
                self.column.push(*c);
                self.ln_weight.push(w);
            }
            // A row that can neither be missed nor seen would leave no joint event at all: it counts as missed.
            let (miss, top) = if top.is_finite() { (miss, top) } else { (0.0, 0.0) };
            for w in &mut self.ln_weight[from..] {
                *w -= top;
            }
            self.ln_miss.push(miss - top);
            self.starts.push(self.ln_weight.len());
        }
        self.weight.clear();
        self.weight.extend(self.ln_weight.iter().map(|w| w.exp()));
        self.miss.clear();
        self.miss.extend(self.ln_miss.iter().map(|w| w.exp()));
        self.probability.clear();
        self.probability.resize(self.weight.len(), 0.0);
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use crate::associate::jpda::{exact, loopy, star};
    use crate::associate::{Pair, Prior};
    use proptest::prelude::*;
    use std::collections::{BTreeMap, BTreeSet};

    /// A joint event: ln of its weight and the pairs taken.
    type Event = (f64, Vec<usize>);

    /// Every joint event.
    fn events(p: &Problem) -> Vec<Event> {
        fn visit(p: &Problem, row: usize, used: u64, ln: f64, taken: &mut Vec<usize>, out: &mut Vec<Event>) {
            if row == p.n_rows() {
                out.push((ln, taken.clone()));
                return;
            }
            visit(p, row + 1, used, ln + p.ln_miss[row], taken, out);
            for k in p.row(row) {
                let bit = 1 << p.column[k];
                if used & bit == 0 {
                    taken.push(k);
                    visit(p, row + 1, used | bit, ln + p.ln_weight[k], taken, out);
                    taken.pop();
                }
            }
        }
        let mut out = Vec::new();
        visit(p, 0, 0, 0.0, &mut Vec::new(), &mut out);
        out
    }

    fn shares(p: &Problem, events: &[Event]) -> Vec<f64> {
        let top = events.iter().map(|e| e.0).fold(f64::NEG_INFINITY, f64::max);
        let total: f64 = events.iter().map(|e| (e.0 - top).exp()).sum();
        let of = |k: usize| events.iter().filter(|e| e.1.contains(&k)).map(|e| (e.0 - top).exp()).sum::<f64>() / total;
        (0..p.weight.len()).map(of).collect()
    }

    /// Pair probabilities by listing every joint event.
    pub(crate) fn brute_force(p: &Problem) -> Vec<f64> {
        shares(p, &events(p))
    }

    /// The same of the likeliest permutation of each set of tracks and each set of detections (JPDA*).
    fn brute_force_star(p: &Problem) -> Vec<f64> {
        let rows_of = |taken: &[usize]| taken.iter().map(|k| p.starts.partition_point(|s| s <= k)).collect::<Vec<_>>();
        let mut best = BTreeMap::<(Vec<usize>, BTreeSet<u32>), Event>::new();
        for e in events(p) {
            let key = (rows_of(&e.1), e.1.iter().map(|k| p.column[*k]).collect());
            let kept = best.entry(key).or_insert_with(|| e.clone());
            if e.0 > kept.0 {
                *kept = e;
            }
        }
        shares(p, &best.into_values().collect::<Vec<_>>())
    }

    pub(crate) fn problem(rows: &[(f64, Vec<(u32, f64)>)]) -> Problem {
        let mut p = Problem { starts: vec![0], ..Problem::default() };
        for (miss, pairs) in rows {
            p.miss.push(*miss);
            p.ln_miss.push(miss.ln());
            for (c, w) in pairs {
                p.column.push(*c);
                p.weight.push(*w);
                p.ln_weight.push(w.ln());
                p.n_columns = p.n_columns.max(*c as usize + 1);
            }
            p.starts.push(p.weight.len());
        }
        p.probability = vec![0.0; p.weight.len()];
        p
    }

    pub(crate) fn any_problem() -> impl Strategy<Value = Problem> {
        let row = (0.001..1.0f64, prop::collection::btree_map(0u32..5, 0.001..1.0f64, 0..5));
        prop::collection::vec(row, 1..6).prop_map(|rows| {
            let rows: Vec<_> = rows.into_iter().map(|(m, r)| (m, r.into_iter().collect())).collect();
            problem(&rows)
        })
    }

    /// A table of gates with clutter of this density; rows of log-likelihoods by detection.
    fn gates(density: f64, p_detection: f64, rows: &[BTreeMap<u32, f64>]) -> Gates {
        let mut gates = Gates::new();
        gates.reset(6, density);
        for row in rows {
            for (detection, log_likelihood) in row {
                gates.push(Pair { detection: *detection, cost: 1.0, log_likelihood: *log_likelihood });
            }
            gates.end_row(Prior { p_detection, p_gate: 0.99, existence: 1.0, miss_cost: 9.21 });
        }
        gates
    }

    proptest! {
        #[test]
        fn weights_are_those_of_the_listed_events_however_thin_the_clutter(
            rows in prop::collection::vec(prop::collection::btree_map(0u32..6, -20.0..20.0f64, 1..5), 1..6),
            exponent in 0..5usize,
            sure in proptest::bool::ANY,
        ) {
            // Density 0 is taken as 1e-200: two misses that a joint event forces already weigh less than the least f64.
            let table = gates([1.0, 1e-5, 1e-50, 1e-150, 0.0][exponent], if sure { 1.0 } else { 0.7 }, &rows);
            let all: Vec<u32> = (0..rows.len() as u32).collect();
            let mut p = Problem::default();
            p.load(&table, &all, &mut [u32::MAX; 6]);
            let (plain, star) = (brute_force(&p), brute_force_star(&p));
            prop_assert!(exact::Exact::default().solve(&mut p, 100_000));
            for (a, b) in p.probability.iter().zip(&plain) {
                prop_assert!((a - b).abs() < 1e-9, "{} instead of {}", a, b);
            }
            prop_assert!(star::Star::default().solve(&mut p, 100_000));
            for (a, b) in p.probability.iter().zip(&star) {
                prop_assert!((a - b).abs() < 1e-9, "JPDA*: {} instead of {}", a, b);
            }
            loopy::Loopy::default().solve(&mut p);
            for r in 0..p.n_rows() {
                let sum: f64 = p.row(r).map(|k| p.probability[k]).sum();
                prop_assert!((0.0..=1.0 + 1e-9).contains(&sum), "belief propagation: {}", sum);
            }
        }

        #[test]
        fn the_exact_sum_equals_the_list_of_all_joint_events(p in any_problem()) {
            let mut p = p;
            prop_assert!(exact::Exact::default().solve(&mut p, 100_000));
            for (a, b) in p.probability.iter().zip(brute_force(&p)) {
                prop_assert!((a - b).abs() < 1e-12, "{} instead of {}", a, b);
            }
        }

        #[test]
        fn belief_propagation_stays_near_the_exact_sum(p in any_problem()) {
            let mut p = p;
            loopy::Loopy::default().solve(&mut p);
            for r in 0..p.n_rows() {
                prop_assert!(p.row(r).map(|k| p.probability[k]).sum::<f64>() <= 1.0 + 1e-9);
            }
            for (a, b) in p.probability.iter().zip(brute_force(&p)) {
                prop_assert!((a - b).abs() < 0.25, "{} instead of {}", a, b);
            }
        }
    }

    #[test]
    fn belief_propagation_is_exact_on_a_tree() {
        let mut p = problem(&[(0.3, vec![(0, 1.0), (1, 0.5)]), (0.2, vec![(1, 0.7)]), (0.1, vec![(0, 0.4)])]);
        loopy::Loopy::default().solve(&mut p);
        for (a, b) in p.probability.iter().zip(brute_force(&p)) {
            assert!((a - b).abs() < 1e-9, "{a} instead of {b}");
        }
    }

    #[test]
    fn jpda_star_keeps_two_close_tracks_apart() {
        // Two tracks on either side of two detections: plain JPDA mixes nearly evenly, JPDA* keeps the better pairing.
        let rows = [(0.01, vec![(0, 1.0), (1, 0.8)]), (0.01, vec![(0, 0.8), (1, 1.0)])];
        let mut plain = problem(&rows);
        exact::Exact::default().solve(&mut plain, 1000);
        let mut star = problem(&rows);
        assert!(star::Star::default().solve(&mut star, 1000));
        assert!(plain.probability[0] < 0.62 && star.probability[0] > 0.95, "{plain:?} {star:?}");
    }
}
