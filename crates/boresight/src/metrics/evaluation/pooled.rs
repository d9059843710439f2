//! One value of a measure from those of several sequences.
//!
//! A root mean square of all sequences is the root of the mean of their squares, not the mean of their roots; a scatter is
//! about the mean of all; the bounds of an average are those of as many values as all have.
//! Symbols: w weight of a sequence (its frames, or its matched rows), v value, m mean of the sequence.
//! Limits: values over rows of equal weight; sequences in which nothing was counted weigh nothing.

use super::states::LEVEL;
use crate::metrics::consistency::bounds;
use crate::metrics::value::Value;

/// How the values of sequences make one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Pooling {
    /// Σ w v / Σ w.
    Mean,
    /// √(Σ w v² / Σ w).
    RootMeanSquare,
    /// √(Σ w (v² + m²) / Σ w − (Σ w m / Σ w)²), a standard deviation about the mean of all.
    Spread {
        mean: f64,
    },
    /// Bounds of the average of Σ w values of so many degrees of freedom.
    LowerBound {
        dimension: usize,
    },
    UpperBound {
        dimension: usize,
    },
}

/// A measure of one sequence with its weight among several.
#[derive(Clone, Copy, Debug)]
pub(super) struct Part {
    pub(super) value: Value,
    weight: f64,
    pooling: Pooling,
}

impl Part {
    pub(super) fn mean(value: Value, weight: f64) -> Self {
        Self { value, weight, pooling: Pooling::Mean }
    }

    pub(super) fn root_mean_square(value: Value, weight: f64) -> Self {
        Self { value, weight, pooling: Pooling::RootMeanSquare }
    }

    pub(super) fn pooled(self, pooling: Pooling) -> Self {
        Self { pooling, ..self }
    }
}

/// The value of each measure over all sequences, in the order of their first appearance.
pub(super) fn pooled(parts: impl Iterator<Item = Part>) -> Vec<Value> {
    let mut measures: Vec<Vec<Part>> = Vec::new();
    for part in parts {
        match measures.iter_mut().find(|m| m[0].value.name == part.value.name) {
            Some(same) => same.push(part),
            None => measures.push(vec![part]),
        }
    }
    measures.iter().map(|parts| Value { value: one(parts), ..parts[0].value }).collect()
}

fn one(parts: &[Part]) -> f64 {
    if let [only] = parts {
        return only.value.value;
    }
    let weight: f64 = parts.iter().map(|p| p.weight).sum();
    if weight == 0.0 {
        return f64::NAN;
    }
    // What weighs nothing may be no number.
    let counted = || parts.iter().filter(|p| p.weight > 0.0);
    let mean = |of: fn(&Part) -> f64| counted().map(|p| p.weight * of(p)).sum::<f64>() / weight;
    let bound = |dimension, side: usize| bounds(weight, dimension, LEVEL).map_or(f64::NAN, |b| b[side]);
    match parts[0].pooling {
        Pooling::Mean => mean(|p| p.value.value),
        Pooling::RootMeanSquare => mean(|p| p.value.value.powi(2)).sqrt(),
        Pooling::Spread { .. } => {
            let second_moment = mean(|p| p.value.value.powi(2) + p.own_mean().powi(2));
            (second_moment - mean(Part::own_mean).powi(2)).max(0.0).sqrt()
        }
        Pooling::LowerBound { dimension } => bound(dimension, 0),
        Pooling::UpperBound { dimension } => bound(dimension, 1),
    }
}

impl Part {
    /// The mean that a scatter is about; 0 of other measures.
    fn own_mean(&self) -> f64 {
        if let Pooling::Spread { mean } = self.pooling { mean } else { 0.0 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::metrics::evaluation::{Evaluation, Matching, ResultEvaluation, Sequence};
    use crate::metrics::{EvaluateOptions, evaluate};
    use crate::{PixelOrigin, RowState, TrackRow, TrackTable, TrackTableBuilder};

    /// One point a frame from `frame` on, each this far to the right of 10 px, with covariance 4 px² an axis.
    fn points(frame: u32, shifts: &[f64]) -> TrackTable {
        let mut b = TrackTableBuilder::new("t", PixelOrigin::Centre0);
        for (k, shift) in shifts.iter().enumerate() {
            let state = RowState { position_cov: Some([4.0, 0.0, 4.0]), ..RowState::default() };
            let bbox = [8.0 + shift, 8.0, 4.0, 4.0];
            b.push_with_state(&TrackRow { frame: frame + k as u32, id: 1, bbox, ..TrackRow::default() }, &state)
                .unwrap();
        }
        b.finish(0).unwrap()
    }

    #[test]
    fn two_sequences_have_the_values_of_their_rows_in_one() {
        let mut o = EvaluateOptions::default();
        o.matching = Matching::Centre;
        o.max_distance_px = 20.0;
        let judged = |from: u32, shifts: &[f64]| -> Evaluation {
            let (t, r) = (points(from, &vec![0.0; shifts.len()]), points(from, shifts));
            Sequence::new(&t, &r).evaluate(&o).unwrap()
        };
        let (first, second) = ([1.0, 2.0, -0.5], [-3.0]);
        let both = [1.0, 2.0, -0.5, -3.0];
        let parts = ResultEvaluation::new("parts", vec![judged(0, &first), judged(0, &second)]).values();
        let whole = evaluate(&points(0, &[0.0; 4]), &points(0, &both), &o).unwrap().values();
        let of = |values: &[Value], name: &str| values.iter().find(|v| v.name == name).unwrap().value;
        for name in
            ["RMSE", "RMSPE", "RMSPE/2", "PFE_x", "PFE_y", "bias_x", "scatter_x", "ANEES", "ANEES_lower", "ANEES_upper"]
        {
            let (a, b) = (of(&parts, name), of(&whole, name));
            assert!((a - b).abs() < 1e-12, "{name}: {a}, in one sequence {b}");
        }
        // √((1 + 4 + 0.25 + 9) / 4), by hand.
        assert!((of(&parts, "RMSE") - 3.5625_f64.sqrt()).abs() < 1e-12);
    }

    #[test]
    fn a_sequence_without_a_match_weighs_nothing_in_an_error() {
        let rmse = |value, weight| Part::root_mean_square(Value::lower("RMSE", value, "px"), weight);
        assert_eq!(pooled([rmse(2.0, 9.0), rmse(f64::NAN, 0.0)].into_iter())[0].value, 2.0);
        assert!(pooled([rmse(f64::NAN, 0.0), rmse(f64::NAN, 0.0)].into_iter())[0].value.is_nan());
    }

    #[test]
    fn a_result_that_matches_nothing_has_no_error() {
        let mut o = EvaluateOptions::default();
        (o.matching, o.max_distance_px) = (Matching::Centre, 5.0);
        let values = evaluate(&points(0, &[0.0; 4]), &points(0, &[300.0; 4]), &o).unwrap().values();
        let of = |name: &str| values.iter().find(|v| v.name == name).unwrap().value;
        for name in ["RMSE", "bias_x", "scatter_y", "SIAP_PA"] {
            assert!(of(name).is_nan(), "{name}: {}", of(name));
        }
        assert_eq!((of("JSC"), of("SIAP_C")), (0.0, 0.0));
        // Beside a sequence that has one they are that one's.
        let judged = |shift: f64| Sequence::new(&points(0, &[0.0; 4]), &points(0, &[shift; 4])).evaluate(&o).unwrap();
        let both = ResultEvaluation::new("both", vec![judged(2.0), judged(300.0)]).values();
        let of = |name: &str| both.iter().find(|v| v.name == name).unwrap().value;
        assert_eq!(["RMSE", "bias_x", "scatter_y", "SIAP_PA"].map(of), [2.0, 2.0, 0.0, 2.0]);
    }
}
