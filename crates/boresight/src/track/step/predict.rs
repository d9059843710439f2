//! Predict: every track's state and existence to the time of the scan, and how far it can have come.
//!
//! Source: docs/theory/filters.md, docs/theory/track-management.md. The prediction itself is the filter's.
//! Symbols: reach, the farthest distance (px) from the prediction at which the largest speed still allows the target.

use super::super::config::TrackerConfig;
use super::super::filter::TrackedFilter;
use super::super::scan_table::Predicted;
use super::super::single_track::Track;
use crate::{Result, Timestamp};
use boresight_filters::Filter;
use nalgebra::Vector2;

/// Predicts tracks over `dt_s`, in place, and appends what gating needs of each to `predicted`. `survival` is the probability that a
/// target stays in view for that time.
/// # Errors
/// A filter that cannot predict over that time.
#[inline]
pub(in crate::track) fn predict(
    tracks: &mut [Track],
    now: Timestamp,
    dt_s: f64,
    survival: f64,
    config: &TrackerConfig,
    predicted: &mut Vec<Predicted>,
) -> Result<()> {
    for t in tracks {
        t.filter.predict(dt_s)?;
        config.confirmation.predict_existence(&mut t.history, survival);
        predicted.push(predicted_of(&t.filter, t.last_seen(), t.last_place, now, config));
    }
    Ok(())
}

/// What gating needs of a predicted track that was last seen at `last_place` (x, y, standard deviation; px).
#[inline]
pub(in crate::track) fn predicted_of(
    filter: &TrackedFilter,
    last_seen: Timestamp,
    last_place: [f64; 3],
    now: Timestamp,
    config: &TrackerConfig,
) -> Predicted {
    let p = filter.predicted();
    let elapsed_s = now.seconds_since(last_seen);
    // From where it was last seen the target came at most this far; the prediction may already lie off it.
    let [x, y, std] = last_place;
    let far = config.max_speed_px_per_s * elapsed_s + 3.0 * std;
    let off = (p.mean - Vector2::new(x, y)).norm();
    Predicted::of(&p, if config.gate_within_max_speed { far + off } else { f64::INFINITY })
}
