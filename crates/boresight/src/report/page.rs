//! Puts the page together: summary, trajectories over a frame, tracks with their consistency, curves, counts, stages.

use super::Notes;
use super::collect::{Collected, Sample, TrackLog};
use super::text::{escape, push_array, push_json};
use crate::TrackStatus;
use std::fmt::Write;

/// Tracks with curves and rows of their own; the rest is counted.
const N_DETAILED: usize = 50;
/// Paths drawn in the overview.
const N_PATHS: usize = 1500;
/// Points of all curves of one kind together; so the page stays below some 6 MB.
const POINTS_IN_ALL: usize = 40_000;

/// Writes the page. Writing to a String cannot fail, so results of `write!` are dropped throughout.
pub(super) fn page(notes: &Notes, seen: Collected) -> String {
    let name = notes.input.trim_end_matches(['/', '\\']).rsplit(['/', '\\']).next().unwrap_or_default();
    let title = [notes.title.as_str(), name, "Tracks"].into_iter().find(|t| !t.is_empty()).unwrap_or_default();
    let mut order: Vec<&TrackLog> = seen.tracks.values().collect();
    order.sort_by_key(|t| (std::cmp::Reverse((t.confirmed, t.n_frames)), t.id));
    let mut detailed: Vec<&TrackLog> = order.iter().copied().filter(|t| t.detail.is_some()).take(N_DETAILED).collect();
    // The first one shown is the longest; the list goes by number.
    let longest = detailed.first().map(|t| t.id);
    detailed.sort_by_key(|t| (Some(t.id) != longest, t.id));
    let mut out = String::with_capacity(1 << 20);
    let _ = write!(
        out,
        "<!DOCTYPE html>\n<html lang=\"en\"><head><meta charset=\"utf-8\">\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\
         <meta name=\"generator\" content=\"boresight {}\"><title>{} - boresight</title><style>{}</style></head><body>\
         <main><h1>{}</h1>",
        env!("CARGO_PKG_VERSION"),
        escape(title),
        include_str!("page.css"),
        escape(title)
    );
    warnings(&mut out, notes);
    out.push_str("<div class=\"two\">");
    summary(&mut out, notes, &seen);
    settings(&mut out, notes);
    out.push_str("</div>");
    trajectories(&mut out, &seen, &order, &detailed);
    table(&mut out, &seen, &detailed);
    curves(&mut out, &detailed);
    out.push_str(
        "<section><h2>Detections and tracks over time</h2><div class=\"charts\" id=\"count-charts\"></div>\
         <p class=\"key\"><span><i style=\"background:var(--blue)\"></i>detections; confirmed tracks</span>\
         <span><i style=\"background:var(--orange)\"></i>coasting</span>\
         <span><i style=\"background:var(--grey)\"></i>tentative (dashed)</span></p>",
    );
    if seen.per_bucket > 1 {
        let _ = write!(
            out,
            "<p class=\"soft\">Each point is the mean of {} frames; the grey line above the detections is the most in one frame.</p>",
            seen.per_bucket
        );
    }
    out.push_str("</section>");
    stages(&mut out, notes, &seen);
    out.push_str("<noscript><p>The curves need JavaScript; the summary, the trajectories and the tables do not.</p></noscript></main>");
    out.push_str("<script type=\"application/json\" id=\"data\">");
    json(&mut out, &seen, &detailed);
    let _ = writeln!(out, "</script><script>{}</script></body></html>", include_str!("page.js"));
    out
}

fn row(out: &mut String, name: &str, value: &str) {
    let _ = write!(out, "<tr><th scope=\"row\">{}</th><td>{}</td></tr>", escape(name), escape(value));
}

fn warnings(out: &mut String, notes: &Notes) {
    if notes.warnings.is_empty() {
        return;
    }
    out.push_str("<section class=\"warnings\" aria-label=\"Warnings\"><strong>Warnings</strong><ul>");
    for warning in notes.warnings.iter().take(50) {
        let _ = write!(out, "<li>{}</li>", escape(warning));
    }
    if notes.warnings.len() > 50 {
        let _ = write!(out, "<li>and {} more</li>", notes.warnings.len() - 50);
    }
    out.push_str("</ul></section>");
}

fn summary(out: &mut String, notes: &Notes, seen: &Collected) {
    out.push_str("<section><h2>Summary</h2><table><tbody>");
    if !notes.input.is_empty() {
        row(out, "Input", &notes.input);
    }
    for (name, value) in &notes.facts {
        row(out, name, value);
    }
    let duration = seen.last_time_s - seen.first_time_s;
    let rate = if seen.n_frames > 1 && duration > 0.0 {
        format!(", {} frames/s", short((seen.n_frames - 1) as f64 / duration, 4))
    } else {
        String::new()
    };
    row(out, "Frames", &format!("{}{rate}", seen.n_frames));
    row(out, "Time", &format!("{} s to {} s", short(seen.first_time_s, 7), short(seen.last_time_s, 7)));
    if let Some(picture) = &seen.picture {
        row(out, "Size", &format!("{} x {} px", picture.width, picture.height));
    }
    let per_frame = if seen.n_frames > 0 { seen.n_detections as f64 / seen.n_frames as f64 } else { 0.0 };
    row(out, "Detections", &format!("{}, {} per frame", seen.n_detections, short(per_frame, 4)));
    row(out, "Confirmed tracks", &format!("{} (of {} that were started)", seen.n_confirmed, seen.n_tracks));
    if let Some(mean) = seen.nis.mean() {
        let bounds = seen
            .nis
            .bounds()
            .map_or(String::new(), |(a, b)| format!(", 95 % bounds {} to {}", short(a, 3), short(b, 3)));
        row(
            out,
            "Consistency of all confirmed tracks",
            &format!("mean NIS {} (2 expected{bounds}): {}", short(mean, 3), seen.nis.words()),
        );
    }
    out.push_str("</tbody></table></section>");
}

fn settings(out: &mut String, notes: &Notes) {
    if notes.settings.is_empty() {
        return;
    }
    // Reasons come first; what follows an empty line is the configuration in full, long and seldom read.
    let mut parts = notes.settings.splitn(2, String::is_empty);
    out.push_str("<section><h2>Settings and why</h2><ul>");
    for reason in parts.next().unwrap_or_default() {
        let _ = write!(out, "<li>{}</li>", escape(reason));
    }
    out.push_str("</ul>");
    if let Some(config) = parts.next() {
        out.push_str("<details><summary>The whole configuration</summary><pre>");
        for line in config {
            out.push_str(&escape(line));
            out.push('\n');
        }
        out.push_str("</pre></details>");
    }
    out.push_str("</section>");
}

fn short(v: f64, digits: i32) -> String {
    let mut text = String::new();
    push_json(&mut text, v, digits);
    text
}

/// Paths over the picture, or over an empty ground when there were no frames.
fn trajectories(out: &mut String, seen: &Collected, order: &[&TrackLog], detailed: &[&TrackLog]) {
    let finite = |p: &&[f32; 2]| p[0].is_finite() && p[1].is_finite();
    let (left, top, width, height) = match &seen.picture {
        Some(p) => (-0.5, -0.5, p.width as f64, p.height as f64),
        None => {
            let mut b = [f32::MAX, f32::MAX, f32::MIN, f32::MIN];
            for p in order.iter().flat_map(|t| &t.path.values).filter(finite) {
                b = [b[0].min(p[0]), b[1].min(p[1]), b[2].max(p[0]), b[3].max(p[1])];
            }
            if b[0] > b[2] {
                return;
            }
            let [x0, y0, x1, y1] = b.map(f64::from);
            let margin = ((x1 - x0).max(y1 - y0) * 0.03).max(1.0);
            (x0 - margin, y0 - margin, x1 - x0 + 2.0 * margin, y1 - y0 + 2.0 * margin)
        }
    };
    out.push_str("<section><h2>Trajectories</h2>");
    let number = |v: f64| short(v, 7);
    let _ = write!(
        out,
        "<svg class=\"view\" id=\"view\" role=\"img\" aria-label=\"Paths of the tracks in the image\" viewBox=\"{} {} {} {}\" \
         style=\"aspect-ratio:{} / {}\">",
        number(left),
        number(top),
        number(width),
        number(height),
        number(width),
        number(height)
    );
    if let Some(url) = seen.picture.as_ref().and_then(super::picture::Picture::data_url) {
        let _ = write!(
            out,
            "<image href=\"{url}\" x=\"-0.5\" y=\"-0.5\" width=\"{}\" height=\"{}\" preserveAspectRatio=\"none\"/>",
            number(width),
            number(height)
        );
    }
    // Short paths lie below long ones.
    for track in order.iter().take(N_PATHS).rev() {
        let has_curves = detailed.iter().any(|d| d.id == track.id);
        let class = if track.confirmed { format!("c{}", track.id.0 % 8) } else { "tentative".to_string() };
        let pick = if has_curves { format!(" pick\" data-track=\"{}", track.id.0) } else { String::new() };
        let _ = write!(out, "<polyline class=\"path {class}{pick}\" points=\"");
        for p in track.path.values.iter().chain(std::iter::once(&track.end)).filter(finite) {
            let _ = write!(out, "{:.1},{:.1} ", p[0], p[1]);
        }
        let _ = write!(out, "\"><title>track {}</title></polyline>", track.id.0);
    }
    for track in detailed.iter().filter(|t| t.confirmed) {
        if let Some(p) = track.path.values.first().filter(finite) {
            let colour = track.id.0 % 8;
            let _ = write!(out, "<circle class=\"start f{colour}\" cx=\"{:.1}\" cy=\"{:.1}\" r=\"2\"/>", p[0], p[1]);
            let e = track.end;
            if e[0].is_finite() && e[1].is_finite() {
                let _ = write!(
                    out,
                    "<text class=\"tag f{colour}\" data-track=\"{}\" x=\"{:.1}\" y=\"{:.1}\" dx=\".4em\" dy=\".3em\">{}</text>",
                    track.id.0, e[0], e[1], track.id.0
                );
            }
        }
    }
    out.push_str("<circle class=\"spot\" id=\"spot\" r=\"6\" visibility=\"hidden\"/></svg><p class=\"soft\">");
    if let Some(picture) = &seen.picture {
        let _ = write!(out, "Ground: frame {}, stretched. ", picture.frame);
    }
    out.push_str("A dot marks where a track began, its number where it ended; grey paths were never confirmed. Click a path to see its curves below.");
    let n_hidden = order.len().saturating_sub(N_PATHS) as u64 + seen.n_dropped;
    if n_hidden > 0 {
        let _ = write!(out, " Not drawn: the {n_hidden} shortest tracks.");
    }
    out.push_str("</p></section>");
}

fn table(out: &mut String, seen: &Collected, detailed: &[&TrackLog]) {
    out.push_str("<section><h2>Tracks</h2>");
    if detailed.is_empty() {
        out.push_str("<p>No track was started.</p></section>");
        return;
    }
    if seen.n_tracks > detailed.len() as u64 {
        let _ = write!(
            out,
            "<p class=\"soft\">The {} longest of {} tracks, confirmed ones first.</p>",
            detailed.len(),
            seen.n_tracks
        );
    }
    out.push_str(
        "<div class=\"scroll\" tabindex=\"0\" role=\"region\" aria-label=\"Table of tracks\"><table><thead><tr><th scope=\"col\">Track</th>\
         <th scope=\"col\">At the end</th>\
         <th scope=\"col\" class=\"number\">From, s</th><th scope=\"col\" class=\"number\">To, s</th>\
         <th scope=\"col\" class=\"number\">Frames</th><th scope=\"col\" class=\"number\">Coasting</th>\
         <th scope=\"col\" class=\"number\">Mean NIS</th><th scope=\"col\" class=\"number\">95 % bounds</th>\
         <th scope=\"col\">Consistency</th></tr></thead><tbody>",
    );
    let mut rows: Vec<&&TrackLog> = detailed.iter().collect();
    rows.sort_by_key(|t| (!t.confirmed, t.id));
    for t in rows {
        let status = match (t.confirmed, t.last_status) {
            (false, _) => "never confirmed",
            (true, TrackStatus::Coasting) => "coasting",
            (true, _) => "confirmed",
        };
        let nis = t.nis.mean().map_or("none".to_string(), |m| short(m, 3));
        let bounds = t.nis.bounds().map_or(String::new(), |(a, b)| format!("{} to {}", short(a, 3), short(b, 3)));
        let coasting = 100.0 * t.n_coasting as f64 / t.n_frames.max(1) as f64;
        let _ = write!(
            out,
            "<tr class=\"pick\" data-track=\"{}\"><th scope=\"row\"><button class=\"link\" type=\"button\">{}</button></th><td>{status}</td>\
             <td class=\"number\">{}</td><td class=\"number\">{}</td><td class=\"number\">{}</td><td class=\"number\">{} %</td>\
             <td class=\"number\">{nis}</td><td class=\"number\">{bounds}</td><td>{}</td></tr>",
            t.id.0,
            t.id.0,
            short(t.first.1, 6),
            short(t.last.1, 6),
            t.n_frames,
            short(coasting, 2),
            escape(&t.nis.words())
        );
    }
    out.push_str(
        "</tbody></table></div><p class=\"soft\">NIS is the innovation's square over its expected covariance; a consistent filter \
         has a mean of 2 within the bounds in 95 of 100 tracks. Optimistic filters claim less error than there is.</p></section>",
    );
}

fn curves(out: &mut String, detailed: &[&TrackLog]) {
    if detailed.is_empty() {
        return;
    }
    out.push_str(
        "<section><h2>Curves of one track</h2><div class=\"bar\"><button type=\"button\" id=\"before\" aria-label=\"track before\">&#9664;</button>\
         <label>Track <select id=\"choose\">",
    );
    for t in detailed {
        let _ = write!(out, "<option value=\"{}\">{} ({} frames)</option>", t.id.0, t.id.0, t.n_frames);
    }
    out.push_str(
        "</select></label><button type=\"button\" id=\"after\" aria-label=\"next track\">&#9654;</button>\
         <button type=\"button\" id=\"whole\">Whole time</button><span id=\"reading\" class=\"soft\" aria-live=\"polite\"></span></div>\
         <p id=\"verdict\"></p><div class=\"charts\" id=\"track-charts\"></div>\
         <p class=\"key\"><span><i style=\"background:var(--band)\"></i>95 % band (± 2 standard deviations)</span>\
         <span><i style=\"background:var(--coast)\"></i>coasting: no detection</span>\
         <span><i style=\"background:var(--blue)\"></i>x, estimates, updates</span><span><i style=\"background:var(--orange)\"></i>y (dashed)</span></p>\
         <p class=\"soft\">Point at a curve to read values in all of them; drag sideways to look closer, double-click to see all again.</p></section>",
    );
}

fn stages(out: &mut String, notes: &Notes, seen: &Collected) {
    let total: f64 = notes.stages.iter().map(|(_, s)| s.max(0.0)).sum();
    if notes.stages.is_empty() || !total.is_finite() {
        return;
    }
    out.push_str("<section><h2>Time per stage</h2><div class=\"stage\">");
    for (name, seconds) in &notes.stages {
        let share = if total > 0.0 { 100.0 * seconds.max(0.0) / total } else { 0.0 };
        let per_frame = 1e3 * seconds / seen.n_frames.max(1) as f64;
        let _ = write!(
            out,
            "<span>{}</span><span style=\"width:{share:.1}%\"><b style=\"display:block\"></b></span><span>{} s, {} ms a frame</span>",
            escape(name),
            short(*seconds, 3),
            short(per_frame, 3)
        );
    }
    out.push_str("</div></section>");
}

/// The curves' numbers. Only numbers and our own words go in, so nothing can end the script element.
fn json(out: &mut String, seen: &Collected, detailed: &[&TrackLog]) {
    let b = &seen.buckets;
    let mean = |sum: u64, n: u64| sum as f64 / n.max(1) as f64;
    let _ = write!(out, "{{\"counts\":{{\"per\":{},\"t\":", seen.per_bucket);
    push_array(out, b.iter().map(|b| b.time_s), 9);
    out.push_str(",\"f\":");
    push_array(out, b.iter().map(|b| b.frame as f64), 12);
    out.push_str(",\"n\":");
    push_array(out, b.iter().map(|b| mean(b.detections, b.n)), 4);
    out.push_str(",\"most\":");
    push_array(out, b.iter().map(|b| b.most_detections as f64), 9);
    for (k, name) in ["n0", "c", "o"].into_iter().enumerate() {
        let _ = write!(out, ",\"{name}\":");
        push_array(out, b.iter().map(|b| mean(b.tracks[k], b.n)), 4);
    }
    out.push_str("},\"tracks\":[");
    let most = (POINTS_IN_ALL / detailed.len().max(1)).clamp(400, 2000);
    for (i, track) in detailed.iter().enumerate() {
        if i > 0 {
            out.push(',');
        }
        track_json(out, track, most);
    }
    out.push_str("]}");
}

fn track_json(out: &mut String, track: &TrackLog, most: usize) {
    let Some(detail) = &track.detail else { return };
    let step = detail.values.len().div_ceil(most).max(1);
    let samples = || detail.values.iter().step_by(step);
    let words = match (track.nis.mean(), track.nis.bounds()) {
        (Some(mean), Some((a, b))) => {
            format!(
                "Mean NIS {} (95 % bounds {} to {}): {}.",
                short(mean, 3),
                short(a, 3),
                short(b, 3),
                track.nis.words()
            )
        }
        _ => format!("NIS: {}.", track.nis.words()),
    };
    let _ =
        write!(out, "{{\"id\":{},\"k\":{},\"words\":\"{words}\",\"s\":\"", track.id.0, detail.stride() * step as u64);
    out.extend(samples().map(|s| match s.status {
        TrackStatus::Tentative => 't',
        TrackStatus::Confirmed => 'c',
        TrackStatus::Coasting => 'o',
    }));
    out.push_str("\",\"t\":");
    push_array(out, samples().map(|s| s.time_s), 9);
    out.push_str(",\"f\":");
    push_array(out, samples().map(|s| s.frame as f64), 12);
    type Get = fn(&Sample) -> f32;
    let curves: [(&str, Get, i32); 13] = [
        ("x", |s| s.mean[0], 6),
        ("vx", |s| s.mean[1], 5),
        ("y", |s| s.mean[2], 6),
        ("vy", |s| s.mean[3], 5),
        ("sx", |s| s.std[0], 3),
        ("svx", |s| s.std[1], 3),
        ("sy", |s| s.std[2], 3),
        ("svy", |s| s.std[3], 3),
        ("ix", |s| s.innovation[0], 4),
        ("iy", |s| s.innovation[1], 4),
        ("rx", |s| s.innovation[2], 3),
        ("ry", |s| s.innovation[3], 3),
        ("nis", |s| s.innovation[4], 3),
    ];
    for (name, get, digits) in curves {
        let _ = write!(out, ",\"{name}\":");
        push_array(out, samples().map(|s| f64::from(get(s))), digits);
    }
    out.push('}');
}
