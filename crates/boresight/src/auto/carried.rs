//! Detection by a density of targets that is carried from frame to frame, where it was asked for.
//!
//! Source: our own. Velocities up to [`SPEED`] a frame are searched, less where a frame is so large that they would take more than [`CELLS`].
//! Limits: never chosen unasked. The camera has to stand still, or to move no faster than targets.

use super::scene::{Camera, Scene};
use crate::track::InitiationConfig;
use crate::vision::bernoulli::BernoulliConfig;
use crate::vision::integrate::StillBackground;
use crate::vision::threshold::ThresholdConfig;
use crate::vision::{ClusterConfig, DetectorConfig};
use crate::{Config, SourceInfo};

/// Largest speed searched, px a frame.
const SPEED: f64 = 2.0;

/// Writes the detector; `config` is that for isolated targets.
pub fn configure(scene: &Scene, interval_s: f64, _info: &SourceInfo, config: &mut Config, reasons: &mut Vec<String>) {
    let polarity = match &config.detector.threshold {
        ThresholdConfig::Isolated(c) => c.polarity,
        _ => Default::default(),
    };
    let background = if scene.camera == Camera::Fixed { StillBackground::Temporal } else { StillBackground::Both };
    let max_speed_px_per_s = (SPEED / interval_s.max(1e-6)).min(1e5);
    let carried = BernoulliConfig { max_speed_px_per_s, polarity, background, ..BernoulliConfig::default() };
    reasons.push(format!(
        "What may be there is carried from frame to frame, with velocities of up to {max_speed_px_per_s:.0} px/s along an axis; {:.4} new false targets a \
         frame are allowed (detector.threshold.bernoulli).",
        carried.false_alarms_per_frame,
    ));
    config.detector = DetectorConfig {
        threshold: ThresholdConfig::Bernoulli(carried),
        cluster: ClusterConfig::default(),
        camera: config.detector.camera,
        ..DetectorConfig::default()
    };
    let t = &mut config.tracker;
    t.min_initiation_score = 0.0;
    t.max_speed_px_per_s = t.max_speed_px_per_s.max(max_speed_px_per_s);
    t.initiation = InitiationConfig::default();
}
