//! The linear programme of a group of pairs in trajectory GOSPA.
//!
//! Maximise Σ gain w − λ Σ |w(k) − w(k − 1)| over shares w ≥ 0 of each pair in each block of frames, where the shares of
//! a truth, and those of a result, sum to at most 1. A solution
//! that lies within 1e-6 of multiples of 1/6 is moved onto them, so that the usual sums are exact to the last digits.
//! Symbols: gain and λ in units of c^p.

use super::solver::{LinearProgramme, solve};
use crate::Result;

/// A pair in a block of frames.
#[derive(Clone, Copy, Debug)]
pub struct Share {
    /// Number of the pair in the group.
    pub pair: u32,
    /// Sum over the frames of 1 − (d/c)^p.
    pub gain: f64,
    /// Number of frames in which the pair is near.
    pub n: u32,
}

/// Pairs that share tracks, and the blocks of frames in which any of them is near.
#[derive(Clone, Debug, Default)]
pub struct Group {
    pairs: Vec<(u32, u32)>,
    blocks: Vec<Vec<Share>>,
    last_frame: Option<u32>,
}

/// What an optimal assignment of a group gives.
#[derive(Clone, Copy, Debug, Default)]
pub struct Solution {
    /// Σ w over near rows.
    pub rows: f64,
    /// Σ w gain.
    pub gain: f64,
    /// Σ |w(k) − w(k − 1)|.
    pub changes: f64,
}

impl Group {
    /// Adds a pair of tracks; its number in the group.
    pub fn add_pair(&mut self, truth: u32, result: u32) -> u32 {
        self.pairs.push((truth, result));
        self.pairs.len() as u32 - 1
    }

    /// Adds a near pair; frames ascend.
    pub fn add(&mut self, frame: u32, share: Share) {
        if self.last_frame == Some(frame) {
            if let Some(block) = self.blocks.last_mut() {
                block.push(share);
            }
            return;
        }
        self.merge_last();
        self.last_frame = Some(frame);
        self.blocks.push(vec![share]);
    }

    /// Two blocks with one and the same near pair are one: whichever of their shares is larger does for both.
    fn merge_last(&mut self) {
        if let [.., before, last] = &mut self.blocks[..]
            && let ([a], [b]) = (&mut before[..], &last[..])
            && a.pair == b.pair
        {
            *a = Share { pair: a.pair, gain: a.gain + b.gain, n: a.n + b.n };
            self.blocks.pop();
        }
    }

    /// Ends the group; the number of its unknown shares, 0 if it needs no programme.
    pub fn close(&mut self) -> usize {
        self.merge_last();
        if self.pairs.len() < 2 { 0 } else { self.pairs.len() * self.blocks.len() }
    }

    /// The best assignment.
    /// # Errors
    /// [`ErrorKind::Numeric`] if the solver does not finish.
    pub fn solve(&self, lambda: f64) -> Result<Solution> {
        // A pair without rivals is assigned throughout.
        let shares = if self.pairs.len() < 2 {
            vec![1.0; self.pairs.len() * self.blocks.len()]
        } else {
            snapped(self.shares(lambda)?)
        };
        let n = self.pairs.len();
        let mut s = Solution::default();
        for (k, block) in self.blocks.iter().enumerate() {
            for b in block {
                let w = shares[k * n + b.pair as usize];
                s.rows += w * f64::from(b.n);
                s.gain += w * b.gain;
            }
            if k > 0 {
                s.changes += (0..n).map(|p| (shares[k * n + p] - shares[(k - 1) * n + p]).abs()).sum::<f64>();
            }
        }
        Ok(s)
    }

    /// Truths and results that have several pairs: only their sums bound anything.
    fn sums(&self) -> Vec<Vec<usize>> {
        let mut sums: Vec<Vec<usize>> = Vec::new();
        for side in [|p: &(u32, u32)| p.0, |p: &(u32, u32)| p.1] {
            let mut order: Vec<usize> = (0..self.pairs.len()).collect();
            order.sort_by_key(|&k| side(&self.pairs[k]));
            let chunks = order.chunk_by(|&a, &b| side(&self.pairs[a]) == side(&self.pairs[b]));
            sums.extend(chunks.filter(|c| c.len() > 1).map(<[usize]>::to_vec));
        }
        sums
    }

    fn shares(&self, lambda: f64) -> Result<Vec<f64>> {
        let (n, k) = (self.pairs.len(), self.blocks.len());
        let (sums, n_w, n_u) = (self.sums(), n * k, n * (k - 1));
        // Unknowns: w by block and pair, then u ≥ |change| by block from the second on.
        // Rows: −w ≤ 0; sums ≤ 1; w(k) − w(k − 1) − u ≤ 0 and its mirror image.
        let (row_sum, row_change) = (n_w, n_w + sums.len() * k);
        let n_rows = row_change + 2 * n_u;
        let mut in_sums: Vec<Vec<usize>> = vec![Vec::new(); n];
        for (s, members) in sums.iter().enumerate() {
            members.iter().for_each(|&p| in_sums[p].push(s));
        }
        let (mut starts, mut rows, mut values) = (vec![0], Vec::new(), Vec::new());
        for block in 0..k {
            for p in 0..n {
                let w = block * n + p;
                rows.push(w);
                values.push(-1.0);
                for s in &in_sums[p] {
                    rows.push(row_sum + block * sums.len() + s);
                    values.push(1.0);
                }
                // This share as the later one of a change, then as the earlier one.
                for (later, sign) in [(block, 1.0), (block + 1, -1.0)] {
                    if later > 0 && later < k {
                        let at = row_change + 2 * ((later - 1) * n + p);
                        rows.extend([at, at + 1]);
                        values.extend([sign, -sign]);
                    }
                }
                starts.push(rows.len());
            }
        }
        for u in 0..n_u {
            rows.extend([row_change + 2 * u, row_change + 2 * u + 1]);
            values.extend([-1.0, -1.0]);
            starts.push(rows.len());
        }
        let mut cost = vec![0.0; n_w];
        for (block, shares) in self.blocks.iter().enumerate() {
            shares.iter().for_each(|s| cost[block * n + s.pair as usize] -= s.gain);
        }
        cost.resize(n_w + n_u, lambda);
        let mut bound = vec![0.0; n_rows];
        bound[row_sum..row_change].fill(1.0);
        let mut x = solve(LinearProgramme { cost, starts, rows, values, bound })?;
        x.truncate(n_w);
        Ok(x)
    }
}

/// Moves shares onto multiples of 1/6 if all of them lie near one.
fn snapped(mut shares: Vec<f64>) -> Vec<f64> {
    let near = |w: f64| (6.0 * w).round() / 6.0;
    if shares.iter().all(|&w| (w - near(w)).abs() < 1e-6) {
        shares.iter_mut().for_each(|w| *w = near(*w));
    } else {
        shares.iter_mut().for_each(|w| *w = w.clamp(0.0, 1.0));
    }
    shares
}
