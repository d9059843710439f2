//! What the run hands to the viewers: the newest picture with its tracks, and the events. The newest wins; nobody is waited for.

use crate::board::{Board, read};
use crate::event::TrackReport;
use axum::body::Bytes;
use serde::Serialize;
use std::sync::{Arc, Mutex, PoisonError};
use tokio::sync::{broadcast, watch};

/// Events that a slow reader may lag behind before it loses some.
const EVENTS: usize = 1024;
/// Detections that are shown.
pub const MOST_SHOWN: usize = 1000;

/// Everything of one frame but the picture, as viewers get it.
#[derive(Debug, Serialize)]
pub struct Snapshot<'a> {
    /// Name and version of this object.
    pub schema: &'static str,
    /// Name of the source.
    pub source: &'a str,
    /// State of the run, and why.
    pub state: &'static str,
    /// See `state`.
    pub why: String,
    /// Number, time and arrival of the frame.
    pub frame: u64,
    /// See `frame`.
    pub time_s: f64,
    /// See `frame`.
    pub arrived_unix_s: f64,
    /// Size of the frame; 0 where there are only detections.
    pub size_px: [usize; 2],
    /// Positions of the detections.
    pub detections: &'a [[f32; 2]],
    /// The confirmed tracks.
    pub tracks: &'a [TrackReport],
    /// Frames a second.
    pub rate_hz: f64,
    /// Latency from arrival to the last output, ms.
    pub latency_ms: [Option<f64>; 2],
    /// Frames that came, were dropped, were refused; times that the source was lost.
    pub arrived: u64,
    /// See `arrived`.
    pub dropped: u64,
    /// See `arrived`.
    pub refused: u64,
    /// See `arrived`.
    pub lost: u64,
    /// Events that an output could not take.
    pub events_dropped: u64,
    /// Mean normalised squared innovation; 2 where the filters are consistent.
    pub mean_nis: Option<f64>,
    /// Viewers.
    pub viewers: u64,
}

impl<'a> Snapshot<'a> {
    /// What the board says, without a frame.
    pub fn of(board: &'a Board) -> Self {
        let said = board.said();
        let ms = |share: f64| board.latency.quantile_s(share).map(|s| (s * 1e5).round() / 100.0);
        let c = &board.counts;
        Self {
            schema: "boresight.live/1",
            source: &board.source,
            state: said.state.word(),
            why: said.why,
            frame: 0,
            time_s: 0.0,
            arrived_unix_s: 0.0,
            size_px: [0, 0],
            detections: &[],
            tracks: &[],
            rate_hz: (board.rate_hz() * 10.0).round() / 10.0,
            latency_ms: [ms(0.5), ms(0.99)],
            arrived: read(&c.arrived),
            dropped: read(&c.dropped),
            refused: read(&c.refused),
            lost: read(&c.lost),
            events_dropped: read(&c.events_dropped),
            mean_nis: board.mean_nis().map(|(mean, _)| mean),
            viewers: read(&c.viewers),
        }
    }

    /// As JSON.
    pub fn json(&self) -> String {
        serde_json::to_string(self).unwrap_or_default()
    }
}

/// The hub.
pub struct Hub {
    /// What the run says of itself.
    pub board: Arc<Board>,
    /// The newest message for viewers: length of the JSON (4 bytes, the highest first), JSON, JPEG (may be empty).
    pub message: watch::Sender<Bytes>,
    /// Events.
    pub events: broadcast::Sender<Arc<str>>,
    latest: Mutex<Arc<str>>,
}

impl Hub {
    /// A hub without viewers.
    pub fn new(board: Arc<Board>) -> Self {
        let latest: Arc<str> = Snapshot::of(&board).json().into();
        let message = watch::Sender::new(message(&latest, &[]));
        Self { board, message, events: broadcast::Sender::new(EVENTS), latest: Mutex::new(latest) }
    }

    /// The newest snapshot as JSON.
    pub fn latest(&self) -> Arc<str> {
        Arc::clone(&self.latest.lock().unwrap_or_else(PoisonError::into_inner))
    }

    /// Notes the newest snapshot.
    pub fn set_latest(&self, json: Arc<str>) {
        *self.latest.lock().unwrap_or_else(PoisonError::into_inner) = json;
    }
}

/// A message for viewers.
pub fn message(json: &str, jpeg: &[u8]) -> Bytes {
    let n = u32::try_from(json.len()).unwrap_or(0);
    [&n.to_be_bytes(), json.as_bytes(), jpeg].concat().into()
}
