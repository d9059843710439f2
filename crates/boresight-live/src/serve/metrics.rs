//! Counts for a monitoring system, in the text form of Prometheus 0.0.4.
//!
//! Why not `prometheus-client`: a dozen numbers and one histogram, all of which the board has already.

use crate::board::{Board, State, read};
use std::fmt::Write;

/// Upper edges of the latency's buckets, s.
const EDGES_S: [f64; 10] = [0.001, 0.002, 0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0];

/// The text.
pub fn text(board: &Board) -> String {
    let c = &board.counts;
    let mut out = String::new();
    let mut one = |name: &str, kind: &str, help: &str, value: f64| {
        let _ =
            writeln!(out, "# HELP boresight_{name} {help}\n# TYPE boresight_{name} {kind}\nboresight_{name} {value}");
    };
    one("frames_total", "counter", "Frames or scans that came from the source.", read(&c.arrived) as f64);
    one("frames_tracked_total", "counter", "Frames that went through detector and tracker.", read(&c.tracked) as f64);
    one("frames_dropped_total", "counter", "Frames that a newer one replaced.", read(&c.dropped) as f64);
    one("frames_refused_total", "counter", "Frames that detector or tracker refused.", read(&c.refused) as f64);
    one("bad_lines_total", "counter", "Lines of detections that could not be read.", read(&c.bad_lines) as f64);
    one("source_lost_total", "counter", "Times that the source was lost.", read(&c.lost) as f64);
    one("detections_total", "counter", "Detections.", read(&c.detections) as f64);
    one("tracks_total", "counter", "Tracks that were confirmed.", read(&c.tracks) as f64);
    one("tracks", "gauge", "Confirmed tracks now.", read(&c.now) as f64);
    one("events_total", "counter", "Events for the wire.", read(&c.events) as f64);
    one("events_dropped_total", "counter", "Events that an output could not take.", read(&c.events_dropped) as f64);
    one("output_failures_total", "counter", "Frames that an output could not write.", read(&c.record_failures) as f64);
    one("viewers", "gauge", "Viewers of the page.", read(&c.viewers) as f64);
    one("requests_refused_total", "counter", "Requests that were refused.", read(&c.requests_refused) as f64);
    one("rate_hz", "gauge", "Frames tracked a second.", board.rate_hz());
    one("running", "gauge", "1 while frames come.", f64::from(u8::from(board.said().state == State::Running)));
    if let Some((nis, _)) = board.mean_nis() {
        one("nis_mean", "gauge", "Mean normalised squared innovation; 2 if consistent.", nis);
    }
    if let Some(bytes) = resident_bytes() {
        one("resident_bytes", "gauge", "Memory of the process.", bytes as f64);
    }
    let name = "boresight_latency_seconds";
    let _ = writeln!(out, "# HELP {name} From the arrival of a frame to the last output.\n# TYPE {name} histogram");
    for (edge, n) in EDGES_S.iter().zip(board.latency.cumulative(&EDGES_S)) {
        let _ = writeln!(out, "{name}_bucket{{le=\"{edge}\"}} {n}");
    }
    let n = board.latency.n();
    let _ = writeln!(out, "{name}_bucket{{le=\"+Inf\"}} {n}\n{name}_sum {}\n{name}_count {n}", board.latency.sum_s());
    out
}

/// Memory of this process that is in use, bytes; only Linux tells.
pub fn resident_bytes() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let kib = status.lines().find_map(|l| l.strip_prefix("VmRSS:"))?.split_whitespace().next()?;
    kib.parse::<u64>().ok().map(|kib| kib << 10)
}
