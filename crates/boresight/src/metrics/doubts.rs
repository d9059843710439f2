//! Can this truth and this result belong together? Says what looks wrong, with the likely cause.
//!
//! Tables that share no frame are refused. The rest are doubts, told beside the scores: a result that fits better one frame
//! earlier or later (frames counted from 0 in one file and from 1 in the other), or that fits nowhere although it is full
//! (another image size, x and y swapped, another sequence).
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

/// Sum of the best similarity of each truth row, with the result `shift` frames later.
fn fit(truth: &TrackTable, result: &TrackTable, similarity: Similarity, shift: i64, finder: &mut OverlapFinder) -> f64 {
    let n = truth.n_frames().max(1);
    let step = n.div_ceil(200);
    let (mut sum, mut overlaps) = (0.0, Vec::new());
    for frame in (0..n).step_by(step) {
        let Ok(other) = usize::try_from(frame as i64 + shift) else { continue };
        overlaps.clear();
        finder.frame(similarity, frame_boxes(truth, frame), frame_boxes(result, other), &mut overlaps);
        sum += overlaps
            .chunk_by(|a, b| a.row == b.row)
            .map(|o| o.iter().map(|o| o.similarity).fold(0.0, f64::max))
            .sum::<f64>();
    }
    sum
}

/// Looks for signs that a truth and a result do not belong together; each doubt is a whole sentence.
/// # Errors
/// [`ErrorKind::Damaged`] if both have rows but no frame in common.
pub fn doubts(truth: &TrackTable, result: &TrackTable, similarity: Similarity) -> Result<Vec<String>> {
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
    if here == 0.0 && best.0 == 0.0 {
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
        out.push(format!("No truth overlaps any result: truth spans {}, result {}; {cause}", span(a), span(b)));
    } else if best.0 > here * 1.03 {
        out.push(format!(
            "The result fits better one frame {} ({:.1} % more overlap): does one file count frames from 0 and the other from 1?",
            if best.1 > 0 { "later" } else { "earlier" },
            100.0 * (best.0 / here.max(1e-9) - 1.0).min(99.0)
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
        assert!(doubts(&moving(0, 1.0), &moving(0, 1.0), Similarity::Iou).unwrap().is_empty());
        let d = doubts(&moving(0, 1.0), &moving(1, 1.0), Similarity::Iou).unwrap();
        assert!(d[0].contains("one frame later"), "{d:?}");
    }

    #[test]
    fn tables_without_a_common_frame_are_refused_and_other_sizes_are_doubted() {
        let e = doubts(&moving(0, 1.0), &moving(100, 1.0), Similarity::Iou).unwrap_err().to_string();
        assert!(e.contains("frames 0 to 49, result in 100 to 149"), "{e}");
        let mut far = moving(0, 4.0);
        far.boxes.iter_mut().for_each(|b| b[1] += 900.0);
        let d = doubts(&moving(0, 1.0), &far, Similarity::Iou).unwrap();
        assert!(d[0].contains("different sizes"), "{d:?}");
    }
}
