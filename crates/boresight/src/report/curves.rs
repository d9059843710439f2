//! The numbers of the curves, as JSON inside the page, thinned so that the page stays below some 6 MB.

use super::collect::{Collected, Sample, TrackLog};
use super::text::{push_array, short};
use crate::TrackStatus;
use crate::io::LengthUnit;
use std::fmt::Write;

/// Points of all curves of one kind together.
const POINTS_IN_ALL: usize = 40_000;

/// The counts over time and the curves of `detailed`. Only numbers and our own words go in, so nothing can end the script element. Writing to
/// a String cannot fail, so results of `write!` are dropped.
pub(super) fn json(seen: &Collected, detailed: &[&TrackLog], unit: LengthUnit) -> String {
    let mut out = String::with_capacity(1 << 20);
    let out = &mut out;
    let b = &seen.buckets;
    let mean = |sum: u64, n: u64| sum as f64 / n.max(1) as f64;
    let _ = write!(out, "{{\"unit\":\"{}\",\"counts\":{{\"per\":{},\"t\":", unit.sign(), seen.per_bucket);
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
        track_json(out, track, most, seen.ground.is_steadied());
    }
    out.push_str("]}");
    std::mem::take(out)
}

fn track_json(out: &mut String, track: &TrackLog, most: usize, is_steadied: bool) {
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
    // Where the overview has its spot.
    type Place = fn(&Sample) -> f32;
    let places: [(&str, Place); 2] = match is_steadied {
        true => [("px", |s| s.ground[0]), ("py", |s| s.ground[1])],
        false => [("px", |s| s.mean[0]), ("py", |s| s.mean[2])],
    };
    for (name, get) in places {
        let _ = write!(out, ",\"{name}\":");
        push_array(out, samples().map(|s| f64::from(get(s))), 5);
    }
    let _ = write!(out, ",\"colour\":\"{}\"}}", css_colour(track.id));
}

/// The colour of a track, as in the video.
pub(super) fn css_colour(id: crate::TrackId) -> String {
    let [r, g, b] = crate::palette::track_colour(id);
    format!("#{r:02x}{g:02x}{b:02x}")
}
