//! The scores as tables: for the terminal and as CSV.

use super::judged::Judged;
use boresight::io::LengthUnit;
use boresight::metrics::consistency::Consistency;
use boresight::metrics::evaluation::{
    Comparison, Evaluation, NeesOverRuns, ResultEvaluation, StateMeasures, Value, nees_over_runs,
};
use std::fmt::Write;

const COUNTS: [&str; 7] = ["FP", "FN", "IDSW", "Frag", "MT", "PT", "ML"];

fn number(key: &str, v: f64) -> String {
    if v.is_nan() {
        "-".into()
    } else if COUNTS.contains(&key) {
        format!("{v:.0}")
    } else if v.abs() >= 1000.0 {
        format!("{v:.1}")
    } else {
        format!("{v:.4}")
    }
}

/// A table whose first column is left-aligned and whose others are right-aligned.
pub fn aligned(head: &[String], rows: &[Vec<String>]) -> String {
    let width =
        |c: usize| rows.iter().chain([&head.to_vec()]).filter_map(|r| r.get(c)).map(|t| t.chars().count()).max();
    let widths: Vec<usize> = (0..head.len()).map(|c| width(c).unwrap_or(0)).collect();
    let mut out = String::new();
    for row in std::iter::once(&head.to_vec()).chain(rows) {
        for (c, cell) in row.iter().enumerate() {
            if c == 0 {
                let _ = write!(out, "{cell:<w$}", w = widths[0]);
            } else {
                let _ = write!(out, "  {cell:>w$}", w = widths[c]);
            }
        }
        out.truncate(out.trim_end_matches(' ').len());
        out.push('\n');
    }
    out
}

fn block(e: &ResultEvaluation, values: fn(&Evaluation) -> Vec<Value>, combined: &[Value]) -> String {
    let mut head = vec!["sequence".to_string()];
    head.extend(combined.iter().map(|c| c.name.to_string()));
    let mut rows = Vec::new();
    for sequence in &e.sequences {
        let own = values(sequence);
        let mut cells = vec![sequence.name.clone()];
        let cell = |c: &Value| own.iter().find(|o| o.name == c.name).map_or("-".into(), |o| number(o.name, o.value));
        cells.extend(combined.iter().map(cell));
        rows.push(cells);
    }
    if e.sequences.len() > 1 {
        let mut cells = vec!["COMBINED".to_string()];
        cells.extend(combined.iter().map(|c| number(c.name, c.value)));
        rows.push(cells);
    }
    aligned(&head, &rows)
}

/// The tables of one result.
pub fn sequences(e: &ResultEvaluation) -> String {
    let mut out = format!("{}\n\n", e.label);
    out.push_str(&block(e, Evaluation::mot_values, &e.mot_values()));
    out.push('\n');
    for part in e.optional_values().chunks(12) {
        out.push_str(&block(e, Evaluation::optional_values, part));
        out.push('\n');
    }
    if e.sequences.iter().any(|s| s.unit == LengthUnit::Metre) {
        out.push_str("Distances are in m, speeds in m/s: the tables are in metres.\n");
    }
    for sequence in &e.sequences {
        for line in state(sequence).into_iter().flat_map(sentences) {
            let _ = writeln!(out, "{}: {line}", sequence.name);
        }
    }
    if let Some(line) = over_runs(&nees_over_runs(e.sequences.iter().filter_map(state))) {
        let _ = writeln!(out, "{line}");
    }
    out
}

/// The state measures of a sequence, if it has any.
pub fn state(sequence: &Evaluation) -> Option<&StateMeasures> {
    sequence.optional.as_ref()?.state.as_ref()
}

/// What the consistency tests say.
fn sentences(state: &StateMeasures) -> Vec<String> {
    let tests = [("position NEES", &state.nees), ("state NEES", &state.nees4), ("NIS", &state.nis)];
    tests.into_iter().filter_map(|(name, c)| c.as_ref().map(|c| sentence(name, c))).collect()
}

fn sentence(what: &str, c: &Consistency) -> String {
    format!(
        "{what} {:.3} over {} values, expected {} within {:.3} to {:.3} (95 %): {}",
        c.average,
        c.n,
        c.expected,
        c.lower,
        c.upper,
        c.verdict()
    )
}

/// What the averages over runs say, if there are any.
fn over_runs(runs: &NeesOverRuns) -> Option<String> {
    if runs.frames.is_empty() {
        return None;
    }
    let inside = runs.frames.iter().filter(|(_, c)| c.is_credible()).count();
    let share = 100.0 * inside as f64 / runs.frames.len() as f64;
    Some(format!(
        "position NEES over {} runs: {inside} of {} frames ({share:.1} %) within their 95 % bounds",
        runs.n_runs,
        runs.frames.len()
    ))
}

/// The comparison of several results; nothing for one.
pub fn comparison(results: &[Judged], rows: &[Comparison]) -> String {
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
                judged.evaluation.label.clone(),
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

/// All results and sequences as CSV.
pub fn csv(results: &[Judged]) -> String {
    let mut out = String::from("result,sequence");
    let names: Vec<&str> =
        results.first().map_or(Vec::new(), |j| j.evaluation.values().iter().map(|v| v.name).collect());
    for n in &names {
        let _ = write!(out, ",{n}");
    }
    out.push('\n');
    let quoted =
        |s: &str| if s.contains([',', '"']) { format!("\"{}\"", s.replace('"', "\"\"")) } else { s.to_string() };
    for e in results.iter().map(|j| &j.evaluation) {
        let mut line = |name: &str, values: Vec<Value>| {
            let _ = write!(out, "{},{}", quoted(&e.label), quoted(name));
            for n in &names {
                match values.iter().find(|v| v.name == *n) {
                    Some(v) if v.value.is_finite() => {
                        let _ = write!(out, ",{}", v.value);
                    }
                    _ => out.push(','),
                }
            }
            out.push('\n');
        };
        for sequence in &e.sequences {
            line(&sequence.name, sequence.values());
        }
        if e.sequences.len() > 1 {
            line("COMBINED", e.values());
        }
    }
    out
}
