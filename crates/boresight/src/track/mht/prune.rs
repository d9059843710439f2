//! N-scan pruning: what disagrees with the answer `n_scan` scans back is cut, and targets that were not part of it for as long.

use super::hypothesis::{NONE, Tree};

/// Prunes the trees after a choice; the chosen leaf of a tree is then its first.
pub(super) fn prune(trees: &mut Vec<Tree>, n_scan: usize) {
    let n = n_scan;
    let mut settled: Vec<u32> = trees.iter().filter_map(|t| t.answer().map(|leaf| leaf.path[n])).collect();
    settled.retain(|d| *d != NONE);
    settled.sort_unstable();
    for tree in trees.iter_mut() {
        if let Some(chosen) = tree.chosen {
            // The chosen leaf goes first and stays, since it agrees with itself.
            tree.leaves.swap(0, chosen);
            let mine = tree.leaves[0].path[n];
            tree.leaves.retain(|l| l.path[n] == mine);
            tree.chosen = Some(0);
            tree.unchosen = 0;
        } else {
            tree.unchosen += 1;
            tree.leaves.retain(|l| l.path[n] == NONE || settled.binary_search(&l.path[n]).is_err());
        }
    }
    trees.retain(|t| !t.leaves.is_empty() && t.unchosen as usize <= n + 1);
}
