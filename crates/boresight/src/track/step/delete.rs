//! Delete: when a track's coasting budget is over, and when two tracks are one.
//!
//! Source: docs/theory/track-management.md. What the confirmation rule deletes (tentative tracks, fallen scores) is in
//! [`confirm`](super::super::confirm); here is what holds whatever the rule.
//! Method: a track without detections coasts for a budget in seconds, at least some usual scan intervals. On merged measurements that fit
//! another track better it is kept by the time that it was seen alone before: what was a piece of another target for a moment, a tail or a swinging arm, is no
//! target that hides in it. Time seen alone is saved up to the largest budget, time in merged measurements is taken from it. Of two tracks that
//! follow the same detections for long enough the younger ends.

use super::super::config::TrackerConfig;
use super::super::confirm::history::History;
use super::super::scan_interval::ScanInterval;
use super::super::single_track::{Outcome, Track};
use crate::Timestamp;

/// Seconds in merged measurements that a second alone allows: a target shows itself alone in a ninth of the time at least. Chosen; with 1 people who walk
/// together are lost (vtest.avi: IDF1 71 %, with 4 82 %, with 8 and 16 88 %), and with all of them a mouse's tail is no second mouse for long.
const MERGED_PER_ALONE: f32 = 8.0;

/// How long a confirmed track may go without a detection, s.
pub(in crate::track) fn coast_budget_s(config: &TrackerConfig, interval: &ScanInterval) -> f64 {
    config.coast_s.max(interval.span_s(config.coast_scans))
}

/// Whether a track's coasting budget had ended before the scan at `now`, that is in scans which are missing. `interval_s` is the usual
/// interval between scans, above 0.
pub(in crate::track) fn expired_in_gap(history: &History, now: Timestamp, budget_s: f64, interval_s: f64) -> bool {
    let missed_s = now.seconds_since(Timestamp::from_ns(history.last_seen_ns));
    // The newest scan in which the track can still be seen ends the budget, not the gap itself.
    missed_s > 1e-9 && missed_s - interval_s >= budget_s - 1e-9
}

/// Whether a track's budget is over after a scan: of coasting if it missed, of merged measurements if it was secondary in one.
#[inline]
pub(in crate::track) fn budget_is_over(
    history: &History,
    secondary: bool,
    now: Timestamp,
    coast_budget_s: f64,
) -> bool {
    if secondary {
        return f64::from(history.alone_s) <= -coast_budget_s;
    }
    // Without any detection it coasts from the last, its own or merged.
    history.misses > 0 && now.seconds_since(Timestamp::from_ns(history.last_seen_ns)) >= coast_budget_s - 1e-9
}

/// Saves the time since the last scan in which the track was seen, if it was seen alone in both, or takes it off, if it is merged now; before the history takes
/// the scan in. What is saved and the coasting budget are at most the larger of the two budgets.
#[inline]
pub(in crate::track) fn save_time_alone(
    history: &mut History,
    outcome: &Outcome,
    now: Timestamp,
    coast_budget_s: f64,
    secondary_budget_s: f64,
) {
    let since_s = now.seconds_since(Timestamp::from_ns(history.last_seen_ns)) as f32;
    if outcome.merged {
        history.alone_s -= since_s;
    } else if outcome.hit && history.misses == 0 {
        let most = (secondary_budget_s - coast_budget_s).max(0.0) as f32;
        history.alone_s = (history.alone_s + MERGED_PER_ALONE * since_s).min(most);
    }
}

/// Whether the track has followed the same detections as an older one for `longest_s`; `owned` says which detections older tracks follow.
pub(in crate::track) fn is_lasting_duplicate(
    track: &mut Track,
    owned: &mut [bool],
    outcome: &Outcome,
    now: Timestamp,
    longest_s: f64,
) -> bool {
    let Some(j) = outcome.detection else { return false };
    if !std::mem::replace(&mut owned[j as usize], true) {
        track.duplicate_since_ns = None;
        return false;
    }
    let since = *track.duplicate_since_ns.get_or_insert(now.ns);
    now.seconds_since(Timestamp::from_ns(since)) >= longest_s
}

#[cfg(test)]
mod tests {
    use super::super::super::confirm::history::Evidence;
    use super::super::super::confirm::rule::ConfirmationConfig;
    use super::*;

    const S: i64 = 1_000_000_000;

    /// A track last seen at 3 s, with `misses` since.
    fn history(misses: u32) -> History {
        let mut h = ConfirmationConfig::default().begin(1, 0, 1e-5, 1.0);
        (h.last_seen_ns, h.misses) = (3 * S, misses);
        h
    }

    #[test]
    fn a_missed_track_coasts_from_its_last_detection_merged_or_not() {
        let over = |ns: i64| budget_is_over(&history(1), false, Timestamp::from_ns(ns), 2.0);
        assert!(!over(5 * S - 10) && over(5 * S));
        assert!(!budget_is_over(&history(0), false, Timestamp::from_ns(99 * S), 2.0), "seen in this scan");
    }

    /// Scans of a quarter of a second in which a track that was seen alone in `alone` scans is kept as a secondary one; budgets of 0.5 s and `secondary_s`.
    fn kept(alone: u32, secondary_s: f64) -> u32 {
        let rule = ConfirmationConfig::default();
        let mut h = rule.begin(1, 0, 1e-5, 1.0);
        let mut scan = 0;
        let mut next = |merged: bool| {
            scan += 1;
            let now = Timestamp::from_ns(S / 4 * scan);
            let outcome = Outcome { hit: true, merged, secondary: merged, ..Outcome::default() };
            save_time_alone(&mut h, &outcome, now, 0.5, secondary_s);
            rule.decide(&mut h, Evidence { hit: true, likelihood_ratio: 1.0 }, now.ns);
            budget_is_over(&h, merged, now, 0.5)
        };
        (0..alone).for_each(|_| assert!(!next(false)));
        (0..1000).take_while(|_| !next(true)).count() as u32
    }

    #[test]
    fn a_secondary_track_is_kept_by_the_time_that_it_was_seen_alone_and_no_longer_than_the_budget() {
        assert_eq!(kept(0, 8.0), 1, "the coasting budget: the scan at 0.5 s is too late");
        assert_eq!(kept(1, 8.0), 9, "a quarter of a second alone is worth two");
        assert_eq!(kept(1000, 8.0), 31);
        assert_eq!(kept(1000, 0.0), 1);
    }

    #[test]
    fn a_gap_ends_a_track_whose_budget_ended_before_its_last_scan() {
        let expired = |s: f64| expired_in_gap(&history(0), Timestamp::from_secs_f64(s), 2.0, 0.5);
        assert!(!expired(5.4) && expired(5.5));
    }

    #[test]
    fn the_coasting_budget_is_the_longer_of_seconds_and_scans() {
        let mut interval = ScanInterval::default();
        (0..9).for_each(|_| interval.note(0.25));
        let budget = |coast_s, coast_scans| {
            coast_budget_s(&TrackerConfig { coast_s, coast_scans, ..TrackerConfig::default() }, &interval)
        };
        assert_eq!(budget(2.0, 4), 2.0);
        assert!((budget(0.5, 4) - 1.0).abs() < 1e-8);
    }
}
