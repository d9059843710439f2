//! Counts for a monitoring system, in the text form of Prometheus 0.0.4.
//!
//! Why not `prometheus-client`: a dozen numbers and one histogram, all of which the board has already.

use crate::board::{Board, State, read};
use std::fmt::Write;
use std::sync::atomic::AtomicU64;

/// Upper edges of the latency's buckets, s.
const EDGES_S: [f64; 10] = [0.001, 0.002, 0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0];

/// A number of a source: its name, its kind, what it is, and how it is had; `None`: it is not known yet.
type Number = (&'static str, &'static str, &'static str, fn(&Board) -> Option<f64>);

const NUMBERS: [Number; 27] = [
    ("frames_total", "counter", "Frames or scans that came from the source.", |b| count(&b.counts.arrived)),
    ("frames_tracked_total", "counter", "Frames that went through detector and tracker.", |b| count(&b.counts.tracked)),
    ("frames_dropped_total", "counter", "Frames that a newer one replaced.", |b| count(&b.counts.dropped)),
    ("frames_refused_total", "counter", "Frames that detector or tracker refused.", |b| count(&b.counts.refused)),
    ("scans_late_total", "counter", "Scans that came late and were taken at their own time.", |b| {
        count(&b.counts.late)
    }),
    ("scans_too_late_total", "counter", "Scans that came too late and were left out.", |b| count(&b.counts.too_late)),
    ("bad_lines_total", "counter", "Lines of detections that could not be read.", |b| count(&b.counts.bad_lines)),
    ("source_lost_total", "counter", "Times that the source was lost.", |b| count(&b.counts.lost)),
    ("detections_total", "counter", "Detections.", |b| count(&b.counts.detections)),
    ("detections_unclaimed_total", "counter", "Detections beyond those that confirmed tracks took.", |b| {
        count(&b.counts.unclaimed)
    }),
    ("false_alarms_asked_per_frame", "gauge", "False detections a frame that the detector was asked for.", |b| {
        b.notes().false_alarms_asked
    }),
    (
        "false_alarms_seen_per_frame",
        "gauge",
        "Detections a frame beyond those that confirmed tracks took, lately.",
        |b| b.unclaimed_per_scan(),
    ),
    ("camera_motion_px", "gauge", "How far the background moved since the frame before.", |b| {
        b.notes().camera_moved_px
    }),
    ("tracks_total", "counter", "Tracks that were confirmed.", |b| count(&b.counts.tracks)),
    ("tracks", "gauge", "Confirmed tracks now.", |b| count(&b.counts.now)),
    ("events_total", "counter", "Events for the wire.", |b| count(&b.counts.events)),
    ("events_dropped_total", "counter", "Events that an output could not take.", |b| count(&b.counts.events_dropped)),
    ("events_unplaced_total", "counter", "Events without a place on Earth, for wires that need one.", |b| {
        count(&b.counts.unplaced)
    }),
    ("output_failures_total", "counter", "Frames that an output could not write.", |b| {
        count(&b.counts.record_failures)
    }),
    ("video_frames_total", "counter", "Frames in the record's video.", |b| count(&b.counts.video_frames)),
    ("video_frames_left_out_total", "counter", "Frames left out of the record's video.", |b| {
        count(&b.counts.video_left_out)
    }),
    ("viewers", "gauge", "Viewers of the page.", |b| count(&b.counts.viewers)),
    ("rate_hz", "gauge", "Frames tracked a second.", |b| Some(b.rate_hz())),
    ("running", "gauge", "1 while frames come.", |b| Some(f64::from(u8::from(b.said().state == State::Running)))),
    ("nis_mean", "gauge", "Mean normalised squared innovation; 2 if consistent.", |b| b.mean_nis().map(|n| n.0)),
    ("nis_lately", "gauge", "The same over the last half minute or so, where the parameters follow the scans.", |b| {
        b.notes().nis_lately
    }),
    ("nis_count", "gauge", "Innovations behind the mean.", |b| b.mean_nis().map(|n| n.1 as f64)),
];

fn count(of: &AtomicU64) -> Option<f64> {
    Some(read(of) as f64)
}

/// A name as the value of a label.
fn label(source: &str) -> String {
    source.replace('\\', "\\\\").replace('"', "\\\"").replace('\n', "\\n")
}

/// The text: of each source under its name, and of the process.
pub fn text(boards: &[&Board], n_refused: u64) -> String {
    let mut out = String::new();
    let head = |out: &mut String, name: &str, kind: &str, help: &str| {
        let _ = writeln!(out, "# HELP boresight_{name} {help}\n# TYPE boresight_{name} {kind}");
    };
    for (name, kind, help, value) in NUMBERS {
        head(&mut out, name, kind, help);
        for board in boards {
            if let Some(value) = value(board) {
                let _ = writeln!(out, "boresight_{name}{{source=\"{}\"}} {value}", label(&board.source));
            }
        }
    }
    // The parameters that a run may change by itself, named by their keys.
    let parameters: Vec<_> = boards.iter().map(|board| board.parameters().map(|p| p.values())).collect();
    for k in 0..parameters.iter().flatten().map(|values| values.len()).next().unwrap_or(0) {
        let mut begun = false;
        for (board, values) in boards.iter().zip(&parameters) {
            let Some((key, Some(value))) = values.map(|values| values[k]) else { continue };
            let name = format!("tracker_{}", key.replace('-', "_"));
            if !std::mem::replace(&mut begun, true) {
                head(
                    &mut out,
                    &name,
                    "gauge",
                    &format!("What the tracker assumes now: tracker.{key} of the configuration."),
                );
            }
            let _ = writeln!(out, "boresight_{name}{{source=\"{}\"}} {value}", label(&board.source));
        }
    }
    head(&mut out, "requests_refused_total", "counter", "Requests that were refused.");
    let _ = writeln!(out, "boresight_requests_refused_total {n_refused}");
    if let Some(bytes) = resident_bytes() {
        head(&mut out, "resident_bytes", "gauge", "Memory of the process.");
        let _ = writeln!(out, "boresight_resident_bytes {bytes}");
    }
    head(&mut out, "latency_seconds", "histogram", "From the arrival of a frame to the last output.");
    for board in boards {
        let (name, source, latency) = ("boresight_latency_seconds", label(&board.source), &board.latency);
        for (edge, n) in EDGES_S.iter().zip(latency.cumulative(&EDGES_S)) {
            let _ = writeln!(out, "{name}_bucket{{source=\"{source}\",le=\"{edge}\"}} {n}");
        }
        let (n, sum) = (latency.n(), latency.sum_s());
        let _ = writeln!(out, "{name}_bucket{{source=\"{source}\",le=\"+Inf\"}} {n}");
        let _ = writeln!(out, "{name}_sum{{source=\"{source}\"}} {sum}\n{name}_count{{source=\"{source}\"}} {n}");
    }
    out
}

/// Memory of this process that is in use, bytes; only Linux tells.
pub fn resident_bytes() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let kib = status.lines().find_map(|l| l.strip_prefix("VmRSS:"))?.split_whitespace().next()?;
    kib.parse::<u64>().ok().map(|kib| kib << 10)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_number_stands_once_under_each_source_and_a_name_cannot_break_its_line() {
        let boards = [Board::new("north", |_| {}), Board::new("a\"b\\c\nd", |_| {})];
        let config = boresight::Config::default().tracker;
        boards[1].assumes(boresight::track::TrackerParameters::of(&config));
        let text = text(&[&boards[0], &boards[1]], 3);
        let lines = |start: &str| text.lines().filter(|l| l.starts_with(start)).count();
        assert_eq!((lines("# TYPE boresight_frames_total "), lines("boresight_frames_total{")), (1, 2), "{text}");
        assert_eq!((lines("# TYPE boresight_latency_seconds "), lines("boresight_latency_seconds_count{")), (1, 2));
        assert!(text.contains("boresight_tracks{source=\"a\\\"b\\\\c\\nd\"} 0\n"), "{text}");
        let extra =
            format!("boresight_tracker_extra_noise_px{{source=\"a\\\"b\\\\c\\nd\"}} {}\n", config.extra_noise_px);
        assert!(text.contains(&extra), "{extra} {text}");
        assert_eq!(
            (lines("# TYPE boresight_tracker_extra_noise_px "), lines("boresight_tracker_extra_noise_px{")),
            (1, 1)
        );
        assert!(text.contains("boresight_requests_refused_total 3\n"));
    }
}
