//! JPDA weights by loopy belief propagation: bounded work for groups of any size.
//!
//! Source: J. L. Williams, R. Lau, "Approximate evaluation of marginal association probabilities with belief
//! propagation", IEEE Trans. AES 50, 2014, eqs 29-32: it converges from any start and is exact on trees.
//! Differs from it: each message sums what the others send; it is not the sum of all less the receiver's own part, in which
//! next to no clutter (a miss of weight 10⁻²⁰⁰) nothing but rounding would be left.
//! Symbols: ψ = w / w_miss; μ messages from tracks to detections, ν back.
//! Cost: O(pairs) an iteration, at most [`MOST_ITERATIONS`]. Limits: far from exact where tracks on a cycle of the gating
//! graph are more than the detections they compete for and none may be missed.

use super::problem::Problem;

/// Iterations before the answer is taken as it is.
pub const MOST_ITERATIONS: usize = 200;

/// Largest change of a message at which it has converged.
const CONVERGED: f64 = 1e-10;

/// Solves groups; keeps its memory.
#[derive(Clone, Debug, Default)]
pub struct Loopy {
    mu: Vec<f64>,
    nu: Vec<f64>,
    others: Vec<f64>,
    column_sum: Vec<f64>,
}

/// A miss that cannot be would make ψ infinite.
fn miss_of(p: &Problem, row: usize) -> f64 {
    p.miss[row].max(f64::MIN_POSITIVE)
}

impl Loopy {
    /// Fills the probabilities.
    pub fn solve(&mut self, p: &mut Problem) {
        let n = p.weight.len();
        self.nu.clear();
        self.nu.resize(n, 1.0);
        self.mu.clear();
        self.mu.resize(n, 0.0);
        self.others.clear();
        self.others.resize(n, 0.0);
        for _ in 0..MOST_ITERATIONS {
            for r in 0..p.n_rows() {
                // What lies before a pair in its row, then what lies behind it.
                let mut sum = miss_of(p, r);
                for k in p.row(r) {
                    self.others[k] = sum;
                    sum += p.weight[k] * self.nu[k];
                }
                sum = 0.0;
                for k in p.row(r).rev() {
                    self.mu[k] = p.weight[k] / (self.others[k] + sum);
                    sum += p.weight[k] * self.nu[k];
                }
            }
            self.column_sum.clear();
            self.column_sum.resize(p.n_columns, 0.0);
            for k in 0..n {
                let sum = &mut self.column_sum[p.column[k] as usize];
                self.others[k] = *sum;
                *sum += self.mu[k];
            }
            self.column_sum.fill(0.0);
            let mut change = 0f64;
            for k in (0..n).rev() {
                let sum = &mut self.column_sum[p.column[k] as usize];
                let new = 1.0 / (1.0 + (self.others[k] + *sum));
                *sum += self.mu[k];
                change = change.max((new - self.nu[k]).abs());
                self.nu[k] = new;
            }
            if change < CONVERGED {
                break;
            }
        }
        for r in 0..p.n_rows() {
            let total = miss_of(p, r) + p.row(r).map(|k| p.weight[k] * self.nu[k]).sum::<f64>();
            for k in p.row(r) {
                p.probability[k] = p.weight[k] * self.nu[k] / total;
            }
        }
    }
}
