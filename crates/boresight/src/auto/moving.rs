//! Things that move before a fixed camera: people, cars, animals; detector and tracker from the size of what moves.

use super::chains::Chain;
use super::digits::round;
use super::evidence::{Evidence, LEAST_EXPLAINED};
use super::scene::{Camera, Scene};
use super::shake;
use super::sightings::Sighting;
use super::stretch;
use crate::camera::CameraConfig;
use crate::tempo::Tempo;
use crate::track::{
    ConfirmationConfig, InitiationConfig, MOfNConfig, MergedMeasurementsConfig, OnePointConfig, Report, TrackerConfig,
};
use crate::vision::background::{BackgroundConfig, ShadowConfig};
use crate::vision::config::DetectorConfig;
use crate::vision::threshold::ThresholdConfig;
use crate::{Config, Detection, Frame, Result, Scan, SourceInfo};
use nalgebra::Vector2;

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
/// Regions count from this share of the area on that half of what moves has, or more: what is smaller is parts and flicker.
const SHARE_OF_AREA: f64 = 0.35;
/// And from this area on, px: three by three, the least that a clean-up by majority leaves whole.
pub(super) const LEAST_PX: u32 = 9;
/// Share of its detections in which a smaller thing may be as large as those that count: two things that overlap are one region.
const NOW_AND_THEN: f64 = 0.05;
/// Fewer frames than this show no background.
const LEAST_FRAMES: usize = 12;

/// Whether what moves, if the camera stands, is long and new enough to be tracked: then the share of it that isolated blobs explain; `frames` are those looked at.
/// # Errors
/// Frames of more than one size or pixel type.
pub fn look(frames: &[&Frame], scene: &Scene, info: &SourceInfo, n_threads: usize) -> Result<Option<f64>> {
    if !fits(scene, info) {
        return Ok(None);
    }
    scene.explained(frames, info, n_threads).map(Some)
}

/// Whether what moves, of which blobs explain that share, is evidently what should be tracked.
pub fn is_evident(scene: &Scene, explained: f64, info: &SourceInfo) -> bool {
    explained <= MOST_EXPLAINED && scene.area_px >= LEAST_AREA * (info.width * info.height) as f64
}

/// Whether it is open that such things move: a few large ones are seen, but not as they should be, or before a camera that is not seen to stand.
pub fn is_open(scene: &Scene, info: &SourceInfo) -> bool {
    are_large(scene, info) && scene.regions <= MOST_REGIONS && (scene.camera != Camera::Fixed || !fits(scene, info))
}

/// Whether large things move, if the camera stands.
fn are_large(scene: &Scene, info: &SourceInfo) -> bool {
    let side = scene.size_px[0].max(scene.size_px[1]);
    scene.n_moving as f64 >= SHARE_OF_FRAMES * scene.n_frames as f64
        && side >= LEAST_SIDE * info.width.max(info.height) as f64
}

/// Whether what moves, if the camera stands, is long, lasting and new enough.
fn fits(scene: &Scene, info: &SourceInfo) -> bool {
    are_large(scene, info)
        && scene.size_px[0] <= MOST_SHARE[0] * info.width as f64
        && scene.size_px[1] <= MOST_SHARE[1] * info.height as f64
        && scene.novelty >= LEAST_NOVELTY
        && scene.regions <= MOST_REGIONS
        && scene.share <= 0.35
        && scene.n_frames >= LEAST_FRAMES
}

/// Writes detector and tracker.
pub fn configure(
    scene: &Scene,
    explained: f64,
    tempo: Tempo,
    info: &SourceInfo,
    config: &mut Config,
    reasons: &mut Vec<String>,
) {
    let [w, h] = scene.size_px;
    let shakes = !scene.places.is_empty();
    let camera = match scene.camera {
        Camera::Fixed if shakes => {
            let rms_px = shake::rms_px(&scene.places, Vector2::new(info.width as f64, info.height as f64));
            &format!(
                "A camera that stays in its place but shakes by {rms_px:.1} px rms: its frames are brought to the first one's (detector.camera = \"shaking\")"
            )
        }
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
    if scene.has_dark_things() {
        reasons.push(format!(
            "{:.0} % of what moves is darker than the ground by a factor, as shadows are; but a shadow has a thing that casts it, and there is less besides than could: so the things are dark, and \
             nothing is taken for shadow.",
            100.0 * scene.shadow
        ));
    }
    let least = least_area(scene.area_px);
    // Measured on vtest.avi: dark clothes are darker than 0.6 of the ground, shadows are not.
    let background = BackgroundConfig {
        threshold_sd: 6.0,
        shadow: ShadowConfig {
            enabled: !scene.has_dark_things(),
            darkest: 0.6,
            spread: 0.15,
            ..ShadowConfig::default()
        },
        ..BackgroundConfig::default()
    };
    config.detector = DetectorConfig {
        threshold: ThresholdConfig::Moving(background),
        max_detections: Some(1000),
        ..DetectorConfig::default()
    };
    config.detector.cluster.min_area_px = Some(least);
    config.detector.cluster.distance_px = round((PARTS_APART * w.min(h)).clamp(2.0, 12.0));
    config.detector.camera = if shakes { CameraConfig::Shaking } else { CameraConfig::Fixed };
    tracker(w.max(h), info, &mut config.tracker);
    // What differs from the background where it is (an exposure that changed, a thing that was taken away) never moves.
    config.tracker.report = Report::Moving;
    // People walk side by side for seconds.
    config.tracker.merged_measurements.max_secondary_s = 8.0;
    stretch::of_both(tempo, config);
    reasons.push(format!(
        "Regions of {least} px or more count, parts nearer than {} px are one. What stands long becomes background \
         (detector.threshold.moving.standing-time-s); a track is reported once it has moved farther than its covariance and the wander of its \
         outline explain, all are with --set tracker.report=all.",
        config.detector.cluster.distance_px
    ));
}

/// Regions count from this area on where half of what moves has at least so much, px.
fn least_area(area_px: f64) -> u32 {
    round((SHARE_OF_AREA * area_px).max(f64::from(LEAST_PX))) as u32
}

/// The area from which on regions count, px, with the reason, where smaller ones than `least_px` surely move by themselves: chains of `evidence` in most of whose `scans` something of that area
/// or more is elsewhere, and which hold enough of what would be detected besides. A thing that is now and then as large as those that count is of their kind.
pub(super) fn smaller(evidence: &Evidence, scans: &[Scan], least_px: u32) -> Option<(u32, String)> {
    let area_px = |hit: &(usize, Sighting)| hit.1.side_px * hit.1.thickness_px;
    let counts = |hit: &&(usize, Sighting)| area_px(hit) >= f64::from(least_px);
    let is_small = |c: &Chain| c.hits.iter().filter(counts).count() as f64 <= NOW_AND_THEN * c.hits.len() as f64;
    let is_elsewhere = |c: &Chain| is_beside(c, &evidence.times_s, scans, least_px);
    let beside: Vec<&Chain> =
        evidence.sure().filter(|c| is_small(c) && has_left_its_place(c) && is_elsewhere(c)).collect();
    let mut areas: Vec<f64> = beside.iter().flat_map(|c| &c.hits).map(area_px).collect();
    areas.sort_by(f64::total_cmp);
    let median = *areas.get(areas.len() / 2)?;
    let area_px = least_area(median);
    let looked = scans.iter().filter(|s| !s.blind).take(evidence.times_s.len());
    let is_added = |d: &&Detection| (area_px..least_px).contains(&d.area_px);
    let n_added = looked.flat_map(|s| &s.detections).filter(is_added).count();
    let n_held = areas.iter().filter(|a| **a < f64::from(least_px)).count();
    if (n_held as f64) < LEAST_EXPLAINED * n_added as f64 {
        return None;
    }
    (area_px < least_px).then(|| {
        let one = beside.len() == 1;
        let words = format!(
            "Besides, {} smaller thing{} surely move{}, of {median:.0} px in the median: regions of {area_px} px or more count, not of {least_px}.",
            beside.len(),
            if one { "" } else { "s" },
            if one { "s" } else { "" },
        );
        (area_px, words)
    })
}

/// Whether a chain came farther than the longest side it had: what a background has wrongly learnt shrinks and changes its outline where it is.
fn has_left_its_place(chain: &Chain) -> bool {
    let longest_px = chain.hits.iter().map(|h| h.1.side_px).fold(0.0, f64::max);
    chain.hits.first().is_some_and(|(_, first)| chain.hits.iter().any(|(_, h)| (h.at - first.at).norm() > longest_px))
}

/// Whether something of that area or more is elsewhere, and nothing such near, in most of a chain's scans.
fn is_beside(chain: &Chain, times_s: &[f64], scans: &[Scan], least_px: u32) -> bool {
    let elsewhere = |(k, hit): &&(usize, Sighting)| {
        let time_s = |s: &Scan| s.time.ns as f64 * 1e-9;
        let at = scans.partition_point(|s| time_s(s) < times_s[*k]);
        let mut large =
            scans.get(at).into_iter().flat_map(|s| &s.detections).filter(|d| d.area_px >= least_px).peekable();
        let side_px = |d: &Detection| d.extent.width_px.max(d.extent.height_px);
        let touches = |d: &Detection| (d.position - hit.at).norm() <= side_px(d) + hit.side_px + 2.0;
        large.peek().is_some() && !large.any(touches)
    };
    2 * chain.hits.iter().filter(elsewhere).count() > chain.hits.len()
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
    use crate::{Extent, FrameIndex, PixelKind, Timestamp};
    use nalgebra::{Matrix2, Vector2};
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    /// Things of that size move in all of 40 frames of 640 x 480, so many at a time.
    fn seen(camera: Camera, regions: f64, size_px: [f64; 2]) -> (Scene, SourceInfo) {
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
        let mut scene = Scene::default();
        (scene.camera, scene.n_frames, scene.n_moving, scene.regions) = (camera, 40, 40, regions);
        (scene.size_px, scene.area_px, scene.share, scene.novelty) = (size_px, 2000.0, 0.1, 0.5);
        (scene, info)
    }

    #[test]
    fn what_is_wider_than_half_of_the_frame_is_the_ground() {
        let fits = |size_px: [f64; 2]| {
            let (scene, info) = seen(Camera::Fixed, 4.0, size_px);
            super::fits(&scene, &info)
        };
        assert!(fits([100.0, 250.0]), "people who stand near");
        assert!(!fits([424.0, 88.0]) && !fits([100.0, 400.0]));
    }

    #[test]
    fn large_things_that_do_not_fit_or_before_who_knows_what_camera_leave_the_question_open() {
        let open = |camera: Camera, regions: f64, size_px: [f64; 2]| {
            let (scene, info) = seen(camera, regions, size_px);
            is_open(&scene, &info)
        };
        assert!(!open(Camera::Fixed, 4.0, [100.0, 250.0]), "they are seen as they should be");
        assert!(open(Camera::Fixed, 4.0, [424.0, 88.0]) && open(Camera::Unknown, 4.0, [100.0, 250.0]));
        assert!(!open(Camera::Unknown, 4.0, [8.0, 8.0]), "small ones are told otherwise");
        assert!(!open(Camera::Unknown, 100.0, [100.0, 250.0]), "and many are no such things");
    }

    /// What is said of smaller things where regions of 60 px or more count: a box of 20 x 20 px goes to the right, and one of `size` px, half of both filled, goes from `from` by `step` px a
    /// frame; in every `n_large`-th frame it has 100 px.
    fn said(from: [f64; 2], step: [f64; 2], size: f64, n_large: u64) -> Option<(u32, String)> {
        said_among(0, from, step, size, n_large)
    }

    /// The same among so many flickers a frame.
    fn said_among(n_flickers: usize, from: [f64; 2], step: [f64; 2], size: f64, n_large: u64) -> Option<(u32, String)> {
        let mut rng = ChaCha8Rng::seed_from_u64(6);
        let region = |at: Vector2<f64>, side: f64, area_px: u32| {
            let extent = Extent::around(at, side, side);
            Detection::at(at, Matrix2::identity() * 0.01).with_extent(extent).with_area_px(area_px)
        };
        let scans: Vec<Scan> = {
            let mut scan = |k: u64| {
                let t = k as f64;
                let small = Vector2::new(from[0] + step[0] * t, from[1] + step[1] * t);
                let area_px = if k % n_large == n_large - 1 { 100 } else { (0.5 * size * size) as u32 };
                let mut all = vec![region(Vector2::new(30.0 + 2.0 * t, 40.0), 20.0, 200), region(small, size, area_px)];
                let mut any = |length: f64| length * rng.random::<f64>();
                all.extend((0..n_flickers).map(|_| region(Vector2::new(any(320.0), any(240.0)), 6.0, 18)));
                Scan::at(FrameIndex(k), Timestamp::from_secs_f64(0.04 * t)).with_detections(all)
            };
            (0..60).map(&mut scan).collect()
        };
        smaller(&Evidence::of_scans(&scans, 320.0 * 240.0), &scans, 60)
    }

    #[test]
    fn a_smaller_thing_that_goes_its_own_way_counts_and_parts_ghosts_and_those_of_the_same_kind_do_not() {
        let never = u64::MAX;
        let (area_px, reason) = said([200.0, 180.0], [-1.5, 0.5], 6.0, never).expect("goes its own way");
        // A third of its 18 px is less than can be told from noise.
        assert!(area_px == LEAST_PX && reason.contains("1 smaller thing surely moves, of 18 px"), "{reason}");
        assert_eq!(said([200.0, 180.0], [-1.5, 0.5], 9.0, never).map(|s| s.0), Some(14), "a third of 40 px");
        assert_eq!(said([42.0, 52.0], [2.0, 0.0], 6.0, never), None, "a part goes with its thing");
        assert_eq!(said([200.0, 180.0], [0.02, 0.0], 6.0, never), None, "a ghost stays where it is");
        assert_eq!(said([200.0, 180.0], [-1.5, 0.5], 9.0, 4), None, "now and then it is as large as those that count");
        let among = |n: usize| said_among(n, [200.0, 180.0], [-1.5, 0.5], 6.0, never);
        assert_eq!(among(3).map(|s| s.0), Some(LEAST_PX), "three flickers a frame");
        assert_eq!(among(9), None, "nine: mostly clutter");
    }
}
