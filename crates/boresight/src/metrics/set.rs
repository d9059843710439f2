//! Distances between two sets of points: OSPA and GOSPA, the latter with its parts.
//!
//! Sources: D. Schuhmacher, B.-T. Vo, B.-N. Vo, *A consistent metric for performance evaluation of multi-object filters*,
//! IEEE Trans. Signal Processing 56(8), 2008; A. Rahmathullah, A. García-Fernández, L. Svensson, *Generalized optimal
//! sub-pattern assignment metric*, FUSION 2017 (α = 2: missed and false points cost c^p / 2 each).
//! Both are maximum-weight matchings with the gain c^p − d^p of each pair nearer than c, so only near pairs are looked at.
//! Symbols: c cutoff, px; p order, ≥ 1; d distance, px; n the larger number of points.
//! Departure: Stone Soup assigns OSPA by the plain distances even where p > 1 and then adds their powers; that is
//! [`OspaAssignment::FirstPower`], and [`OspaAssignment::OrderP`], the definition, is the default. Both agree for p = 1.
//! Limits: finite p.

use crate::associate::assignment::matching::{Matcher, WeightedPair};
use crate::{Error, ErrorKind, Result};
use serde::Serialize;

/// Cutoff and order of a set distance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SetOptions {
    /// Distance from which two points have nothing to do with each other, px, above 0.
    pub cutoff_px: f64,
    /// Order p ≥ 1: larger orders punish outliers more.
    pub order: f64,
    /// What the assignment of OSPA minimises.
    pub assignment: OspaAssignment,
}

impl Default for SetOptions {
    fn default() -> Self {
        Self { cutoff_px: 10.0, order: 2.0, assignment: OspaAssignment::OrderP }
    }
}

/// What the assignment of OSPA minimises.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum OspaAssignment {
    /// The sum of the p-th powers, as defined.
    #[default]
    OrderP,
    /// The sum of the distances, as Stone Soup does.
    FirstPower,
}

impl SetOptions {
    /// # Errors
    /// A cutoff not above 0, an order below 1.
    pub fn validate(&self, at: &str) -> Result<()> {
        if !(self.cutoff_px > 0.0 && self.cutoff_px.is_finite()) {
            return Err(Error::new(ErrorKind::Config, "expected a distance above 0 px")
                .at(format!("{at}.cutoff-px = {}", self.cutoff_px))
                .hint("about three times the error you expect of a good track"));
        }
        if !(self.order >= 1.0 && self.order.is_finite()) {
            return Err(Error::new(ErrorKind::Config, "expected a finite order of at least 1")
                .at(format!("{at}.order = {}", self.order))
                .hint("2 is the usual one"));
        }
        Ok(())
    }
}

/// GOSPA and its parts.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Gospa {
    /// The distance: (localisation + missed + false)^(1/p), px.
    pub distance: f64,
    /// Sum of d^p of the matched pairs, px^p.
    pub localisation: f64,
    /// c^p / 2 for each missed truth, px^p.
    pub missed: f64,
    /// c^p / 2 for each false result, px^p.
    pub false_: f64,
    /// Number of missed truths.
    pub n_missed: u64,
    /// Number of false results.
    pub n_false: u64,
}

/// Computes set distances; keeps its memory between scans.
#[derive(Debug, Default)]
pub struct SetDistance {
    order: Vec<(f64, f64, u32)>,
    pairs: Vec<WeightedPair>,
    distance2: Vec<f64>,
    matcher: Matcher,
    taken: Vec<u32>,
}

fn power(d2: f64, p: f64) -> f64 {
    if p == 2.0 {
        d2
    } else if p == 1.0 {
        d2.sqrt()
    } else {
        d2.sqrt().powf(p)
    }
}

impl SetDistance {
    /// Matches points nearer than the cutoff so that Σ (c^q − d^q) is greatest; afterwards `taken` lists the pairs, whose
    /// columns are places in the order of x. False if other matchings are as good.
    fn assign(&mut self, truth: &[[f64; 2]], result: &[[f64; 2]], c: f64, q: f64) -> bool {
        self.order.clear();
        self.order.extend(result.iter().enumerate().map(|(j, p)| (p[0], p[1], j as u32)));
        self.order.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.2.cmp(&b.2)));
        self.pairs.clear();
        self.distance2.clear();
        let (c2, top) = (c * c, power(c * c, q));
        for (i, t) in truth.iter().enumerate() {
            let begin = self.order.partition_point(|o| o.0 <= t[0] - c);
            for (at, &(x, y, _)) in self.order.iter().enumerate().skip(begin) {
                if x >= t[0] + c {
                    break;
                }
                let (dx, dy) = (t[0] - x, t[1] - y);
                let d2 = dx * dx + dy * dy;
                if d2 < c2 {
                    let weight = top - power(d2, q);
                    if weight > 0.0 {
                        self.pairs.push(WeightedPair { row: i as u32, column: at as u32, weight });
                        self.distance2.push(d2);
                    }
                }
            }
        }
        self.matcher.solve_unique(truth.len(), result.len(), &self.pairs, &mut self.taken)
    }

    /// The pairs (truth, result) matched last.
    pub fn matched(&self) -> impl Iterator<Item = (u32, u32)> + '_ {
        let pair = |&k: &u32| self.pairs[k as usize];
        self.taken.iter().map(pair).map(|p| (p.row, self.order[p.column as usize].2))
    }

    fn sum_of_powers(&self, p: f64) -> f64 {
        self.taken.iter().map(|&k| power(self.distance2[k as usize], p)).sum()
    }

    /// GOSPA of two sets of points (α = 2).
    ///
    /// ```
    /// use boresight::metrics::set::{SetDistance, SetOptions};
    /// let g = SetDistance::default().gospa(&[[0.0, 0.0], [50.0, 0.0]], &[[3.0, 4.0]], &SetOptions::default());
    /// assert_eq!((g.localisation, g.n_missed, g.n_false), (25.0, 1, 0));
    /// assert_eq!(g.distance, 75.0_f64.sqrt());
    /// ```
    pub fn gospa(&mut self, truth: &[[f64; 2]], result: &[[f64; 2]], options: &SetOptions) -> Gospa {
        let (c, p) = (options.cutoff_px, options.order);
        self.assign(truth, result, c, p);
        let n = self.taken.len();
        let (n_missed, n_false) = ((truth.len() - n) as u64, (result.len() - n) as u64);
        let half = c.powf(p) / 2.0;
        let localisation = self.sum_of_powers(p);
        let (missed, false_) = (half * n_missed as f64, half * n_false as f64);
        Gospa {
            distance: (localisation + missed + false_).powf(1.0 / p),
            localisation,
            missed,
            false_,
            n_missed,
            n_false,
        }
    }

    /// OSPA of two sets of points, px; 0 for two empty sets.
    pub fn ospa(&mut self, truth: &[[f64; 2]], result: &[[f64; 2]], options: &SetOptions) -> f64 {
        let (c, p) = (options.cutoff_px, options.order);
        let n = truth.len().max(result.len());
        if n == 0 {
            return 0.0;
        }
        let q = if options.assignment == OspaAssignment::FirstPower { 1.0 } else { p };
        let unique = self.assign(truth, result, c, q);
        if !unique && q != p && n <= 1 << 13 {
            // Assignments that are equally good by the distances are not so by their powers: find the one scipy finds.
            return self.ospa_of_dense(truth, result, n, c, p);
        }
        let rest = (n - self.taken.len()) as f64 * c.powf(p);
        ((self.sum_of_powers(p) + rest) / n as f64).powf(1.0 / p)
    }
}

impl SetDistance {
    fn ospa_of_dense(&mut self, truth: &[[f64; 2]], result: &[[f64; 2]], n: usize, c: f64, p: f64) -> f64 {
        let mut costs = vec![c; n * n];
        for (i, r) in result.iter().enumerate() {
            for (j, t) in truth.iter().enumerate() {
                let (dx, dy) = (r[0] - t[0], r[1] - t[1]);
                costs[i * n + j] = (dx * dx + dy * dy).sqrt().min(c);
            }
        }
        let mut chosen = Vec::new();
        self.matcher.solve_costs(n, n, &costs, &mut chosen);
        let sum: f64 = chosen.iter().map(|&(i, j)| costs[i as usize * n + j as usize].powf(p)).sum();
        (sum / n as f64).powf(1.0 / p)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_missing_point_costs_the_cutoff_and_a_shift_its_length() {
        let o = SetOptions { cutoff_px: 10.0, order: 1.0, ..SetOptions::default() };
        let mut s = SetDistance::default();
        assert_eq!(s.ospa(&[[0.0, 0.0]], &[[3.0, 4.0]], &o), 5.0);
        assert_eq!(s.ospa(&[[0.0, 0.0], [9.0, 9.0]], &[[3.0, 4.0]], &o), 7.5);
        assert_eq!(s.ospa(&[], &[[3.0, 4.0]], &o), 10.0);
        assert_eq!(s.ospa(&[], &[], &o), 0.0);
    }

    #[test]
    fn the_two_assignments_of_ospa_differ_where_the_order_says_so() {
        // On a line: truths 0 and 1, results 1.5 and 2.6 with c = 4, p = 2: 0-1.5, 1-2.6 adds 4.81 squared and 3.1 plain;
        // 0-2.6, 1-1.5 adds 7.01 squared and 3.1 plain.
        let (t, r) = ([[0.0, 0.0], [1.0, 0.0]], [[1.5, 0.0], [2.6, 0.1]]);
        let p = SetOptions { cutoff_px: 4.0, order: 2.0, assignment: OspaAssignment::OrderP };
        let q = SetOptions { assignment: OspaAssignment::FirstPower, ..p };
        let mut s = SetDistance::default();
        assert!(s.ospa(&t, &r, &p) < s.ospa(&t, &r, &q) + 1e-12);
    }

    #[test]
    fn wrong_options_are_refused_with_a_hint() {
        let e = SetOptions { cutoff_px: 0.0, ..SetOptions::default() }.validate("gospa").unwrap_err().to_string();
        assert!(e.starts_with("gospa.cutoff-px = 0: expected"), "{e}");
        assert!(SetOptions { order: 0.5, ..SetOptions::default() }.validate("gospa").is_err());
    }
}
