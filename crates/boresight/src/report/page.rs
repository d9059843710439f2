//! Puts the page together: summary, trajectories over a frame, tracks with their consistency, curves, counts, stages.

use super::collect::{Collected, TrackLog};
use super::map::{self, Map};
use super::notes::Notes;
use super::text::{head, printable, short};
use super::{curves, trajectories};
use crate::TrackStatus;
use crate::io::LengthUnit;
use maud::{DOCTYPE, Markup, PreEscaped, html};

/// Tracks with curves and rows of their own; the rest is counted.
const N_DETAILED: usize = 50;
/// Warnings that are shown in full.
const N_WARNINGS: usize = 50;

/// Writes the page.
pub(super) fn page(notes: &Notes, seen: &Collected, map: Option<&Map>, unit: LengthUnit) -> String {
    let name = notes.input.trim_end_matches(['/', '\\']).rsplit(['/', '\\']).next().unwrap_or_default();
    let title = [notes.title.as_str(), name, "Tracks"].into_iter().find(|t| !t.is_empty()).unwrap_or_default();
    let title = printable(title);
    let mut order: Vec<&TrackLog> = seen.tracks.values().collect();
    order.sort_by_key(|t| (std::cmp::Reverse((t.confirmed, t.n_frames)), t.id));
    let mut detailed: Vec<&TrackLog> = order.iter().copied().filter(|t| t.detail.is_some()).take(N_DETAILED).collect();
    // The first one shown is the longest; the list goes by number.
    let longest = detailed.first().map(|t| t.id);
    detailed.sort_by_key(|t| (Some(t.id) != longest, t.id));
    let page = html! {
        (DOCTYPE)
        html lang="en" {
            (head(&format!("{title} - boresight"), ""))
            body {
                main {
                    h1 { (title) }
                    (verdict(notes))
                    (trajectories::key_frames(seen))
                    (warnings(notes))
                    div class="two" {
                        (summary(notes, seen))
                        (settings(notes))
                    }
                    @match map {
                        Some(map) => (map::section(map, &order, &detailed)),
                        None => (trajectories::section(seen, &order, &detailed)),
                    }
                    (table(seen, &detailed))
                    (charts(&detailed))
                    (counts(seen))
                    (stages(notes, seen))
                    noscript { p { "The curves need JavaScript; the summary, the trajectories and the tables do not." } }
                }
                script type="application/json" id="data" { (PreEscaped(curves::json(seen, &detailed, unit))) }
                script { (PreEscaped(include_str!("page.js"))) }
            }
        }
    };
    page.into_string() + "\n"
}

fn verdict(notes: &Notes) -> Markup {
    let Some((sentence, doubtful)) = &notes.verdict else { return Markup::default() };
    html! {
        section class=(if *doubtful { "verdict doubtful" } else { "verdict" }) aria-label="Verdict" {
            p { strong { @if *doubtful { "Doubtful: " } } (printable(sentence)) }
            @if let Some(next) = &notes.next { p { "Try next the same command with " code { (printable(next)) } } }
            @if let Some(look) = &notes.look { p { "See what each detector finds: " code { (printable(look)) } } }
        }
    }
}

fn warnings(notes: &Notes) -> Markup {
    if notes.warnings.is_empty() {
        return Markup::default();
    }
    html! {
        section class="warnings" aria-label="Warnings" {
            strong { "Warnings" }
            ul {
                @for warning in notes.warnings.iter().take(N_WARNINGS) { li { (printable(warning)) } }
                @if notes.warnings.len() > N_WARNINGS { li { "and " (notes.warnings.len() - N_WARNINGS) " more" } }
            }
        }
    }
}

fn summary(notes: &Notes, seen: &Collected) -> Markup {
    let mut rows: Vec<(&str, String)> = Vec::new();
    if !notes.input.is_empty() {
        rows.push(("Input", notes.input.clone()));
    }
    rows.extend(notes.facts.iter().map(|(name, value)| (name.as_str(), value.clone())));
    let duration = seen.last_time_s - seen.first_time_s;
    let rate = if seen.n_frames > 1 && duration > 0.0 {
        format!(", {} frames/s", short((seen.n_frames - 1) as f64 / duration, 4))
    } else {
        String::new()
    };
    rows.push(("Frames", format!("{}{rate}", seen.n_frames)));
    rows.push(("Time", format!("{:.2} s to {:.2} s", seen.first_time_s, seen.last_time_s)));
    if let Some(picture) = &seen.picture {
        rows.push(("Size", format!("{} x {} px", picture.width, picture.height)));
    }
    let per_frame = if seen.n_frames > 0 { seen.n_detections as f64 / seen.n_frames as f64 } else { 0.0 };
    rows.push(("Detections", format!("{}, {} a frame", seen.n_detections, short(per_frame, 3))));
    rows.push(("Confirmed tracks", format!("{} (of {} that were started)", seen.n_confirmed, seen.n_tracks)));
    if let Some(mean) = seen.nis.mean() {
        let bounds = seen.nis.bounds().map_or(String::new(), |(a, b)| format!(", 95 % bounds {a:.2} to {b:.2}"));
        let value = format!("mean NIS {mean:.2} (2 expected{bounds}): {}", seen.nis.words());
        rows.push(("Consistency", value));
    }
    html! {
        section {
            h2 { "Summary" }
            table { tbody {
                @for (name, value) in &rows { tr { th scope="row" { (printable(name)) } td { (printable(value)) } } }
            } }
        }
    }
}

fn settings(notes: &Notes) -> Markup {
    if notes.settings.is_empty() && notes.configuration.is_none() {
        return Markup::default();
    }
    html! {
        section {
            h2 { "Settings and why" }
            ul { @for reason in &notes.settings { li { (printable(reason)) } } }
            // Long and seldom read.
            @if let Some(configuration) = &notes.configuration {
                details {
                    summary { "The whole configuration" }
                    pre { (printable(configuration)) "\n" }
                }
            }
        }
    }
}

fn table(seen: &Collected, detailed: &[&TrackLog]) -> Markup {
    let mut rows: Vec<&TrackLog> = detailed.to_vec();
    rows.sort_by_key(|t| (!t.confirmed, t.id));
    html! {
        section {
            h2 { "Tracks" }
            @if detailed.is_empty() {
                p { "No track was started." }
            } @else {
                @if seen.n_tracks > detailed.len() as u64 {
                    p class="soft" { "The " (detailed.len()) " longest of " (seen.n_tracks) " tracks; those never confirmed show with the switch above." }
                }
                div class="scroll" tabindex="0" role="region" aria-label="Table of tracks" {
                    table id="tracks" class="hide-never" {
                        thead { tr {
                            th scope="col" { "Track" }
                            th scope="col" { "At the end" }
                            @for name in ["From, s", "To, s", "Frames", "Coasting", "Mean NIS", "95 % bounds"] {
                                th scope="col" class="number" { (name) }
                            }
                            th scope="col" { "Consistency" }
                        } }
                        tbody { @for track in rows { (table_row(track)) } }
                    }
                }
                p class="soft" {
                    "NIS is the innovation's square over its expected covariance; a consistent filter has a mean of 2 within the bounds in 95 of \
                     100 tracks. Optimistic filters claim less error than there is."
                }
            }
        }
    }
}

fn table_row(t: &TrackLog) -> Markup {
    let status = match (t.confirmed, t.last_status) {
        (false, _) => "never confirmed",
        (true, TrackStatus::Coasting) => "coasting",
        (true, _) => "confirmed",
    };
    let nis = t.nis.mean().map_or("none".to_string(), |m| format!("{m:.2}"));
    let bounds = t.nis.bounds().map_or(String::new(), |(a, b)| format!("{a:.2} to {b:.2}"));
    let coasting = 100.0 * t.n_coasting as f64 / t.n_frames.max(1) as f64;
    html! {
        tr class=(if t.confirmed { "pick" } else { "pick never" }) data-track=(t.id.0) {
            th scope="row" { (swatch(t.id)) button class="link" type="button" { (t.id.0) } }
            td { (status) }
            td class="number" { (format!("{:.2}", t.first.1)) }
            td class="number" { (format!("{:.2}", t.last.1)) }
            td class="number" { (t.n_frames) }
            td class="number" { (format!("{coasting:.0}")) " %" }
            td class="number" { (nis) }
            td class="number" { (bounds) }
            td { (t.nis.words()) }
        }
    }
}

/// The colour of a track as a small square.
fn swatch(id: crate::TrackId) -> Markup {
    html! { i class="swatch" style={ "background:" (curves::css_colour(id)) } {} }
}

/// A line of a chart's key: its colour and what it stands for.
fn key(colour: &str, words: &str) -> Markup {
    html! { span { i style={ "background:var(--" (colour) ")" } {} (words) } }
}

fn charts(detailed: &[&TrackLog]) -> Markup {
    if detailed.is_empty() {
        return Markup::default();
    }
    html! {
        section {
            h2 { "Curves of one track" }
            div class="bar" {
                button type="button" id="before" aria-label="track before" { "\u{25c0}" }
                label {
                    i class="swatch" id="swatch" {} "Track "
                    select id="choose" {
                        @for t in detailed { option value=(t.id.0) { (t.id.0) " (" (t.n_frames) " frames)" } }
                    }
                }
                button type="button" id="after" aria-label="next track" { "\u{25b6}" }
                button type="button" id="whole" { "Whole time" }
                span id="reading" class="soft" aria-live="polite" {}
            }
            p id="verdict" {}
            div class="charts" id="track-charts" {}
            p class="key" {
                (key("band", "95 % band (± 2 standard deviations)"))
                (key("coast", "coasting: no detection"))
                (key("own", "estimates, in the track's colour"))
                (key("blue", "x (broad), updates"))
                (key("orange", "y (thin, dashed)"))
            }
            p class="soft" {
                "Point at a curve to read values in all of them; drag sideways to look closer, double-click to see all again."
            }
        }
    }
}

fn counts(seen: &Collected) -> Markup {
    html! {
        section {
            h2 { "Detections and tracks over time" }
            div class="charts" id="count-charts" {}
            p class="key" {
                (key("blue", "detections; confirmed tracks"))
                (key("orange", "coasting"))
                (key("grey", "tentative (dashed)"))
            }
            @if seen.per_bucket > 1 {
                p class="soft" {
                    "Each point is the mean of " (seen.per_bucket) " frames; the grey line above the detections is the most in one frame."
                }
            }
        }
    }
}

fn stages(notes: &Notes, seen: &Collected) -> Markup {
    let total: f64 = notes.stages.iter().map(|(_, s)| s.max(0.0)).sum();
    if notes.stages.is_empty() || !total.is_finite() {
        return Markup::default();
    }
    let share = |seconds: f64| if total > 0.0 { 100.0 * seconds.max(0.0) / total } else { 0.0 };
    html! {
        section {
            h2 { "Time per stage" }
            div class="stage" {
                @for (name, seconds) in &notes.stages {
                    span { (printable(name)) }
                    span style=(format!("width:{:.1}%", share(*seconds))) { b style="display:block" {} }
                    span { (short(*seconds, 3)) " s, " (short(1e3 * seconds / seen.n_frames.max(1) as f64, 3)) " ms a frame" }
                }
            }
        }
    }
}
