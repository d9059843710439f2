//! M-of-N confirmation: a track is confirmed after M hits in its last N scans.
//!
//! Source: Y. Bar-Shalom, X.-R. Li, T. Kirubarajan, *Estimation with Applications to Tracking and Navigation*, 2001 (sliding window
//! logic); docs/theory/track-management.md. A tentative track is deleted once M hits can no longer be reached in its first N scans,
//! or after `tentative_s`.
//! Limits: N ≤ 64. A confirmed track is never deleted by this rule; its coasting budget ends it.

use super::history::{Decision, History};
use crate::Result;
use crate::validate::{check, positive};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Confirmed after M detections in N scans.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct MOfNConfig {
    /// M: detections needed, 1..=`scans`; a two-point initiation counts as two. More means fewer false tracks, later ones.
    pub hits: u32,
    /// N: scans looked back, `hits`..=64.
    pub scans: u32,
    /// A tentative track is deleted after this time without being confirmed, s, above 0.
    pub tentative_s: f64,
}

impl Default for MOfNConfig {
    fn default() -> Self {
        Self { hits: 3, scans: 5, tentative_s: 1e9 }
    }
}

impl MOfNConfig {
    /// Checks all values; `at` names the place in the configuration.
    /// # Errors
    /// The first value outside its range.
    pub fn validate(&self, at: &str) -> Result<()> {
        check((1..=64).contains(&self.scans), at, "scans", self.scans, "1..=64 scans", "3 of 5 is usual")?;
        check((1..=self.scans).contains(&self.hits), at, "hits", self.hits, "1..=scans", "3 of 5 is usual")?;
        positive(at, "tentative-s", self.tentative_s, "a second is long at video rate")
    }

    /// Share of hits in the window, 0..=1.
    #[inline]
    pub(super) fn score(&self, history: &History) -> f32 {
        let n = u32::from(history.scans).min(self.scans).max(1);
        history.hits_in(n) as f32 / n as f32
    }

    /// Decides after a scan that `history` has recorded.
    pub(super) fn decide(&self, history: &mut History, now_ns: i64) -> Decision {
        if history.accepted {
            return Decision::Keep;
        }
        let scans = u32::from(history.scans);
        let hits = history.hits_in(self.scans);
        if hits >= self.hits && scans >= self.hits {
            history.accept();
            return Decision::Keep;
        }
        let late = (now_ns.saturating_sub(history.initiated_ns)) as f64 * 1e-9 > self.tentative_s;
        if scans >= self.scans || hits + (self.scans - scans) < self.hits || late {
            return Decision::Delete;
        }
        Decision::Keep
    }
}

#[cfg(test)]
mod tests {
    use super::super::history::Evidence;
    use super::super::rule::ConfirmationConfig;
    use super::*;

    /// What M of N says after each scan of a track that began with `n_points` hits, by counting a list.
    fn counted(m: usize, n: usize, n_points: usize, scans: &[bool]) -> Vec<(bool, Decision)> {
        let mut seen = vec![true; n_points];
        let mut confirmed = n_points >= m;
        let mut out = Vec::new();
        for hit in scans {
            seen.push(*hit);
            let window = &seen[seen.len().saturating_sub(n)..];
            let hits = window.iter().filter(|h| **h).count();
            let left = n.saturating_sub(seen.len());
            let decision = if confirmed || hits >= m {
                confirmed = true;
                Decision::Keep
            } else if left == 0 || hits + left < m {
                Decision::Delete
            } else {
                Decision::Keep
            };
            out.push((confirmed, decision));
            if decision == Decision::Delete {
                break;
            }
        }
        out
    }

    #[test]
    fn every_pattern_of_hits_is_decided_as_a_count_over_the_window_says() {
        for (m, n) in [(1, 1), (2, 2), (1, 3), (2, 3), (3, 5), (4, 6), (5, 8)] {
            let rule = ConfirmationConfig::MOfN(MOfNConfig { hits: m, scans: n, tentative_s: 1e9 });
            for n_points in [1, 2] {
                for pattern in 0u32..1 << 9 {
                    let scans: Vec<bool> = (0..9).map(|k| pattern >> k & 1 == 1).collect();
                    let mut history = rule.begin(n_points, 0, 1e-5, 1.0);
                    let mut got = Vec::new();
                    for hit in &scans {
                        let evidence = Evidence { hit: *hit, likelihood_ratio: 1.0 };
                        got.push((rule.decide(&mut history, evidence, 0), history.accepted));
                        if got.last().is_some_and(|g| g.0 == Decision::Delete) {
                            break;
                        }
                    }
                    let got: Vec<_> = got.into_iter().map(|(d, c)| (c, d)).collect();
                    assert_eq!(
                        got,
                        counted(m as usize, n as usize, n_points as usize, &scans),
                        "{m} of {n}, {n_points} points, {scans:?}"
                    );
                }
            }
        }
    }

    #[test]
    fn a_tentative_track_is_deleted_when_its_time_is_over_not_before() {
        let rule = ConfirmationConfig::MOfN(MOfNConfig { hits: 3, scans: 60, tentative_s: 2.0 });
        let mut history = rule.begin(1, 1_000_000_000, 1e-5, 1.0);
        let miss = Evidence { hit: false, likelihood_ratio: 1.0 };
        assert_eq!(rule.decide(&mut history, miss, 3_000_000_000), Decision::Keep);
        assert_eq!(rule.decide(&mut history, miss, 3_000_000_001), Decision::Delete);
    }

    #[test]
    fn the_score_is_the_share_of_hits_in_the_window_seen_so_far() {
        let rule = ConfirmationConfig::default();
        let mut history = rule.begin(2, 0, 1e-5, 1.0);
        let mut after = |hit| {
            rule.decide(&mut history, Evidence { hit, likelihood_ratio: 1.0 }, 0);
            rule.score(&history)
        };
        // 11, then 0 1 1 0 0: windows of at most five.
        let scores = [false, true, true, false, false].map(&mut after);
        assert_eq!(scores, [2.0 / 3.0, 3.0 / 4.0, 4.0 / 5.0, 3.0 / 5.0, 2.0 / 5.0]);
    }
}
