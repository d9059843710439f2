//! The map of a radar's run, as SVG: north up, axes in km, a scale bar, range rings, own ship's path, plots light, tracks in colour with their numbers.
//!
//! What is drawn in metres east and north stands in a group that is turned over (SVG counts y downwards); words stand outside of it.
//! Limits: at most [`MOST_PLOTS`] plots, every k-th of more; rings lie around where own ship is at the end.

use super::collect::{Thinned, TrackLog};
use super::curves::css_colour;
use super::text::short;
use crate::View;
use crate::io::{LengthUnit, RadarPicture};
use maud::{Markup, html};
use std::fmt::Write;

/// Plots drawn.
const MOST_PLOTS: usize = 20_000;
/// Tracks drawn.
const MOST_TRACKS: usize = 1500;
/// Width and height of the field on a usual screen, px: what letters and strokes are measured by.
const SCREEN_PX: [f64; 2] = [1150.0, 640.0];
/// Rings and lines of the grid, about.
const STEPS: f64 = 5.0;

/// What the map needs of a run besides its tracks.
#[derive(Debug)]
pub(super) struct Map {
    radar: RadarPicture,
    plots: Thinned<[f32; 2], MOST_PLOTS>,
    n: u64,
    last_time_s: f64,
}

/// Where things lie: least and most x and y, m.
#[derive(Clone, Copy)]
struct Field([f64; 4]);

impl Map {
    pub fn new(radar: RadarPicture) -> Self {
        Self { radar, plots: Thinned::default(), n: 0, last_time_s: f64::NEG_INFINITY }
    }

    /// Unit of length of the run.
    pub fn unit(&self) -> LengthUnit {
        self.radar.unit
    }

    /// Sees a scan.
    pub fn put(&mut self, view: &View<'_>) {
        self.last_time_s = view.scan.time.as_secs_f64();
        for d in &view.scan.detections {
            self.plots.put([d.position.x as f32, d.position.y as f32]);
            self.n += 1;
        }
    }

    /// What holds plots, tracks and own ship, with the shape of a screen; `None` where nothing was seen.
    fn field(&self, tracks: &[&TrackLog]) -> Option<Field> {
        let own = self.own_path().map(|p| [p[0] as f32, p[1] as f32]);
        let paths = tracks.iter().flat_map(|t| &t.path.values).map(|p| [p[0], p[1]]);
        let mut b = [f32::MAX, f32::MAX, f32::MIN, f32::MIN];
        for p in
            self.plots.values.iter().copied().chain(paths).chain(own).filter(|p| p[0].is_finite() && p[1].is_finite())
        {
            b = [b[0].min(p[0]), b[1].min(p[1]), b[2].max(p[0]), b[3].max(p[1])];
        }
        if b[0] > b[2] {
            return None;
        }
        let [x0, y0, x1, y1] = b.map(f64::from);
        let mut half = [(x1 - x0) / 2.0, (y1 - y0) / 2.0].map(|h| 1.06 * h.max(10.0));
        let shape = SCREEN_PX[0] / SCREEN_PX[1];
        half = [half[0].max(half[1] * shape), half[1].max(half[0] / shape)];
        let middle = [(x0 + x1) / 2.0, (y0 + y1) / 2.0];
        Some(Field([middle[0] - half[0], middle[1] - half[1], middle[0] + half[0], middle[1] + half[1]]))
    }

    /// Own ship's path up to the run's end.
    fn own_path(&self) -> impl Iterator<Item = [f64; 2]> + '_ {
        let until = self.last_time_s;
        let seen = self.radar.own_path.iter().filter(move |p| p[0] <= until).map(|p| [p[1], p[2]]);
        let step = (self.radar.own_path.len() / 500).max(1);
        seen.step_by(step).chain(std::iter::once(self.radar.own_at(until)))
    }
}

/// The next of 1, 2, 5, 10 .. that is at least `v`.
fn round_step(v: f64) -> f64 {
    let power = 10f64.powf(v.max(1e-9).log10().floor());
    [1.0, 2.0, 5.0, 10.0].into_iter().map(|m| m * power).find(|s| *s >= v * (1.0 - 1e-9)).unwrap_or(10.0 * power)
}

/// A length in words: metres below a kilometre.
fn length(m: f64, unit: LengthUnit) -> String {
    match unit {
        LengthUnit::Metre if m.abs() >= 1000.0 => format!("{} km", short(m / 1000.0, 4)),
        unit => format!("{} {}", short(m, 4), unit.sign()),
    }
}

/// The multiples of `step` between two values.
fn multiples(from: f64, to: f64, step: f64) -> Vec<f64> {
    let (first, last) = ((from / step).ceil() as i64, (to / step).floor() as i64);
    (first..=last.min(first + 100)).map(|k| k as f64 * step).collect()
}

fn line_of(points: impl Iterator<Item = [f64; 2]>) -> String {
    let mut out = String::new();
    for p in points.filter(|p| p[0].is_finite() && p[1].is_finite()) {
        let _ = write!(out, "{:.1},{:.1} ", p[0], p[1]); // writing to a String cannot fail
    }
    out
}

/// The section; `order` are the tracks, those with curves of their own in `detailed`.
pub(super) fn section(map: &Map, order: &[&TrackLog], detailed: &[&TrackLog]) -> Markup {
    let tracks: Vec<&TrackLog> = order.iter().copied().filter(|t| t.confirmed).take(MOST_TRACKS).collect();
    let Some(field) = map.field(&tracks) else { return Markup::default() };
    let Field([x0, y0, x1, y1]) = field;
    let (width, height) = (x1 - x0, y1 - y0);
    // A pixel of a usual screen, m.
    let px = (width / SCREEN_PX[0]).max(height / SCREEN_PX[1]);
    let unit = map.unit();
    let own = map.radar.own_at(map.last_time_s);
    let grid = round_step(height / STEPS / 1.5);
    let ring = round_step(map.radar.longest_range.max(height / 2.0) / STEPS);
    let rings: Vec<f64> = multiples(ring, map.radar.longest_range * 1.02 + ring, ring);
    let own_path = line_of(map.own_path());
    let mut plots = String::new();
    for [x, y] in &map.plots.values {
        let _ = write!(plots, "M{x:.0} {y:.0}h0");
    }
    let text = |size: f64| format!("font:{:.2}px system-ui,sans-serif;fill:#b8c7d1", size * px);
    let n_plots = map.n;
    let round = |v: f64| short(v, 8);
    html! {
        section {
            h2 { "Map" }
            svg class="view map" id="view" role="img" aria-label="Map of plots and tracks, north up" style={ "background:#0d1b26;aspect-ratio:" (round(width)) " / " (round(height)) }
                viewBox={ (round(x0)) " " (round(-y1)) " " (round(width)) " " (round(height)) } {
                g transform="scale(1,-1)" fill="none" {
                    g stroke="#ffffff" stroke-opacity=".09" stroke-width="1" {
                        @for x in multiples(x0, x1, grid) { line x1=(round(x)) x2=(round(x)) y1=(round(y0)) y2=(round(y1)) vector-effect="non-scaling-stroke" {} }
                        @for y in multiples(y0, y1, grid) { line x1=(round(x0)) x2=(round(x1)) y1=(round(y)) y2=(round(y)) vector-effect="non-scaling-stroke" {} }
                    }
                    g stroke="#7fd1c7" stroke-opacity=".45" stroke-width="1" stroke-dasharray="2 4" {
                        @for r in &rings { circle cx=(round(own[0])) cy=(round(own[1])) r=(round(*r)) vector-effect="non-scaling-stroke" {} }
                    }
                    path d=(plots) stroke="#dbe7ee" stroke-opacity=".5" stroke-width="2.4" stroke-linecap="round" vector-effect="non-scaling-stroke" {}
                    polyline points=(own_path) stroke="#ffffff" stroke-width="2" vector-effect="non-scaling-stroke" {}
                    g { @for t in tracks.iter().rev() { (path(t, detailed.iter().any(|d| d.id == t.id))) } }
                    g { @for t in tracks.iter().filter(|t| detailed.iter().any(|d| d.id == t.id)) {
                        @if let Some(p) = t.path.values.first().filter(|p| p[0].is_finite() && p[1].is_finite()) {
                            circle class="start" fill=(css_colour(t.id)) cx=(round(f64::from(p[0]))) cy=(round(f64::from(p[1]))) r=(round(2.6 * px)) {}
                        }
                    } }
                    path d={ "M" (round(own[0] - 5.0 * px)) " " (round(own[1] - 5.0 * px)) "L" (round(own[0])) " " (round(own[1] + 8.0 * px)) "L" (round(own[0] + 5.0 * px)) " " (round(own[1] - 5.0 * px)) "Z" } fill="#ffffff" {
                        title { "own ship" }
                    }
                    circle class="spot" id="spot" r=(round(7.0 * px)) visibility="hidden" {}
                }
                g style=(text(11.0)) {
                    @for r in &rings {
                        @let away = (r + 4.0 * px) * std::f64::consts::FRAC_1_SQRT_2;
                        text x=(round(own[0] + away)) y=(round(-(own[1] + away))) text-anchor="start" style="fill:#7fd1c7" { (length(*r, unit)) }
                    }
                }
                g style=(text(11.0)) {
                    @for x in multiples(x0 + 60.0 * px, x1 - 40.0 * px, grid) { text x=(round(x)) y=(round(-y0 - 5.0 * px)) text-anchor="middle" { (length(x, unit)) } }
                    @for y in multiples(y0 + 24.0 * px, y1 - 12.0 * px, grid) { text x=(round(x0 + 6.0 * px)) y=(round(-y + 4.0 * px)) { (length(y, unit)) } }
                }
                g { @for t in numbered(&tracks, detailed, px) { (number(t, px)) } }
                (north(x1 - 34.0 * px, -y1 + 14.0 * px, px))
                (scale_bar(x0 + 70.0 * px, -y0 - 30.0 * px, grid, px, unit))
            }
            p class="soft" {
                "North is up; axes count " (if unit == LengthUnit::Metre { "metres" } else { "pixels" }) " east and north of where own ship's positions count from. Light dots: "
                (n_plots) " plots" @if map.plots.stride() > 1 { " (every " (map.plots.stride()) "th)" } "; dashed rings: range from own ship at the end; white: own ship. A dot marks where a track began, its number where it ended, if there is room. "
                "Click a track to see its curves below."
            }
        }
    }
}

/// The tracks whose numbers have room: the longest first, none over another.
fn numbered<'t>(tracks: &[&'t TrackLog], detailed: &[&TrackLog], px: f64) -> Vec<&'t TrackLog> {
    let mut kept: Vec<&TrackLog> = Vec::new();
    for t in tracks.iter().filter(|t| detailed.iter().any(|d| d.id == t.id)) {
        let free = |k: &&TrackLog| {
            let d = [0, 1].map(|i| f64::from((k.end[i] - t.end[i]).abs()));
            d[0] > 30.0 * px || d[1] > 13.0 * px
        };
        if kept.iter().all(free) {
            kept.push(t);
        }
    }
    kept
}

fn path(t: &TrackLog, has_curves: bool) -> Markup {
    let points = t.path.values.iter().chain(std::iter::once(&t.end)).map(|p| [f64::from(p[0]), f64::from(p[1])]);
    html! {
        polyline class={ "path" @if has_curves { " pick" } } stroke=(css_colour(t.id)) data-track=[has_curves.then_some(t.id.0)] points=(line_of(points)) {
            title { "track " (t.id.0) }
        }
    }
}

fn number(t: &TrackLog, px: f64) -> Markup {
    let [x, y] = [f64::from(t.end[0]), f64::from(t.end[1])];
    if !(x.is_finite() && y.is_finite()) {
        return Markup::default();
    }
    html! {
        text class="tag" fill=(css_colour(t.id)) data-track=(t.id.0) x=(short(x, 8)) y=(short(-y, 8)) dx=".45em" dy=".3em"
            style={ "font-size:" (short(11.0 * px, 5)) "px;stroke:#0d1b26;stroke-width:" (short(2.5 * px, 5)) "px" } { (t.id.0) }
    }
}

/// An arrow to the north.
fn north(x: f64, y: f64, px: f64) -> Markup {
    let at = |dx: f64, dy: f64| format!("{} {}", short(x + dx * px, 8), short(y + dy * px, 8));
    html! {
        path d={ "M" (at(0.0, 0.0)) "L" (at(7.0, 22.0)) "L" (at(0.0, 17.0)) "L" (at(-7.0, 22.0)) "Z" } fill="#e6eef3" {}
        text x=(short(x, 8)) y=(short(y + 36.0 * px, 8)) text-anchor="middle" style={ "font:600 " (short(12.0 * px, 5)) "px system-ui,sans-serif;fill:#e6eef3" } { "N" }
    }
}

/// A bar of a round length.
fn scale_bar(x: f64, y: f64, step: f64, px: f64, unit: LengthUnit) -> Markup {
    let end = x + step;
    html! {
        path d={ "M" (short(x, 8)) " " (short(y - 5.0 * px, 8)) "v" (short(5.0 * px, 5)) "H" (short(end, 8)) "v" (short(-5.0 * px, 5)) } fill="none" stroke="#e6eef3" stroke-width="2" vector-effect="non-scaling-stroke" {}
        text x=(short((x + end) / 2.0, 8)) y=(short(y - 6.0 * px, 8)) text-anchor="middle" style={ "font:600 " (short(12.0 * px, 5)) "px system-ui,sans-serif;fill:#e6eef3" } { (length(step, unit)) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Detection, FrameIndex, Scan, Timestamp};
    use nalgebra::{Matrix2, Vector2};

    fn seen(n: u64) -> Map {
        let own_path = vec![[0.0, 0.0, 0.0], [100.0, 500.0, 0.0]];
        let mut map = Map::new(RadarPicture { unit: LengthUnit::Metre, own_path, turn_s: 2.5, longest_range: 3000.0 });
        for k in 0..n {
            let at = Vector2::new(3000.0 * (k as f64).sin(), 2000.0 * (k as f64 * 0.7).cos());
            let scan = Scan::at(FrameIndex(k), Timestamp::from_secs_f64(k as f64));
            let scan = scan.with_detections(vec![Detection::at(at, Matrix2::identity())]);
            map.put(&View { frame: None, scan: &scan, tracks: &[] });
        }
        map
    }

    #[test]
    fn north_is_up_and_rings_and_the_bar_are_round_lengths() {
        let page = section(&seen(50), &[], &[]).into_string();
        assert!(page.contains("scale(1,-1)") && page.contains(">1 km<") && page.contains(">N<"), "{page}");
        // The field holds all plots: x to 3 km, y to 2 km, in the shape of a screen.
        let view = page.split("viewBox=\"").nth(1).unwrap().split('"').next().unwrap();
        let v: Vec<f64> = view.split(' ').map(|w| w.parse().unwrap()).collect();
        assert!(v[0] < -2990.0 && v[1] < -1990.0 && v[0] + v[2] > 2990.0 && v[1] + v[3] > 1990.0, "{view}");
        assert_eq!([0.3, 1.0, 1.2, 4.9, 7.0].map(round_step), [0.5, 1.0, 2.0, 5.0, 10.0]);
        assert_eq!(
            (length(1500.0, LengthUnit::Metre), length(500.0, LengthUnit::Metre)),
            ("1.5 km".into(), "500 m".into())
        );
    }

    #[test]
    fn many_plots_are_thinned_and_none_give_no_map() {
        let map = seen(50_000);
        assert!(map.plots.values.len() <= MOST_PLOTS && map.plots.values.len() > MOST_PLOTS / 3 && map.n == 50_000);
        assert!(section(&map, &[], &[]).into_string().contains("50000 plots (every 4th)"));
    }
}
