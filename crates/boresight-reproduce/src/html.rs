//! The report of a reproduction: one HTML file that opens offline, tables and figures drawn as SVG.
//!
//! Nothing is fetched from anywhere; pictures are drawn as one SVG rectangle a run of equal pixels. Text is escaped.

use super::item::{Figure, Output, Row};
use std::fmt::Write;

const STYLE: &str = "body{font:15px/1.5 system-ui,sans-serif;max-width:1100px;margin:2em auto;padding:0 1em;color:#1b1f24}\
h1{font-size:1.6em}h2{font-size:1.15em;margin-top:2em;border-top:1px solid #ddd;padding-top:.8em}\
table{border-collapse:collapse;font-variant-numeric:tabular-nums}td,th{padding:.15em .7em;text-align:right;border-bottom:1px solid #eee}\
td:first-child,th:first-child,td:nth-child(2),th:nth-child(2){text-align:left}.reading{color:#555}.out{color:#b00}\
figure{display:inline-block;margin:1em 1em 0 0;vertical-align:top;width:min(500px,calc(100% - 1em))}.wide{overflow-x:auto}figcaption{font-size:.88em}svg{background:#fff;max-width:100%}";

const COLOURS: [&str; 5] = ["#1f6fb2", "#d9542b", "#2f9e58", "#8a4fb0", "#555555"];

/// Escapes text for HTML.
fn escape(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

/// Writes the report of some items.
pub fn page(outputs: &[Output], runs: u64, seed: u64) -> String {
    let mut h = format!(
        "<!doctype html><html lang=\"en\"><meta charset=\"utf-8\"><meta name=\"viewport\" content=\"width=device-width,initial-scale=1\"><title>boresight reproduce</title><style>{STYLE}</style>\
         <h1>The papers' tables and figures</h1><p>{runs} Monte Carlo runs of each study, seed {seed}. \"Percentile\" is the share of our runs below the \
         paper's value: near 0 or 100 the print is not a typical run of this reading. \"Reference\" is an independent Monte Carlo of \
         the same reading and tuning (200 runs), \"off\" our distance from it in standard errors.</p>"
    );
    for output in outputs {
        for s in &output.sections {
            let _ = write!(h, "<h2>{}</h2><p class=\"reading\">Reading {}</p>", escape(&s.title), escape(&s.reading));
            h.push_str("<div class=\"wide\"><table><tr><th>case<th>measure<th>paper<th>our mean<th>our std<th>percentile<th>reference<th>off<th>runs lost</tr>");
            for r in &s.rows {
                row(&mut h, r);
            }
            let _ = write!(h, "</table></div><p>{}</p>", escape(&s.sentence));
        }
    }
    if outputs.iter().any(|o| !o.figures.is_empty()) {
        h.push_str("<h2>Figures</h2>");
    }
    for f in outputs.iter().flat_map(|o| &o.figures) {
        let _ = write!(
            h,
            "<figure>{}<figcaption><b>{}.</b> {}</figcaption></figure>",
            svg(f),
            escape(&f.caption),
            escape(&f.sentence)
        );
    }
    h.push_str("</html>\n");
    h
}

fn row(h: &mut String, r: &Row) {
    let number = |v: Option<f64>, digits: usize| v.map_or("–".into(), |v| format!("{v:.digits$}"));
    let odd = r.ours.percentile.is_some_and(|p| !(2.5..=97.5).contains(&p));
    let _ = write!(
        h,
        "<tr><td>{}<td>{}<td>{}<td>{}<td>{}<td{}>{}<td>{}<td>{}<td>{}</tr>",
        escape(&r.case),
        escape(&r.measure),
        number(r.paper, 4),
        number(r.ours.kept().map(|s| s.mean), 4),
        number(r.ours.kept().map(|s| s.std), 4),
        if odd { " class=\"out\"" } else { "" },
        number(r.ours.percentile, 1),
        number(r.reference.map(|x| x.0), 4),
        number(r.standard_errors_off(), 1),
        r.lost
    );
}

/// Draws a figure as SVG, 500 x 320.
pub fn svg(f: &Figure) -> String {
    let (w, h, left, bottom) = (500.0, 320.0, 52.0, 40.0);
    // Lines start below the legend.
    let top = if f.lines.len() > 4 { 40.0 } else { 26.0 };
    let mut out = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {w} {h}\" shape-rendering=\"{}\" font-family=\"sans-serif\" font-size=\"11\">",
        // Without smoothing, or seams show between the pixels of a picture.
        if f.picture.is_some() { "crispEdges" } else { "auto" }
    );
    if let Some((pw, ph, levels)) = &f.picture {
        let scale = 300.0 / (*pw.max(ph)).max(1) as f64;
        for (y, line) in levels.chunks(*pw.max(&1)).enumerate() {
            let mut x = 0;
            while x < line.len() {
                let n = line[x..].iter().take_while(|v| **v == line[x]).count();
                let (px, py) = (100.0 + x as f64 * scale, 8.0 + y as f64 * scale);
                let _ = write!(
                    out,
                    "<path d=\"M{px:.1} {py:.1}h{:.1}v{:.1}h-{0:.1}z\" fill=\"#{2:02x}{2:02x}{2:02x}\"/>",
                    n as f64 * scale + 0.1,
                    scale + 0.1,
                    line[x]
                );
                x += n;
            }
        }
        out.push_str("</svg>");
        return out;
    }
    let points = || f.lines.iter().flat_map(|l| &l.points).filter(|p| p[0].is_finite() && p[1].is_finite());
    let range = |i: usize| {
        let (a, b) = points().fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), p| (a.min(p[i]), b.max(p[i])));
        if a < b {
            (a, b)
        } else if a.is_finite() {
            (a - 1.0, a + 1.0)
        } else {
            (0.0, 1.0)
        }
    };
    let ((x0, x1), (y0, y1)) = (range(0), range(1));
    let margin = 0.05 * (y1 - y0);
    let (y0, y1) = (y0 - margin, y1 + margin);
    let px = |x: f64| left + (x - x0) / (x1 - x0) * (w - left - 14.0);
    let py = |y: f64| h - bottom - (y - y0) / (y1 - y0) * (h - bottom - top);
    for t in ticks(y0, y1) {
        let y = py(t);
        let _ = write!(
            out,
            "<path d=\"M{left} {y:.1}H{}\" stroke=\"#e4e4e4\"/><text x=\"{}\" y=\"{:.1}\" text-anchor=\"end\">{}</text>",
            w - 14.0,
            left - 5.0,
            y + 4.0,
            label(t)
        );
    }
    for t in ticks(x0, x1) {
        let _ = write!(
            out,
            "<text x=\"{:.1}\" y=\"{}\" text-anchor=\"middle\">{}</text>",
            px(t),
            h - bottom + 15.0,
            label(t)
        );
    }
    let _ = write!(
        out,
        "<text x=\"{}\" y=\"{}\" text-anchor=\"middle\">{}</text><text transform=\"translate(12 {}) rotate(-90)\" text-anchor=\"middle\">{}</text>",
        w / 2.0,
        h - 6.0,
        escape(&f.axes[0]),
        h / 2.0,
        escape(&f.axes[1])
    );
    for (i, l) in f.lines.iter().enumerate() {
        let colour = COLOURS[i % COLOURS.len()];
        let on = l.points.iter().filter(|p| p[0].is_finite() && p[1].is_finite());
        if l.marks {
            for p in on {
                let _ = write!(
                    out,
                    "<circle cx=\"{:.1}\" cy=\"{:.1}\" r=\"2.6\" fill=\"none\" stroke=\"{colour}\"/>",
                    px(p[0]),
                    py(p[1])
                );
            }
        } else {
            let d: Vec<String> = on.map(|p| format!("{:.1},{:.1}", px(p[0]), py(p[1]))).collect();
            let _ = write!(
                out,
                "<polyline points=\"{}\" fill=\"none\" stroke=\"{colour}\" stroke-width=\"1.4\"/>",
                d.join(" ")
            );
        }
        let (x, y) = (left + 8.0 + 110.0 * (i % 4) as f64, 10.0 + 13.0 * (i / 4) as f64);
        let _ = write!(
            out,
            "<path d=\"M{x} {y}h14\" stroke=\"{colour}\" stroke-width=\"2\"/><text x=\"{}\" y=\"{}\">{}</text>",
            x + 18.0,
            y + 4.0,
            escape(&l.name)
        );
    }
    out.push_str("</svg>");
    out
}

/// Round places for about five ticks.
fn ticks(a: f64, b: f64) -> Vec<f64> {
    let raw = (b - a) / 5.0;
    let power = 10f64.powf(raw.log10().floor());
    let step = [1.0, 2.0, 5.0, 10.0].into_iter().map(|m| m * power).find(|s| *s >= raw).unwrap_or(raw);
    let first = (a / step).ceil() as i64;
    (first..first + 12).map(|i| i as f64 * step).take_while(|t| *t <= b).collect()
}

fn label(v: f64) -> String {
    let text = format!("{v:.4}");
    let text = text.trim_end_matches('0').trim_end_matches('.');
    if text.is_empty() || text == "-0" { "0".into() } else { text.into() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ticks_are_round_and_inside() {
        assert_eq!(ticks(0.0, 50.0), [0.0, 10.0, 20.0, 30.0, 40.0, 50.0]);
        assert!(ticks(-0.13, 0.21).iter().all(|t| (-0.13..=0.21).contains(t)));
        assert_eq!(label(0.30000000000000004), "0.3");
    }

    #[test]
    fn text_cannot_break_the_page() {
        let f = Figure {
            item: "x",
            caption: "<script>".into(),
            axes: ["a<b".into(), "c".into()],
            lines: vec![],
            picture: None,
            sentence: "&".into(),
        };
        let html = page(&[Output { figures: vec![f], ..Output::default() }], 1, 1);
        assert!(!html.contains("<script>") && html.contains("a&lt;b") && html.contains("&amp;"));
    }
}
