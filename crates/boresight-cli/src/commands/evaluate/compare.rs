//! Several results side by side, with bootstrap confidence intervals.

use super::Args;
use super::measures::Judged;
use super::table::aligned;
use super::values::mot_values;
use boresight::metrics::bootstrap::{Compared, compare as bootstrap};
use boresight::metrics::{MatchOptions, Scores, evaluate};
use boresight::{Result, TrackTable};

/// The measures that are compared.
const MEASURES: [&str; 7] = ["HOTA", "DetA", "AssA", "LocA", "MOTA", "MOTP", "IDF1"];
/// Sequences from which on they are the units drawn; fewer are cut into pieces.
const ENOUGH_SEQUENCES: usize = 8;
const N_PIECES: usize = 20;
const LEVEL: f64 = 0.95;

/// One measure of all results.
#[derive(Debug, serde::Serialize)]
pub struct Row {
    pub measure: &'static str,
    pub results: Vec<Compared>,
}

/// Scores of the pieces of a sequence.
/// # Errors
/// What judging fails with.
pub fn pieces(truth: &TrackTable, result: &TrackTable, options: &MatchOptions) -> Result<Vec<Scores>> {
    let n = truth.n_frames().max(result.n_frames());
    let length = n.div_ceil(N_PIECES).max(10);
    (0..n)
        .step_by(length)
        .map(|from| {
            let inside = |frame: usize, _: usize| (from..from + length).contains(&frame);
            evaluate(&truth.filtered(inside), &result.filtered(inside), options)
        })
        .collect()
}

/// Compares the results.
/// # Errors
/// Too little to draw from.
pub fn compare(args: &Args, results: &[Judged]) -> Result<Vec<Row>> {
    let whole: Vec<Scores> = results.iter().map(|j| j.combined.clone()).collect();
    let many = results.iter().all(|j| j.rows.len() >= ENOUGH_SEQUENCES);
    let units: Vec<Vec<Scores>> = results
        .iter()
        .map(|j| {
            if many {
                j.rows.iter().map(|r| r.scores.clone()).collect()
            } else {
                j.rows.iter().flat_map(|r| r.pieces.iter().cloned()).collect()
            }
        })
        .collect();
    // Pieces beyond the end of a shorter result are empty there: all lists are made as long as the longest.
    let longest = units.iter().map(Vec::len).max().unwrap_or(0);
    let units: Vec<Vec<Scores>> = units
        .into_iter()
        .map(|mut u| {
            u.resize(longest, Scores::default());
            u
        })
        .collect();
    MEASURES
        .into_iter()
        .map(|measure| {
            let pick = |s: &Scores| mot_values(s, None).iter().find(|v| v.0 == measure).map_or(0.0, |v| v.1);
            Ok(Row { measure, results: bootstrap(&units, &whole, pick, LEVEL, args.draws.get(), args.seed)? })
        })
        .collect()
}

/// The comparison as a table.
pub fn table(results: &[Judged], rows: &[Row]) -> String {
    if rows.is_empty() {
        return String::new();
    }
    let head = ["measure", "result", "score", "95 % interval", "minus first", "95 % interval", "above first in"];
    let head: Vec<String> = head.map(String::from).to_vec();
    let mut cells = Vec::new();
    for row in rows {
        for (k, (c, judged)) in row.results.iter().zip(results).enumerate() {
            let mut line = vec![
                row.measure.to_string(),
                judged.label.clone(),
                format!("{:.4}", c.score.value),
                format!("{:.4} .. {:.4}", c.score.lower, c.score.upper),
            ];
            if k > 0 {
                line.push(format!("{:+.4}", c.difference.value));
                line.push(format!("{:+.4} .. {:+.4}", c.difference.lower, c.difference.upper));
                line.push(format!("{:.1} % of draws", 100.0 * c.share_above));
            }
            cells.push(line);
        }
    }
    aligned(&head, &cells)
}
