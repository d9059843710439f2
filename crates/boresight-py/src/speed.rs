//! The library's own step on the same boxes, timed without Python: what `examples/speed.py` compares `Tracker.update` with.

use crate::config::PyConfig;
use crate::detections::Given;
use crate::errors::OrRaise;
use boresight::{FrameIndex, Scan, Timestamp, track};
use pyo3::prelude::*;
use std::time::Instant;

/// Seconds that a fresh tracker takes for all scans; each is N x 4, left, top, right, bottom.
#[pyfunction]
pub fn time_of_updates(py: Python<'_>, config: PyConfig, scans: Vec<Bound<'_, PyAny>>, dt_s: f64) -> PyResult<f64> {
    let table = &config.config.input.table;
    let mut made = Vec::new();
    for (k, boxes) in scans.into_iter().enumerate() {
        let given =
            Given { boxes: Some(boxes), std_px: table.std_px, std_per_side: table.std_per_side, ..Given::default() };
        let scan = Scan::at(FrameIndex(k as u64), Timestamp::from_secs_f64(k as f64 * dt_s));
        made.push(scan.with_detections(given.detections()?));
    }
    let mut tracker = track::build(&config.config.tracker).or_raise(py)?;
    let began = Instant::now();
    for scan in &made {
        tracker.step(scan).or_raise(py)?;
    }
    Ok(began.elapsed().as_secs_f64())
}
