//! The sequences of one result together.

use super::evaluate::Evaluation;
use super::pooled::pooled;
use super::values::mot_values;
use crate::metrics::clear_classic::ClearClassic;
use crate::metrics::multi_object::MotScores;
use crate::metrics::value::Value;

/// A result, judged on all its sequences.
#[derive(Clone, Debug, Default)]
#[non_exhaustive]
pub struct ResultEvaluation {
    /// What the result is called.
    pub label: String,
    /// Its sequences.
    pub sequences: Vec<Evaluation>,
    /// CLEAR, identity and HOTA of all sequences, as TrackEval combines them.
    pub combined: MotScores,
}

impl ResultEvaluation {
    /// Puts sequences together.
    pub fn new(label: impl Into<String>, sequences: Vec<Evaluation>) -> Self {
        let scores: Vec<MotScores> = sequences.iter().map(|s| s.scores.clone()).collect();
        Self { label: label.into(), combined: MotScores::combined(&scores), sequences }
    }

    /// The combined measures by name: first CLEAR, identity and HOTA as TrackEval combines them, then
    /// [the rest](Self::optional_values).
    pub fn values(&self) -> Vec<Value> {
        let mut values = self.mot_values();
        values.extend(self.optional_values());
        values
    }

    /// CLEAR, identity and HOTA of all sequences.
    pub fn mot_values(&self) -> Vec<Value> {
        let classics: Vec<ClearClassic> = self.sequences.iter().filter_map(|s| s.classic).collect();
        let classic = (!classics.is_empty()).then(|| ClearClassic::combined(&classics));
        mot_values(&self.combined, classic.as_ref())
    }

    /// The other measures: errors and averages over matched rows as over the rows of all sequences, the rest as means over
    /// the sequences weighted by their frames.
    pub fn optional_values(&self) -> Vec<Value> {
        pooled(self.sequences.iter().flat_map(Evaluation::parts))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::metrics::evaluation::{Better, ClearConvention, EvaluateOptions, evaluate};
    use crate::{PixelOrigin, TrackRow, TrackTable};
    use std::collections::BTreeSet;

    fn table(n_frames: u32, shift: f64) -> TrackTable {
        let row = |frame| TrackRow { frame, id: 1, bbox: [shift, 0.0, 10.0, 10.0], ..TrackRow::default() };
        TrackTable::from_rows("t", PixelOrigin::Centre0, (0..n_frames).map(row)).unwrap()
    }

    fn two(options: &EvaluateOptions) -> ResultEvaluation {
        let judged = |n, shift| evaluate(&table(n, 0.0), &table(n, shift), options).unwrap();
        ResultEvaluation::new("two", vec![judged(3, 1.0), judged(1, 3.0)])
    }

    fn value(r: &ResultEvaluation, name: &str) -> f64 {
        r.values().into_iter().find(|v| v.name == name).unwrap().value
    }

    #[test]
    fn counts_add_up_and_other_measures_weigh_by_frames() {
        let r = two(&EvaluateOptions::default());
        assert_eq!((r.combined.clear.tp, r.combined.n_frames), (4, 4));
        // Biases 1 px over 3 frames and 3 px over 1: (3 + 3) / 4.
        assert!((value(&r, "bias_x") - 1.5).abs() < 1e-12 && (value(&r, "OSPA") - 1.5).abs() < 1e-12);
        assert_eq!(value(&r, "MT"), 2.0);
        let mut classic = EvaluateOptions::default();
        classic.convention = ClearConvention::MotMetrics;
        // Overlaps 9/11 and 7/13; the classic MOTP is the mean distance over all pairs.
        let distance = (3.0 * (1.0 - 9.0 / 11.0) + (1.0 - 7.0 / 13.0)) / 4.0;
        assert!((value(&two(&classic), "MOTP") - distance).abs() < 1e-12);
        assert!(ResultEvaluation::default().optional_values().is_empty());
    }

    #[test]
    fn every_measure_stands_once_with_a_direction_that_fits_its_kind() {
        let values = two(&EvaluateOptions::default()).values();
        let names: BTreeSet<&str> = values.iter().map(|v| v.name).collect();
        assert_eq!(names.len(), values.len());
        let better = |name: &str| values.iter().find(|v| v.name == name).unwrap().better;
        for name in ["HOTA", "MOTA", "IDF1", "Recall", "MT", "SIAP_C", "SIAP_LS", "particle_alpha", "JSC", "AP"] {
            assert_eq!(better(name), Better::Higher, "{name}");
        }
        for name in
            ["FP", "FN", "IDSW", "ML", "GOSPA", "GOSPA_missed", "OSPA2", "TGOSPA", "SIAP_S", "RMSE", "RMSPE", "RMSPE/2"]
        {
            assert_eq!(better(name), Better::Lower, "{name}");
        }
        for name in ["PT", "SIAP_A", "bias_x"] {
            assert_eq!(better(name), Better::Neither, "{name}");
        }
        let unit = |name: &str| values.iter().find(|v| v.name == name).unwrap().unit;
        assert_eq!(
            (unit("GOSPA"), unit("GOSPA_missed"), unit("SIAP_R"), unit("PFE_x"), unit("HOTA")),
            ("px", "px^p", "1/s", "%", "")
        );
    }
}
