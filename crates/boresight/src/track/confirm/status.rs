//! What is said of a track to the outside: tentative, confirmed or coasting, as it runs.
//!
//! A track is reported as confirmed when its rule holds it for confirmed and it has moved by itself where only that is reported; without a
//! detection in the scan it is coasting. A track that the rule has confirmed and that has not moved yet is tentative for everyone outside,
//! while it is associated and kept like a confirmed one.

use super::history::History;
use crate::TrackStatus;

/// The reported status after a scan with (`hit`) or without a detection.
#[inline]
pub(in crate::track) fn status(history: &History, may_report: bool, hit: bool) -> TrackStatus {
    match (history.accepted && may_report, hit) {
        (false, _) => TrackStatus::Tentative,
        (true, true) => TrackStatus::Confirmed,
        (true, false) => TrackStatus::Coasting,
    }
}
