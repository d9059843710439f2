//! Exact JPDA weights by dynamic programming over the contested detections.
//!
//! Method: rows are taken in order; a state is the set of used detections that later rows can still want, so detections
//! that only one row gates, and those already passed, need no bit. Forward sums f and backward sums b over the states give
//! P(row t takes j) ∝ Σ f_t(s) w_tj b_{t+1}(s ∪ j). The same numbers as listing all events, without the factorial.
//! Limits: at most 128 contested detections and `max_states` states a row; else `false` is returned.

use super::Problem;

/// Solves groups; keeps its memory.
#[derive(Clone, Debug, Default)]
pub struct Exact {
    last_row: Vec<u32>,
    n_rows_of: Vec<u32>,
    bit: Vec<u8>,
    levels: Vec<Vec<(u128, f64)>>,
    backward: [Vec<f64>; 2],
    next: Vec<(u128, f64)>,
}

impl Exact {
    /// Fills the probabilities, or returns `false` if the group is too large.
    pub fn solve(&mut self, p: &mut Problem, max_states: usize) -> bool {
        let n = p.n_rows();
        self.last_row.clear();
        self.last_row.resize(p.n_columns, 0);
        self.n_rows_of.clear();
        self.n_rows_of.resize(p.n_columns, 0);
        for r in 0..n {
            for k in p.row(r) {
                self.last_row[p.column[k] as usize] = r as u32;
                self.n_rows_of[p.column[k] as usize] += 1;
            }
        }
        self.bit.clear();
        self.bit.resize(p.n_columns, u8::MAX);
        let mut n_bits = 0;
        for c in 0..p.n_columns {
            if self.n_rows_of[c] > 1 {
                if n_bits == 128 {
                    return false;
                }
                self.bit[c] = n_bits;
                n_bits += 1;
            }
        }
        if self.levels.len() < n + 1 {
            self.levels.resize(n + 1, Vec::new());
        }
        self.levels[0].clear();
        self.levels[0].push((0, 1.0));
        for r in 0..n {
            let keep = kept_after(&self.bit, &self.last_row, r);
            self.next.clear();
            for (mask, f) in &self.levels[r] {
                self.next.push((mask & keep, f * p.miss[r]));
                for k in p.row(r) {
                    let bit = bit_of(&self.bit, p.column[k]);
                    if mask & bit == 0 {
                        self.next.push(((mask | bit) & keep, f * p.weight[k]));
                    }
                }
                if self.next.len() > 64 * max_states.max(16) {
                    return false;
                }
            }
            self.next.sort_by_key(|s| s.0);
            let level = &mut self.levels[r + 1];
            level.clear();
            for (mask, f) in &self.next {
                match level.last_mut() {
                    Some(last) if last.0 == *mask => last.1 += f,
                    _ => level.push((*mask, *f)),
                }
            }
            if level.len() > max_states {
                return false;
            }
            let total: f64 = level.iter().map(|s| s.1).sum();
            // Not a number either: weights that cannot be summed.
            if !(total > 0.0 && total.is_finite()) {
                return false;
            }
            for s in level {
                s.1 /= total;
            }
        }
        let [b, b_next] = &mut self.backward;
        b_next.clear();
        b_next.resize(self.levels[n].len(), 1.0);
        for r in (0..n).rev() {
            let keep = kept_after(&self.bit, &self.last_row, r);
            let after = &self.levels[r + 1];
            let at = |mask: u128| after.binary_search_by_key(&mask, |s| s.0).unwrap_or(0);
            b.clear();
            let mut total = 0.0;
            for k in p.row(r) {
                p.probability[k] = 0.0;
            }
            for (mask, f) in &self.levels[r] {
                let mut sum = p.miss[r] * b_next[at(mask & keep)];
                for k in p.row(r) {
                    let bit = bit_of(&self.bit, p.column[k]);
                    if mask & bit == 0 {
                        let part = p.weight[k] * b_next[at((mask | bit) & keep)];
                        p.probability[k] += f * part;
                        sum += part;
                    }
                }
                total += f * sum;
                b.push(sum);
            }
            for k in p.row(r) {
                p.probability[k] /= total;
            }
            // Only ratios matter: scaled, so that long groups do not run out of range.
            let top = b.iter().copied().fold(0.0, f64::max);
            for v in b.iter_mut() {
                *v /= top;
            }
            std::mem::swap(b, b_next);
        }
        true
    }
}

fn bit_of(bits: &[u8], column: u32) -> u128 {
    match bits[column as usize] {
        u8::MAX => 0,
        b => 1 << b,
    }
}

/// The bits of the detections that rows after `row` can still want.
fn kept_after(bits: &[u8], last_row: &[u32], row: usize) -> u128 {
    let wanted = bits.iter().zip(last_row).filter(|(b, last)| **b != u8::MAX && **last as usize > row);
    wanted.fold(0, |mask, (b, _)| mask | 1 << *b)
}
