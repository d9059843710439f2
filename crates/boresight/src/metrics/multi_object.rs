//! CLEAR, identity and HOTA of a result against a truth, in one pass over the boxes.
//!
//! Source: see [`super::clear`], [`super::identity`], [`super::hota`]. The overlaps of every frame are found once and kept
//! (16 bytes each) for the second pass of HOTA; nothing is ever dense.

use super::clear::{Clear, ClearCounter};
use super::hota::{Alignment, Hota, HotaCounter};
use super::identity::{Identity, identity};
use super::near::rows_of_tracks;
use super::overlap::{Overlap, OverlapFinder, Similarity, frame_boxes, frame_tracks};
use super::pairs::PairIndex;
use crate::{Error, ErrorKind, Result, TrackTable};
use serde::Serialize;

/// How truths and results are matched.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MatchOptions {
    /// What makes two boxes alike.
    pub similarity: Similarity,
    /// Similarity from which a pair may match in CLEAR and identity, in (0, 1]. HOTA goes through all thresholds.
    pub threshold: f64,
}

impl Default for MatchOptions {
    fn default() -> Self {
        Self { similarity: Similarity::Iou, threshold: 0.5 }
    }
}

/// Scores of a result; those of several sequences can be combined.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct MotScores {
    /// CLEAR counts.
    pub clear: Clear,
    /// Identity counts.
    pub identity: Identity,
    /// HOTA.
    pub hota: Hota,
    /// Truth rows.
    pub n_truth_rows: u64,
    /// Result rows.
    pub n_result_rows: u64,
    /// Frames, those of an empty truth or result included.
    pub n_frames: u64,
    /// Truth tracks.
    pub n_truths: u64,
    /// Result tracks.
    pub n_results: u64,
}

impl MotScores {
    /// Several sequences together, as TrackEval combines them.
    pub fn combined(all: &[Self]) -> Self {
        Self {
            clear: Clear::combined(all.iter().map(|s| &s.clear)),
            identity: Identity::combined(all.iter().map(|s| &s.identity)),
            hota: Hota::combined(all.iter().map(|s| &s.hota)),
            n_truth_rows: all.iter().map(|s| s.n_truth_rows).sum(),
            n_result_rows: all.iter().map(|s| s.n_result_rows).sum(),
            n_frames: all.iter().map(|s| s.n_frames).sum(),
            n_truths: all.iter().map(|s| s.n_truths).sum(),
            n_results: all.iter().map(|s| s.n_results).sum(),
        }
    }
}

/// Refuses tables in which a track stands twice in a frame.
/// # Errors
/// [`ErrorKind::Damaged`], with frame and id.
pub fn refuse_doubles(table: &TrackTable) -> Result<()> {
    match table.twice_in_a_frame() {
        None => Ok(()),
        Some((frame, id)) => Err(Error::new(
            ErrorKind::Damaged,
            format!("id {id} stands twice in frame {frame} (counted from 0): expected each id at most once a frame"),
        )
        .at(&table.label)
        .hint("a table of detections without ids? or two sequences in one file?")),
    }
}

/// Computes CLEAR, identity and HOTA.
///
/// ```
/// use boresight::metrics::{MatchOptions, mot_scores};
/// use boresight::{PixelOrigin, TrackRow, TrackTable};
/// let row = |frame, id, left| TrackRow { frame, id, bbox: [left, 0.0, 10.0, 10.0], ..TrackRow::default() };
/// let truth = TrackTable::from_rows("truth", PixelOrigin::Centre0, [row(0, 1, 0.0), row(1, 1, 1.0)])?;
/// let result = TrackTable::from_rows("result", PixelOrigin::Centre0, [row(0, 7, 0.0), row(1, 8, 1.0)])?;
/// let scores = mot_scores(&truth, &result, &MatchOptions::default())?;
/// assert_eq!(scores.clear.idsw, 1);
/// assert_eq!(scores.identity.idf1(), 0.5);
/// # Ok::<(), boresight::Error>(())
/// ```
/// # Errors
/// A threshold outside (0, 1]; an id twice in a frame.
pub fn mot_scores(truth: &TrackTable, result: &TrackTable, options: &MatchOptions) -> Result<MotScores> {
    if !(options.threshold > 0.0 && options.threshold <= 1.0) {
        return Err(Error::new(ErrorKind::Config, "expected a similarity in (0, 1]")
            .at(format!("threshold = {}", options.threshold)));
    }
    if let Similarity::Centre { zero_distance_px: d } = options.similarity
        && !(d > 0.0 && d.is_finite())
    {
        return Err(Error::new(ErrorKind::Config, "expected a distance above 0 px").at(format!("zero distance = {d}")));
    }
    refuse_doubles(truth)?;
    refuse_doubles(result)?;
    let n_frames = truth.n_frames().max(result.n_frames());
    let (truth_rows, result_rows) = (rows_of_tracks(truth, 0..n_frames), rows_of_tracks(result, 0..n_frames));
    let mut finder = OverlapFinder::default();
    let mut clear = ClearCounter::new(truth.n_tracks(), options.threshold);
    let mut index = PairIndex::default();
    let mut alignment = Alignment::default();
    let mut common: Vec<u32> = Vec::new();
    let mut overlaps: Vec<Overlap> = Vec::new();
    let mut numbers: Vec<u32> = Vec::new();
    let mut starts = Vec::with_capacity(n_frames + 1);
    starts.push(0_usize);
    for frame in 0..n_frames {
        let from = overlaps.len();
        finder.frame(options.similarity, frame_boxes(truth, frame), frame_boxes(result, frame), &mut overlaps);
        let (t, r) = (frame_tracks(truth, frame), frame_tracks(result, frame));
        let here = &overlaps[from..];
        clear.frame(t, r, here);
        for o in here {
            let k = index.number(t[o.row as usize], r[o.col as usize]);
            numbers.push(k);
            if common.len() <= k as usize {
                common.push(0);
            }
            common[k as usize] += u32::from(o.similarity >= options.threshold);
        }
        alignment.frame(t.len(), r.len(), here, &numbers[from..]);
        starts.push(overlaps.len());
    }
    let (n_truth_rows, n_result_rows) = (truth.n_rows() as u64, result.n_rows() as u64);
    let hota = if n_truth_rows == 0 || n_result_rows == 0 {
        Hota::of_empty(n_truth_rows, n_result_rows)
    } else {
        let scores = alignment.scores(index.pairs(), &truth_rows, &result_rows);
        let mut hota = HotaCounter::new(index.pairs().len());
        for frame in 0..n_frames {
            let span = starts[frame]..starts[frame + 1];
            let (n, m) = (truth.rows(frame).len(), result.rows(frame).len());
            hota.frame(n, m, &overlaps[span.clone()], &numbers[span], &scores);
        }
        hota.finish(index.pairs(), &truth_rows, &result_rows)
    };
    Ok(MotScores {
        clear: clear.finish(n_frames as u64),
        identity: identity(n_truth_rows, n_result_rows, result.n_tracks(), index.pairs(), &common),
        hota,
        n_truth_rows,
        n_result_rows,
        n_frames: n_frames as u64,
        n_truths: truth.n_tracks() as u64,
        n_results: result.n_tracks() as u64,
    })
}
