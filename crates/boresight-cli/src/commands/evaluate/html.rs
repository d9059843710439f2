//! The report: one HTML file with tables and plots, readable without a network.

use super::compare::{self, Row};
use super::measures::Judged;
use super::plot::{Line, escaped, label, plot};
use super::state::over_runs;
use super::values::mot_values;
use boresight::metrics::hota::alphas;
use std::fmt::Write;

fn table(judged: &Judged) -> String {
    let all = judged.combined_values();
    let mut out = String::from("<div class=\"w\"><table><tr><th>sequence</th>");
    for (name, _) in &all {
        let _ = write!(out, "<th>{name}</th>");
    }
    out.push_str("</tr>");
    let mut row = |name: &str, values: &[(&'static str, f64)]| {
        let _ = write!(out, "<tr><td>{}</td>", escaped(name));
        for (k, _) in &all {
            let cell =
                values.iter().find(|v| v.0 == *k).filter(|v| v.1.is_finite()).map_or("–".to_string(), |v| label(v.1));
            let _ = write!(out, "<td>{cell}</td>");
        }
        out.push_str("</tr>");
    };
    for r in &judged.rows {
        let mut v = mot_values(&r.scores, r.classic.as_ref());
        if !judged.mot_only {
            v.extend(r.more_values());
        }
        row(&r.name, &v);
    }
    if judged.rows.len() > 1 {
        row("COMBINED", &all);
    }
    out.push_str("</table></div>");
    out
}

/// At most about 200 points of a long curve: each the mean of a run of frames.
fn thinned(values: impl Iterator<Item = f64>) -> Vec<(f64, f64)> {
    let v: Vec<f64> = values.collect();
    let step = v.len().div_ceil(200).max(1);
    v.chunks(step).enumerate().map(|(k, c)| ((k * step) as f64, c.iter().sum::<f64>() / c.len() as f64)).collect()
}

fn plots(judged: &Judged) -> String {
    let h = &judged.combined.hota;
    let curve = |name: &str, c: [f64; 19]| Line { name: name.into(), points: alphas().into_iter().zip(c).collect() };
    let lines = [curve("HOTA", h.hota()), curve("DetA", h.det_a()), curve("AssA", h.ass_a), curve("LocA", h.loc_a)];
    let mut out = plot("HOTA and its parts", "threshold α", "score", &lines, Some(1.0));
    if judged.mot_only {
        return out;
    }
    let of_all = |f: &dyn Fn(&super::measures::Row) -> Vec<(f64, f64)>| -> Vec<Line> {
        judged.rows.iter().take(7).map(|r| Line { name: r.name.clone(), points: f(r) }).collect()
    };
    let curve = |r: &super::measures::Row| r.curve.iter().map(|p| (p.recall, p.precision)).collect();
    out.push_str(&plot("Operating curve over the score", "recall", "precision", &of_all(&curve), Some(1.0)));
    let curve = |r: &super::measures::Row| r.curve.iter().map(|p| (p.fp_per_frame, p.recall)).collect();
    out.push_str(&plot("Recall against false alarms", "false alarms per frame", "recall", &of_all(&curve), Some(1.0)));
    let errors = |r: &super::measures::Row| {
        r.state.as_ref().map_or(Vec::new(), |s| s.rsspe.iter().map(|&(f, v)| (f64::from(f), v)).collect())
    };
    out.push_str(&plot("Position error of the matched rows", "frame", "root mean square, px", &of_all(&errors), None));
    let runs = over_runs(judged.rows.iter().filter_map(|r| r.state.as_ref()));
    let line = |name: &str, f: fn(&boresight::metrics::consistency::Consistency) -> f64| Line {
        name: name.into(),
        points: runs.frames.iter().map(|(frame, c)| (f64::from(*frame), f(c))).collect(),
    };
    let lines = [line("average", |c| c.average), line("lower bound", |c| c.lower), line("upper bound", |c| c.upper)];
    out.push_str(&plot("Position NEES over the runs", "frame", "average", &lines, None));
    for r in judged.rows.iter().take(12) {
        let part = |name: &str, f: fn(&boresight::metrics::set::Gospa) -> f64| Line {
            name: name.into(),
            points: thinned(r.gospa.iter().map(f)),
        };
        let lines =
            [part("localisation", |g| g.localisation), part("missed", |g| g.missed), part("false", |g| g.false_)];
        out.push_str(&plot(&format!("GOSPA by parts: {}", r.name), "frame", "cost, px^p", &lines, None));
    }
    out
}

/// The whole report.
pub fn report(results: &[Judged], comparison: &[Row]) -> String {
    let mut out = String::from(
        "<!doctype html><html lang=\"en\"><meta charset=\"utf-8\"><meta name=\"viewport\" content=\"width=device-width\">\
<title>boresight evaluate</title><style>\
body{font:15px/1.45 system-ui,sans-serif;margin:2rem auto;max-width:1180px;padding:0 1rem;color:#222}\
h1{font-size:1.5rem}h2{font-size:1.15rem;margin-top:2rem;word-break:break-all}\
.w{overflow-x:auto}table{border-collapse:collapse;font-variant-numeric:tabular-nums}\
th,td{padding:.25rem .6rem;text-align:right;border-bottom:1px solid #ddd;white-space:nowrap}\
th:first-child,td:first-child{text-align:left;position:sticky;left:0;background:#fff}\
.f{display:flex;flex-wrap:wrap;gap:1rem}figure{margin:0;flex:1 1 480px;max-width:580px}svg{width:100%}\
.t{font-size:14px;font-weight:600}.n{font-size:11px;fill:#555}.e{text-anchor:end}.m{text-anchor:middle}.g{stroke:#e4e4e4}\
.l{margin:0 0 .5rem 3.5rem;font-size:13px}.l span{margin-right:1rem}.l i{display:inline-block;width:.8em;height:.8em;margin-right:.35em}\
pre{overflow-x:auto;background:#f6f6f6;padding:.8rem}.note{color:#8a4b00}\
</style><h1>Evaluation</h1>",
    );
    if !comparison.is_empty() {
        let _ = write!(out, "<h2>Comparison</h2><pre>{}</pre>", escaped(&compare::table(results, comparison)));
    }
    for judged in results {
        let _ = write!(out, "<h2>{}</h2>", escaped(&judged.label));
        for note in &judged.notes {
            let _ = write!(out, "<p class=\"note\">{}</p>", escaped(note));
        }
        out.push_str(&table(judged));
        let _ = write!(out, "<div class=\"f\">{}</div>", plots(judged));
    }
    let _ = writeln!(out, "<p>boresight {}</p></html>", env!("CARGO_PKG_VERSION"));
    out
}
