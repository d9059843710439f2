//! Exact JPDA weights by dynamic programming over the contested detections.
//!
//! Method: rows are taken in order; a state is the set of used detections that later rows can still want, so detections
//! that only one row gates, and those already passed, need no bit. Forward sums f and backward sums b over the states give
//! P(row t takes j) ∝ Σ f_t(s) w_tj b_{t+1}(s ∪ j). The same numbers as listing all events, without the factorial.
//! Sums are plain while even the event in which all are missed stays within the range of f64; else (next to no clutter,
//! where each miss that a joint event forces weighs 10⁻²⁰⁰) they are logarithms: dearer, but nothing is lost.
//! Limits: at most 128 contested detections and `max_states` states a row; else `false` is returned.

use super::problem::Problem;

/// ln of the least share of the joint weight that plain sums keep: 10⁻²⁶⁰, far from the least f64.
const LEAST_LN: f64 = -600.0;

/// Solves groups; keeps its memory.
#[derive(Clone, Debug, Default)]
pub struct Exact {
    states: States,
    plain: Sums<Plain>,
    logarithmic: Sums<Logarithm>,
}

impl Exact {
    /// Fills the probabilities, or returns `false` if the group is too large.
    pub fn solve(&mut self, p: &mut Problem, max_states: usize) -> bool {
        if !self.states.plan(p) {
            return false;
        }
        // A sum of up to Π (1 + pairs) events, none lighter than the one in which all are missed.
        let least: f64 = (0..p.n_rows()).map(|r| p.ln_miss[r] - (1.0 + p.row(r).len() as f64).ln()).sum();
        if least > LEAST_LN {
            self.plain.solve(p, &self.states, max_states)
        } else {
            self.logarithmic.solve(p, &self.states, max_states)
        }
    }
}

/// Which detections are contested, and until which row.
#[derive(Clone, Debug, Default)]
struct States {
    last_row: Vec<u32>,
    n_rows_of: Vec<u32>,
    bit: Vec<u8>,
}

impl States {
    fn plan(&mut self, p: &Problem) -> bool {
        self.last_row.clear();
        self.last_row.resize(p.n_columns, 0);
        self.n_rows_of.clear();
        self.n_rows_of.resize(p.n_columns, 0);
        for r in 0..p.n_rows() {
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
        true
    }

    fn bit_of(&self, column: u32) -> u128 {
        match self.bit[column as usize] {
            u8::MAX => 0,
            b => 1 << b,
        }
    }

    /// The bits of the detections that rows after `row` can still want.
    fn kept_after(&self, row: usize) -> u128 {
        let all = self.bit.iter().zip(&self.last_row);
        let wanted = all.filter(|(b, last)| **b != u8::MAX && **last as usize > row);
        wanted.fold(0, |mask, (b, _)| mask | 1 << *b)
    }
}

/// A weight that can be added and multiplied, in one of two notations.
trait Weight: Copy {
    const NONE: Self;
    const ONE: Self;
    fn of_miss(p: &Problem, row: usize) -> Self;
    fn of_pair(p: &Problem, k: usize) -> Self;
    fn times(self, other: Self) -> Self;
    fn plus(self, other: Self) -> Self;
    /// Its share of a total that is above zero.
    fn share_of(self, total: Self) -> f64;
    fn is_positive(self) -> bool;
}

/// The weight itself.
#[derive(Clone, Copy, Debug)]
struct Plain(f64);

impl Weight for Plain {
    const NONE: Self = Self(0.0);
    const ONE: Self = Self(1.0);
    fn of_miss(p: &Problem, row: usize) -> Self {
        Self(p.miss[row])
    }
    fn of_pair(p: &Problem, k: usize) -> Self {
        Self(p.weight[k])
    }
    fn times(self, other: Self) -> Self {
        Self(self.0 * other.0)
    }
    fn plus(self, other: Self) -> Self {
        Self(self.0 + other.0)
    }
    fn share_of(self, total: Self) -> f64 {
        self.0 / total.0
    }
    fn is_positive(self) -> bool {
        self.0 > 0.0
    }
}

/// Its natural logarithm.
#[derive(Clone, Copy, Debug)]
struct Logarithm(f64);

impl Weight for Logarithm {
    const NONE: Self = Self(f64::NEG_INFINITY);
    const ONE: Self = Self(0.0);
    fn of_miss(p: &Problem, row: usize) -> Self {
        Self(p.ln_miss[row])
    }
    fn of_pair(p: &Problem, k: usize) -> Self {
        Self(p.ln_weight[k])
    }
    fn times(self, other: Self) -> Self {
        Self(self.0 + other.0)
    }
    fn plus(self, other: Self) -> Self {
        let (high, low) = if self.0 >= other.0 { (self.0, other.0) } else { (other.0, self.0) };
        if low == f64::NEG_INFINITY { Self(high) } else { Self(high + (low - high).exp().ln_1p()) }
    }
    fn share_of(self, total: Self) -> f64 {
        (self.0 - total.0).exp()
    }
    fn is_positive(self) -> bool {
        self.0 > f64::NEG_INFINITY
    }
}

/// Forward and backward sums.
#[derive(Clone, Debug)]
struct Sums<W> {
    levels: Vec<Vec<(u128, W)>>,
    backward: [Vec<W>; 2],
    next: Vec<(u128, W)>,
    taken: Vec<W>,
}

impl<W> Default for Sums<W> {
    fn default() -> Self {
        Self { levels: Vec::new(), backward: [Vec::new(), Vec::new()], next: Vec::new(), taken: Vec::new() }
    }
}

impl<W: Weight> Sums<W> {
    fn solve(&mut self, p: &mut Problem, states: &States, max_states: usize) -> bool {
        let n = p.n_rows();
        if self.levels.len() < n + 1 {
            self.levels.resize_with(n + 1, Vec::new);
        }
        self.levels[0].clear();
        self.levels[0].push((0, W::ONE));
        for r in 0..n {
            let keep = states.kept_after(r);
            self.next.clear();
            for (mask, f) in &self.levels[r] {
                self.next.push((mask & keep, f.times(W::of_miss(p, r))));
                for k in p.row(r) {
                    let bit = states.bit_of(p.column[k]);
                    if mask & bit == 0 {
                        self.next.push(((mask | bit) & keep, f.times(W::of_pair(p, k))));
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
                    Some(last) if last.0 == *mask => last.1 = last.1.plus(*f),
                    _ => level.push((*mask, *f)),
                }
            }
            if level.len() > max_states {
                return false;
            }
        }
        let [b, b_next] = &mut self.backward;
        b_next.clear();
        b_next.resize(self.levels[n].len(), W::ONE);
        for r in (0..n).rev() {
            let keep = states.kept_after(r);
            let after = &self.levels[r + 1];
            let at = |mask: u128| after.binary_search_by_key(&mask, |s| s.0).unwrap_or(0);
            b.clear();
            let mut total = W::NONE;
            self.taken.clear();
            self.taken.resize(p.row(r).len(), W::NONE);
            for (mask, f) in &self.levels[r] {
                let mut sum = W::of_miss(p, r).times(b_next[at(mask & keep)]);
                for (k, taken) in p.row(r).zip(&mut self.taken) {
                    let bit = states.bit_of(p.column[k]);
                    if mask & bit == 0 {
                        let part = W::of_pair(p, k).times(b_next[at((mask | bit) & keep)]);
                        *taken = taken.plus(f.times(part));
                        sum = sum.plus(part);
                    }
                }
                total = total.plus(f.times(sum));
                b.push(sum);
            }
            if !total.is_positive() {
                return false;
            }
            for (k, taken) in p.row(r).zip(&self.taken) {
                p.probability[k] = taken.share_of(total);
            }
            std::mem::swap(b, b_next);
        }
        true
    }
}
