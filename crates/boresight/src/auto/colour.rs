//! A single target told by its colour: a ball, a marker; the colour is chosen from the frames looked at.

use super::digits::round;
use super::scene::{Camera, Scene};
use crate::camera::CameraConfig;
use crate::io::Colour;
use crate::track::{ConfirmationConfig, InitiationConfig, MOfNConfig, OnePointConfig};
use crate::vision::colour::{ColourMatchConfig, Reference, choose_reference};
use crate::vision::config::DetectorConfig;
use crate::vision::threshold::ThresholdConfig;
use crate::{Config, Frame, Pixels, SourceInfo};

/// More regions than this that move at a time are not a single target and a hand.
const MOST_REGIONS: f64 = 4.0;
/// Share of the frames with motion in which the colour must be seen in one piece.
const SEEN: f64 = 0.4;
/// Least saturation of a colour that tells a target from its surroundings.
const LEAST_SATURATION: f64 = 0.1;

/// The colour of a single moving target, if there is one.
pub fn look(frames: &[Frame], scene: &Scene) -> Option<Reference> {
    let images: Vec<_> = frames
        .iter()
        .filter_map(|f| match &f.pixels {
            Pixels::Rgb8(image) => Some(image),
            _ => None,
        })
        .collect();
    if images.is_empty() || scene.camera != Camera::Fixed || scene.regions > MOST_REGIONS {
        return None;
    }
    let seen = |r: &Reference| r.n_frames as f64 >= SEEN * scene.n_moving as f64;
    choose_reference(&images).filter(|r| seen(r) && r.hsi.saturation >= LEAST_SATURATION)
}

/// Writes detector and tracker.
pub fn configure(reference: &Reference, info: &SourceInfo, config: &mut Config, reasons: &mut Vec<String>) {
    let [r, g, b] = reference.rgb;
    let side = reference.area_px.sqrt();
    reasons.push(format!(
        "Fixed camera, and one moving piece of a colour of its own: red {r}, green {g}, blue {b} (hue {:.0} degrees), about {side:.0} px across, in {} \
         of the frames looked at. So pixels of this colour are detected (input.colour = rgb).",
        reference.hsi.hue_deg, reference.n_frames
    ));
    config.input.colour = Colour::Rgb;
    let colour = ColourMatchConfig { reference: reference.rgb, ..ColourMatchConfig::default() };
    config.detector = DetectorConfig {
        threshold: ThresholdConfig::Colour(colour),
        max_detections: Some(100),
        ..DetectorConfig::default()
    };
    config.detector.cluster.min_area_px = Some(round((0.15 * reference.area_px).max(6.0)) as u32);
    config.detector.cluster.distance_px = round((0.15 * side).clamp(2.0, 12.0));
    config.detector.camera = CameraConfig::Fixed;
    super::moving::tracker(side, info, &mut config.tracker);
    let tracker = &mut config.tracker;
    // A thrown thing: 1 g is 245 times the side of a ball of 4 cm a second squared, and a hand jerks as much for 0.04 s.
    tracker.acceleration_density_px2_per_s3 = round((60.0 * side).powi(2));
    tracker.max_speed_px_per_s = round(2.0 * info.width.max(info.height) as f64);
    // It comes into view at any speed up to that, and may be gone after ten frames.
    let velocity_std_px_per_s = round(tracker.max_speed_px_per_s / 3.0);
    tracker.initiation = InitiationConfig::OnePoint(OnePointConfig { velocity_std_px_per_s });
    tracker.confirmation = ConfirmationConfig::MOfN(MOfNConfig { hits: 3, scans: 5, ..MOfNConfig::default() });
}
