//! Can this truth and this result belong together? Says what looks wrong, with the likely cause.
//!
//! Tables that share no frame are refused. The rest are doubts, told beside the scores: a result that fits better one frame
//! earlier or later (frames counted from 0 in one file and from 1 in the other), that fits nowhere although it is full
//! (another image size, x and y swapped, another sequence), that reaches far beyond the image, or in which every
//! row is a track of its own (detections instead of tracks).
//! Limits: the shift is looked for in up to 200 frames spread over the sequence.

use super::overlap::{OverlapFinder, Similarity, frame_boxes};
use crate::{Error, ErrorKind, Result, TrackTable};

fn first_and_last(table: &TrackTable) -> Option<(usize, usize)> {
    let full = |f: &usize| !table.rows(*f).is_empty();
    Some(((0..table.n_frames()).find(full)?, (0..table.n_frames()).rev().find(full)?))
}

fn reach(table: &TrackTable) -> [f64; 4] {
    let mut r = [f64::INFINITY, f64::INFINITY, f64::NEG_INFINITY, f64::NEG_INFINITY];
    for b in &table.boxes {
        r = [r[0].min(b[0]), r[1].min(b[1]), r[2].max(b[0] + b[2]), r[3].max(b[1] + b[3])];
    }
    r
}

/// Mean of the best similarity of each truth row, with the result `shift` frames later.
fn fit(truth: &TrackTable, result: &TrackTable, similarity: Similarity, shift: i64, finder: &mut OverlapFinder) -> f64 {
    let n = truth.n_frames().max(1);
    let step = n.div_ceil(200);
    let (mut sum, mut n_rows, mut overlaps) = (0.0, 0, Vec::new());
    for frame in (0..n).step_by(step) {
        let Ok(other) = usize::try_from(frame as i64 + shift) else { continue };
        overlaps.clear();
        n_rows += truth.rows(frame).len();
        finder.frame(similarity, frame_boxes(truth, frame), frame_boxes(result, other), &mut overlaps);
        sum += overlaps
            .chunk_by(|a, b| a.row == b.row)
            .map(|o| o.iter().map(|o| o.similarity).fold(0.0, f64::max))
            .sum::<f64>();
    }
    sum / (n_rows.max(1)) as f64
}

/// Mean overlap below which a result that reaches elsewhere is doubted.
const HARDLY_ANY: f64 = 0.02;

/// Looks for signs that a truth and a result do not belong together; each doubt is a whole sentence. `size_px` is the size of
/// the images where it is known.
/// # Errors
/// [`ErrorKind::Damaged`] if both have rows but no frame in common.
pub fn doubts(
    truth: &TrackTable,
    result: &TrackTable,
    similarity: Similarity,
    size_px: Option<(f64, f64)>,
) -> Result<Vec<String>> {
    let mut out = Vec::new();
    let (t, r) = match (first_and_last(truth), first_and_last(result)) {
        (None, None) => return Ok(vec!["Truth and result are both empty.".into()]),
        (None, _) => return Ok(vec![format!("The truth {} has no rows that count.", truth.label)]),
        (_, None) => return Ok(vec![format!("The result {} has no rows.", result.label)]),
        (Some(t), Some(r)) => (t, r),
    };
    if t.1 < r.0 || r.1 < t.0 {
        let what = format!(
            "truth has rows in frames {} to {}, result in {} to {} (counted from 0): no frame in common",
            t.0, t.1, r.0, r.1
        );
        return Err(Error::new(ErrorKind::Damaged, what)
            .at(format!("{} and {}", truth.label, result.label))
            .hint("are they of the same sequence, and do both count frames from the beginning of the video?"));
    }
    let mut finder = OverlapFinder::default();
    let here = fit(truth, result, similarity, 0, &mut finder);
    let shifted = [-1, 1].map(|s| (fit(truth, result, similarity, s, &mut finder), s));
    let best = if shifted[1].0 > shifted[0].0 { shifted[1] } else { shifted[0] };
    if here.max(best.0) < HARDLY_ANY {
        let (a, b) = (reach(truth), reach(result));
        let span = |v: [f64; 4]| format!("x {:.0} to {:.0}, y {:.0} to {:.0}", v[0], v[2], v[1], v[3]);
        let ratio = ((b[2] - b[0]) / (a[2] - a[0]), (b[3] - b[1]) / (a[3] - a[1]));
        let swapped =
            ((b[2] - b[0]) / (a[3] - a[1]) - 1.0).abs() < 0.2 && ((b[3] - b[1]) / (a[2] - a[0]) - 1.0).abs() < 0.2;
        let cause = if ratio.0.max(ratio.1) > 1.5 || ratio.0.min(ratio.1) < 0.67 {
            if swapped { "are x and y swapped in one of them?" } else { "are they of images of different sizes?" }
        } else {
            "are they of different sequences?"
        };
        let how = if here == 0.0 { "No truth" } else { "Hardly any truth" };
        out.push(format!("{how} overlaps any result: truth spans {}, result {}; {cause}", span(a), span(b)));
    } else if best.0 > here * 1.03 {
        out.push(format!(
            "The result fits better one frame {} ({:.1} % more overlap): does one file count frames from 0 and the other from 1?",
            if best.1 > 0 { "later" } else { "earlier" },
            100.0 * (best.0 / here.max(1e-9) - 1.0).min(99.0)
        ));
    }
    if let Some((width, height)) = size_px {
        for table in [truth, result] {
            let [_, _, right, bottom] = reach(table);
            if right > 1.5 * width || bottom > 1.5 * height {
                out.push(format!(
                    "{} reaches x {right:.0}, y {bottom:.0} in images of {width:.0} x {height:.0} px: is it of images of another size?",
                    table.label
                ));
            }
        }
    }
    if result.n_tracks() == result.n_rows() && result.n_rows() > 3 * truth.n_tracks() && result.n_rows() > 20 {
        out.push(format!(
            "Each of the result's {} rows is a track of its own: is it a table of detections, or is its id column another one?",
            result.n_rows()
        ));
    }
    if r.1 > t.1 + truth.n_frames().max(20) / 2 {
        out.push(format!(
            "The result goes on to frame {}, the truth ends at {}: rows after that count as false.",
            r.1, t.1
        ));
    }
    Ok(out)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{PixelOrigin, TrackRow};

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
    fn a_shift_by_one_frame_is_seen_and_a_good_result_is_not_doubted() {
        assert!(doubts(&moving(0, 1.0), &moving(0, 1.0), Similarity::Iou, None).unwrap().is_empty());
        let d = doubts(&moving(0, 1.0), &moving(1, 1.0), Similarity::Iou, None).unwrap();
        assert!(d[0].contains("one frame later"), "{d:?}");
    }

    #[test]
    fn tables_without_a_common_frame_are_refused_and_other_sizes_are_doubted() {
        let e = doubts(&moving(0, 1.0), &moving(100, 1.0), Similarity::Iou, None).unwrap_err().to_string();
        assert!(e.contains("frames 0 to 49, result in 100 to 149"), "{e}");
        let mut far = moving(0, 4.0);
        far.boxes.iter_mut().for_each(|b| b[1] += 900.0);
        let d = doubts(&moving(0, 1.0), &far, Similarity::Iou, None).unwrap();
        assert!(d[0].contains("different sizes"), "{d:?}");
    }

    #[test]
    fn detections_without_ids_and_rows_outside_of_the_image_are_doubted() {
        let mut n = 0;
        let own = |r: TrackRow| {
            n += 1;
            TrackRow { id: n, ..r }
        };
        let rows = (0..50).map(|f| moving(0, 1.0).row(f, f)).map(own);
        let detections = TrackTable::from_rows("d", PixelOrigin::Centre0, rows.collect::<Vec<_>>()).unwrap();
        let d = doubts(&moving(0, 1.0), &detections, Similarity::Iou, Some((100.0, 100.0))).unwrap();
        assert!(d.iter().any(|d| d.contains("50 rows is a track of its own")), "{d:?}");
        assert!(d.iter().any(|d| d.contains("reaches x 255, y 10 in images of 100 x 100 px")), "{d:?}");
    }
}
