//! Sanity checks: can this truth and this result belong together? Says what looks wrong, with the likely cause.
//!
//! Tables that share no frame are refused. The rest are warnings, told beside the scores: a result that fits better one
//! frame earlier or later (frames counted from 0 in one file and from 1 in the other), that fits nowhere although it is full
//! (another image size, x and y swapped, another sequence), that reaches far beyond the image, or in which every
//! row is a track of its own (detections instead of tracks).
//! Limits: the shift is looked for in up to 200 frames spread over the sequence.

use super::overlap::{Overlap, OverlapFinder, Similarity, frame_boxes};
use crate::{Error, ErrorKind, Result, TrackTable};
use std::fmt;

/// Left, top, right and bottom of all that a table holds, px.
type Bounds = [f64; 4];

/// What looks wrong with a truth and a result; shown as a whole sentence.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum SanityWarning {
    /// Neither table has rows.
    BothEmpty,
    /// The truth of this name has no rows that count.
    EmptyTruth(String),
    /// The result of this name has no rows.
    EmptyResult(String),
    /// Truth and result hardly overlap anywhere.
    NoOverlap {
        /// Whether there is no overlap at all.
        none: bool,
        /// Where the truth's boxes lie.
        truth: Bounds,
        /// Where the result's boxes lie.
        result: Bounds,
        /// What the extents say of the cause.
        cause: Mismatch,
    },
    /// The result fits better if it is moved by one frame.
    ShiftedFrames {
        /// Whether the better frame is the later one.
        later: bool,
        /// How much more they overlap then, %.
        gain_percent: f64,
    },
    /// A table reaches far beyond the images.
    OutsideImages {
        /// Its name.
        table: String,
        /// Its largest x and y, px.
        reach_px: (f64, f64),
        /// Width and height of the images, px.
        size_px: (f64, f64),
    },
    /// Each of the result's so many rows is a track of its own.
    DetectionsWithoutIds(usize),
    /// The result goes on long after the truth's end.
    LongerThanTruth {
        /// Last frame of the result.
        result_last: usize,
        /// Last frame of the truth.
        truth_last: usize,
    },
}

/// Why a truth and a result may not overlap.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Mismatch {
    /// The extents are each other's with x and y swapped.
    SwappedAxes,
    /// The extents are of different sizes.
    ImageSize,
    /// The extents are alike.
    Sequence,
}

impl fmt::Display for SanityWarning {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::BothEmpty => write!(f, "Truth and result are both empty."),
            Self::EmptyTruth(label) => write!(f, "The truth {label} has no rows that count."),
            Self::EmptyResult(label) => write!(f, "The result {label} has no rows."),
            Self::NoOverlap { none, truth, result, cause } => {
                let span = |v: &Bounds| format!("x {:.0} to {:.0}, y {:.0} to {:.0}", v[0], v[2], v[1], v[3]);
                let how = if *none { "No truth" } else { "Hardly any truth" };
                let cause = match cause {
                    Mismatch::SwappedAxes => "are x and y swapped in one of them?",
                    Mismatch::ImageSize => "are they of images of different sizes?",
                    Mismatch::Sequence => "are they of different sequences?",
                };
                write!(f, "{how} overlaps any result: truth spans {}, result {}; {cause}", span(truth), span(result))
            }
            Self::ShiftedFrames { later, gain_percent } => write!(
                f,
                "The result fits better one frame {} ({gain_percent:.1} % more overlap): does one file count frames from 0 and the other from 1?",
                if *later { "later" } else { "earlier" },
            ),
            Self::OutsideImages { table, reach_px: (x, y), size_px: (width, height) } => write!(
                f,
                "{table} reaches x {x:.0}, y {y:.0} in images of {width:.0} x {height:.0} px: is it of images of another size?"
            ),
            Self::DetectionsWithoutIds(n) => write!(
                f,
                "Each of the result's {n} rows is a track of its own: is it a table of detections, or is its id column another one?"
            ),
            Self::LongerThanTruth { result_last, truth_last } => write!(
                f,
                "The result goes on to frame {result_last}, the truth ends at {truth_last}: rows after that count as false."
            ),
        }
    }
}

fn first_and_last(table: &TrackTable) -> Option<(usize, usize)> {
    let full = |f: &usize| !table.rows(*f).is_empty();
    Some(((0..table.n_frames()).find(full)?, (0..table.n_frames()).rev().find(full)?))
}

fn bounds(table: &TrackTable) -> Bounds {
    let mut r = [f64::INFINITY, f64::INFINITY, f64::NEG_INFINITY, f64::NEG_INFINITY];
    for b in &table.boxes {
        r = [r[0].min(b[0]), r[1].min(b[1]), r[2].max(b[0] + b[2]), r[3].max(b[1] + b[3])];
    }
    r
}

/// Sum of the best similarities of the truth rows of each frame looked at, and how many rows; `None` where the result `shift` frames later has no such frame.
fn fits(
    truth: &TrackTable,
    result: &TrackTable,
    similarity: Similarity,
    shift: i64,
    finder: &mut OverlapFinder,
) -> Vec<Option<(f64, usize)>> {
    let n = truth.n_frames().max(1);
    let mut overlaps = Vec::new();
    let frames = (0..n).step_by(n.div_ceil(200));
    frames
        .map(|frame| {
            let other = usize::try_from(frame as i64 + shift).ok()?;
            overlaps.clear();
            finder.frame(similarity, frame_boxes(truth, frame), frame_boxes(result, other), &mut overlaps);
            let best = |o: &[Overlap]| o.iter().map(|o| o.similarity).fold(0.0, f64::max);
            Some((overlaps.chunk_by(|a, b| a.row == b.row).map(best).sum(), truth.rows(frame).len()))
        })
        .collect()
}

/// Mean over the truth's rows.
fn mean(fits: &[Option<(f64, usize)>]) -> f64 {
    let (sum, n) = fits.iter().flatten().fold((0.0, 0), |(s, n), f| (s + f.0, n + f.1));
    sum / n.max(1) as f64
}

/// Whether more frames fit better than worse by more than chance (the sign test: a lost target counts no more than any other frame).
fn is_surely_better(better: &[Option<(f64, usize)>], than: &[Option<(f64, usize)>]) -> bool {
    let pairs = better.iter().zip(than).filter_map(|(a, b)| Some((a.as_ref()?.0, b.as_ref()?.0)));
    let (wins, losses) = pairs.fold((0, 0), |(w, l), (a, b)| (w + u32::from(a > b), l + u32::from(a < b)));
    f64::from(wins) - f64::from(losses) > SURE * f64::from(wins + losses).sqrt()
}

/// Mean overlap below which a truth and a result are said not to fit.
const HARDLY_ANY: f64 = 0.02;
/// Gain in overlap from which a shift by one frame is told; and one from which it is told if it is sure. A target that moves little overlaps itself a frame later
/// nearly as well, but a result that lags by less than half a frame fits best where it is.
const SHIFT_GAIN: f64 = 1.03;
const SURE_SHIFT_GAIN: f64 = 1.01;
/// Standard deviations of chance from which a gain is sure.
const SURE: f64 = 4.0;
/// Share of the images' size beyond which a table is said to be of other images.
const FAR_OUTSIDE: f64 = 1.5;

/// Looks for signs that a truth and a result do not belong together. `size_px` is the size of the images where it is known.
/// # Errors
/// [`ErrorKind::Damaged`] if both have rows but no frame in common.
pub fn sanity_checks(
    truth: &TrackTable,
    result: &TrackTable,
    similarity: Similarity,
    size_px: Option<(f64, f64)>,
) -> Result<Vec<SanityWarning>> {
    let (t, r) = match (first_and_last(truth), first_and_last(result)) {
        (None, None) => return Ok(vec![SanityWarning::BothEmpty]),
        (None, _) => return Ok(vec![SanityWarning::EmptyTruth(truth.label.clone())]),
        (_, None) => return Ok(vec![SanityWarning::EmptyResult(result.label.clone())]),
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
    let mut out: Vec<SanityWarning> = misfit(truth, result, similarity).into_iter().collect();
    if let Some((width, height)) = size_px {
        for table in [truth, result] {
            let [_, _, right, bottom] = bounds(table);
            if right > FAR_OUTSIDE * width || bottom > FAR_OUTSIDE * height {
                let (table, reach_px, size_px) = (table.label.clone(), (right, bottom), (width, height));
                out.push(SanityWarning::OutsideImages { table, reach_px, size_px });
            }
        }
    }
    if result.n_tracks() == result.n_rows() && result.n_rows() > 3 * truth.n_tracks() && result.n_rows() > 20 {
        out.push(SanityWarning::DetectionsWithoutIds(result.n_rows()));
    }
    if r.1 > t.1 + truth.n_frames().max(20) / 2 {
        out.push(SanityWarning::LongerThanTruth { result_last: r.1, truth_last: t.1 });
    }
    Ok(out)
}

/// What the overlap in the same frame and in the neighbouring ones says.
fn misfit(truth: &TrackTable, result: &TrackTable, similarity: Similarity) -> Option<SanityWarning> {
    let mut finder = OverlapFinder::default();
    let mut at = |shift| fits(truth, result, similarity, shift, &mut finder);
    let unmoved = at(0);
    let here = mean(&unmoved);
    let [earlier, later] = [-1, 1].map(|s| {
        let fits = at(s);
        (mean(&fits), s, fits)
    });
    let best = if later.0 > earlier.0 { later } else { earlier };
    if here.max(best.0) < HARDLY_ANY {
        let (a, b) = (bounds(truth), bounds(result));
        let cause = mismatch((a[2] - a[0], a[3] - a[1]), (b[2] - b[0], b[3] - b[1]));
        return Some(SanityWarning::NoOverlap { none: here == 0.0, truth: a, result: b, cause });
    }
    let is_sure = || best.0 > here * SURE_SHIFT_GAIN && is_surely_better(&best.2, &unmoved);
    (best.0 > here * SHIFT_GAIN || is_sure()).then(|| SanityWarning::ShiftedFrames {
        later: best.1 > 0,
        gain_percent: 100.0 * (best.0 / here.max(1e-9) - 1.0).min(99.0),
    })
}

/// What the widths and heights of two tables say of the cause.
fn mismatch(truth: (f64, f64), result: (f64, f64)) -> Mismatch {
    let ratio = (result.0 / truth.0, result.1 / truth.1);
    let swapped = (result.0 / truth.1 - 1.0).abs() < 0.2 && (result.1 / truth.0 - 1.0).abs() < 0.2;
    if ratio.0.max(ratio.1) > 1.5 || ratio.0.min(ratio.1) < 0.67 {
        if swapped { Mismatch::SwappedAxes } else { Mismatch::ImageSize }
    } else {
        Mismatch::Sequence
    }
}

#[cfg(test)]
mod tests;
