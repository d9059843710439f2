//! The sequences of one result together.

use super::sequence::Evaluation;
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

    /// The combined measures by name: first CLEAR, identity and HOTA as TrackEval combines them, then the rest as the mean
    /// of the sequences, weighted by their frames.
    pub fn values(&self) -> Vec<Value> {
        let mut values = self.mot_values();
        values.extend(self.further_values());
        values
    }

    /// CLEAR, identity and HOTA of all sequences.
    pub fn mot_values(&self) -> Vec<Value> {
        let classics: Vec<ClearClassic> = self.sequences.iter().filter_map(|s| s.classic).collect();
        let classic = (!classics.is_empty()).then(|| ClearClassic::combined(&classics));
        mot_values(&self.combined, classic.as_ref())
    }

    /// The other measures: means over the sequences, weighted by their frames.
    pub fn further_values(&self) -> Vec<Value> {
        let mut sums: Vec<(Value, f64, f64)> = Vec::new();
        for sequence in &self.sequences {
            let weight = sequence.further.as_ref().map_or(0.0, |f| f.gospa.len() as f64);
            for v in sequence.further_values() {
                match sums.iter_mut().find(|s| s.0.name == v.name) {
                    Some(s) => {
                        s.1 += v.value * weight;
                        s.2 += weight;
                    }
                    None => sums.push((v, v.value * weight, weight)),
                }
            }
        }
        sums.into_iter().map(|(v, sum, weight)| Value { value: sum / weight.max(1.0), ..v }).collect()
    }
}
