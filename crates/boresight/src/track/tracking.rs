//! The trait of everything that turns scans into tracks.

use super::backward::Backward;
use super::parameters::TrackerParameters;
use crate::{Result, Scan, TrackId, TrackState};

/// Turns scans into tracks: the tracker, or the multiple-hypothesis tracker.
pub trait Tracking: Send {
    /// Takes the next scan and returns all tracks after it, in the order of their ids.
    /// # Errors
    /// A scan that runs back in time or holds values that are not finite; the tracks are then unchanged.
    fn step(&mut self, scan: &Scan) -> Result<&[TrackState]>;

    /// Takes other parameters from the next scan on, while its tracks go on; `false` if it cannot.
    /// # Errors
    /// A value outside its range; all stays as it was.
    fn adapt(&mut self, parameters: &TrackerParameters) -> Result<bool> {
        let _ = parameters;
        Ok(false)
    }

    /// Tracks that got another id in the newest scan, because they continue a lost one: the id they had until then, and the one they have now.
    fn renamed(&self) -> &[(TrackId, TrackId)] {
        &[]
    }

    /// A copy that goes on alike, to come back to; none where it cannot be copied.
    fn twin(&self) -> Option<Box<dyn Tracking>> {
        None
    }

    /// The number that the next new track gets.
    fn next_id(&self) -> TrackId {
        TrackId(0)
    }

    /// Gives new tracks numbers from `next` on, if those are higher, and tracks of the first of each pair the number of the second; returns the tracks after the newest scan.
    fn renumber(&mut self, next: TrackId, pairs: &[(TrackId, TrackId)]) -> &[TrackState] {
        let _ = (next, pairs);
        &[]
    }

    /// For how long a run holds back its results, so that a track that is confirmed is reported from its first detection on, s; 0 gives them at once.
    fn retrospective_s(&self) -> f64 {
        0.0
    }

    /// What continues a track backward from its first detection, where results are held back; none if it cannot be said how likely that is.
    fn backward(&self) -> Option<Backward> {
        None
    }
}

/// Gives states of the first of each pair the number of the second.
pub(super) fn renumber_states(states: &mut [TrackState], pairs: &[(TrackId, TrackId)]) {
    for s in states {
        if let Some((_, to)) = pairs.iter().find(|(from, _)| *from == s.id) {
            s.id = *to;
        }
    }
}
