//! All measures of one sequence.
//!
//! Order: both tables are brought to one origin of coordinates, rows that do not count are left out, the tables are looked
//! at for signs that they do not belong together, and what is left goes through every measure.

use super::note::Note;
use super::optional::OptionalMeasures;
use super::options::{ClearConvention, EvaluateOptions, MeasureSet};
use super::sequence::Sequence;
use crate::length_unit::LengthUnit;
use crate::metrics::clear_classic::{ClearClassic, clear_classic};
use crate::metrics::multi_object::{MatchOptions, MotScores, mot_scores};
use crate::metrics::preprocess::preprocess;
use crate::metrics::sanity::sanity_checks;
use crate::{PixelOrigin, Result, TrackTable};
use serde::Serialize;

/// Pieces into which a sequence is cut for the bootstrap, and their least length, frames.
const N_PIECES: usize = 20;
const MIN_PIECE_FRAMES: usize = 10;

/// What was measured in one sequence.
#[derive(Clone, Debug, Default, Serialize)]
#[non_exhaustive]
pub struct Evaluation {
    /// Name of the sequence.
    pub name: String,
    /// What distances are counted in; fields that end in `_px` are in it.
    pub unit: LengthUnit,
    /// CLEAR, identity and HOTA.
    pub scores: MotScores,
    /// CLEAR in the convention of py-motmetrics, if asked for.
    pub classic: Option<ClearClassic>,
    /// All other measures, unless only CLEAR, identity and HOTA were asked for; their keys are then absent from the JSON.
    #[serde(flatten)]
    pub optional: Option<OptionalMeasures>,
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

impl Sequence<'_> {
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
            unit: self.unit(),
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
            out.optional = Some(OptionalMeasures::of(&counted, options, &matching, &mut out.notes)?);
        }
        Ok(out)
    }

    /// Metres where one of the tables says so.
    fn unit(&self) -> LengthUnit {
        let metres = [self.truth, self.result].iter().any(|t| t.unit == LengthUnit::Metre);
        if metres { LengthUnit::Metre } else { LengthUnit::Pixel }
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::metrics::evaluation::Matching;
    use crate::metrics::sanity::SanityWarning;
    use crate::{Error, ErrorKind, TrackRow};

    /// Boxes of 10 x 10 px: frame, id, left.
    fn boxes(origin: PixelOrigin, rows: &[(u32, i64, f64)]) -> TrackTable {
        let row = |&(frame, id, x): &_| TrackRow { frame, id, bbox: [x, 0.0, 10.0, 10.0], ..TrackRow::default() };
        TrackTable::from_rows("t", origin, rows.iter().map(row)).unwrap()
    }

    fn value(e: &Evaluation, name: &str) -> f64 {
        e.values().into_iter().find(|v| v.name == name).unwrap_or_else(|| panic!("no {name}")).value
    }

    /// Three frames of one truth; the result is 4 px to the right, then 4 px, then away; a false row in frame 1.
    fn pair() -> (TrackTable, TrackTable) {
        let truth = boxes(PixelOrigin::Centre0, &[(0, 1, 0.0), (1, 1, 0.0), (2, 1, 0.0)]);
        let result = boxes(PixelOrigin::Centre0, &[(0, 5, 4.0), (1, 5, 4.0), (1, 6, 90.0)]);
        (truth, result)
    }

    #[test]
    fn every_family_of_measures_has_its_value_by_hand() {
        let (t, r) = pair();
        let mut o = EvaluateOptions::default();
        o.matching = Matching::Centre;
        o.max_distance_px = 8.0;
        o.set.cutoff_px = 6.0;
        o.set.order = 1.0;
        o.window_frames = 3;
        o.convention = ClearConvention::MotMetrics;
        let mut s = Sequence::new(&t, &r);
        s.rate_hz = Some(2.0);
        s.size_px = Some((100.0, 50.0));
        let e = s.evaluate(&o).unwrap();
        // GOSPA of order 1: 4, then 4 + 3, then 3: mean 14/3. OSPA: 4, (4 + 6) / 2, 6: mean 5.
        assert!((value(&e, "GOSPA") - 14.0 / 3.0).abs() < 1e-12);
        assert!((value(&e, "GOSPA_location") - 8.0 / 3.0).abs() < 1e-12);
        assert!((value(&e, "GOSPA_missed") - 1.0).abs() < 1e-12 && (value(&e, "GOSPA_false") - 1.0).abs() < 1e-12);
        assert!((value(&e, "OSPA") - 5.0).abs() < 1e-12);
        // OSPA(2): the tracks are (4 + 4 + 6) / 3 apart, the false one counts 6: mean of both.
        assert!((value(&e, "OSPA2") - (14.0 / 3.0 + 6.0) / 2.0).abs() < 1e-12);
        // Trajectory GOSPA: the sums of GOSPA over 3 frames, no switch; per frame.
        #[cfg(feature = "trajectory-gospa")]
        assert!((value(&e, "TGOSPA") - 14.0 / 3.0).abs() < 1e-9 && value(&e, "TGOSPA_switch") == 0.0);
        // SIAP: 2 of 3 truth rows associated; 1 of 3 result rows spurious; accuracy 4 px.
        assert!((value(&e, "SIAP_C") - 2.0 / 3.0).abs() < 1e-12 && (value(&e, "SIAP_S") - 1.0 / 3.0).abs() < 1e-12);
        assert!((value(&e, "SIAP_PA") - 4.0).abs() < 1e-12 && value(&e, "SIAP_A") == 1.0);
        // Particle measures with the gate 8: d = 4 + 4 + 8 of 24; the false row adds 8.
        assert!(
            (value(&e, "particle_alpha") - 1.0 / 3.0).abs() < 1e-12
                && (value(&e, "particle_beta") - 8.0 / 32.0).abs() < 1e-12
        );
        assert!((value(&e, "RMSE") - 4.0).abs() < 1e-12 && (value(&e, "JSC") - 0.5).abs() < 1e-12);
        // Detections: bias 4 px without scatter; a false alarm in 3 frames of 5000 px at 2 frames/s.
        assert_eq!((value(&e, "bias_x"), value(&e, "bias_y"), value(&e, "scatter_x")), (4.0, 0.0, 0.0));
        assert!((value(&e, "FP/Mpx") - 1.0 / 3.0 / 0.005).abs() < 1e-9 && (value(&e, "FP/hour") - 2400.0).abs() < 1e-9);
        // CLEAR of py-motmetrics: MOTP is 1 − similarity = 4 / 16; MOTA 1 − (1 + 1) / 3.
        assert!((value(&e, "MOTP") - 0.25).abs() < 1e-12 && (value(&e, "MOTA") - 1.0 / 3.0).abs() < 1e-12);
        assert!((value(&e, "FP/frame") - 1.0 / 3.0).abs() < 1e-12 && value(&e, "ML") == 0.0);
        assert!((value(&e, "RMSPE") - 4.0).abs() < 1e-12 && (value(&e, "RMSPE/2") - 8.0_f64.sqrt()).abs() < 1e-12);
    }

    #[test]
    fn the_switch_cost_is_half_the_cutoff_and_the_rate_25_where_nothing_is_said() {
        let truth = boxes(PixelOrigin::Centre0, &[(0, 1, 0.0), (1, 1, 0.0), (2, 1, 0.0), (3, 1, 0.0)]);
        let cut = boxes(PixelOrigin::Centre0, &[(0, 1, 1.0), (1, 1, 1.0), (2, 2, 1.0), (3, 2, 1.0)]);
        let mut o = EvaluateOptions::default();
        o.set.order = 1.0;
        let e = evaluate(&truth, &cut, &o).unwrap();
        // 4 frames at 1 px and one switch of 5 px over 4 frames.
        #[cfg(feature = "trajectory-gospa")]
        {
            assert!(
                (value(&e, "TGOSPA") - 9.0 / 4.0).abs() < 1e-9 && (value(&e, "TGOSPA_switch") - 5.0 / 4.0).abs() < 1e-9
            );
            o.switch_px = Some(2.0);
            let e = evaluate(&truth, &cut, &o).unwrap();
            assert!((value(&e, "TGOSPA_switch") - 2.0 / 4.0).abs() < 1e-9);
        }
        // One change of number; two associations of one step of 0.04 s each.
        assert!((value(&e, "SIAP_R") - 1.0 / 0.08).abs() < 1e-9, "{}", value(&e, "SIAP_R"));
        assert!(e.values().iter().all(|v| v.name != "FP/hour"));
    }

    #[test]
    fn windows_too_large_for_the_solver_are_left_out_with_a_note() {
        let truth = boxes(PixelOrigin::Centre0, &[(0, 1, 0.0), (1, 1, 0.0)]);
        let cut = boxes(PixelOrigin::Centre0, &[(0, 1, 1.0), (1, 2, 1.0)]);
        let mut o = EvaluateOptions::default();
        o.max_unknowns = 3;
        let e = evaluate(&truth, &cut, &o).unwrap();
        let note = e.notes.iter().find(|n| matches!(n, Note::TrajectoryGospaLeftOut(_))).unwrap().to_string();
        assert_eq!(note, "TGOSPA is left out: trajectory GOSPA needs 4 unknowns, more than 3");
        assert!(e.values().iter().all(|v| v.name != "TGOSPA"));
    }

    #[test]
    fn tables_of_other_origins_meet_in_one() {
        let truth = boxes(PixelOrigin::Pixel1, &[(0, 1, 11.5), (1, 1, 11.5)]);
        let result = boxes(PixelOrigin::Centre0, &[(0, 1, 10.0), (1, 1, 10.0)]);
        let e = evaluate(&truth, &result, &EvaluateOptions::default()).unwrap();
        // y begins at 0 in both files: 1.5 px apart.
        assert!((value(&e, "bias_x")).abs() < 1e-12 && (value(&e, "bias_y") - 1.5).abs() < 1e-12);
    }

    #[test]
    fn only_clear_identity_and_hota_are_computed_if_only_they_are_wanted() {
        let (t, r) = pair();
        let mut o = EvaluateOptions::default();
        o.measures = MeasureSet::Mot;
        o.min_overlap = 0.4;
        // A cutoff that set distances refuse is not looked at.
        o.set.cutoff_px = 0.0;
        let e = evaluate(&t, &r, &o).unwrap();
        assert!(e.optional.is_none() && e.optional_values().is_empty() && e.scores.clear.tp == 2);
        let json = serde_json::to_value(&e).unwrap();
        assert!(
            json.get("ospa2").is_none() && json.get("particle").is_none() && json.get("scores").is_some(),
            "{json}"
        );
        assert_eq!(evaluate(&t, &r, &EvaluateOptions::default()).unwrap().scores.clear.tp, 0);
    }

    #[test]
    fn twenty_pieces_of_at_least_ten_frames_are_kept_if_asked_for() {
        let rows = |n: u32| boxes(PixelOrigin::Centre0, &(0..n).map(|f| (f, 1, 0.0)).collect::<Vec<_>>());
        let mut o = EvaluateOptions::default();
        assert!(evaluate(&rows(400), &rows(400), &o).unwrap().pieces.is_empty());
        o.keep_pieces = true;
        let pieces = |n| evaluate(&rows(n), &rows(n), &o).unwrap().pieces;
        assert_eq!((pieces(400).len(), pieces(95).len()), (20, 10));
        assert_eq!(pieces(95).iter().map(|p| p.n_truth_rows).collect::<Vec<_>>(), [&[10; 9][..], &[5]].concat());
    }

    #[test]
    fn wrong_options_and_strange_tables_are_told() {
        let (t, r) = pair();
        let refused = |change: fn(&mut EvaluateOptions)| -> Error {
            let mut o = EvaluateOptions::default();
            change(&mut o);
            evaluate(&t, &r, &o).unwrap_err()
        };
        let e = refused(|o| o.max_distance_px = 0.0).to_string();
        assert!(e.contains("max-distance-px = 0"), "{e}");
        assert!(refused(|o| o.window_frames = 0).to_string().contains("at least 1 frame"));
        assert!(refused(|o| o.set.cutoff_px = -1.0).to_string().contains("evaluate.cutoff-px"));
        assert_eq!(refused(|o| o.min_overlap = 1.5).kind(), ErrorKind::Config);
        let empty = boxes(PixelOrigin::Centre0, &[]);
        let e = evaluate(&t, &empty, &EvaluateOptions::default()).unwrap();
        assert_eq!(e.notes, [Note::Sanity(SanityWarning::EmptyResult("t".into()))]);
        // Without truth the particle measures are not defined; they stay 0.
        let e = evaluate(&empty, &r, &EvaluateOptions::default()).unwrap();
        assert_eq!((value(&e, "particle_alpha"), value(&e, "FP")), (0.0, 3.0));
    }
}
