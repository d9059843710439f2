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
