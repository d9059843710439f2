//! Line plots as SVG, for the report.

use maud::{Markup, html};

/// Colours that stay apart for colour-blind readers (M. Okabe, K. Ito, 2008).
const COLOURS: [&str; 7] = ["#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#000000"];

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

/// Size of a plot and its margins, px.
const WIDTH: f64 = 560.0;
const HEIGHT: f64 = 320.0;
const LEFT: f64 = 58.0;
const TOP: f64 = 30.0;
const RIGHT: f64 = 12.0;
const BOTTOM: f64 = 44.0;

/// From values to places in the plot.
struct Axes {
    x: (f64, f64),
    /// Top of the y axis, which begins at 0.
    y_max: f64,
}

impl Axes {
    /// The axes that hold all points; `None` without any.
    fn around(lines: &[Line], y_max: Option<f64>) -> Option<Self> {
        let points = || lines.iter().flat_map(Line::finite);
        points().next()?;
        let (x0, mut x1) =
            points().fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), p| (low.min(p.0), high.max(p.0)));
        let mut y1 = y_max.unwrap_or(1.05 * points().map(|p| p.1).fold(0.0, f64::max));
        if x1 <= x0 {
            x1 = x0 + 1.0;
        }
        if y1 <= 0.0 {
            y1 = 1.0;
        }
        Some(Self { x: (x0, x1), y_max: y1 })
    }

    fn px(&self, x: f64) -> f64 {
        LEFT + (x - self.x.0) / (self.x.1 - self.x.0) * (WIDTH - LEFT - RIGHT)
    }

    fn py(&self, y: f64) -> f64 {
        HEIGHT - BOTTOM - (y / self.y_max).clamp(0.0, 1.0) * (HEIGHT - TOP - BOTTOM)
    }
}

impl Line {
    fn finite(&self) -> impl Iterator<Item = &(f64, f64)> {
        self.points.iter().filter(|p| p.0.is_finite() && p.1.is_finite())
    }
}

/// One decimal: a tenth of a pixel.
fn at(v: f64) -> String {
    format!("{v:.1}")
}

/// A plot with its legend; `y_max` fixes the top of the axis, which begins at 0. Nothing where there is no point.
pub fn plot(title: &str, x_name: &str, y_name: &str, lines: &[Line], y_max: Option<f64>) -> Markup {
    let Some(axes) = Axes::around(lines, y_max) else { return Markup::default() };
    let coloured = || lines.iter().zip(COLOURS.iter().cycle());
    let middle_y = (TOP + HEIGHT - BOTTOM) / 2.0;
    html! {
        figure {
            svg viewBox=(format!("0 0 {WIDTH} {HEIGHT}")) role="img" aria-label=(title) {
                text x=(LEFT) y="18" class="t" { (title) }
                @for (t, y) in ticks(0.0, axes.y_max).into_iter().map(|t| (t, axes.py(t))) {
                    line x1=(LEFT) x2=(WIDTH - RIGHT) y1=(at(y)) y2=(at(y)) class="g" {}
                    text x=(LEFT - 6.0) y=(at(y + 4.0)) class="n e" { (label(t)) }
                }
                @for t in ticks(axes.x.0, axes.x.1) {
                    text x=(at(axes.px(t))) y=(HEIGHT - BOTTOM + 16.0) class="n m" { (label(t)) }
                }
                text x=((LEFT + WIDTH - RIGHT) / 2.0) y=(HEIGHT - 8.0) class="n m" { (x_name) }
                text transform=(format!("translate(14 {middle_y}) rotate(-90)")) class="n m" { (y_name) }
                @for (line, colour) in coloured() {
                    // A single point has no line: a result whose scores are all the same.
                    @if let [p] = line.points[..] {
                        circle cx=(at(axes.px(p.0))) cy=(at(axes.py(p.1))) r="4" fill=(colour) {}
                    }
                    polyline points=(path(&axes, line)) fill="none" stroke=(colour) stroke-width="1.8" {}
                }
            }
            p class="l" {
                @for (line, colour) in coloured() {
                    span { i style=(format!("background:{colour}")) {} (line.name) }
                }
            }
        }
    }
}

fn path(axes: &Axes, line: &Line) -> String {
    let points: Vec<String> = line.finite().map(|p| format!("{:.1},{:.1}", axes.px(p.0), axes.py(p.1))).collect();
    points.join(" ")
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
    fn names_are_escaped_and_a_plot_without_points_is_left_out() {
        let line = |points| [Line { name: "<b>&\"".into(), points }];
        let shown = plot("t", "x", "y", &line(vec![(0.0, 1.0)]), None).into_string();
        assert!(shown.contains("&lt;b&gt;&amp;&quot;") && shown.contains("<circle"), "{shown}");
        assert!(plot("t", "x", "y", &line(vec![(0.0, f64::NAN)]), None).into_string().is_empty());
    }
}
