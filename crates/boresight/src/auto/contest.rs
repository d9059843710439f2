//! A choice held against the whole first pass: what was so in the first frames must go on being so.
//!
//! Source: our own. A detector of movers on steadied frames is chosen where chains hold enough of its regions in the few frames looked at (docs/theory/choice.md). The same
//! share is counted over all scans of the first pass; if it has fallen below what the choice asks for, most of what is detected is none that goes anywhere, and the
//! tracker, which counts hits, would make tracks of it: then it is the candidate that came next.
//! Limits: those of [`super::chains`].

use super::choose::Choice;
use super::evidence::{Evidence, LEAST_EXPLAINED};
use crate::Scan;

/// Why the choice is not borne out by its first pass, whose chains are `evidence`; nothing if it is.
pub(super) fn lost(evidence: &Evidence, scans: &[Scan], choice: &Choice, instead: &Choice) -> Option<String> {
    let share = evidence.explained(scans);
    (share < LEAST_EXPLAINED).then(|| {
        let [name, other] = [choice, instead].map(|c| c.config.detector.threshold.name());
        format!(
            "In {} frames {} finds {}, which hold {:.0} % of what it detects (less than {:.0} %: mostly clutter): so {} is taken.",
            evidence.times_s.len(),
            name,
            evidence.words(),
            100.0 * share,
            100.0 * LEAST_EXPLAINED,
            other,
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Config, Detection, FrameIndex, Timestamp};
    use nalgebra::{Matrix2, Vector2};
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    /// Forty scans of two things that cross the field of 300 x 300 px, among so many detections anywhere.
    fn scans(n_false: usize) -> Vec<Scan> {
        let mut rng = ChaCha8Rng::seed_from_u64(4);
        let scan = |k: u64| {
            let at = |x: f64, y: f64| Detection::at(Vector2::new(x, y), Matrix2::identity() * 0.09);
            let mut detections = vec![at(20.0 + 3.0 * k as f64, 40.0), at(280.0 - 4.0 * k as f64, 200.0)];
            detections.extend((0..n_false).map(|_| at(300.0 * rng.random::<f64>(), 300.0 * rng.random::<f64>())));
            Scan::at(FrameIndex(k), Timestamp::from_secs_f64(0.04 * k as f64)).with_detections(detections)
        };
        (0..40).map(scan).collect()
    }

    #[test]
    fn a_choice_whose_detections_go_nowhere_is_lost() {
        let choice = Choice::alone(Config::default(), Vec::new());
        let reason = |n_false: usize| {
            let scans = scans(n_false);
            lost(&Evidence::of_scans(&scans, 9e4), &scans, &choice, &choice)
        };
        // Two of four go somewhere, and two of twenty.
        assert_eq!(reason(2), None);
        assert!(reason(18).is_some_and(|r| r.contains("10 %")), "{:?}", reason(18));
        assert!(lost(&Evidence::default(), &[], &choice, &choice).is_some(), "nothing seen bears nothing out");
    }

    #[test]
    fn scans_in_which_nothing_could_be_seen_do_not_count() {
        let choice = Choice::alone(Config::default(), Vec::new());
        // Two of sixteen go somewhere; of the detections of the first forty of all scans it would be two of eight.
        let mut late = scans(14);
        let blind = |k: u64| Scan { blind: true, ..Scan::at(FrameIndex(k), Timestamp::from_secs_f64(0.04 * k as f64)) };
        late.iter_mut().for_each(|s| s.time = Timestamp::from_ns(s.time.ns + 800_000_000));
        let late: Vec<Scan> = (0..20).map(blind).chain(late).collect();
        let evidence = Evidence::of_scans(&late, 9e4);
        assert_eq!(evidence.times_s.len(), 40);
        assert!(lost(&evidence, &late, &choice, &choice).is_some());
    }
}
