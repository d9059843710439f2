//! The trajectories: paths over the picture, as SVG.

use super::collect::{Collected, TrackLog};
use super::picture::Picture;
use super::text::short;
use maud::{Markup, html};
use std::fmt::Write;

/// Paths drawn.
const N_PATHS: usize = 1500;

fn finite(p: &&[f32; 2]) -> bool {
    p[0].is_finite() && p[1].is_finite()
}

/// Left, top, width and height of what is drawn, px: the picture, or what holds all paths; `None` without either.
fn field(seen: &Collected, order: &[&TrackLog]) -> Option<[f64; 4]> {
    if let Some(p) = &seen.picture {
        return Some([-0.5, -0.5, p.width as f64, p.height as f64]);
    }
    let mut b = [f32::MAX, f32::MAX, f32::MIN, f32::MIN];
    for p in order.iter().flat_map(|t| &t.path.values).filter(finite) {
        b = [b[0].min(p[0]), b[1].min(p[1]), b[2].max(p[0]), b[3].max(p[1])];
    }
    if b[0] > b[2] {
        return None;
    }
    let [x0, y0, x1, y1] = b.map(f64::from);
    let margin = ((x1 - x0).max(y1 - y0) * 0.03).max(1.0);
    Some([x0 - margin, y0 - margin, x1 - x0 + 2.0 * margin, y1 - y0 + 2.0 * margin])
}

/// Paths over the picture, or over an empty ground when there were no frames; `detailed` are those with curves of their own.
pub(super) fn section(seen: &Collected, order: &[&TrackLog], detailed: &[&TrackLog]) -> Markup {
    let Some(field) = field(seen, order) else { return Markup::default() };
    let [left, top, width, height] = field.map(|v| short(v, 7));
    let n_hidden = order.len().saturating_sub(N_PATHS) as u64 + seen.n_dropped;
    html! {
        section {
            h2 { "Trajectories" }
            svg class="view" id="view" role="img" aria-label="Paths of the tracks in the image"
                viewBox={ (left) " " (top) " " (width) " " (height) } style={ "aspect-ratio:" (width) " / " (height) } {
                @if let Some(url) = seen.picture.as_ref().and_then(Picture::data_url) {
                    image href=(url) x="-0.5" y="-0.5" width=(width) height=(height) preserveAspectRatio="none" {}
                }
                // Short paths lie below long ones.
                @for track in order.iter().take(N_PATHS).rev() {
                    (path(track, detailed.iter().any(|d| d.id == track.id)))
                }
                @for track in detailed.iter().filter(|t| t.confirmed) { (ends(track)) }
                circle class="spot" id="spot" r="6" visibility="hidden" {}
            }
            p class="soft" {
                @if let Some(picture) = &seen.picture { "Ground: frame " (picture.frame) ", stretched. " }
                "A dot marks where a track began, its number where it ended; grey paths were never confirmed. Click a path to see its curves below."
                @if n_hidden > 0 { " Not drawn: the " (n_hidden) " shortest tracks." }
            }
        }
    }
}

fn path(track: &TrackLog, has_curves: bool) -> Markup {
    let class = if track.confirmed { format!("c{}", track.id.0 % 8) } else { "tentative".to_string() };
    let mut points = String::new();
    for p in track.path.values.iter().chain(std::iter::once(&track.end)).filter(finite) {
        let _ = write!(points, "{:.1},{:.1} ", p[0], p[1]); // writing to a String cannot fail
    }
    html! {
        polyline class={ "path " (class) @if has_curves { " pick" } } data-track=[has_curves.then_some(track.id.0)] points=(points) {
            title { "track " (track.id.0) }
        }
    }
}

/// A dot where the track began, its number where it ended.
fn ends(track: &TrackLog) -> Markup {
    let Some(start) = track.path.values.first().filter(finite) else { return Markup::default() };
    let (colour, tenths) = (track.id.0 % 8, |v: f32| format!("{v:.1}"));
    html! {
        circle class={ "start f" (colour) } cx=(tenths(start[0])) cy=(tenths(start[1])) r="2" {}
        @if let Some(end) = Some(&track.end).filter(finite) {
            text class={ "tag f" (colour) } data-track=(track.id.0) x=(tenths(end[0])) y=(tenths(end[1])) dx=".4em" dy=".3em" { (track.id.0) }
        }
    }
}
