//! JPDA weights by loopy belief propagation: bounded work for groups of any size.
//!
//! Source: J. L. Williams, R. Lau, "Approximate evaluation of marginal association probabilities with belief
//! propagation", IEEE Trans. AES 50, 2014, eqs 29-32: it converges from any start and is exact on trees.
//! Symbols: ψ = w / w_miss; μ messages from tracks to detections, ν back.
//! Cost: O(pairs) an iteration, at most [`MOST_ITERATIONS`].

use super::Problem;

/// Iterations before the answer is taken as it is.
pub const MOST_ITERATIONS: usize = 200;

/// Largest change of a message at which it has converged.
const CONVERGED: f64 = 1e-10;

/// Solves groups; keeps its memory.
#[derive(Clone, Debug, Default)]
pub struct Loopy {
    mu: Vec<f64>,
    nu: Vec<f64>,
    column_sum: Vec<f64>,
}

impl Loopy {
    /// Fills the probabilities.
    pub fn solve(&mut self, p: &mut Problem) {
        let n = p.weight.len();
        self.nu.clear();
        self.nu.resize(n, 1.0);
        self.mu.clear();
        self.mu.resize(n, 0.0);
        for _ in 0..MOST_ITERATIONS {
            self.column_sum.clear();
            self.column_sum.resize(p.n_columns, 0.0);
            for r in 0..p.n_rows() {
                // A miss that cannot be would make ψ infinite.
                let miss = p.miss[r].max(1e-12);
                let total: f64 = miss + p.row(r).map(|k| p.weight[k] * self.nu[k]).sum::<f64>();
                for k in p.row(r) {
                    self.mu[k] = p.weight[k] / (total - p.weight[k] * self.nu[k]).max(1e-12);
                    self.column_sum[p.column[k] as usize] += self.mu[k];
                }
            }
            let mut change = 0f64;
            for k in 0..n {
                let new = 1.0 / (1.0 + (self.column_sum[p.column[k] as usize] - self.mu[k]).max(0.0));
                change = change.max((new - self.nu[k]).abs());
                self.nu[k] = new;
            }
            if change < CONVERGED {
                break;
            }
        }
        for r in 0..p.n_rows() {
            let total = p.miss[r].max(1e-12) + p.row(r).map(|k| p.weight[k] * self.nu[k]).sum::<f64>();
            for k in p.row(r) {
                p.probability[k] = p.weight[k] * self.nu[k] / total;
            }
        }
    }
}
