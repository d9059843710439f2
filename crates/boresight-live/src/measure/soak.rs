//! A day in minutes: memory of a run over many simulated hours, with page, wire and record, as fast as it goes.

use super::camera::{CameraPlug, View};
use crate::board::{Board, read};
use crate::cbor::Form;
use crate::output::{LiveOutput, Shown};
use crate::publish::Udp;
use crate::record::{Record, RecordOptions};
use crate::run::{RunOptions, run};
use crate::serve::{Page, PageOptions, resident_bytes};
use boresight::{Config, Error, ErrorKind, Result};
use std::net::UdpSocket;
use std::sync::{Arc, Mutex, PoisonError};

/// Memory at one time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sample {
    /// Simulated hours.
    pub hours: f64,
    /// Memory of the process in use, bytes.
    pub bytes: u64,
}

/// A detector that costs next to nothing: what is measured is the run and its outputs, not a detector.
const CONFIG: &str = "[detector.threshold.band]\nlow = 150\nhigh = 255\n[detector.cluster]\nmin-area-px = 25\n";

/// What a soak gave.
#[derive(Clone, Debug, PartialEq)]
pub struct Soak {
    /// Frames tracked, tracks begun, events sent.
    pub frames: u64,
    /// See `frames`.
    pub tracks: u64,
    /// See `frames`.
    pub events: u64,
    /// Memory each simulated hour, from the first on.
    pub samples: Vec<Sample>,
}

impl Soak {
    /// From the first hour to the largest later value, bytes: warming up is no growth.
    pub fn growth_bytes(&self) -> u64 {
        let most = self.samples.iter().map(|s| s.bytes).max().unwrap_or(0);
        most.saturating_sub(self.samples.first().map_or(0, |s| s.bytes))
    }
}

/// Notes the memory each simulated hour.
struct Scale {
    samples: Arc<Mutex<Vec<Sample>>>,
    next_s: f64,
}

impl LiveOutput for Scale {
    fn put(&mut self, shown: &Shown<'_>) -> Result<()> {
        let time_s = shown.when.time.as_secs_f64();
        if time_s >= self.next_s {
            self.next_s += 3600.0;
            let sample = Sample { hours: time_s / 3600.0, bytes: resident_bytes().unwrap_or(0) };
            self.samples.lock().unwrap_or_else(PoisonError::into_inner).push(sample);
        }
        Ok(())
    }
}

/// Runs so many simulated hours; the record goes to `folder`, which the caller removes.
/// # Errors
/// A system that does not tell the memory of a process; outputs that cannot be opened.
pub fn soak(hours: f64, folder: &std::path::Path) -> Result<Soak> {
    if resident_bytes().is_none() {
        return Err(Error::new(ErrorKind::Unsupported, "this system does not tell the memory of a process"));
    }
    let rate_hz = 2.0;
    let n_frames = (hours * 3600.0 * rate_hz) as u64 + 1;
    let view = View { size_px: [128, 96], rate_hz, n_frames, n_targets: 3, seen_s: 40.0 };
    let board = Arc::new(Board::new("simulated", |_| {}));
    let page = Page::serve(&PageOptions::at(([127, 0, 0, 1], 0).into()), &[Arc::clone(&board)])?;
    let failed = |e: std::io::Error| Error::new(ErrorKind::Output, "no socket can be had").because(e);
    let sink = UdpSocket::bind("127.0.0.1:0").map_err(failed)?;
    let to = sink.local_addr().map_err(failed)?.to_string();
    let limits = RecordOptions { segment_bytes: 4 << 20, most_bytes: 16 << 20, ..RecordOptions::default() };
    let samples = Arc::new(Mutex::new(Vec::new()));
    let scale = Scale { samples: Arc::clone(&samples), next_s: 3600.0 };
    let record = Record::create(folder, limits)?;
    let mut outputs: Vec<Box<dyn LiveOutput>> =
        vec![page.output(0)?, Box::new(Udp::open(&to, Form::Json)?), Box::new(record), Box::new(scale)];
    let config = Some(Config::from_toml(CONFIG, "soak")?);
    let options = RunOptions { config, ..RunOptions::default() };
    run(Box::new(CameraPlug(view, None)), &options, &board, &mut outputs, &|| false)?;
    let c = &board.counts;
    let samples = samples.lock().unwrap_or_else(PoisonError::into_inner).clone();
    Ok(Soak { frames: read(&c.tracked), tracks: read(&c.tracks), events: read(&c.events), samples })
}
