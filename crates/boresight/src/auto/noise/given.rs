//! The noise of a tracker's configuration: what is assumed there, and what was found, written into it.

use super::super::digits::round;
use super::fit::{LEAST, Noise};
use crate::track::{TrackerConfig, TrackerParameters};

/// Probability that a target's detection lies in the gate, once the innovations are as wide as their covariances say: one true detection in
/// ten thousand outside, a track's loss in some minutes of video. With 0.99 of covariances that were far too large the gate was as wide.
const GATE_PROBABILITY: f64 = 0.9999;

/// The noise that a tracker assumes.
pub(in super::super) fn assumed(p: &TrackerParameters) -> Noise {
    Noise {
        scale: p.detection_covariance_scale,
        extra_px: p.extra_noise_px,
        extra_per_height: p.extra_noise_per_height,
        density: p.acceleration_density_px2_per_s3,
        density_per_height2: p.acceleration_density_per_height2_per_s3,
    }
}

/// Writes noise and motion into the tracker's configuration.
pub(super) fn put(found: &Noise, least_density: f64, t: &mut TrackerConfig) {
    t.gate_probability = GATE_PROBABILITY;
    t.detection_covariance_scale = round(found.scale);
    t.extra_noise_px = or_none(found.extra_px, LEAST);
    t.extra_noise_per_height = or_none(found.extra_per_height, LEAST);
    t.acceleration_density_px2_per_s3 = round(found.density);
    t.acceleration_density_per_height2_per_s3 = or_none(found.density_per_height2, least_density);
}

/// Three digits of a number, 0 where the search has left it at its floor.
fn or_none(v: f64, least: f64) -> f64 {
    if v <= 2.0 * least { 0.0 } else { round(v) }
}
