//! What the papers print and what an independent Monte Carlo found (the reference), read from `printed.csv`.
//!
//! Source: the papers' tables; the reference is another program in another language, 200 runs for each case
//! (`docs/theory/papers.md`). Columns: item, reading, case, measure, the paper's value, mean and standard deviation of
//! those 200 runs.

use super::item::Row;
use super::score::{MEASURES, spread};
use super::study::Outcome;

/// The table.
const PRINTED: &str = include_str!("printed.csv");

/// Runs of the reference.
pub const REFERENCE_RUNS: usize = 200;

/// A line of the table.
#[derive(Clone, Debug, PartialEq, serde::Deserialize)]
pub struct Printed {
    item: String,
    reading: String,
    case: String,
    measure: String,
    /// The paper's value.
    pub paper: f64,
    /// Mean of the reference's runs.
    pub mean: f64,
    /// Their standard deviation.
    pub std: f64,
}

/// All lines.
pub fn all() -> Vec<Printed> {
    csv::Reader::from_reader(PRINTED.as_bytes()).deserialize().filter_map(Result::ok).collect()
}

/// The papers' four numbers of a case beside ours; a case that is not in the table has no paper's value.
pub fn four_rows(item: &str, reading: &str, case: &str, outcome: &Outcome) -> Vec<Row> {
    let printed = all();
    (0..4)
        .map(|i| {
            let line = printed
                .iter()
                .find(|p| p.item == item && p.reading == reading && p.case == case && p.measure == MEASURES[i]);
            let paper = line.map(|p| p.paper);
            Row {
                case: case.into(),
                measure: MEASURES[i].into(),
                paper,
                ours: spread(&outcome.column(i), paper),
                reference: line.map(|p| (p.mean, p.std, REFERENCE_RUNS)),
                lost: outcome.lost,
            }
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_table_is_whole() {
        // 15 cases of Roopa et al., 1 + 6 of the thesis' tracking, 12 of its fusion, 18 + 2 of Parimala and Raol; four
        // numbers each.
        assert_eq!(all().len(), 4 * (15 + 1 + 6 + 12 + 18 + 2));
        assert!(all().iter().all(|p| MEASURES.contains(&p.measure.as_str()) && p.paper >= 0.0));
    }
}
