//! What is said of a track to the outside: tentative, confirmed or coasting. The one place that says so.
//!
//! A track is reported as confirmed when its rule holds it for confirmed and it has passed the confirmation gate; without a
//! detection in the scan it is coasting. A track that the rule has confirmed but the gate not yet is tentative for everyone outside,
//! while it is associated and kept like a confirmed one.

use super::history::History;
use crate::TrackStatus;

/// The reported status after a scan with (`hit`) or without a detection.
#[inline]
pub(in crate::track) fn status(history: &History, passed_gate: bool, hit: bool) -> TrackStatus {
    match (history.accepted && passed_gate, hit) {
        (false, _) => TrackStatus::Tentative,
        (true, true) => TrackStatus::Confirmed,
        (true, false) => TrackStatus::Coasting,
    }
}
