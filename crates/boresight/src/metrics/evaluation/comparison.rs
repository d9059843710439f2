//! Several results side by side, with bootstrap confidence intervals.
//!
//! Source: see [`mod@crate::metrics::bootstrap`]. The units drawn are the sequences where there are at least 8, else pieces
//! of them.

use super::result::ResultEvaluation;
use super::values::mot_values;
use crate::Result;
use crate::metrics::bootstrap::{Compared, compare as bootstrap};
use crate::metrics::multi_object::MotScores;
use serde::Serialize;

/// The measures that are compared.
const MEASURES: [&str; 7] = ["HOTA", "DetA", "AssA", "LocA", "MOTA", "MOTP", "IDF1"];
/// Sequences from which on they are the units drawn; fewer are cut into pieces.
const ENOUGH_SEQUENCES: usize = 8;
/// Probability of the intervals.
const LEVEL: f64 = 0.95;

/// One measure of all results.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct Comparison {
    /// The measure's name.
    pub measure: &'static str,
    /// One entry a result; differences are to the first.
    pub results: Vec<Compared>,
}

/// Compares results judged on the same sequences, with `keep_pieces` where there are fewer than 8. The same seed gives the
/// same intervals.
/// # Errors
/// Fewer than two sequences or pieces; no draws.
pub fn compare(results: &[ResultEvaluation], n_draws: usize, seed: u64) -> Result<Vec<Comparison>> {
    let whole: Vec<MotScores> = results.iter().map(|r| r.combined.clone()).collect();
    let many = results.iter().all(|r| r.sequences.len() >= ENOUGH_SEQUENCES);
    let mut units: Vec<Vec<MotScores>> = results
        .iter()
        .map(|r| {
            if many {
                r.sequences.iter().map(|s| s.scores.clone()).collect()
            } else {
                r.sequences.iter().flat_map(|s| s.pieces.iter().cloned()).collect()
            }
        })
        .collect();
    // Pieces beyond the end of a shorter result are empty there: all lists are made as long as the longest.
    let longest = units.iter().map(Vec::len).max().unwrap_or(0);
    units.iter_mut().for_each(|u| u.resize(longest, MotScores::default()));
    MEASURES
        .into_iter()
        .map(|measure| {
            let pick = |s: &MotScores| mot_values(s, None).iter().find(|v| v.name == measure).map_or(0.0, |v| v.value);
            Ok(Comparison { measure, results: bootstrap(&units, &whole, pick, LEVEL, n_draws, seed)? })
        })
        .collect()
}
