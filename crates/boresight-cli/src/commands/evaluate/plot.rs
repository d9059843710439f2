//! Line plots as SVG, for the report.

use std::fmt::Write;

/// Colours that stay apart for colour-blind readers (M. Okabe, K. Ito, 2008).
const COLOURS: [&str; 7] = ["#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#000000"];

/// Text as it may stand in HTML.
pub fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

/// A line of a plot.
pub struct Line {
    pub name: String,
    pub points: Vec<(f64, f64)>,
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

/// A number, short.
pub fn label(v: f64) -> String {
    let text = format!("{v:.4}");
    let text = text.trim_end_matches('0').trim_end_matches('.');
    if text == "-0" { "0".into() } else { text.to_string() }
}

/// A plot with its legend; `y_max` fixes the top of the axis, which begins at 0. Nothing where there is no point.
pub fn plot(title: &str, x_name: &str, y_name: &str, lines: &[Line], y_max: Option<f64>) -> String {
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
