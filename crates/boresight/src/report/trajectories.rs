//! The trajectories: paths over the picture, or over the steady ground where the camera moves, as SVG; and the small pictures at the head of the page.

use super::collect::{Collected, TrackLog};
use super::curves::css_colour;
use super::picture::Picture;
use super::text::short;
use crate::Homography;
use maud::{Markup, html};
use nalgebra::Vector2;
use std::fmt::Write;

/// Paths in the page.
const N_PATHS: usize = 1500;
/// Paths that are shown at first.
const N_SHOWN: usize = 20;
/// Greatest height of the overview on the screen, px.
const HEIGHT_PX: f64 = 620.0;

/// The points of a path as drawn: those of the image, or of the ground.
fn points(track: &TrackLog, is_steadied: bool) -> impl Iterator<Item = [f32; 2]> + '_ {
    track.path.values.iter().chain(std::iter::once(&track.end)).map(move |p| place(p, is_steadied)).filter(finite)
}

fn place(p: &[f32; 4], is_steadied: bool) -> [f32; 2] {
    if is_steadied { [p[2], p[3]] } else { [p[0], p[1]] }
}

fn finite(p: &[f32; 2]) -> bool {
    p[0].is_finite() && p[1].is_finite()
}

/// Left, top, width and height of what is drawn, px: the ground, the picture, or what holds all paths; `None` without any.
fn field(seen: &Collected, order: &[&TrackLog]) -> Option<[f64; 4]> {
    if seen.ground.is_steadied() {
        return seen.ground.field();
    }
    if let Some(p) = &seen.picture {
        return Some([-0.5, -0.5, p.width as f64, p.height as f64]);
    }
    let mut b = [f32::MAX, f32::MAX, f32::MIN, f32::MIN];
    for p in order.iter().flat_map(|t| points(t, false)) {
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
    let is_steadied = seen.ground.is_steadied();
    let shape = format!(
        "aspect-ratio:{} / {};width:min(100%, {:.0}px)",
        short(field[2], 7),
        short(field[3], 7),
        HEIGHT_PX * field[2] / field[3].max(1.0)
    );
    let [left, top, width, height] = field.map(|v| short(v, 7));
    let n_confirmed = order.iter().filter(|t| t.confirmed).count();
    let n_never = order.len().min(N_PATHS) - n_confirmed.min(N_PATHS);
    let n_left_out = order.len().saturating_sub(N_PATHS) as u64 + seen.n_dropped;
    let every = seen.detections.stride();
    html! {
        section {
            h2 { "Trajectories" }
            div class="bar switches" {
                @if n_confirmed > N_SHOWN { label { input type="checkbox" data-show="many"; " all " (n_confirmed.min(N_PATHS)) " tracks, not the " (N_SHOWN) " longest" } }
                @if n_never > 0 { label { input type="checkbox" data-show="never"; " " (n_never) " never confirmed" } }
                @if !seen.detections.values.is_empty() {
                    label { input type="checkbox" data-show="found" checked; " detections" @if every > 1 { ", one in " (every) } }
                }
            }
            svg class="view hide-many hide-never" id="view" role="img" aria-label="Paths of the tracks in the image"
                viewBox={ (left) " " (top) " " (width) " " (height) } style=(shape) {
                @if is_steadied {
                    @for (picture, first_from) in &seen.ground.pictures { (laid(picture, first_from)) }
                } @else if let Some(url) = seen.picture.as_ref().and_then(Picture::data_url) {
                    image href=(url) x="-0.5" y="-0.5" width=(width) height=(height) preserveAspectRatio="none" {}
                }
                path class="found" d=(dots(seen, is_steadied)) {}
                // Short paths lie below long ones.
                @for (rank, track) in order.iter().take(N_PATHS).enumerate().rev() {
                    (path(track, rank, detailed.iter().any(|d| d.id == track.id), is_steadied))
                }
                @for (rank, track) in order.iter().enumerate().take(N_PATHS).filter(|(_, t)| t.confirmed && detailed.iter().any(|d| d.id == t.id)) {
                    (ends(track, rank, is_steadied))
                }
                circle class="spot" id="spot" r="6" visibility="hidden" {}
            }
            p class="soft" {
                @if is_steadied { "The camera moves: paths lie on the ground of the first frame, under them pictures laid where they were taken. " }
                @else if let Some(picture) = &seen.picture { "Ground: frame " (picture.frame) ", stretched. " }
                "A dot marks where a track began, its number where it ended. Click a path to see its curves below."
                @if n_left_out > 0 { " Not in the page: the " (n_left_out) " shortest tracks." }
            }
        }
    }
}

/// A picture where it was taken on the ground; a perspective is drawn as the affine map that it is about the picture's middle.
fn laid(picture: &Picture, first_from: &Homography) -> Markup {
    let Some(url) = picture.data_url() else { return Markup::default() };
    let middle = 0.5 * Vector2::new(picture.width as f64, picture.height as f64);
    let l = first_from.linear_at(middle);
    let at = first_from.apply(middle) - l * middle;
    let numbers = [l[(0, 0)], l[(1, 0)], l[(0, 1)], l[(1, 1)], at.x, at.y].map(|v| short(v, 7)).join(" ");
    html! {
        image href=(url) x="-0.5" y="-0.5" width=(picture.width) height=(picture.height) transform={ "matrix(" (numbers) ")" } preserveAspectRatio="none" {}
    }
}

/// Detections as a path of round points.
fn dots(seen: &Collected, is_steadied: bool) -> String {
    let mut path = String::new();
    for [x, y] in seen.detections.values.iter().map(|p| place(p, is_steadied)).filter(finite) {
        let _ = write!(path, "M{x:.1} {y:.1}h0"); // writing to a String cannot fail
    }
    path
}

/// The words by which the switches find a path.
fn group(track: &TrackLog, rank: usize) -> &'static str {
    match (track.confirmed, rank < N_SHOWN) {
        (true, true) => "few",
        (true, false) => "many",
        (false, _) => "never",
    }
}

fn path(track: &TrackLog, rank: usize, has_curves: bool, is_steadied: bool) -> Markup {
    let colour = if track.confirmed { css_colour(track.id) } else { "#b9b9b9".to_string() };
    let mut line = String::new();
    for p in points(track, is_steadied) {
        let _ = write!(line, "{:.1},{:.1} ", p[0], p[1]); // writing to a String cannot fail
    }
    html! {
        polyline class={ "path " (group(track, rank)) @if has_curves { " pick" } } stroke=(colour) data-track=[has_curves.then_some(track.id.0)] points=(line) {
            title { "track " (track.id.0) }
        }
    }
}

/// A dot where the track began, its number where it ended.
fn ends(track: &TrackLog, rank: usize, is_steadied: bool) -> Markup {
    let Some(start) = points(track, is_steadied).next() else { return Markup::default() };
    let (colour, group, tenths) = (css_colour(track.id), group(track, rank), |v: f32| format!("{v:.1}"));
    html! {
        circle class={ "start " (group) } fill=(colour) cx=(tenths(start[0])) cy=(tenths(start[1])) r="2" {}
        @if let Some(end) = Some(place(&track.end, is_steadied)).filter(finite) {
            text class={ "tag " (group) } fill=(colour) data-track=(track.id.0) x=(tenths(end[0])) y=(tenths(end[1])) dx=".4em" dy=".3em" { (track.id.0) }
        }
    }
}

/// Small pictures of the run with the tracks that were reported then.
pub(super) fn key_frames(seen: &Collected) -> Markup {
    let kept = &seen.key_frames.kept;
    if kept.is_empty() {
        return Markup::default();
    }
    html! {
        div class="keys" role="group" aria-label="Pictures of the run" {
            @for key in kept {
                figure {
                    svg viewBox={ "-0.5 -0.5 " (key.picture.width) " " (key.picture.height) } role="img" aria-label={ "frame " (key.picture.frame) ", " (key.tracks.len()) " tracks" } {
                        @if let Some(url) = key.picture.data_url() {
                            image href=(url) x="-0.5" y="-0.5" width=(key.picture.width) height=(key.picture.height) preserveAspectRatio="none" {}
                        }
                        @for (id, r) in &key.tracks { (key_mark(key.picture.width as f32, *r, &css_colour(*id))) }
                    }
                    figcaption { span { (format!("{:.1}", key.time_s)) " s" } span { (key.tracks.len()) @if key.tracks.len() == 1 { " track" } @else { " tracks" } } }
                }
            }
        }
    }
}

/// A box that can be seen in a small picture.
fn key_mark(width_px: f32, [x, y, w, h]: [f32; 4], colour: &str) -> Markup {
    let (cx, cy) = (x + w / 2.0, y + h / 2.0);
    let least = 0.03 * width_px;
    let (w, h) = ((1.1 * w).max(least), (1.1 * h).max(least));
    let tenths = |v: f32| format!("{v:.1}");
    html! { rect x=(tenths(cx - w / 2.0)) y=(tenths(cy - h / 2.0)) width=(tenths(w)) height=(tenths(h)) stroke=(colour) {} }
}
