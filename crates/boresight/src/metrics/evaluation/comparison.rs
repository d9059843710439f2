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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::metrics::evaluation::Evaluation;

    fn scores(tp: u64) -> MotScores {
        let mut s = MotScores::default();
        s.clear.tp = tp;
        s.clear.fn_ = 10 - tp;
        s
    }

    fn of_sequences(tps: &[u64]) -> ResultEvaluation {
        let one = |&tp: &u64| {
            let pieces = vec![scores(tp), scores(tp / 2)];
            Evaluation { scores: scores(tp), pieces, ..Evaluation::default() }
        };
        ResultEvaluation::new("r", tps.iter().map(one).collect())
    }

    fn mota(c: &[Comparison]) -> &Compared {
        &c.iter().find(|c| c.measure == "MOTA").unwrap().results[1]
    }

    #[test]
    fn eight_sequences_are_the_units_and_fewer_are_cut_into_pieces() {
        let (a, b) = (of_sequences(&[4; 8]), of_sequences(&[6; 8]));
        let c = compare(&[a, b], 50, 3).unwrap();
        assert_eq!(c.iter().map(|c| c.measure).collect::<Vec<_>>(), MEASURES);
        // Sequences all alike: no draw differs.
        let all = mota(&c);
        assert_eq!(
            (all.difference.lower, all.difference.upper, all.share_above),
            (all.difference.value, all.difference.value, 1.0)
        );
        assert!((all.difference.value - 0.2).abs() < 1e-12);
        // Pieces differ within a sequence: so do the draws.
        let c = compare(&[of_sequences(&[4; 7]), of_sequences(&[6; 7])], 50, 3).unwrap();
        assert!(mota(&c).score.lower < mota(&c).score.upper);
    }

    #[test]
    fn a_shorter_result_has_empty_pieces_at_its_end() {
        let (a, mut b) = (of_sequences(&[4]), of_sequences(&[4]));
        b.sequences[0].pieces.pop();
        assert!(compare(&[a.clone(), b], 10, 1).is_ok());
        let (mut a, mut b) = (a.clone(), a);
        for r in [&mut a, &mut b] {
            r.sequences[0].pieces.truncate(1);
        }
        assert!(compare(&[a, b], 10, 1).unwrap_err().to_string().contains("at least two"));
    }
}
