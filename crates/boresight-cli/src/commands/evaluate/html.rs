//! The report: one HTML file with tables and plots, readable without a network.

use super::compare::{self, Row};
use super::measures::{Judged, mot_values};
use boresight::metrics::hota::alphas;
use std::fmt::Write;

/// Colours that stay apart for colour-blind readers (M. Okabe, K. Ito, 2008).
const COLOURS: [&str; 7] = ["#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#000000"];

fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

/// A line of a plot.
struct Line {
    name: String,
    points: Vec<(f64, f64)>,
}

/// Steps of 1, 2 or 5 times a power of ten, about five of them.
fn ticks(low: f64, high: f64) -> Vec<f64> {
    let raw = ((high - low) / 5.0).max(1e-12);
    let power = 10_f64.powf(raw.log10().floor());
    let step = [1.0, 2.0, 5.0, 10.0].into_iter().map(|m| m * power).find(|s| *s >= raw).unwrap_or(raw);
    let first = (low / step).ceil() as i64;
    let last = (high / step + 1e-9).floor() as i64;
    (first..=last).map(|k| k as f64 * step).collect()
}

fn label(v: f64) -> String {
    let text = format!("{v:.4}");
    let text = text.trim_end_matches('0').trim_end_matches('.');
    if text == "-0" { "0".into() } else { text.to_string() }
}

fn plot(title: &str, x_name: &str, y_name: &str, lines: &[Line], y_max: Option<f64>) -> String {
    let points = || lines.iter().flat_map(|l| &l.points).filter(|p| p.0.is_finite() && p.1.is_finite());
    if points().next().is_none() {
        return String::new();
    }
    let fold =
        |f: &dyn Fn(&(f64, f64)) -> f64, start: f64, pick: fn(f64, f64) -> f64| points().map(f).fold(start, pick);
    let (x0, mut x1) = (fold(&|p| p.0, f64::INFINITY, f64::min), fold(&|p| p.0, f64::NEG_INFINITY, f64::max));
    let mut y1 = y_max.unwrap_or(1.05 * fold(&|p| p.1, 0.0, f64::max));
    if x1 <= x0 {
        x1 = x0 + 1.0;
    }
    if y1 <= 0.0 {
        y1 = 1.0;
    }
    let (w, h, left, top, right, bottom) = (560.0, 320.0, 58.0, 30.0, 12.0, 44.0);
    let px = |x: f64| left + (x - x0) / (x1 - x0) * (w - left - right);
    let py = |y: f64| h - bottom - (y / y1).clamp(0.0, 1.0) * (h - top - bottom);
    let mut s = format!(
        "<svg viewBox=\"0 0 {w} {h}\" role=\"img\" aria-label=\"{0}\"><text x=\"{left}\" y=\"18\" class=\"t\">{0}</text>",
        escaped(title)
    );
    for t in ticks(0.0, y1) {
        let y = py(t);
        let _ = write!(s, "<line x1=\"{left}\" x2=\"{}\" y1=\"{y:.1}\" y2=\"{y:.1}\" class=\"g\"/>", w - right);
        let _ = write!(s, "<text x=\"{}\" y=\"{:.1}\" class=\"n e\">{}</text>", left - 6.0, y + 4.0, label(t));
    }
    for t in ticks(x0, x1) {
        let x = px(t);
        let _ = write!(s, "<text x=\"{x:.1}\" y=\"{}\" class=\"n m\">{}</text>", h - bottom + 16.0, label(t));
    }
    let _ = write!(
        s,
        "<text x=\"{}\" y=\"{}\" class=\"n m\">{}</text>",
        (left + w - right) / 2.0,
        h - 8.0,
        escaped(x_name)
    );
    let _ = write!(
        s,
        "<text transform=\"translate(14 {}) rotate(-90)\" class=\"n m\">{}</text>",
        (top + h - bottom) / 2.0,
        escaped(y_name)
    );
    for (k, line) in lines.iter().enumerate() {
        let colour = COLOURS[k % COLOURS.len()];
        if let [p] = line.points[..] {
            // A single point has no line: a result whose scores are all the same.
            let _ = write!(s, "<circle cx=\"{:.1}\" cy=\"{:.1}\" r=\"4\" fill=\"{colour}\"/>", px(p.0), py(p.1));
        }
        let path: Vec<String> = line
            .points
            .iter()
            .filter(|p| p.0.is_finite() && p.1.is_finite())
            .map(|p| format!("{:.1},{:.1}", px(p.0), py(p.1)))
            .collect();
        let _ = write!(
            s,
            "<polyline points=\"{}\" fill=\"none\" stroke=\"{colour}\" stroke-width=\"1.8\"/>",
            path.join(" ")
        );
    }
    s.push_str("</svg><p class=\"l\">");
    for (k, line) in lines.iter().enumerate() {
        let _ = write!(
            s,
            "<span><i style=\"background:{}\"></i>{}</span>",
            COLOURS[k % COLOURS.len()],
            escaped(&line.name)
        );
    }
    s.push_str("</p>");
    format!("<figure>{s}</figure>")
}

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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ticks_are_round_numbers_within_the_axis() {
        assert_eq!(ticks(0.0, 1.0).len(), 6);
        assert_eq!(ticks(0.0, 37.0), [0.0, 10.0, 20.0, 30.0]);
        assert_eq!(label(0.30000000000000004), "0.3");
    }

    #[test]
    fn names_are_escaped() {
        assert_eq!(escaped("<b>&\""), "&lt;b&gt;&amp;&quot;");
    }
}
