//! What is left out before counting: distractors and ignored rows of MOTChallenge, DontCare and small boxes of KITTI.
//!
//! Source: the rules of the official kits as in TrackEval. MOT16, MOT17, MOT20: results are matched to all truth boxes at
//! an overlap of 0.5; results matched to a distractor (person on vehicle 2, static person 7, distractor 8, reflection 12;
//! in MOT20 also non-MOT vehicle 6) vanish; then only pedestrians (class 1) whose column 7 is not 0 remain as truth. MOT15:
//! truth rows with 0 in column 7 vanish, nothing else. KITTI: truths of the neighbour class (van for car, person sitting for
//! pedestrian) and truths too hidden (occlusion > 2) or cut off (truncation > 0) take their result with them; unmatched
//! results vanish if at most 25 px high or more than half inside a DontCare region.

use super::overlap::{OverlapFinder, Similarity, frame_boxes};
use crate::associate::assignment::matching::{Matcher, WeightedPair};
use crate::{Error, ErrorKind, Result, TrackTable};

/// The rules by which rows are left out.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Rules {
    /// All rows count.
    #[default]
    None,
    /// 2D MOT 2015: truth rows marked 0 do not count.
    Mot15,
    /// MOT16 and MOT17.
    Mot17,
    /// MOT20.
    Mot20,
    /// KITTI, one class.
    Kitti(KittiClass),
}

impl Rules {
    /// The rules of a MOTChallenge truth by its look: MOT15's without classes, MOT20's where its name says so, else MOT17's.
    pub fn of_mot_challenge(truth: &TrackTable) -> Self {
        let has_classes = (0..truth.n_rows()).any(|r| truth.class.get(r) != 1);
        if !has_classes {
            Self::Mot15
        } else if truth.label.to_ascii_uppercase().contains("MOT20") {
            Self::Mot20
        } else {
            Self::Mot17
        }
    }
}

/// The classes that KITTI evaluates.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum KittiClass {
    /// Cars; vans are neither demanded nor punished.
    Car,
    /// Pedestrians; sitting persons are neither demanded nor punished.
    Pedestrian,
}

impl KittiClass {
    /// The class and its neighbour (car and van, pedestrian and person), by TrackEval's numbers, which the reader gives.
    fn numbers(self) -> (i32, i32) {
        match self {
            Self::Car => (1, 2),
            Self::Pedestrian => (4, 5),
        }
    }
}

/// KITTI's limits, as in TrackEval: lower boxes and more hidden truths are neither demanded nor punished.
const MIN_HEIGHT_PX: f64 = 25.0;
const MAX_OCCLUSION: i32 = 2;

/// Applies the rules: the truth and the result that count.
/// # Errors
/// A class that the rules do not know.
pub fn preprocess(truth: &TrackTable, result: &TrackTable, rules: Rules) -> Result<(TrackTable, TrackTable)> {
    match rules {
        Rules::None => Ok((truth.clone(), result.clone())),
        Rules::Mot15 => Ok((truth.filtered(|_, r| marked(truth, r)), result.clone())),
        Rules::Mot17 => mot(truth, result, &[2, 7, 8, 12]),
        Rules::Mot20 => mot(truth, result, &[2, 7, 8, 12, 6]),
        Rules::Kitti(class) => Ok(kitti(truth, result, class)),
    }
}

/// Column 7 read as a whole number is not 0.
fn marked(truth: &TrackTable, row: usize) -> bool {
    truth.score.get(row).trunc() != 0.0
}

fn mot(truth: &TrackTable, result: &TrackTable, distractors: &[i32]) -> Result<(TrackTable, TrackTable)> {
    for frame in 0..truth.n_frames() {
        for r in truth.rows(frame) {
            let class = truth.class.get(r);
            if !(1..=13).contains(&class) {
                return Err(Error::new(
                    ErrorKind::Damaged,
                    format!("class {class}: expected one of MOTChallenge's 1 to 13"),
                )
                .at(format!("{} frame {}", truth.label, frame + 1))
                .hint("--rules mot15 or --rules none if the truth has no classes"));
            }
        }
    }
    for frame in 0..result.n_frames() {
        for r in result.rows(frame) {
            let class = result.class.get(r);
            if class > 1 {
                return Err(Error::new(
                    ErrorKind::Damaged,
                    format!("class {class}: these rules judge pedestrians (1) only"),
                )
                .at(format!("{} frame {}", result.label, frame + 1)));
            }
        }
    }
    let mut gone = vec![false; result.n_rows()];
    for_each_match(
        truth,
        result,
        |_, _| true,
        |_, _| true,
        |_, t, r| {
            gone[r] = distractors.contains(&truth.class.get(t));
        },
    );
    Ok((truth.filtered(|_, r| marked(truth, r) && truth.class.get(r) == 1), result.filtered(|_, r| !gone[r])))
}

fn kitti(truth: &TrackTable, result: &TrackTable, class: KittiClass) -> (TrackTable, TrackTable) {
    let (own, neighbour) = class.numbers();
    let counts = |r: usize| truth.class.get(r) == own && !hidden(truth, r);
    let mut matched = vec![false; result.n_rows()];
    let mut gone = vec![false; result.n_rows()];
    let judged = |_: usize, r: usize| truth.class.get(r) == own || truth.class.get(r) == neighbour;
    for_each_match(
        truth,
        result,
        judged,
        |_, r| result.class.get(r) == own,
        |_, t, r| {
            matched[r] = true;
            gone[r] = !counts(t);
        },
    );
    let mut ignore = truth.ignore.clone();
    ignore.sort_by_key(|i| i.0);
    for frame in 0..result.n_frames() {
        let from = ignore.partition_point(|i| (i.0 as usize) < frame);
        let to = ignore.partition_point(|i| (i.0 as usize) <= frame);
        for r in result.rows(frame).filter(|&r| !matched[r]) {
            let b = &result.boxes[r];
            // Top + height − top, as the kit's corners give it.
            let height = b[1] + b[3] - b[1];
            gone[r] = height <= MIN_HEIGHT_PX + f64::EPSILON
                || ignore[from..to].iter().any(|(_, i)| share_inside(b, i) > 0.5 + f64::EPSILON);
        }
    }
    (truth.filtered(|_, r| counts(r)), result.filtered(|_, r| result.class.get(r) == own && !gone[r]))
}

fn hidden(truth: &TrackTable, r: usize) -> bool {
    truth.occlusion.get(r) > MAX_OCCLUSION || truth.truncation.get(r).trunc() > 0.0
}

/// Share of box `a` that lies inside `b`.
fn share_inside(a: &[f64; 4], b: &[f64; 4]) -> f64 {
    let w = ((a[0] + a[2]).min(b[0] + b[2]) - a[0].max(b[0])).max(0.0);
    let h = ((a[1] + a[3]).min(b[1] + b[3]) - a[1].max(b[1])).max(0.0);
    let area = a[2] * a[3];
    if area > f64::EPSILON { w * h / area } else { 0.0 }
}

/// Matches the chosen rows of each frame by overlap from 0.5 on and calls `each(frame, truth row, result row)`.
fn for_each_match(
    truth: &TrackTable,
    result: &TrackTable,
    truth_counts: impl Fn(usize, usize) -> bool,
    result_counts: impl Fn(usize, usize) -> bool,
    mut each: impl FnMut(usize, usize, usize),
) {
    let (mut finder, mut matcher) = (OverlapFinder::default(), Matcher::default());
    let (mut overlaps, mut pairs, mut taken) = (Vec::new(), Vec::new(), Vec::new());
    let (mut row_of, mut col_of) = (Vec::new(), Vec::new());
    for frame in 0..truth.n_frames().min(result.n_frames()) {
        let (ts, rs) = (truth.rows(frame), result.rows(frame));
        overlaps.clear();
        finder.frame(Similarity::Iou, frame_boxes(truth, frame), frame_boxes(result, frame), &mut overlaps);
        // The kit matches the rows that count only; numbers in the frame are theirs.
        let n = renumber(ts.clone().map(|r| truth_counts(frame, r)), &mut row_of);
        let m = renumber(rs.clone().map(|r| result_counts(frame, r)), &mut col_of);
        pairs.clear();
        for o in &overlaps {
            let (row, col) = (row_of[o.row as usize], col_of[o.col as usize]);
            if row != u32::MAX && col != u32::MAX && o.similarity >= 0.5 - f64::EPSILON {
                pairs.push((WeightedPair { row, column: col, weight: o.similarity }, o.row, o.col));
            }
        }
        let only: Vec<WeightedPair> = pairs.iter().map(|p| p.0).collect();
        matcher.solve(n, m, &only, &mut taken);
        for &k in &taken {
            let (_, row, col) = pairs[k as usize];
            each(frame, ts.start + row as usize, rs.start + col as usize);
        }
    }
}

fn renumber(counts: impl Iterator<Item = bool>, out: &mut Vec<u32>) -> usize {
    out.clear();
    let mut n = 0;
    for c in counts {
        out.push(if c { n } else { u32::MAX });
        n += u32::from(c);
    }
    n as usize
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{PixelOrigin, TrackRow};

    fn table(rows: &[(u32, i64, [f64; 4], f64, i32)]) -> TrackTable {
        let row =
            |&(frame, id, bbox, score, class): &_| TrackRow { frame, id, bbox, score, class, ..TrackRow::default() };
        TrackTable::from_rows("t", PixelOrigin::Pixel1, rows.iter().map(row)).unwrap()
    }

    #[test]
    fn a_result_on_a_distractor_vanishes_and_ignored_truths_too() {
        let truth = table(&[
            (0, 1, [0.0, 0.0, 10.0, 10.0], 1.0, 1),
            (0, 2, [50.0, 0.0, 10.0, 10.0], 0.0, 8),
            (0, 3, [90.0, 0.0, 10.0, 10.0], 0.0, 1),
        ]);
        let result = table(&[(0, 7, [51.0, 0.0, 10.0, 10.0], 1.0, 1), (0, 8, [200.0, 0.0, 10.0, 10.0], 1.0, 1)]);
        let (t, r) = preprocess(&truth, &result, Rules::Mot17).unwrap();
        assert_eq!((t.ids.as_slice(), r.ids.as_slice()), ([1_i64].as_slice(), [8_i64].as_slice()));
    }

    #[test]
    fn kitti_spares_results_in_dont_care_regions_and_small_ones() {
        let truth = {
            let mut t = table(&[(0, 1, [0.0, 0.0, 40.0, 40.0], 1.0, 1)]);
            t.ignore.push((0, [300.0, 0.0, 100.0, 100.0]));
            t
        };
        let result = table(&[
            (0, 5, [320.0, 10.0, 40.0, 40.0], 1.0, 1),
            (0, 6, [500.0, 0.0, 25.0, 25.0], 1.0, 1),
            (0, 7, [600.0, 0.0, 40.0, 40.0], 1.0, 1),
        ]);
        let (_, r) = preprocess(&truth, &result, Rules::Kitti(KittiClass::Car)).unwrap();
        assert_eq!(r.ids, [7]);
    }

    #[test]
    fn a_mot_challenge_truth_is_told_by_its_classes_and_its_name() {
        let plain = table(&[(0, 1, [0.0, 0.0, 9.0, 9.0], 1.0, 1)]);
        let mut classes = table(&[(0, 1, [0.0, 0.0, 9.0, 9.0], 1.0, 1), (0, 2, [0.0, 0.0, 9.0, 9.0], 1.0, 8)]);
        assert_eq!(Rules::of_mot_challenge(&plain), Rules::Mot15);
        assert_eq!(Rules::of_mot_challenge(&classes), Rules::Mot17);
        classes.label = "data/mot20-01/gt.txt".into();
        assert_eq!(Rules::of_mot_challenge(&classes), Rules::Mot20);
    }

    #[test]
    fn a_non_mot_vehicle_is_a_distractor_in_mot20_only() {
        let truth = table(&[(0, 1, [0.0, 0.0, 10.0, 10.0], 1.0, 1), (0, 2, [50.0, 0.0, 10.0, 10.0], 1.0, 6)]);
        let result = table(&[(0, 7, [50.0, 0.0, 10.0, 10.0], 1.0, 1)]);
        let kept = |rules| preprocess(&truth, &result, rules).unwrap().1.n_rows();
        assert_eq!((kept(Rules::Mot17), kept(Rules::Mot20), kept(Rules::Mot15), kept(Rules::None)), (1, 0, 1, 1));
    }

    #[test]
    fn classes_that_the_rules_do_not_know_are_refused_with_their_place() {
        let strange = table(&[(4, 1, [0.0, 0.0, 9.0, 9.0], 1.0, 14)]);
        let good = table(&[(4, 1, [0.0, 0.0, 9.0, 9.0], 1.0, 1)]);
        let e = preprocess(&strange, &good, Rules::Mot17).unwrap_err().to_string();
        assert!(e.contains("class 14") && e.contains("frame 5"), "{e}");
        let car = table(&[(2, 1, [0.0, 0.0, 9.0, 9.0], 1.0, 3)]);
        let e = preprocess(&good, &car, Rules::Mot17).unwrap_err().to_string();
        assert!(e.contains("class 3") && e.contains("frame 3"), "{e}");
    }

    #[test]
    fn kitti_takes_the_results_of_vans_and_of_hidden_or_cut_cars_away() {
        let row = |id, x, class, occlusion, truncation| TrackRow {
            id,
            bbox: [x, 0.0, 40.0, 40.0],
            class,
            occlusion,
            truncation,
            ..TrackRow::default()
        };
        let table = |rows: Vec<TrackRow>| TrackTable::from_rows("k", PixelOrigin::Pixel0, rows).unwrap();
        // A car that counts, one hidden beyond 2, one hidden at 2, one cut off, a van, a pedestrian.
        let truth = table(vec![
            row(1, 0.0, 1, 0, 0.0),
            row(2, 100.0, 1, 3, 0.0),
            row(3, 200.0, 1, 2, 0.0),
            row(4, 300.0, 1, 0, 1.0),
            row(5, 400.0, 2, 0, 0.0),
            row(6, 500.0, 4, 0, 0.0),
        ]);
        let result = table((0..6).map(|k| row(10 + k, 100.0 * k as f64, 1, 0, 0.0)).collect());
        let (t, r) = preprocess(&truth, &result, Rules::Kitti(KittiClass::Car)).unwrap();
        assert_eq!((t.ids.as_slice(), r.ids.as_slice()), ([1, 3].as_slice(), [10, 12, 15].as_slice()));
        let (t, _) = preprocess(&truth, &result, Rules::Kitti(KittiClass::Pedestrian)).unwrap();
        assert_eq!(t.ids, [6]);
    }

    #[test]
    fn a_box_counts_as_inside_a_region_from_more_than_half_of_its_area_on() {
        assert_eq!(share_inside(&[0.0, 0.0, 10.0, 10.0], &[5.0, 5.0, 100.0, 100.0]), 0.25);
        assert_eq!(share_inside(&[0.0, 0.0, 10.0, 10.0], &[20.0, 0.0, 5.0, 5.0]), 0.0);
        assert_eq!(share_inside(&[0.0, 0.0, 0.0, 10.0], &[0.0, 0.0, 5.0, 5.0]), 0.0);
    }
}
