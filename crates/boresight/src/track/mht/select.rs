//! The best set of histories: at most one of each target, no detection of the window used twice, largest total score.
//!
//! Method: targets that compete for a detection, even through others, form a cluster (union-find over scan and
//! detection); within a cluster branch and bound, depth first, best leaf first, with the sum of the best scores still
//! open as the bound. A history of negative score is worse than none.
//! Limits: a budget of steps for each cluster; when it is spent the best set found so far stands (the first one is greedy,
//! so an answer is always there).

use super::hypothesis::{NONE, Tree, WINDOW};
use crate::union_find::{join, root};

/// Largest cluster that is searched (the search is as deep as the cluster is large).
const DEEPEST: usize = 500;

/// Selects; keeps its memory.
#[derive(Default)]
pub(super) struct Select {
    /// (age, detection, tree) of every leaf, for the clusters.
    claims: Vec<(u32, u32, u32)>,
    parent: Vec<u32>,
    members: Vec<(u32, u32)>,
    /// Detections used by the set under construction, by age.
    used: Vec<Vec<bool>>,
    picks: Vec<Option<usize>>,
    best: Vec<Option<usize>>,
    best_score: f64,
    steps: u32,
    bound: Vec<f64>,
}

impl Select {
    /// Marks the chosen leaf of every tree.
    pub fn choose(&mut self, trees: &mut [Tree], max_steps: u32) {
        self.claims.clear();
        for (t, tree) in trees.iter().enumerate() {
            for leaf in &tree.leaves {
                let taken = leaf.path.iter().enumerate().filter(|(_, d)| **d != NONE);
                self.claims.extend(taken.map(|(age, d)| (age as u32, *d, t as u32)));
            }
        }
        self.claims.sort_unstable();
        self.claims.dedup();
        self.parent.clear();
        self.parent.extend(0..trees.len() as u32);
        for pair in self.claims.windows(2) {
            if (pair[0].0, pair[0].1) == (pair[1].0, pair[1].1) {
                join(&mut self.parent, pair[0].2, pair[1].2);
            }
        }
        self.used.resize(WINDOW, Vec::new());
        for age in 0..WINDOW {
            let last = self.claims.iter().filter(|c| c.0 == age as u32).map(|c| c.1).max();
            self.used[age].clear();
            self.used[age].resize(last.map_or(0, |d| d as usize + 1), false);
        }
        self.members.clear();
        for t in 0..trees.len() as u32 {
            let r = root(&mut self.parent, t);
            self.members.push((r, t));
        }
        self.members.sort_unstable();
        let members = std::mem::take(&mut self.members);
        let mut from = 0;
        while from < members.len() {
            let to = from + members[from..].iter().take_while(|m| m.0 == members[from].0).count();
            self.cluster(trees, &members[from..to], max_steps);
            from = to;
        }
        self.members = members;
    }

    fn cluster(&mut self, trees: &mut [Tree], members: &[(u32, u32)], max_steps: u32) {
        let score = |t: u32| trees[t as usize].leaves[0].score;
        let mut order: Vec<u32> = members.iter().map(|m| m.1).collect();
        // Leaves are best first; strong targets decide first.
        order.sort_by(|a, b| score(*b).total_cmp(&score(*a)).then(a.cmp(b)));
        self.bound.clear();
        self.bound.resize(order.len() + 1, 0.0);
        for k in (0..order.len()).rev() {
            self.bound[k] = self.bound[k + 1] + score(order[k]).max(0.0);
        }
        self.picks.clear();
        self.best.clear();
        self.best.resize(order.len(), None);
        if order.len() > DEEPEST {
            self.greedy(trees, &order);
            return;
        }
        self.best_score = -1.0;
        self.steps = max_steps;
        self.descend(trees, &order, 0.0);
        for (t, pick) in order.iter().zip(&self.best) {
            trees[*t as usize].chosen = *pick;
        }
    }

    /// A cluster too large to search: each target takes its best leaf that is still open.
    fn greedy(&mut self, trees: &mut [Tree], order: &[u32]) {
        for t in order {
            let tree = &mut trees[*t as usize];
            let open = |path: &[u32; WINDOW]| {
                path.iter().enumerate().all(|(age, d)| *d == NONE || !self.used[age][*d as usize])
            };
            tree.chosen = tree.leaves.iter().position(|l| l.score > 0.0 && open(&l.path));
            if let Some(leaf) = tree.chosen.map(|c| &tree.leaves[c]) {
                for (age, d) in leaf.path.iter().enumerate().filter(|(_, d)| **d != NONE) {
                    self.used[age][*d as usize] = true;
                }
            }
        }
    }

    fn descend(&mut self, trees: &[Tree], order: &[u32], score: f64) {
        let depth = self.picks.len();
        if depth == order.len() {
            if score > self.best_score {
                self.best_score = score;
                self.best.clone_from(&self.picks);
            }
            return;
        }
        // The first descent is always finished.
        if self.best_score >= 0.0 && (self.steps == 0 || score + self.bound[depth] <= self.best_score) {
            return;
        }
        self.steps = self.steps.saturating_sub(1);
        let leaves = &trees[order[depth] as usize].leaves;
        for (k, leaf) in leaves.iter().enumerate() {
            if leaf.score <= 0.0 {
                break;
            }
            let taken = || leaf.path.iter().enumerate().filter(|(_, d)| **d != NONE);
            if taken().any(|(age, d)| self.used[age][*d as usize]) {
                continue;
            }
            for (age, d) in taken() {
                self.used[age][*d as usize] = true;
            }
            self.picks.push(Some(k));
            self.descend(trees, order, score + leaf.score);
            self.picks.pop();
            for (age, d) in taken() {
                self.used[age][*d as usize] = false;
            }
            if self.steps == 0 && self.best_score >= 0.0 {
                return;
            }
        }
        self.picks.push(None);
        self.descend(trees, order, score);
        self.picks.pop();
    }
}

#[cfg(test)]
mod tests {
    use super::super::hypothesis::Hypothesis;
    use super::*;
    use crate::Timestamp;
    use crate::track::scan_table::{Cov2, Predicted};
    use crate::track::single_track::{Outcome, Track};
    use crate::track::step::initiate::from_initial_tracks;
    use crate::track::{InitialTrackConfig, TrackerConfig};
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    fn track() -> Track {
        let config = TrackerConfig { initial_tracks: vec![InitialTrackConfig::default()], ..TrackerConfig::default() };
        let mut tracks = Vec::new();
        from_initial_tracks(&config, Timestamp::default(), &mut tracks, &mut 1).unwrap();
        tracks.remove(0)
    }

    /// Leaves of a target: score and the detections of the last two scans.
    type Leaves = Vec<(f64, [u32; 2])>;

    fn chosen(trees: &[Leaves], max_steps: u32) -> Vec<Option<usize>> {
        let track = track();
        let leaf = |&(score, [now, before]): &(f64, [u32; 2])| {
            let mut path = [NONE; WINDOW];
            (path[0], path[1]) = (now, before);
            let predicted = Predicted { x: 0.0, y: 0.0, cov: Cov2::default(), reach: 0.0 };
            Hypothesis { track: track.clone(), score, path, predicted, outcome: Outcome::default() }
        };
        let tree = |t: &Leaves| Tree { id: 0, leaves: t.iter().map(leaf).collect(), chosen: None, unchosen: 0 };
        let mut trees: Vec<Tree> = trees.iter().map(tree).collect();
        Select::default().choose(&mut trees, max_steps);
        trees.iter().map(|t| t.chosen).collect()
    }

    /// The total score of a choice, if no detection is used twice.
    fn total(trees: &[Leaves], choice: &[Option<usize>]) -> Option<f64> {
        let leaves: Vec<_> = trees.iter().zip(choice).filter_map(|(t, c)| Some(t[(*c)?])).collect();
        let mut used: Vec<(usize, u32)> = leaves.iter().flat_map(|l| l.1.into_iter().enumerate()).collect();
        used.retain(|u| u.1 != NONE);
        used.sort_unstable();
        used.windows(2).all(|w| w[0] != w[1]).then(|| leaves.iter().map(|l| l.0).sum())
    }

    #[test]
    fn the_best_target_gives_way_where_both_are_better_off_if_steps_are_left() {
        // 5 alone, or 4 + 4.5: the bound lets the search go on; without steps the first, greedy set stands.
        let trees = [vec![(5.0, [0, NONE]), (4.0, [1, NONE])], vec![(4.5, [0, NONE])]];
        assert_eq!(chosen(&trees, 1000), [Some(1), Some(0)]);
        assert_eq!(chosen(&trees, 0), [Some(0), None]);
    }

    #[test]
    fn no_set_of_compatible_histories_scores_more() {
        let mut rng = ChaCha8Rng::seed_from_u64(5);
        for case in 0..200 {
            let trees: Vec<Leaves> = (0..rng.random_range(1..6))
                .map(|_| {
                    let mut detection = || if rng.random::<f64>() < 0.2 { NONE } else { rng.random_range(0..4) };
                    let places: Vec<[u32; 2]> = (0..3).map(|_| [detection(), detection()]).collect();
                    let mut leaves: Leaves =
                        places.into_iter().map(|p| (f64::from(rng.random_range(-4..20)), p)).collect();
                    leaves.sort_by(|a, b| b.0.total_cmp(&a.0));
                    leaves
                })
                .collect();
            // Every choice there is: each target by one of three leaves or by none.
            let n = trees.len() as u32;
            let choice = |k: usize| -> Vec<Option<usize>> {
                (0..n).map(|t| Some(k / 4usize.pow(t) % 4).filter(|leaf| *leaf < 3)).collect()
            };
            let best = (0..4usize.pow(n)).filter_map(|k| total(&trees, &choice(k))).fold(0.0, f64::max);
            assert_eq!(total(&trees, &chosen(&trees, 100_000)), Some(best), "case {case}: {trees:?}");
        }
    }
}
