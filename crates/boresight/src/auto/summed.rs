//! Detection in sums of frames, where it was asked for.
//!
//! Source: our own. A sum finds small targets of either sign's kind in proportion to the root of its length, as long as they keep their velocity: half a second
//! is what an aircraft keeps to within a pixel or two. Velocities up to [`SPEED`] a frame are searched, since the cost grows with the square.
//! Limits: never chosen unasked. The camera has to stand still, or to move little within half a second.

use super::scene::{Camera, Scene};
use crate::Config;
use crate::track::InitiationConfig;
use crate::vision::integrate::{IntegrateConfig, StillBackground};
use crate::vision::threshold::{Polarity, ThresholdConfig};
use crate::vision::{ClusterConfig, DetectorConfig};

/// Length of a sum, s.
const DURATION_S: f64 = 0.5;
/// Largest speed searched, px a frame.
const SPEED: f64 = 2.0;
/// Reports that a target may be missed in before its track ends.
const MISSED: f64 = 3.0;

/// Writes the detector, and what the tracker needs to wait from report to report; `config` is that for isolated targets.
pub fn configure(scene: &Scene, interval_s: f64, config: &mut Config, reasons: &mut Vec<String>) {
    let polarity = polarity(config);
    let frames = ((DURATION_S / interval_s.max(1e-6)).clamp(8.0, 64.0) as u32).next_power_of_two().min(64);
    let (background, max_speed_px_per_s) = (background(scene), max_speed(interval_s));
    let sums = IntegrateConfig { frames, max_speed_px_per_s, polarity, background, ..IntegrateConfig::default() };
    let report_s = 0.5 * f64::from(frames) * interval_s;
    reasons.push(format!(
        "{frames} frames are summed along every path of up to {max_speed_px_per_s:.0} px/s, {:.4} false alarms a frame are allowed \
         (detector.threshold.integrate); targets are reported every {report_s:.2} s.",
        sums.false_alarms_per_frame,
    ));
    write(ThresholdConfig::Integrate(sums), max_speed_px_per_s, config);
    config.tracker.coast_s = config.tracker.coast_s.max(MISSED * report_s);
}

/// What is taken for background: a camera that stands has one in time.
pub(super) fn background(scene: &Scene) -> StillBackground {
    if scene.camera == Camera::Fixed { StillBackground::Temporal } else { StillBackground::Both }
}

/// Largest speed searched, px/s.
pub(super) fn max_speed(interval_s: f64) -> f64 {
    (SPEED / interval_s.max(1e-6)).min(1e5)
}

/// The sign that isolated targets have.
pub(super) fn polarity(config: &Config) -> Polarity {
    match &config.detector.threshold {
        ThresholdConfig::Isolated(c) => c.polarity,
        _ => Polarity::default(),
    }
}

/// Writes a detector below the noise of a frame in the place of that for isolated targets: it judges scores by itself, and says velocities.
pub(super) fn write(threshold: ThresholdConfig, max_speed_px_per_s: f64, config: &mut Config) {
    let camera = config.detector.camera;
    config.detector =
        DetectorConfig { threshold, cluster: ClusterConfig::default(), camera, ..DetectorConfig::default() };
    let t = &mut config.tracker;
    t.min_initiation_score = 0.0;
    t.max_speed_px_per_s = t.max_speed_px_per_s.max(max_speed_px_per_s);
    t.initiation = InitiationConfig::default();
}
