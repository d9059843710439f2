//! Tests of the signs that a truth and a result do not belong together.

use super::*;
use crate::{PixelOrigin, TrackRow};

fn checks(t: &TrackTable, r: &TrackTable, s: Similarity, size: Option<(f64, f64)>) -> Result<Vec<String>> {
    Ok(sanity_checks(t, r, s, size)?.iter().map(ToString::to_string).collect())
}

fn moving(from: u32, scale: f64) -> TrackTable {
    let row = |f: u32| TrackRow {
        frame: f + from,
        id: 1,
        bbox: [5.0 * f64::from(f) * scale, 0.0, 10.0 * scale, 10.0 * scale],
        ..TrackRow::default()
    };
    TrackTable::from_rows("t", PixelOrigin::Centre0, (0..50).map(row)).unwrap()
}

#[test]
fn a_shift_by_one_frame_is_seen_and_a_good_result_passes() {
    assert!(checks(&moving(0, 1.0), &moving(0, 1.0), Similarity::Iou, None).unwrap().is_empty());
    let d = checks(&moving(0, 1.0), &moving(1, 1.0), Similarity::Iou, None).unwrap();
    assert!(d[0].contains("one frame later"), "{d:?}");
}

#[test]
fn tables_without_a_common_frame_are_refused_and_other_sizes_are_told() {
    let e = checks(&moving(0, 1.0), &moving(100, 1.0), Similarity::Iou, None).unwrap_err().to_string();
    assert!(e.contains("frames 0 to 49, result in 100 to 149"), "{e}");
    let mut far = moving(0, 4.0);
    far.boxes.iter_mut().for_each(|b| b[1] += 900.0);
    let d = checks(&moving(0, 1.0), &far, Similarity::Iou, None).unwrap();
    assert!(d[0].contains("different sizes"), "{d:?}");
}

#[test]
fn detections_without_ids_and_rows_outside_of_the_image_are_told() {
    let mut n = 0;
    let own = |r: TrackRow| {
        n += 1;
        TrackRow { id: n, ..r }
    };
    let rows = (0..50).map(|f| moving(0, 1.0).row(f, f)).map(own);
    let detections = TrackTable::from_rows("d", PixelOrigin::Centre0, rows.collect::<Vec<_>>()).unwrap();
    let d = checks(&moving(0, 1.0), &detections, Similarity::Iou, Some((100.0, 100.0))).unwrap();
    assert!(d.iter().any(|d| d.contains("50 rows is a track of its own")), "{d:?}");
    assert!(d.iter().any(|d| d.contains("reaches x 255, y 10 in images of 100 x 100 px")), "{d:?}");
}

/// A target of 20 px whose speed is 0.5 px a frame, with noise of that size.
fn slow(late: u32) -> TrackTable {
    let noise = |f: u32| f64::from(f.wrapping_mul(2_654_435_761) >> 16) / 65_536.0 - 0.5;
    let row = |f: u32| TrackRow {
        frame: f + late,
        id: 1,
        bbox: [0.5 * f64::from(f) + noise(f + late * 991), 0.0, 20.0, 20.0],
        ..TrackRow::default()
    };
    TrackTable::from_rows("t", PixelOrigin::Centre0, (0..400).map(row)).unwrap()
}

#[test]
fn a_shift_of_a_target_that_overlaps_itself_is_seen_by_many_frames() {
    assert!(warn(&slow(0), &slow(0)).is_empty());
    let w = warn(&slow(0), &slow(1));
    assert!(
        matches!(w[..], [SanityWarning::ShiftedFrames { later: true, gain_percent }] if gain_percent < 3.0),
        "{w:?}"
    );
}

/// The sign test: k wins of k are √k standard deviations, 4 of them are wanted; what fits as well as before is no win.
#[test]
fn a_gain_is_sure_by_the_frames_that_fit_better_and_not_by_those_that_fit_as_well() {
    let fits = |more: usize| -> Vec<_> { (0..400).map(|k| Some((0.5 + f64::from(u8::from(k < more)), 1))).collect() };
    let sure = |wins| is_surely_better(&fits(wins), &fits(0));
    assert!(!sure(0) && !sure(16) && sure(17));
    assert!(!is_surely_better(&fits(0), &fits(17)), "worse");
}

#[test]
fn boxes_are_far_outside_from_half_an_image_beyond_its_edge_on() {
    let told = |left: f64| {
        let table = fixed(30, 1, left, 10.0);
        let w = sanity_checks(&table, &table, Similarity::Iou, Some((100.0, 100.0))).unwrap();
        w.iter().any(|w| matches!(w, SanityWarning::OutsideImages { .. }))
    };
    assert!(!told(80.0) && !told(140.0) && told(140.5));
}

fn fixed(n: u32, step: u32, left: f64, width: f64) -> TrackTable {
    let row = |k| TrackRow { frame: k * step, id: 1, bbox: [left, 0.0, width, 10.0], ..TrackRow::default() };
    TrackTable::from_rows("t", PixelOrigin::Centre0, (0..n).map(row)).unwrap()
}

fn warn(t: &TrackTable, r: &TrackTable) -> Vec<SanityWarning> {
    sanity_checks(t, r, Similarity::Iou, None).unwrap()
}

#[test]
fn empty_tables_are_named() {
    let (some, none) = (fixed(3, 1, 0.0, 10.0), fixed(0, 1, 0.0, 10.0));
    assert_eq!(warn(&none, &none), [SanityWarning::BothEmpty]);
    assert_eq!(warn(&none, &some), [SanityWarning::EmptyTruth("t".into())]);
    assert_eq!(warn(&some, &none), [SanityWarning::EmptyResult("t".into())]);
}

#[test]
fn an_earlier_shift_is_told_apart_from_a_later_one_and_a_small_gain_is_not_told() {
    let w = warn(&moving(1, 1.0), &moving(0, 1.0));
    assert!(matches!(w[0], SanityWarning::ShiftedFrames { later: false, .. }), "{w:?}");
    // A target that stands fits as well in each frame.
    assert!(warn(&fixed(30, 1, 0.0, 10.0), &fixed(30, 1, 1.0, 10.0)).is_empty());
}

#[test]
fn the_extents_tell_why_nothing_overlaps() {
    assert_eq!(mismatch((100.0, 50.0), (100.0, 50.0)), Mismatch::Sequence);
    assert_eq!(mismatch((100.0, 50.0), (149.0, 34.0)), Mismatch::Sequence);
    assert_eq!(mismatch((100.0, 50.0), (160.0, 50.0)), Mismatch::ImageSize);
    assert_eq!(mismatch((100.0, 50.0), (66.0, 50.0)), Mismatch::ImageSize);
    assert_eq!(mismatch((100.0, 50.0), (52.0, 98.0)), Mismatch::SwappedAxes);
    // What counts are the sides, not where they lie: boxes of 20 x 10 px, one 300 px right of and 200 px below the other.
    let mut far = fixed(30, 1, 0.0, 20.0);
    far.boxes.iter_mut().for_each(|b| (b[0], b[1]) = (b[0] + 300.0, b[1] + 200.0));
    for (a, b) in [(&fixed(30, 1, 0.0, 20.0), &far), (&far, &fixed(30, 1, 0.0, 20.0))] {
        let w = warn(a, b);
        assert!(matches!(w[..], [SanityWarning::NoOverlap { none: true, cause: Mismatch::Sequence, .. }]), "{w:?}");
    }
}

#[test]
fn rows_long_after_the_truth_are_told_but_not_those_just_after() {
    let last = |n| {
        let w = sanity_checks(&fixed(20, 1, 0.0, 10.0), &fixed(n, 1, 0.0, 10.0), Similarity::Iou, None).unwrap();
        w.iter().any(|w| matches!(w, SanityWarning::LongerThanTruth { .. }))
    };
    // 20 frames, the last is 19: told from frame 30 on.
    assert!(!last(30) && last(31));
}

#[test]
fn few_rows_without_ids_are_no_table_of_detections() {
    let own = |n: u32| {
        let row = |k: u32| TrackRow { frame: k, id: i64::from(k), bbox: [0.0, 0.0, 9.0, 9.0], ..TrackRow::default() };
        TrackTable::from_rows("d", PixelOrigin::Centre0, (0..n).map(row)).unwrap()
    };
    let told = |n| {
        let w = sanity_checks(&fixed(n, 1, 0.0, 9.0), &own(n), Similarity::Iou, None).unwrap();
        w.contains(&SanityWarning::DetectionsWithoutIds(n as usize))
    };
    assert!(!told(20) && told(21));
}
