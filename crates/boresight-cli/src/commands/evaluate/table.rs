//! The scores as tables: for the terminal and as CSV.

use super::measures::Judged;
use super::state;
use super::values::mot_values;
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

fn block(
    judged: &Judged,
    values: &dyn Fn(usize) -> Vec<(&'static str, f64)>,
    combined: &[(&'static str, f64)],
) -> String {
    let mut head = vec!["sequence".to_string()];
    head.extend(combined.iter().map(|c| c.0.to_string()));
    let mut rows = Vec::new();
    for (k, row) in judged.rows.iter().enumerate() {
        let own = values(k);
        let mut cells = vec![row.name.clone()];
        cells.extend(combined.iter().map(|c| own.iter().find(|o| o.0 == c.0).map_or("-".into(), |o| number(o.0, o.1))));
        rows.push(cells);
    }
    if judged.rows.len() > 1 {
        let mut cells = vec!["COMBINED".to_string()];
        cells.extend(combined.iter().map(|c| number(c.0, c.1)));
        rows.push(cells);
    }
    aligned(&head, &rows)
}

/// The tables of one result.
pub fn sequences(judged: &Judged, mot_only: bool) -> String {
    let mut out = format!("{}\n\n", judged.label);
    let all = judged.combined_values();
    let n_mot = mot_values(&judged.combined, None).len();
    let mot = |k: usize| mot_values(&judged.rows[k].scores, judged.rows[k].classic.as_ref());
    out.push_str(&block(judged, &mot, &all[..n_mot]));
    out.push('\n');
    if !mot_only {
        let more = |k: usize| judged.rows[k].more_values();
        for part in all[n_mot..].chunks(12) {
            out.push_str(&block(judged, &more, part));
            out.push('\n');
        }
    }
    for row in &judged.rows {
        for line in row.state.iter().flat_map(state::StateScores::sentences) {
            let _ = writeln!(out, "{}: {line}", row.name);
        }
    }
    if let Some(line) = state::over_runs(judged.rows.iter().filter_map(|r| r.state.as_ref())).sentence() {
        let _ = writeln!(out, "{line}");
    }
    out
}

/// All results and sequences as CSV.
pub fn csv(results: &[Judged]) -> String {
    let mut out = String::from("result,sequence");
    let names: Vec<&str> = results.first().map_or(Vec::new(), |j| j.combined_values().iter().map(|c| c.0).collect());
    for n in &names {
        let _ = write!(out, ",{n}");
    }
    out.push('\n');
    let quoted =
        |s: &str| if s.contains([',', '"']) { format!("\"{}\"", s.replace('"', "\"\"")) } else { s.to_string() };
    for judged in results {
        let mut line = |name: &str, values: Vec<(&'static str, f64)>| {
            let _ = write!(out, "{},{}", quoted(&judged.label), quoted(name));
            for n in &names {
                match values.iter().find(|v| v.0 == *n) {
                    Some(v) if v.1.is_finite() => {
                        let _ = write!(out, ",{}", v.1);
                    }
                    _ => out.push(','),
                }
            }
            out.push('\n');
        };
        for row in &judged.rows {
            let mut v = mot_values(&row.scores, row.classic.as_ref());
            if !judged.mot_only {
                v.extend(row.more_values());
            }
            line(&row.name, v);
        }
        if judged.rows.len() > 1 {
            line("COMBINED", judged.combined_values());
        }
    }
    out
}
