//! A choice held against the whole first pass: what was so in the first frames must go on being so.
//!
//! Source: our own. A detector of movers on steadied frames is chosen where chains hold enough of its regions in the few frames looked at (docs/theory/choice.md). The same
//! share is counted over all scans of the first pass; if it has fallen below what the choice asks for, most of what is detected is none that goes anywhere, and the
//! tracker, which counts hits, would make tracks of it: then it is the candidate that came next. Where the camera's motion is not seen nothing is told from the ground, and that detector is blind: if
//! the candidate's targets in those frames gain more than all that moves beside them in the others, it is taken as well. Over frames that both see the gains are not compared: things that stand before a
//! ground that is not steadied to the last pixel are chains as well, and gain for as long as they are in view.
//! Limits: those of [`super::chains`].

use super::choose::Choice;
use super::evidence::{Evidence, LEAST_EXPLAINED, SURE_GAIN};
use crate::Scan;

/// Share of blind scans from which it is asked what was missed: the first frames are blind before any steadied detector, for as long as its lag.
const OFTEN_BLIND: f64 = 0.25;

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

/// Whether the choice was blind in so many of its scans that it is asked what came next saw in them.
pub(super) fn is_often_blind(scans: &[Scan]) -> bool {
    scans.iter().filter(|s| s.blind).count() as f64 > OFTEN_BLIND * scans.len() as f64
}

/// Why what came next is taken (the choice's chains are `evidence`): its chains gain more in scans in which the choice was blind than those of the choice that go with none of them in all others; nothing if they do not.
pub(super) fn beaten(
    evidence: &Evidence,
    scans: &[Scan],
    of_next: &[Scan],
    area_px2: f64,
    choice: &Choice,
    instead: &Choice,
) -> Option<String> {
    let next = |own_is_blind: bool| {
        let mut kept = of_next.to_vec();
        kept.iter_mut().zip(scans).for_each(|(next, own)| next.blind |= own.blind != own_is_blind);
        Evidence::of_scans(&kept, area_px2)
    };
    let (alone, beside) = (next(true), evidence.gain_beside(&next(false)).max(0.0));
    (alone.gain() > beside + SURE_GAIN).then(|| {
        let [name, other] = [choice, instead].map(|c| c.config.detector.threshold.name());
        format!(
            "In {} frames of the first pass {name} sees nothing, since the camera's motion is not seen: there {other} finds {}, more than the {beside:.0} nats of what {name} finds beside it in the \
             {} others: so it is taken.",
            alone.times_s.len(),
            alone.words(),
            evidence.times_s.len(),
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
    fn what_is_seen_while_the_choice_is_blind_beats_it_unless_it_sees_more() {
        let choice = Choice::alone(Config::default(), Vec::new());
        let all = scans(0);
        // One of the two things, blind from a scan on.
        let one = |which: usize, blind_from: usize| -> Vec<Scan> {
            let of = |(k, scan): (usize, &Scan)| {
                let one = if k < blind_from { vec![scan.detections[which].clone()] } else { Vec::new() };
                Scan { blind: k >= blind_from, ..scan.clone() }.with_detections(one)
            };
            all.iter().enumerate().map(of).collect()
        };
        let beaten =
            |own: &[Scan], next: &[Scan]| beaten(&Evidence::of_scans(own, 9e4), own, next, 9e4, &choice, &choice);
        assert!(is_often_blind(&one(1, 12)) && !is_often_blind(&one(1, 35)));
        let reason = beaten(&one(1, 12), &one(0, 40)).unwrap();
        assert!(reason.contains("In 28 frames") && reason.contains("1 chain in motion"), "{reason}");
        assert_eq!(beaten(&one(1, 28), &one(0, 40)), None, "it sees another thing for longer");
        assert!(beaten(&one(0, 28), &one(0, 40)).is_some(), "it sees the same thing for longer");
        assert_eq!(beaten(&one(1, 40), &one(0, 40)), None, "it is never blind");
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
