//! A single target told by its colour: a ball, a marker; the colour is chosen from the frames looked at.

use super::digits::round;
use super::scene::{Camera, Scene};
use super::stretch;
use crate::camera::CameraConfig;
use crate::io::Colour;
use crate::tempo::Tempo;
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

/// The colour of a single moving target, if there is one; `frames` may hold every so many-th pixel of the source's.
pub fn look(frames: &[&Frame], scene: &Scene, info: &SourceInfo) -> Option<Reference> {
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
    // Of as many frames as the scene was seen in, or fewer.
    let n_moving = scene.n_moving as f64 * images.len() as f64 / scene.n_frames.max(1) as f64;
    let seen = |r: &Reference| r.n_frames as f64 >= SEEN * n_moving;
    // Of large frames a part of the pixels may have been kept.
    let every_px = info.width.div_ceil(images[0].width().max(1)) as f64;
    let reference = choose_reference(&images).filter(|r| seen(r) && r.hsi.saturation >= LEAST_SATURATION)?;
    Some(Reference { area_px: reference.area_px * every_px * every_px, ..reference })
}

/// Writes detector and tracker.
pub fn configure(
    reference: &Reference,
    tempo: Tempo,
    info: &SourceInfo,
    config: &mut Config,
    reasons: &mut Vec<String>,
) {
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
    stretch::of_tracker(tempo, tracker);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{FrameIndex, Image, PixelKind, Timestamp};

    /// Pairs A, B of "A of B" in a text.
    fn shares(text: &str) -> Vec<(u64, u64)> {
        let words: Vec<&str> = text.split(|c: char| !c.is_alphanumeric()).filter(|w| !w.is_empty()).collect();
        let pair = |w: &[&str]| Some((w[0].parse().ok()?, w.get(2)?.parse().ok()?)).filter(|_| w[1] == "of");
        words.windows(3).filter_map(pair).collect()
    }

    #[test]
    fn every_so_many_th_pixel_tells_the_same_colour_and_size() {
        let info = SourceInfo {
            label: "ball".to_string(),
            reader: "test".to_string(),
            width: 640,
            height: 360,
            kind: PixelKind::Gray8,
            n_frames: Some(12),
            rate_hz: None,
            true_times: false,
        };
        let frames = |every: usize| -> Vec<Frame> {
            let pixel = |x: usize, y: usize, k: usize| {
                let is_ball = (x as f64 - 60.0 - 40.0 * k as f64).hypot(y as f64 - 180.0) < 24.0;
                if is_ball { [200, 40, 60] } else { [128; 3] }
            };
            let frame = |k: usize| {
                let rows = (0..360).step_by(every).flat_map(|y| (0..640).step_by(every).map(move |x| (x, y)));
                let pixels = rows.map(|(x, y)| pixel(x, y, k)).collect();
                let image = Image::from_vec(640 / every, 360 / every, pixels).unwrap();
                let (index, time) = (FrameIndex(k as u64), Timestamp::from_ns(k as i64 * 40_000_000));
                Frame { index, time, pixels: Pixels::Rgb8(image) }
            };
            (0..12).map(frame).collect()
        };
        let mut scene = Scene::default();
        // The scene was seen in four times as many frames.
        (scene.camera, scene.n_frames, scene.n_moving) = (Camera::Fixed, 48, 48);
        let [all, some] = [1, 2].map(|every| look(&frames(every).iter().collect::<Vec<_>>(), &scene, &info).unwrap());
        assert_eq!((all.rgb, all.n_frames, all.area_px), (some.rgb, some.n_frames, some.area_px));
        assert!((all.area_px.sqrt() - 24.0 * std::f64::consts::PI.sqrt()).abs() < 3.0, "{all:?}");
    }

    #[test]
    fn a_colour_that_is_seen_in_more_frames_than_move_is_not_said_to_be_in_three_of_two() {
        // A ball as bright as the wall behind it: in grey it moves in no frame, its colour does in each.
        let info = SourceInfo {
            label: "ball".to_string(),
            reader: "test".to_string(),
            width: 160,
            height: 120,
            kind: PixelKind::Rgb8,
            n_frames: Some(12),
            rate_hz: None,
            true_times: false,
        };
        let frame = |k: u64| {
            let mut image = Image::filled(160, 120, [128u8; 3]);
            for y in 0..120 {
                for x in 0..160 {
                    let (dx, dy) = (x as f64 - 30.0 - 8.0 * k as f64, y as f64 - 60.0);
                    if dx.hypot(dy) < 8.0 {
                        image.row_mut(y)[x] = [200, 94, 120];
                    }
                }
            }
            Frame { index: FrameIndex(k), time: Timestamp::from_ns(k as i64 * 40_000_000), pixels: Pixels::Rgb8(image) }
        };
        let frames: Vec<Frame> = (0..12).map(frame).collect();
        let mut scene = Scene::default();
        (scene.camera, scene.n_frames, scene.n_moving) = (Camera::Fixed, 12, 2);
        let reference = look(&frames.iter().collect::<Vec<_>>(), &scene, &info).unwrap();
        assert!(reference.n_frames > scene.n_moving, "{reference:?}");
        let (mut config, mut reasons) = (Config::default(), Vec::new());
        configure(&reference, Tempo::VIDEO, &info, &mut config, &mut reasons);
        assert!(reasons[0].contains(&format!("in {} of the frames looked at", reference.n_frames)), "{reasons:?}");
        assert_eq!(shares("in 3 of 2 frames"), [(3, 2)]);
        for reason in &reasons {
            assert!(shares(reason).iter().all(|(n, of)| n <= of), "{reason}");
        }
    }
}
