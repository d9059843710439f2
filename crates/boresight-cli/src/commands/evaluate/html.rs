//! The report: one HTML file with tables and plots, readable without a network.

use super::judged::Judged;
use super::plot::{Line, label, plot};
use super::table::{comparison as comparison_table, state};
use boresight::metrics::OperatingPoint;
use boresight::metrics::consistency::Consistency;
use boresight::metrics::evaluation::{Comparison, Evaluation, ResultEvaluation, Value, nees_over_runs};
use boresight::metrics::hota::alphas;
use boresight::metrics::set::Gospa;
use maud::{DOCTYPE, Markup, PreEscaped, html};

/// Sequences whose curves stand in one plot, and those that have a plot of their own.
const CURVES: usize = 7;
const PLOTS: usize = 12;

fn table(e: &ResultEvaluation) -> Markup {
    let all = e.values();
    let cell = |values: &[Value], name: &str| {
        let value = values.iter().find(|v| v.name == name).filter(|v| v.value.is_finite());
        value.map_or("–".to_string(), |v| label(v.value))
    };
    let row = |name: &str, values: &[Value]| {
        html! {
            tr {
                td { (name) }
                @for v in &all { td { (cell(values, v.name)) } }
            }
        }
    };
    html! {
        div class="w" {
            table {
                tr {
                    th { "sequence" }
                    @for v in &all { th { (v.name) @if !v.unit.is_empty() { br; small { (v.unit) } } } }
                }
                @for s in &e.sequences { (row(&s.name, &s.values())) }
                @if e.sequences.len() > 1 { (row("COMBINED", &all)) }
            }
        }
    }
}

/// At most about 200 points of a long curve: each the mean of a run of frames.
fn thinned(values: impl Iterator<Item = f64>) -> Vec<(f64, f64)> {
    let v: Vec<f64> = values.collect();
    let step = v.len().div_ceil(200).max(1);
    v.chunks(step).enumerate().map(|(k, c)| ((k * step) as f64, c.iter().sum::<f64>() / c.len() as f64)).collect()
}

/// A line of each of the first sequences.
fn by_sequence(e: &ResultEvaluation, points: impl Fn(&Evaluation) -> Vec<(f64, f64)>) -> Vec<Line> {
    e.sequences.iter().take(CURVES).map(|s| Line { name: s.name.clone(), points: points(s) }).collect()
}

fn plots(e: &ResultEvaluation) -> Markup {
    let h = &e.combined.hota;
    let curve = |name: &str, c: [f64; 19]| Line { name: name.into(), points: alphas().into_iter().zip(c).collect() };
    let lines = [curve("HOTA", h.hota()), curve("DetA", h.det_a()), curve("AssA", h.ass_a), curve("LocA", h.loc_a)];
    html! {
        (plot("HOTA and its parts", "threshold α", "score", &lines, Some(1.0)))
        @if e.sequences.iter().any(|s| s.optional.is_some()) { (optional_plots(e)) }
    }
}

fn optional_plots(e: &ResultEvaluation) -> Markup {
    let operating = by_sequence(e, |s| curve(s).iter().map(|p| (p.recall, p.precision)).collect());
    let alarms = by_sequence(e, |s| curve(s).iter().map(|p| (p.fp_per_frame, p.recall)).collect());
    let errors =
        by_sequence(e, |s| state(s).map_or(Vec::new(), |s| s.rsspe.iter().map(|&(f, v)| (f64::from(f), v)).collect()));
    let unit = e.sequences.first().map_or("px", |s| s.unit.sign());
    let runs = nees_over_runs(e.sequences.iter().filter_map(state));
    let nees = |name: &str, f: fn(&Consistency) -> f64| Line {
        name: name.into(),
        points: runs.frames.iter().map(|(frame, c)| (f64::from(*frame), f(c))).collect(),
    };
    let nees = [nees("average", |c| c.average), nees("lower bound", |c| c.lower), nees("upper bound", |c| c.upper)];
    html! {
        (plot("Operating curve over the score", "recall", "precision", &operating, Some(1.0)))
        (plot("Recall against false alarms", "false alarms per frame", "recall", &alarms, Some(1.0)))
        (plot("Position error of the matched rows", "frame", &format!("root mean square, {unit}"), &errors, None))
        (plot("Position NEES over the runs", "frame", "average", &nees, None))
        @for s in e.sequences.iter().take(PLOTS) {
            (plot(&format!("GOSPA by parts: {}", s.name), "frame", &format!("cost, {unit}^p"), &gospa_parts(s), None))
        }
    }
}

fn curve(s: &Evaluation) -> &[OperatingPoint] {
    s.optional.as_ref().map_or(&[], |f| &f.curve)
}

fn gospa_parts(s: &Evaluation) -> [Line; 3] {
    let gospa = s.optional.as_ref().map_or(&[][..], |f| &f.gospa);
    let part = |name: &str, f: fn(&Gospa) -> f64| Line { name: name.into(), points: thinned(gospa.iter().map(f)) };
    [part("localisation", |g| g.localisation), part("missed", |g| g.missed), part("false", |g| g.false_)]
}

/// The whole report.
pub fn report(results: &[Judged], comparison: &[Comparison]) -> String {
    let page = html! {
        (DOCTYPE)
        html lang="en" {
            head {
                meta charset="utf-8";
                meta name="viewport" content="width=device-width";
                title { "boresight evaluate" }
                style { (PreEscaped(include_str!("report.css"))) }
            }
            body {
                h1 { "Evaluation" }
                @if !comparison.is_empty() {
                    h2 { "Comparison" }
                    pre { (comparison_table(results, comparison)) }
                }
                @for judged in results {
                    h2 { (judged.evaluation.label) }
                    @for note in &judged.notes { p class="note" { (note) } }
                    (table(&judged.evaluation))
                    div class="f" { (plots(&judged.evaluation)) }
                }
                p { "boresight " (env!("CARGO_PKG_VERSION")) }
            }
        }
    };
    page.into_string()
}
