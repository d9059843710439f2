//! The page of `boresight sensor`: variance against mean with its line, the columns, the numbers; one file, no script.

use super::measured::{Measured, options, sentences};
use std::fmt::Write as _;

const WIDTH: f64 = 760.0;
const HEIGHT: f64 = 380.0;
const LEFT: f64 = 70.0;
const BOTTOM: f64 = 40.0;

fn escape(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;")
}

/// Values of an axis that are round, some five of them.
fn ticks(from: f64, to: f64) -> Vec<f64> {
    let rough = ((to - from) / 5.0).max(f64::MIN_POSITIVE);
    let unit = 10f64.powf(rough.log10().floor());
    let step = [1.0, 2.0, 5.0, 10.0].into_iter().map(|m| m * unit).find(|s| *s >= rough).unwrap_or(rough);
    let first = (from / step).ceil();
    (0..12).map(|k| (first + f64::from(k)) * step).filter(|v| *v <= to).collect()
}

/// A picture whose axes span these values.
struct Plot {
    x: [f64; 2],
    y: [f64; 2],
    svg: String,
}

impl Plot {
    fn new(x: [f64; 2], y: [f64; 2], labels: [&str; 2]) -> Self {
        let spread = |[a, b]: [f64; 2]| if b > a { [a, b] } else { [a - 1.0, a + 1.0] };
        let mut plot = Self { x: spread(x), y: spread(y), svg: String::new() };
        let _ = writeln!(
            plot.svg,
            "<svg xmlns='http://www.w3.org/2000/svg' viewBox='0 0 {WIDTH} {HEIGHT}' role='img' font-size='12'>"
        );
        for v in ticks(plot.x[0], plot.x[1]) {
            let x = plot.at(v, plot.y[0]).0;
            let y = HEIGHT - BOTTOM;
            let _ = writeln!(
                plot.svg,
                "<path d='M{x:.1} {y}V10' class='grid'/><text x='{x:.1}' y='{:.1}' text-anchor='middle'>{}</text>",
                y + 16.0,
                Short(v)
            );
        }
        for v in ticks(plot.y[0], plot.y[1]) {
            let y = plot.at(plot.x[0], v).1;
            let _ = writeln!(
                plot.svg,
                "<path d='M{LEFT} {y:.1}H{WIDTH}' class='grid'/><text x='{:.1}' y='{y:.1}' dy='4' text-anchor='end'>{}</text>",
                LEFT - 6.0,
                Short(v)
            );
        }
        let _ = writeln!(
            plot.svg,
            "<text x='{:.1}' y='{:.1}' text-anchor='middle'>{}</text><text x='14' y='{y:.1}' transform='rotate(-90 14 {y:.1})' text-anchor='middle'>{}</text>",
            0.5 * WIDTH,
            HEIGHT - 6.0,
            labels[0],
            labels[1],
            y = 0.5 * HEIGHT
        );
        plot
    }

    fn at(&self, x: f64, y: f64) -> (f64, f64) {
        let share = |v: f64, [a, b]: [f64; 2]| (v - a) / (b - a);
        (
            LEFT + (WIDTH - LEFT - 10.0) * share(x, self.x),
            HEIGHT - BOTTOM - (HEIGHT - BOTTOM - 10.0) * share(y, self.y).clamp(-0.02, 1.02),
        )
    }

    fn line(&mut self, points: impl Iterator<Item = (f64, f64)>, class: &str) {
        let points: Vec<String> = points.map(|(x, y)| self.at(x, y)).map(|(x, y)| format!("{x:.1},{y:.1}")).collect();
        let _ = writeln!(self.svg, "<polyline points='{}' class='{class}'/>", points.join(" "));
    }

    fn finish(mut self) -> String {
        self.svg.push_str("</svg>\n");
        self.svg
    }
}

/// A number in as few digits as a tick needs.
struct Short(f64);

impl std::fmt::Display for Short {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let text = format!("{:.6}", self.0);
        f.write_str(text.trim_end_matches('0').trim_end_matches('.'))
    }
}

/// Variance against mean.
fn transfer(m: &Measured) -> String {
    let levels = &m.curve.levels;
    let most = |of: fn(&boresight::sensor::Level) -> f64| levels.iter().map(of).fold(0.0, f64::max);
    let (right, top) = (most(|l| l.mean), most(|l| l.variance + 2.0 * l.variance_sd));
    let mut plot = Plot::new([0.0, 1.05 * right], [0.0, 1.1 * top], ["mean, counts", "variance, counts²"]);
    for l in levels {
        let ((x, low), (_, high)) =
            (plot.at(l.mean, l.variance - 2.0 * l.variance_sd), plot.at(l.mean, l.variance + 2.0 * l.variance_sd));
        let y = plot.at(l.mean, l.variance).1;
        let _ = writeln!(
            plot.svg,
            "<path d='M{x:.1} {low:.1}V{high:.1}' class='error'/><circle cx='{x:.1}' cy='{y:.1}' r='3'><title>{} differences</title></circle>",
            l.n
        );
    }
    let [read, gain, offset] = m.curve.noise(m.dark);
    let variance = |x: f64| read * read + gain * (x - offset).max(0.0) + m.curve.rounding;
    plot.line((0..=100).map(|k| 0.0105 * f64::from(k) * right).map(|x| (x, variance(x))), "model");
    plot.finish()
}

/// Offsets of the columns.
fn columns(m: &Measured) -> String {
    let c = &m.defects.columns;
    if c.is_empty() {
        return String::new();
    }
    let most = c.iter().fold(0.0f32, |a, v| a.max(v.abs()));
    let y = f64::from(most) * 1.1;
    let mut plot = Plot::new([0.0, c.len() as f64], [-y, y], ["column, px", "offset, counts"]);
    plot.line(c.iter().enumerate().map(|(x, v)| (x as f64, f64::from(*v))), "model");
    format!("<h2>Columns</h2>\n{}", plot.finish())
}

/// The page.
pub(super) fn html(m: &Measured) -> String {
    let list = |lines: &[String]| lines.iter().map(|l| format!("<li>{}</li>\n", escape(l))).collect::<String>();
    format!(
        "<!doctype html>\n<html lang='en'><meta charset='utf-8'><meta name='viewport' content='width=device-width'>\n\
         <title>Sensor of {input}</title>\n<style>\
         body{{font:16px/1.5 system-ui,sans-serif;max-width:60rem;margin:2rem auto;padding:0 1rem;color:#222;background:#fff}}\
         svg{{width:100%;height:auto}}.grid{{stroke:#ddd}}.error{{stroke:#0072b2}}circle{{fill:#0072b2}}\
         .model{{fill:none;stroke:#d55e00;stroke-width:2}}pre{{overflow:auto;background:#f4f4f4;padding:.6rem}}\
         @media(prefers-color-scheme:dark){{body{{color:#ddd;background:#181818}}.grid{{stroke:#444}}text{{fill:#ddd}}pre{{background:#262626}}}}\
         </style>\n<h1>Sensor of {input}</h1>\n<p>{n} frames of {w} x {h} px.</p>\n<ul>\n{facts}</ul>\n\
         <h2>Variance against mean</h2>\n<p>Points: levels of light, with two deviations of their variance. Line: read² + gain (mean - offset).</p>\n{transfer}\n{columns}\
         <h2>Options that use it</h2>\n<pre>{options}</pre>\n</html>\n",
        input = escape(&m.input),
        n = m.n_frames,
        w = m.size.0,
        h = m.size.1,
        facts = list(&sentences(m)),
        transfer = transfer(m),
        columns = columns(m),
        options = escape(&options(m).join("\n")),
    )
}
