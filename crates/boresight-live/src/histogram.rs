//! A histogram of times that never grows: buckets a fifth apart from 0.1 ms to about 70 s, and the quantiles they give.
//!
//! Why not `hdrhistogram`: one writer or a lock; here every thread adds without one, and the metrics read the same counts.

use std::sync::atomic::{AtomicU64, Ordering};

const N: usize = 75;
const FIRST_S: f64 = 1e-4;
const STEP: f64 = 1.2;

/// The histogram; every thread may add to it.
#[derive(Debug)]
pub struct Histogram {
    counts: [AtomicU64; N],
    sum_us: AtomicU64,
}

impl Default for Histogram {
    fn default() -> Self {
        Self { counts: std::array::from_fn(|_| AtomicU64::new(0)), sum_us: AtomicU64::new(0) }
    }
}

/// Upper edge of a bucket, s.
fn edge_s(k: usize) -> f64 {
    FIRST_S * STEP.powi(k as i32)
}

impl Histogram {
    /// Adds a time, s.
    pub fn add(&self, s: f64) {
        let k = ((s / FIRST_S).ln() / STEP.ln()).ceil().clamp(0.0, (N - 1) as f64) as usize;
        self.counts[k].fetch_add(1, Ordering::Relaxed);
        self.sum_us.fetch_add((s.max(0.0) * 1e6) as u64, Ordering::Relaxed);
    }

    /// Number of times.
    pub fn n(&self) -> u64 {
        self.counts.iter().map(|c| c.load(Ordering::Relaxed)).sum()
    }

    /// Their sum, s.
    pub fn sum_s(&self) -> f64 {
        self.sum_us.load(Ordering::Relaxed) as f64 * 1e-6
    }

    /// The upper edge of the bucket below which this share of the times lies, s: at most a fifth too large.
    pub fn quantile_s(&self, share: f64) -> Option<f64> {
        let n = self.n();
        let wanted = ((share * n as f64).ceil() as u64).max(1);
        let mut below = 0;
        (n > 0).then(|| {
            let k = self.counts.iter().position(|c| {
                below += c.load(Ordering::Relaxed);
                below >= wanted
            });
            edge_s(k.unwrap_or(N - 1))
        })
    }

    /// Number of times up to each of these edges, s, to a bucket's accuracy.
    pub fn cumulative(&self, edges_s: &[f64]) -> Vec<u64> {
        let up_to = |edge: f64| -> u64 {
            let inside = self.counts.iter().enumerate().filter(|(k, _)| edge_s(*k) <= edge * 1.000_001);
            inside.map(|(_, c)| c.load(Ordering::Relaxed)).sum()
        };
        edges_s.iter().map(|e| up_to(*e)).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_are_at_most_a_fifth_too_large() {
        let h = Histogram::default();
        (1..=1000).for_each(|k| h.add(1e-3 * f64::from(k)));
        for (share, truth) in [(0.5, 0.5), (0.99, 0.99), (0.001, 0.001)] {
            let q = h.quantile_s(share).unwrap();
            assert!(q >= truth * 0.999 && q <= truth * 1.21, "{share}: {q}");
        }
        h.add(f64::INFINITY);
        h.add(0.0);
        assert_eq!(h.n(), 1002);
        assert!(h.cumulative(&[0.01, 100.0]).is_sorted());
    }
}
