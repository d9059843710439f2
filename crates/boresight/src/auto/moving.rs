//! Things that move before a fixed camera: people, cars, animals; detector and tracker from the size of what moves.

use super::digits::round;
use super::scene::{Camera, Scene};
use crate::camera::CameraConfig;
use crate::track::{
    ConfirmationConfig, InitiationConfig, MOfNConfig, MergedMeasurementsConfig, OnePointConfig, Report, TrackerConfig,
};
use crate::vision::background::{BackgroundConfig, ShadowConfig};
use crate::vision::config::DetectorConfig;
use crate::vision::threshold::ThresholdConfig;
use crate::{Config, Frame, Result, SourceInfo};

/// Share of the frames in which something must move.
const SHARE_OF_FRAMES: f64 = 0.2;
/// Least longer side of what moves, as a share of the frame's: smaller things are the small targets' matter.
const LEAST_SIDE: f64 = 0.02;
/// Most of the frame's width and height that half of what moves may take: what is wider moves as a whole, and is the ground (a camera that nods, a change of exposure). People who stand near are
/// half as high as the frame.
const MOST_SHARE: [f64; 2] = [0.5, 0.75];
/// Least area of what moves, as a share of the frame's.
const LEAST_AREA: f64 = 0.0004;
/// Least share of new ground, see [`Scene`]: less is leaves, water, flicker.
const LEAST_NOVELTY: f64 = 0.12;
/// More regions than this are noise, water, leaves or particles.
const MOST_REGIONS: f64 = 40.0;
/// Where isolated blobs explain most of what moves, it is found as such, standing still as well.
const MOST_EXPLAINED: f64 = 0.5;
/// Parts of one thing lie nearer than this share of its shorter side. Chosen on vtest.avi, where people walk side by side: IDF1 85.9 % with 0.15, 80.3 % with 0.2.
const PARTS_APART: f64 = 0.15;
/// Fewer frames than this show no background.
const LEAST_FRAMES: usize = 12;

/// Whether what moves before a fixed camera is what should be tracked: then the share of it that isolated blobs explain; `frames` are those looked at.
/// # Errors
/// Frames of more than one size or pixel type.
pub fn look(frames: &[Frame], scene: &Scene, info: &SourceInfo, n_threads: usize) -> Result<Option<f64>> {
    if !fits(scene, info) {
        return Ok(None);
    }
    Ok(Some(scene.explained(frames, info, n_threads)?).filter(|e| *e <= MOST_EXPLAINED))
}

/// Whether what moves is large, lasting and new enough.
fn fits(scene: &Scene, info: &SourceInfo) -> bool {
    let side = scene.size_px[0].max(scene.size_px[1]);
    scene.camera == Camera::Fixed
        && scene.n_moving as f64 >= SHARE_OF_FRAMES * scene.n_frames as f64
        && side >= LEAST_SIDE * info.width.max(info.height) as f64
        && scene.size_px[0] <= MOST_SHARE[0] * info.width as f64
        && scene.size_px[1] <= MOST_SHARE[1] * info.height as f64
        && scene.area_px >= LEAST_AREA * (info.width * info.height) as f64
        && scene.novelty >= LEAST_NOVELTY
        && scene.regions <= MOST_REGIONS
        && scene.share <= 0.35
        && scene.n_frames >= LEAST_FRAMES
}

/// Writes detector and tracker.
pub fn configure(scene: &Scene, explained: f64, info: &SourceInfo, config: &mut Config, reasons: &mut Vec<String>) {
    let [w, h] = scene.size_px;
    let camera = match scene.camera {
        Camera::Fixed => "Fixed camera",
        Camera::Moving => "Moving camera",
        Camera::Unknown => "A camera whose motion cannot be seen",
    };
    reasons.push(format!(
        "{camera}; in {} of {} frames looked at something moves: {:.1} regions a frame, half of it in such of {w:.0} x {h:.0} px or more, of which {:.0} % are isolated \
         blobs. So moving pixels are detected, against a background learned as it goes.",
        scene.n_moving,
        scene.n_frames,
        scene.regions,
        100.0 * explained
    ));
    let least = round((0.35 * scene.area_px).max(9.0)) as u32;
    // Measured on vtest.avi: dark clothes are darker than 0.6 of the ground, shadows are not.
    let background = BackgroundConfig {
        threshold_sd: 6.0,
        shadow: Some(ShadowConfig { darkest: 0.6, spread: 0.15, ..ShadowConfig::default() }),
        ..BackgroundConfig::default()
    };
    config.detector = DetectorConfig {
        threshold: ThresholdConfig::Moving(background),
        max_detections: Some(1000),
        ..DetectorConfig::default()
    };
    config.detector.cluster.min_area_px = Some(least);
    config.detector.cluster.distance_px = round((PARTS_APART * w.min(h)).clamp(2.0, 12.0));
    config.detector.camera = CameraConfig::Fixed;
    tracker(w.max(h), info, &mut config.tracker);
    // What differs from the background where it is (an exposure that changed, a thing that was taken away) never moves.
    config.tracker.report = Report::Moving;
    // People walk side by side for seconds.
    config.tracker.merged_measurements.max_secondary_s = 8.0;
    reasons.push(format!(
        "Regions of {least} px or more count, parts nearer than {} px are one. What stands for a minute becomes background \
         (detector.threshold.moving.standing-time-s); a track is reported once it has moved farther than its covariance and the wander of its \
         outline explain, all are with --set tracker.report=all.",
        config.detector.cluster.distance_px
    ));
}

/// The tracker for things whose outline changes: the noise grows with their size.
pub(super) fn tracker(side_px: f64, info: &SourceInfo, tracker: &mut TrackerConfig) {
    *tracker = TrackerConfig::default();
    tracker.acceleration_density_px2_per_s3 = round((0.2 * side_px).powi(2).max(1.0));
    tracker.extra_noise_px = round((0.05 * side_px).max(0.5));
    tracker.extra_noise_per_height = 0.03;
    tracker.max_speed_px_per_s = round(0.5 * info.width.max(info.height) as f64);
    tracker.initiation = InitiationConfig::OnePoint(OnePointConfig { velocity_std_px_per_s: round(2.0 * side_px) });
    tracker.confirmation = ConfirmationConfig::MOfN(MOfNConfig { hits: 4, scans: 6, ..MOfNConfig::default() });
    // Arms and legs swing the edges of a box more than its middle.
    tracker.merged_measurements = MergedMeasurementsConfig {
        edge_std_px: round((0.1 * side_px).max(0.7)),
        ..MergedMeasurementsConfig::default()
    };
    tracker.coast_s = 0.7;
    tracker.field_px = Some([info.width as f64, info.height as f64]);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::PixelKind;

    #[test]
    fn what_is_wider_than_half_of_the_frame_is_the_ground() {
        let info = SourceInfo {
            label: String::new(),
            reader: String::new(),
            width: 640,
            height: 480,
            kind: PixelKind::Gray8,
            n_frames: None,
            rate_hz: None,
            true_times: true,
        };
        let fits = |size_px: [f64; 2]| {
            let mut scene = Scene::default();
            (scene.camera, scene.n_frames, scene.n_moving, scene.regions) = (Camera::Fixed, 40, 40, 4.0);
            (scene.size_px, scene.area_px, scene.share, scene.novelty) = (size_px, 2000.0, 0.1, 0.5);
            super::fits(&scene, &info)
        };
        assert!(fits([100.0, 250.0]), "people who stand near");
        assert!(!fits([424.0, 88.0]) && !fits([100.0, 400.0]));
    }
}
