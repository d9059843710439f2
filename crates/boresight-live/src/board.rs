//! What a run says of itself while it goes on: its state and its counts, written by every thread, read by page and metrics.

use crate::histogram::Histogram;
use crate::tune::Change;
use boresight::track::TrackerParameters;
use serde::Serialize;
use std::collections::VecDeque;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Mutex, PoisonError};
use std::time::{Instant, SystemTime, UNIX_EPOCH};

/// Changes that wait for the run.
const MOST_CHANGES: usize = 64;

/// Scans over which a mean goes that follows the scene.
const LATELY: u64 = 300;

/// What the run is doing.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum State {
    /// Waits for the source.
    #[default]
    Connecting,
    /// Gathers the first frames and chooses a configuration by them.
    Choosing,
    /// Tracks.
    Running,
    /// The source gives nothing; tracks coast.
    Lost,
    /// The source ended, or the run was stopped.
    Ended,
}

impl State {
    /// Its word.
    pub const fn word(self) -> &'static str {
        match self {
            Self::Connecting => "connecting",
            Self::Choosing => "choosing",
            Self::Running => "running",
            Self::Lost => "lost",
            Self::Ended => "ended",
        }
    }
}

/// Numbers that only grow, or that hold the newest value.
#[derive(Debug, Default)]
pub struct Counts {
    /// Frames or scans that came from the source.
    pub arrived: AtomicU64,
    /// Those that went through detector and tracker.
    pub tracked: AtomicU64,
    /// Those that a newer one replaced before they were taken.
    pub dropped: AtomicU64,
    /// Scans whose time ran back, that the tracker refused, or frames that the detector refused.
    pub refused: AtomicU64,
    /// Scans that came late and were taken at their own time.
    pub late: AtomicU64,
    /// Scans that came too late and were left out.
    pub too_late: AtomicU64,
    /// Lines of detections that could not be read.
    pub bad_lines: AtomicU64,
    /// Times that the source was lost.
    pub lost: AtomicU64,
    /// Detections so far.
    pub detections: AtomicU64,
    /// Of these, beyond those that confirmed tracks took.
    pub unclaimed: AtomicU64,
    /// Tracks that were confirmed so far.
    pub tracks: AtomicU64,
    /// Confirmed tracks now.
    pub now: AtomicU64,
    /// Events that went to the wire.
    pub events: AtomicU64,
    /// Events that an output could not take.
    pub events_dropped: AtomicU64,
    /// Events that a wire of places on Earth could not say: it is not known where the track is.
    pub unplaced: AtomicU64,
    /// Times that the record could not be written.
    pub record_failures: AtomicU64,
    /// Frames in the record's video.
    pub video_frames: AtomicU64,
    /// Frames that were left out of it.
    pub video_left_out: AtomicU64,
    /// Viewers of the page now.
    pub viewers: AtomicU64,
}

/// Adds to a count.
pub fn add(count: &AtomicU64, n: u64) {
    count.fetch_add(n, Ordering::Relaxed);
}

/// Reads a count.
pub fn read(count: &AtomicU64) -> u64 {
    count.load(Ordering::Relaxed)
}

/// What is said of the state.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Said {
    /// The state.
    pub state: State,
    /// Why, for people; empty if there is nothing to say.
    pub why: String,
}

/// What a scan that was tracked says besides its counts.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ScanNotes {
    /// Detections beyond those that confirmed tracks took.
    pub unclaimed: usize,
    /// False detections a frame that the detector was asked for, where it has such a knob.
    pub false_alarms_asked: Option<f64>,
    /// How far the background's middle moved since the scan before, px.
    pub camera_moved_px: Option<f64>,
    /// Mean normalised squared innovation lately, where the parameters follow the scans.
    pub nis_lately: Option<f64>,
}

#[derive(Debug, Default)]
struct Told {
    said: Said,
    reasons: Vec<String>,
    config: String,
    nis: (f64, u64),
    rate: Option<(Instant, f64)>,
    changes: VecDeque<Change>,
    only_tracks: bool,
    parameters: Option<TrackerParameters>,
    notes: ScanNotes,
    /// Mean of the unclaimed detections lately, and the scans so far.
    unclaimed: (f64, u64),
}

/// The board.
#[derive(Debug)]
pub struct Board {
    /// Name of the source, as events show it.
    pub source: String,
    /// Counts.
    pub counts: Counts,
    /// Time from arrival to the last output, s.
    pub latency: Histogram,
    told: Mutex<Told>,
    say: fn(&str),
}

impl Board {
    /// A board for a source of this name; `say` takes a line for people.
    pub fn new(source: impl Into<String>, say: fn(&str)) -> Self {
        let latency = Histogram::default();
        Self { source: source.into(), counts: Counts::default(), latency, told: Mutex::default(), say }
    }

    fn told(&self) -> std::sync::MutexGuard<'_, Told> {
        self.told.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Says a line to people.
    pub fn say(&self, line: &str) {
        (self.say)(line);
    }

    /// Counts a scan that came too late, and says the first.
    pub(crate) fn too_late(&self) {
        if self.counts.too_late.fetch_add(1, Ordering::Relaxed) == 0 {
            let name = &self.source;
            self.say(&format!("warning: {name}: a scan came too late and is left out, and others like it; input.late-s says how late it may come"));
        }
    }

    /// Sets the state and says it, if it or its reason is new; returns whether it is.
    pub fn set(&self, state: State, why: &str) -> bool {
        let said = Said { state, why: why.to_string() };
        let is_new = std::mem::replace(&mut self.told().said, said.clone()) != said;
        if is_new {
            let colon = if why.is_empty() { "" } else { ": " };
            self.say(&format!("{}: {}{colon}{why}", self.source, state.word()));
        }
        is_new
    }

    /// The state.
    pub fn said(&self) -> Said {
        self.told().said.clone()
    }

    /// Notes the configuration of the run, and why it is what it is.
    pub fn configured(&self, config: String, reasons: Vec<String>) {
        let mut told = self.told();
        (told.config, told.reasons) = (config, reasons);
    }

    /// Notes what the tracker assumes now.
    pub fn assumes(&self, parameters: TrackerParameters) {
        self.told().parameters = Some(parameters);
    }

    /// What the tracker assumes now.
    pub fn parameters(&self) -> Option<TrackerParameters> {
        self.told().parameters
    }

    /// The configuration as TOML, empty before it is chosen, and its reasons.
    pub fn configuration(&self) -> (String, Vec<String>) {
        let told = self.told();
        (told.config.clone(), told.reasons.clone())
    }

    /// Notes that detections come from elsewhere.
    pub(crate) fn only_tracks(&self) {
        self.told().only_tracks = true;
    }

    /// Whether the run has a detector.
    pub(crate) fn detects(&self) -> bool {
        !self.told().only_tracks
    }

    /// Asks the run to change a parameter; `false` if it has not yet taken those before.
    pub(crate) fn ask_change(&self, change: Change) -> bool {
        let mut told = self.told();
        let has_room = told.changes.len() < MOST_CHANGES;
        if has_room {
            told.changes.push_back(change);
        }
        has_room
    }

    /// The oldest change that is asked for.
    pub(crate) fn take_change(&self) -> Option<Change> {
        self.told().changes.pop_front()
    }

    /// Notes the normalised squares of a scan's innovations, what else it says, and that it was tracked now.
    pub fn scan_done(&self, nis: impl Iterator<Item = f64>, notes: ScanNotes) {
        let mut told = self.told();
        let n = told.unclaimed.1 + 1;
        let share = 1.0 / n.min(LATELY) as f64;
        told.unclaimed = (told.unclaimed.0 + share * (notes.unclaimed as f64 - told.unclaimed.0), n);
        told.notes = notes;
        nis.filter(|v| v.is_finite()).for_each(|v| told.nis = (told.nis.0 + v, told.nis.1 + 1));
        let now = Instant::now();
        let rate = match told.rate {
            Some((before, rate)) => {
                let dt = now.saturating_duration_since(before).as_secs_f64().max(1e-6);
                // Follows within about a second, whatever the rate.
                let share = dt.min(1.0);
                (1.0 - share) * rate + share / dt
            }
            None => 0.0,
        };
        told.rate = Some((now, rate));
    }

    /// Scans a second lately; 0 where none came for two seconds.
    pub fn rate_hz(&self) -> f64 {
        self.told().rate.filter(|(at, _)| at.elapsed().as_secs_f64() < 2.0).map_or(0.0, |(_, rate)| rate)
    }

    /// Detections a scan beyond those that confirmed tracks took: their mean over some 300 scans.
    pub fn unclaimed_per_scan(&self) -> Option<f64> {
        let (mean, n) = self.told().unclaimed;
        (n > 0).then_some(mean)
    }

    /// What the newest scan says.
    pub fn notes(&self) -> ScanNotes {
        self.told().notes
    }

    /// Mean of the normalised squared innovations, and their number; 2 where the filters are consistent.
    pub fn mean_nis(&self) -> Option<(f64, u64)> {
        let (sum, n) = self.told().nis;
        (n > 0).then(|| (sum / n as f64, n))
    }
}

/// Seconds since 1970 of a time of the system's clock.
pub fn unix_s(at: SystemTime) -> f64 {
    at.duration_since(UNIX_EPOCH).map_or(0.0, |d| d.as_secs_f64())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_state_is_said_once() {
        let board = Board::new("cam", |_| {});
        assert!(board.set(State::Lost, "no answer") && !board.set(State::Lost, "no answer"));
        assert!(board.set(State::Running, "") && board.said().state.word() == "running");
    }
}
