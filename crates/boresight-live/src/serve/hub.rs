//! What the run hands to the viewers: the newest picture with its tracks, and the events. The newest wins; nobody is waited for.

use crate::board::{Board, read};
use crate::event::TrackReport;
use crate::output::Shown;
use axum::body::Bytes;
use serde::Serialize;
use std::sync::atomic::AtomicBool;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use tokio::sync::{broadcast, watch};

/// Events that a slow reader may lag behind before it loses some.
const EVENTS: usize = 1024;
/// Detections that are shown.
const MOST_SHOWN: usize = 1000;

/// Everything of one frame but the picture, as viewers get it.
#[derive(Debug, Serialize)]
struct Snapshot<'a> {
    /// Name and version of this object.
    schema: &'static str,
    /// Name of the source.
    source: &'a str,
    /// State of the run, and why.
    state: &'static str,
    /// See `state`.
    why: String,
    /// Number, time and arrival of the frame.
    frame: u64,
    /// See `frame`.
    time_s: f64,
    /// See `frame`.
    arrived_unix_s: f64,
    /// Size of the frame; 0 where there are only detections.
    size_px: [usize; 2],
    /// Positions of the detections.
    detections: &'a [[f32; 2]],
    /// The confirmed tracks.
    tracks: &'a [TrackReport],
    /// Frames a second.
    rate_hz: f64,
    /// Latency from arrival to the last output, ms.
    latency_ms: [Option<f64>; 2],
    /// Frames that came, were dropped, were refused; times that the source was lost.
    arrived: u64,
    /// See `arrived`.
    dropped: u64,
    /// See `arrived`.
    refused: u64,
    /// See `arrived`.
    lost: u64,
    /// Events that an output could not take.
    events_dropped: u64,
    /// Mean normalised squared innovation; 2 where the filters are consistent.
    mean_nis: Option<f64>,
    /// Viewers.
    viewers: u64,
}

/// What was seen in a frame, as it is kept for viewers; its memory is used again.
#[derive(Clone, Debug, Default)]
pub struct Seen {
    frame: u64,
    time_s: f64,
    arrived_unix_s: f64,
    size_px: [usize; 2],
    detections: Vec<[f32; 2]>,
    tracks: Vec<TrackReport>,
}

impl Seen {
    /// Takes a frame's.
    fn take(&mut self, shown: &Shown<'_>) {
        (self.frame, self.time_s) = (shown.when.frame, shown.when.time.as_secs_f64());
        self.arrived_unix_s = shown.when.arrived_unix_s;
        self.size_px = shown.view.frame.map_or([0, 0], |f| [f.pixels.width(), f.pixels.height()]);
        self.detections.clear();
        let positions = shown.view.scan.detections.iter().take(MOST_SHOWN).map(|d| d.position);
        self.detections.extend(positions.map(|p| [p.x as f32, p.y as f32]));
        self.tracks.clear();
        self.tracks.extend_from_slice(shown.tracks);
    }

    /// As JSON, beside what the run says of itself.
    pub fn json(&self, board: &Board) -> String {
        let said = board.said();
        let ms = |share: f64| board.latency.quantile_s(share).map(|s| (s * 1e5).round() / 100.0);
        let c = &board.counts;
        let snapshot = Snapshot {
            schema: "boresight.live/1",
            source: &board.source,
            state: said.state.word(),
            why: said.why,
            frame: self.frame,
            time_s: self.time_s,
            arrived_unix_s: self.arrived_unix_s,
            size_px: self.size_px,
            detections: &self.detections,
            tracks: &self.tracks,
            rate_hz: (board.rate_hz() * 10.0).round() / 10.0,
            latency_ms: [ms(0.5), ms(0.99)],
            arrived: read(&c.arrived),
            dropped: read(&c.dropped),
            refused: read(&c.refused),
            lost: read(&c.lost),
            events_dropped: read(&c.events_dropped),
            mean_nis: board.mean_nis().map(|(mean, _)| mean),
            viewers: read(&c.viewers),
        };
        serde_json::to_string(&snapshot).unwrap_or_default()
    }
}

/// A coded picture on its way to viewers, with its text.
#[derive(Clone)]
pub struct Coded {
    /// Length of the JSON (4 bytes, the highest first), JSON, length of the coding's name (1 byte, 0 of what needs the picture before), the name, the picture (may be empty).
    pub bytes: Bytes,
    /// Whether decoding can start with the picture; `None`: there is none.
    pub key: Option<bool>,
}

/// Coded pictures that a viewer may lag behind before it loses some.
const CODED: usize = 64;

/// The hub.
pub struct Hub {
    /// What the run says of itself.
    pub board: Arc<Board>,
    /// The newest message for viewers: length of the JSON (4 bytes, the highest first), JSON, JPEG (may be empty).
    pub message: watch::Sender<Bytes>,
    /// Coded pictures, for viewers who take H.264; `None` where the frames cannot be coded.
    pub coded: broadcast::Sender<Option<Coded>>,
    /// Whether one of them waits for a picture from which decoding can start.
    pub wants_key: AtomicBool,
    /// Events.
    pub events: broadcast::Sender<Arc<str>>,
    newest: Mutex<Seen>,
}

impl Hub {
    /// A hub without viewers.
    pub fn new(board: Arc<Board>) -> Self {
        let message = watch::Sender::new(message(&Seen::default().json(&board), &[]));
        let (coded, wants_key) = (broadcast::Sender::new(CODED), AtomicBool::new(false));
        Self { board, message, coded, wants_key, events: broadcast::Sender::new(EVENTS), newest: Mutex::default() }
    }

    fn newest(&self) -> MutexGuard<'_, Seen> {
        self.newest.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// What was seen in the newest frame.
    pub fn seen(&self) -> Seen {
        self.newest().clone()
    }

    /// Takes the newest frame's; of the run's state alone, nothing.
    pub fn see(&self, shown: Option<&Shown<'_>>) {
        match shown {
            Some(shown) => self.newest().take(shown),
            None => *self.newest() = Seen::default(),
        }
    }
}

/// A message for viewers.
pub fn message(json: &str, jpeg: &[u8]) -> Bytes {
    let n = u32::try_from(json.len()).unwrap_or(0);
    [&n.to_be_bytes(), json.as_bytes(), jpeg].concat().into()
}

/// A message for viewers who take H.264: a picture that is a key brings the name of its coding.
pub fn coded_message(json: &str, codec: &str, picture: &[u8]) -> Bytes {
    let n = u32::try_from(json.len()).unwrap_or(0);
    let named = u8::try_from(codec.len()).unwrap_or(0);
    [&n.to_be_bytes(), json.as_bytes(), &[named], codec.as_bytes(), picture].concat().into()
}
