//! All measures of one sequence.
//!
//! Order: both tables are brought to one origin of coordinates, rows that do not count are left out, the tables are looked
//! at for signs that they do not belong together, and what is left goes through every measure.

use super::further::FurtherMeasures;
use super::note::Note;
use super::options::{ClearConvention, EvaluateOptions, MeasureSet};
use crate::metrics::cells::CellSequence;
use crate::metrics::clear_classic::{ClearClassic, clear_classic};
use crate::metrics::multi_object::{MatchOptions, MotScores, mot_scores};
use crate::metrics::preprocess::preprocess;
use crate::metrics::sanity::sanity_checks;
use crate::{PixelOrigin, Result, Scan, TrackTable};
use serde::{Serialize, Serializer};

/// Pieces into which a sequence is cut for the bootstrap, and their least length, frames.
const N_PIECES: usize = 20;
const MIN_PIECE_FRAMES: usize = 10;

/// A truth and a result, and what is known of their sequence.
#[derive(Clone, Copy, Debug)]
#[non_exhaustive]
pub struct Sequence<'a> {
    /// Name of the sequence.
    pub name: &'a str,
    /// What was there.
    pub truth: &'a TrackTable,
    /// What was found.
    pub result: &'a TrackTable,
    /// Frame rate, frames/s; 25 is assumed where a measure needs one.
    pub rate_hz: Option<f64>,
    /// Width and height of the frames, px.
    pub size_px: Option<(f64, f64)>,
    /// The detections that the result was made of, for the NIS.
    pub detections: Option<&'a [Scan]>,
    /// Labelled images, for DET and TRA.
    pub cells: Option<&'a CellSequence>,
}

/// What was measured in one sequence.
#[derive(Clone, Debug, Default, Serialize)]
#[non_exhaustive]
pub struct Evaluation {
    /// Name of the sequence.
    pub name: String,
    /// CLEAR, identity and HOTA.
    pub scores: MotScores,
    /// CLEAR in the convention of py-motmetrics, if asked for.
    pub classic: Option<ClearClassic>,
    /// All other measures, unless only CLEAR, identity and HOTA were asked for.
    #[serde(flatten, serialize_with = "or_default")]
    pub further: Option<FurtherMeasures>,
    /// Frame rate, frames/s.
    pub rate_hz: Option<f64>,
    /// Width and height of the frames, px.
    pub size_px: Option<(f64, f64)>,
    /// Scores of pieces of the sequence, if asked for.
    #[serde(skip)]
    pub pieces: Vec<MotScores>,
    /// Remarks.
    #[serde(skip)]
    pub notes: Vec<Note>,
}

/// Measures that were not asked for stand as zeros and nulls, so that a reader finds the same keys in every file.
fn or_default<S: Serializer>(further: &Option<FurtherMeasures>, to: S) -> Result<S::Ok, S::Error> {
    match further {
        Some(further) => further.serialize(to),
        None => FurtherMeasures::default().serialize(to),
    }
}

/// Judges a result by every measure.
///
/// ```
/// use boresight::metrics::{EvaluateOptions, evaluate};
/// use boresight::{PixelOrigin, TrackRow, TrackTable};
/// let row = |frame, id, left| TrackRow { frame, id, bbox: [left, 0.0, 10.0, 10.0], ..TrackRow::default() };
/// let truth = TrackTable::from_rows("truth", PixelOrigin::Centre0, [row(0, 1, 0.0), row(1, 1, 1.0)])?;
/// let result = TrackTable::from_rows("result", PixelOrigin::Centre0, [row(0, 7, 0.0), row(1, 8, 1.0)])?;
/// let evaluation = evaluate(&truth, &result, &EvaluateOptions::default())?;
/// assert_eq!(evaluation.scores.clear.idsw, 1);
/// let gospa = evaluation.values().into_iter().find(|v| v.name == "GOSPA").unwrap();
/// assert_eq!((gospa.value, gospa.unit), (0.0, "px"));
/// # Ok::<(), boresight::Error>(())
/// ```
/// # Errors
/// As [`Sequence::evaluate`].
pub fn evaluate(truth: &TrackTable, result: &TrackTable, options: &EvaluateOptions) -> Result<Evaluation> {
    Sequence::new(truth, result).evaluate(options)
}

impl<'a> Sequence<'a> {
    /// A truth and a result of which nothing else is known.
    pub fn new(truth: &'a TrackTable, result: &'a TrackTable) -> Self {
        Self { name: "", truth, result, rate_hz: None, size_px: None, detections: None, cells: None }
    }

    /// Judges the result by every measure.
    /// # Errors
    /// Options out of range; tables that share no frame; an id twice in a frame; a class that the rules do not know; a
    /// truth without cells; a programme of trajectory GOSPA that the solver cannot finish.
    pub fn evaluate(&self, options: &EvaluateOptions) -> Result<Evaluation> {
        options.validate()?;
        let (truth, result) = self.counted(options)?;
        let matching = options.match_options(truth.is_points || result.is_points);
        let warnings = sanity_checks(&truth, &result, matching.similarity, self.size_px)?;
        let mut out = Evaluation {
            name: self.name.to_string(),
            scores: mot_scores(&truth, &result, &matching)?,
            rate_hz: self.rate_hz,
            size_px: self.size_px,
            notes: warnings.into_iter().map(Note::Sanity).collect(),
            ..Evaluation::default()
        };
        if options.convention == ClearConvention::MotMetrics {
            out.classic = Some(clear_classic(&truth, &result, &matching)?);
        }
        if options.keep_pieces {
            out.pieces = pieces(&truth, &result, &matching)?;
        }
        if options.measures == MeasureSet::All {
            let counted = Sequence { truth: &truth, result: &result, ..*self };
            out.further = Some(FurtherMeasures::of(&counted, options, &matching, &mut out.notes)?);
        }
        Ok(out)
    }

    /// The rows that count, in one frame of reference.
    fn counted(&self, options: &EvaluateOptions) -> Result<(TrackTable, TrackTable)> {
        if self.truth.origin == self.result.origin {
            return preprocess(self.truth, self.result, options.rules);
        }
        let (mut truth, mut result) = (self.truth.clone(), self.result.clone());
        truth.set_origin(PixelOrigin::Centre0);
        result.set_origin(PixelOrigin::Centre0);
        preprocess(&truth, &result, options.rules)
    }
}

fn pieces(truth: &TrackTable, result: &TrackTable, matching: &MatchOptions) -> Result<Vec<MotScores>> {
    let n = truth.n_frames().max(result.n_frames());
    let length = n.div_ceil(N_PIECES).max(MIN_PIECE_FRAMES);
    (0..n)
        .step_by(length)
        .map(|from| {
            let inside = |frame: usize, _: usize| (from..from + length).contains(&frame);
            mot_scores(&truth.filtered(inside), &result.filtered(inside), matching)
        })
        .collect()
}
