//! What goes over the wire: the state of a track at its start, at updates and at its end, and the state of the run.
//!
//! JSON objects with the name and version of their schema; `docs/live.md` lists the fields. Numbers are the shortest that read back to the
//! same bits, so page, wire and record can be compared exactly.

use crate::on_earth::{OnEarth, upper_triangle};
use boresight::world::World;
use boresight::{Timestamp, TrackState, TrackStatus};
use serde::Serialize;
use std::sync::Arc;

/// Name and version of a track's events.
pub const TRACK_SCHEMA: &str = "boresight.track/1";
/// Name and version of the run's state.
pub const STATUS_SCHEMA: &str = "boresight.status/1";

/// The status of a track with a detection in its frame.
pub const CONFIRMED: &str = "confirmed";

/// A track's state at one time; the same on page, wire and record.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct TrackReport {
    /// The track's number.
    pub track: u64,
    /// `confirmed`, or `coasting`: without a detection in this frame.
    pub status: &'static str,
    /// Position and velocity.
    pub x_px: f64,
    /// See `x_px`.
    pub y_px: f64,
    /// See `x_px`.
    pub vx_px_per_s: f64,
    /// See `x_px`.
    pub vy_px_per_s: f64,
    /// Upper triangle of the covariance of `[x, vx, y, vy]`, row by row.
    pub cov: [f64; 10],
    /// Size of the box around the position.
    pub width_px: f64,
    /// See `width_px`.
    pub height_px: f64,
    /// Confidence, 0 to 1.
    pub score: f32,
    /// Normalised squared innovation of this frame's update.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub nis: Option<f64>,
    /// Where on Earth it is, if the configuration says how to tell.
    #[serde(flatten)]
    pub on_earth: OnEarth,
}

impl TrackReport {
    /// The report of a track, `None` while it is tentative.
    pub fn of(t: &TrackState, world: Option<&World>) -> Option<Self> {
        let status = match t.status {
            TrackStatus::Tentative => return None,
            TrackStatus::Confirmed => CONFIRMED,
            TrackStatus::Coasting => "coasting",
        };
        let (m, p) = (&t.kinematics.mean, &t.kinematics.cov);
        Some(Self {
            track: t.id.0,
            status,
            x_px: m[0],
            y_px: m[2],
            vx_px_per_s: m[1],
            vy_px_per_s: m[3],
            cov: upper_triangle(|i, j| p[(i, j)]),
            width_px: t.extent.width_px,
            height_px: t.extent.height_px,
            score: t.score,
            nis: t.innovation.as_ref().map(|i| i.nis).filter(|n| n.is_finite()),
            on_earth: OnEarth(world.map(|w| w.locate(&t.kinematics)).unwrap_or_default()),
        })
    }
}

/// What happened to a track.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum What {
    /// It was confirmed.
    Start,
    /// It goes on.
    Update,
    /// It is over; the state is the last that was reported.
    End,
}

/// When and where a track had a state.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct When {
    /// Number of the frame in this run, from 0.
    pub frame: u64,
    /// Time of the frame: the stream's stamp.
    pub time: Timestamp,
    /// When it arrived, s since 1970.
    pub arrived_unix_s: f64,
}

#[derive(Serialize)]
struct TrackLine<'a> {
    schema: &'static str,
    event: What,
    source: &'a str,
    frame: u64,
    time_s: f64,
    arrived_unix_s: f64,
    #[serde(flatten)]
    track: &'a TrackReport,
}

#[derive(Serialize)]
struct StatusLine<'a> {
    schema: &'static str,
    source: &'a str,
    state: &'a str,
    #[serde(skip_serializing_if = "str::is_empty")]
    why: &'a str,
    unix_s: f64,
}

fn track_line(event: What, source: &str, when: When, track: &TrackReport) -> String {
    let (frame, time_s, arrived_unix_s) = (when.frame, when.time.as_secs_f64(), when.arrived_unix_s);
    let line = TrackLine { schema: TRACK_SCHEMA, event, source, frame, time_s, arrived_unix_s, track };
    serde_json::to_string(&line).unwrap_or_default()
}

/// The line of the run's state.
pub fn status_line(source: &str, state: &str, why: &str, unix_s: f64) -> String {
    serde_json::to_string(&StatusLine { schema: STATUS_SCHEMA, source, state, why, unix_s }).unwrap_or_default()
}

/// What happened to a track, when, and its state.
#[derive(Clone, Debug, PartialEq)]
pub struct TrackEvent {
    /// What happened.
    pub what: What,
    /// When and where it had the state.
    pub when: When,
    /// The state.
    pub report: TrackReport,
}

/// An event for the wire.
#[derive(Clone, Debug, PartialEq)]
pub struct Event {
    /// Whether it is the run's state, which a broker keeps for those who come later.
    pub is_status: bool,
    /// The JSON object, without an end of line.
    pub json: Arc<str>,
    /// What it says of a track, for wires that do not speak JSON.
    pub track: Option<Arc<TrackEvent>>,
}

impl Event {
    /// The event of a track.
    pub fn of_track(what: What, source: &str, when: When, report: &TrackReport) -> Self {
        let track = Some(Arc::new(TrackEvent { what, when, report: report.clone() }));
        Self { is_status: false, json: track_line(what, source, when, report).into(), track }
    }

    /// An event that is a line alone; `is_status`: the run's state.
    pub fn line(is_status: bool, json: impl Into<Arc<str>>) -> Self {
        Self { is_status, json: json.into(), track: None }
    }
}
