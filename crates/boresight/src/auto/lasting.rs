//! Whether false detections last: the score below which a second detection at the same place is no news.
//!
//! Source: our own; what comes of it is `track/lasting.rs`. A codec copies what it does not code anew, and a false detection comes again at the same place to a hundredth of a pixel. False ones are known by
//! two signs: they are of the other polarity ([`super::decoys`]), or they appear, stay exactly where they are for some frames, and vanish.
//! Method: the score that nearly all of the first kind fall short of, or most of the second, whichever is more, times [`BRIGHTEST`]: what a codec leaves where a bright thing was is brighter than what it makes of
//! noise, and the brightest last longest.
//! Limits: a target that moves slowly is copied as well for a while; some of the second kind are such. Frames that repeat others are all copies. Asked only where all that stands is reported: elsewhere the motion test holds back what stays.

use super::decoys::{COPIED_PX, Decoys};
use super::digits::round;
use super::near::Near;
use crate::{Detection, Scan};

/// Share of the own detections that are there again to [`COPIED_PX`]: of those measured anew, with an error of 0.05 px in each axis, 4 %.
const COPIED_SHARE: f64 = 0.1;
/// Frames in which a thing stays: of those measured anew three in a million do by chance.
const STAYS_FRAMES: usize = 5;
/// Fewest that came and went.
const FEWEST: usize = 5;
/// Shares that score less than what is taken: of the other polarity, and of what appears and vanishes, some of which are targets.
const NEARLY_ALL: f64 = 0.99;
const MOST: f64 = 0.75;
/// The brightest of what a codec leaves behind score so many times as much.
const BRIGHTEST: f64 = 2.0;

/// Whether the detections of the scans are copies of those before, in part: nothing else needs to be looked at.
pub fn is_copied(scans: &[Scan]) -> bool {
    let n: usize = scans.iter().rev().skip(1).map(|s| s.detections.len()).sum();
    let copied = |pair: &[Scan]| {
        let next = Near::of(&pair[1]);
        pair[0].detections.iter().filter(|d| next.nearest(d, COPIED_PX).is_some()).count()
    };
    scans.windows(2).map(copied).sum::<usize>() as f64 > COPIED_SHARE * n as f64
}

/// What is found again and again within its width.
struct Followed<'s> {
    /// Its newest detection.
    last: &'s Detection,
    /// Nothing lay there for [`STAYS_FRAMES`] before it appeared.
    appeared: bool,
    /// In how many scans up to now it was exactly where it is, and whether that were [`STAYS_FRAMES`] once.
    stays: usize,
    stayed: bool,
    /// Scans since.
    missed: usize,
}

impl<'s> Followed<'s> {
    fn begin(d: &'s Detection, appeared: bool) -> Self {
        Self { last: d, appeared, stays: 1, stayed: false, missed: 0 }
    }

    fn go_on(&mut self, d: &'s Detection, far_px: f64) {
        self.stays = if far_px <= COPIED_PX { self.stays + 1 } else { 1 };
        self.stayed |= self.stays >= STAYS_FRAMES;
        (self.last, self.missed) = (d, 0);
    }
}

/// Scores of what appears after the first scans, stays for [`STAYS_FRAMES`] and vanishes for as long, rising.
fn passing(scans: &[Scan]) -> Vec<f32> {
    let width = |d: &Detection| (d.extent.width_px * d.extent.height_px).sqrt().max(COPIED_PX);
    let mut scores = Vec::new();
    let mut followed: Vec<Followed<'_>> = Vec::new();
    for (k, scan) in scans.iter().enumerate() {
        let now = Near::of(scan);
        let mut is_new = vec![true; now.len()];
        for f in &mut followed {
            f.missed += 1;
            if let Some((j, far_px)) = now.nearest(f.last, width(f.last)) {
                is_new[j] = false;
                f.go_on(now.get(j), far_px);
            }
        }
        followed.retain(|f| {
            let vanished = f.missed >= STAYS_FRAMES;
            if vanished && f.appeared && f.stayed {
                scores.push(f.last.score);
            }
            !vanished
        });
        let new = scan.detections.iter().zip(&is_new).filter(|(_, new)| **new);
        followed.extend(new.map(|(d, _)| Followed::begin(d, k >= STAYS_FRAMES)));
    }
    scores.sort_unstable_by(f32::total_cmp);
    scores
}

/// The score that lasting false detections hardly reach, with the reason, if there are any; `scans` are of successive frames.
pub fn score(decoys: &Decoys, scans: &[Scan]) -> Option<(f64, String)> {
    let at = |of: &[f32], share: f64| of[((share * of.len() as f64) as usize).min(of.len() - 1)];
    let Decoys { other, n_first, lasting, .. } = decoys;
    // Without any of the other polarity there are no false detections that could last: what blinks in a picture without noise is what it seems.
    if other.is_empty() {
        return None;
    }
    let passing = passing(scans);
    let of_other = decoys.last().then(|| at(lasting, NEARLY_ALL));
    let of_own = (passing.len() >= FEWEST).then(|| at(&passing, MOST));
    let score = round(BRIGHTEST * of_other.into_iter().chain(of_own).map(f64::from).reduce(f64::max)?);
    if score <= 0.0 {
        return None;
    }
    let reason = format!(
        "False detections last, as where a codec copies the frame before: {} that came and went stayed exactly where they were, and {} of {} of the other polarity are there again in the next frame. \
         One that scores less than {score} is no evidence where it stays; a target is told by its motion, or by being brighter (tracker.lasting-clutter-score).",
        passing.len(),
        lasting.len(),
        n_first,
    );
    Some((score, reason))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Extent, FrameIndex, Timestamp};
    use nalgebra::{Matrix2, Vector2};

    fn scan(k: usize, things: &[(f64, f32)]) -> Scan {
        let detection = |&(x, score): &(f64, f32)| Detection {
            score,
            extent: Extent { width_px: 3.0, height_px: 3.0, ..Extent::default() },
            ..Detection::at(Vector2::new(x, 20.0), Matrix2::identity() * 0.01)
        };
        let time = Timestamp::from_secs_f64(0.04 * k as f64);
        Scan::at(FrameIndex(k as u64), time).with_detections(things.iter().map(detection).collect())
    }

    #[test]
    fn what_comes_stays_exactly_and_goes_is_lasting_clutter() {
        // One from the first on, one that moves, one for four scans, one for six, one up to the last, one that is coded anew beside its place, and one that is missed for four scans.
        let scans: Vec<Scan> = (0..30)
            .map(|k| {
                let mut things = vec![(10.0, 9.0), (30.0 + 0.1 * k as f64, 8.0)];
                let mut beside = |x: f64, score: f32, from: usize, to: usize| {
                    if (from..to).contains(&k) {
                        things.push((x, score));
                    }
                };
                beside(50.0, 7.0, 8, 12);
                beside(60.0, 6.0, 8, 14);
                beside(70.0, 5.0, 12, 30);
                beside(80.0, 4.0, 0, 8);
                beside(80.3, 4.0, 8, 15);
                beside(90.0, 3.0, 8, 14);
                beside(90.0, 3.0, 18, 30);
                scan(k, &things)
            })
            .collect();
        assert_eq!(passing(&scans), [6.0]);
        assert!(is_copied(&scans));
        let moving: Vec<Scan> = (0..20).map(|k| scan(k, &[(10.0 + 0.1 * k as f64, 9.0)])).collect();
        assert!(!is_copied(&moving) && passing(&moving).is_empty());
        assert!(!is_copied(&[]) && passing(&[]).is_empty());
    }

    #[test]
    fn the_score_is_twice_what_either_kind_reaches_and_none_where_there_are_few() {
        let decoys = |lasting: &[f32]| Decoys {
            other: vec![3.0; 40],
            n_first: 20,
            lasting: lasting.to_vec(),
            ..Decoys::default()
        };
        let of = |lasting: &[f32], scans: &[Scan]| score(&decoys(lasting), scans).map(|s| s.0);
        assert_eq!(of(&[2.0, 3.0, 4.0, 5.0], &[]), None);
        assert_eq!(of(&[1.0, 2.0, 3.0, 4.0, 5.0], &[]), Some(10.0));
        let passing: Vec<Scan> = (0..20)
            .map(|k| {
                if (6..12).contains(&k) {
                    scan(k, &[(10.0, 6.0), (20.0, 7.5), (30.0, 6.5), (40.0, 6.2), (50.0, 5.0)])
                } else {
                    scan(k, &[])
                }
            })
            .collect();
        assert_eq!(of(&[], &passing), Some(13.0));
        assert_eq!(score(&Decoys::default(), &passing), None, "a picture without noise");
        assert_eq!(of(&[1.0, 2.0, 3.0, 4.0, 5.0], &passing), Some(13.0));
        assert_eq!(of(&[1.0, 2.0, 3.0, 4.0, 8.0], &passing), Some(16.0));
    }
}
