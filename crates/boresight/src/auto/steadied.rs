//! Things that move before a moving camera, or over the texture that a fixed one sees: a candidate beside isolated targets, weighed by the evidence of its chains.
//!
//! Source: our own. It costs more than a look at isolated targets, so it is tried with one lag and on every second frame or so. Where the camera moves, that isolated targets explain what
//! stands clear does not speak against it: of four that cross a town one may stand clear. It must gain more beside them than they do in all, since leaves and near things move as well:
//! asking only for more than what they gain beside it costs five infrared clips of the exam a sixth to seven tenths of their precision.
//! Limits: a camera whose motion is not seen has no such candidate; what moves by less than a third of its size in the lag is not seen.

use super::chains::Chain;
use super::digits::round;
use super::evidence::{Evidence, LEAST_EXPLAINED, SURE_GAIN};
use super::scene::{Camera, Scene};
use super::sightings::Sightings;
use super::spread::growing;
use super::stretch;
use super::{faint, moving, spots};
use crate::camera::CameraConfig;
use crate::tempo::Tempo;
use crate::track::{ConfirmationConfig, InitiationConfig, MOfNConfig, Report, TwoPointConfig};
use crate::vision::config::DetectorConfig;
use crate::vision::steadied::SteadiedConfig;
use crate::vision::threshold::{Polarity, ThresholdConfig};
use crate::{Config, Frame, Result, Scan, SourceInfo};

/// Fewer frames than this show no steady ground.
const LEAST_FRAMES: usize = 12;
/// Frames that are looked at, at least, where there are so many: a fourth of the lag apart at most.
const LOOKS: usize = 24;
/// Least area of a target as a share of the frame's: 4 px of 512 x 270.
const LEAST_AREA: f64 = 3e-5;
/// And in pixels: fewer make no region.
const LEAST_PX: f64 = 4.0;
/// Rims of one target lie as far apart as this share of the frame's longer side: 7 px of 512. A car of 10 px keeps its id with 7 and is two with 3.
const RIMS: f64 = 0.0137;
/// Share of the sure isolated blobs that chains explain, from which on isolated targets tell what a fixed camera shows.
const TOLD: f64 = 0.5;

/// What was seen.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Seen {
    /// Whether the camera moves.
    pub camera: Camera,
    /// Time to the first of the frames compared with, s.
    pub lag_s: f64,
    /// Regions a frame.
    pub per_frame: f64,
    /// Median of the longer side of their boxes, px.
    pub side_px: f64,
    /// Frames between two that were looked at.
    pub step: usize,
    /// Chains of the regions.
    pub chains: Evidence,
    /// Share of the regions that belong to these.
    pub explained: f64,
}

fn detector(lag_s: f64, info: &SourceInfo) -> DetectorConfig {
    let steadied = SteadiedConfig { lag_s, ..SteadiedConfig::default() };
    let mut config = DetectorConfig {
        threshold: ThresholdConfig::Steadied(steadied),
        max_detections: Some(1000),
        ..DetectorConfig::default()
    };
    let area = LEAST_AREA * (info.width * info.height) as f64;
    config.cluster.min_area_px = Some(area.max(LEAST_PX).round() as u32);
    config.cluster.distance_px = round((RIMS * info.width.max(info.height) as f64).max(3.0));
    config
}

/// Whether the chains of isolated targets hold most of the blobs that stand clear in so many looks; where none does they hold most of nothing.
fn tells(isolated: &spots::Seen, n_looks: usize) -> bool {
    let (polarity, chains) = isolated.most();
    let clear = if polarity == Polarity::Dark { &isolated.dark } else { &isolated.bright };
    !isolated.is_poor() && chains.is_sure() && chains.n_hits() as f64 >= TOLD * clear.per_frame * n_looks as f64
}

/// What moves by itself where the camera moves, or where it stands and isolated targets do not tell what is seen, if its own chains surely gain more beside those of
/// isolated targets than these do and, where nothing stands clear, than those of faint ones.
/// # Errors
/// Frames of more than one size or pixel type.
pub fn look_beside(
    isolated: &spots::Seen,
    frames: &[Frame],
    scene: &Scene,
    tempo: Tempo,
    info: &SourceInfo,
    n_threads: usize,
) -> Result<Option<Seen>> {
    let places = growing(frames.len());
    // Before a fixed camera what moves is mostly found otherwise: where isolated targets tell what stands clear, they are taken.
    let asked = match scene.camera {
        Camera::Moving => true,
        Camera::Fixed => !tells(isolated, places.len()),
        Camera::Unknown => false,
    };
    if !asked || frames.len() < LEAST_FRAMES {
        return Ok(None);
    }
    let seen = look(frames, scene, tempo, info)?;
    if !seen.chains.is_sure() || seen.explained < LEAST_EXPLAINED {
        return Ok(None);
    }
    let (_, of_isolated) = isolated.most();
    // Those were looked for in fewer frames, and what they show as well is placed better by them.
    let more_looks = frames.len().div_ceil(seen.step) as f64 / places.len() as f64;
    let beside = gain_beside(&seen, of_isolated, &places);
    if beside <= SURE_GAIN + more_looks * of_isolated.gain().max(0.0) {
        return Ok(None);
    }
    if isolated.is_poor() {
        let faint = faint::better(faint::count(frames, &scene.ground, info, n_threads)?.0);
        if beside <= SURE_GAIN + more_looks * faint.chains.gain().max(0.0) {
            return Ok(None);
        }
    }
    Ok(Some(seen))
}

/// Whether a chain and another go the same way; the others were looked for in the frames at `places`.
fn goes_with(own: &Chain, other: &Chain, step: usize, places: &[usize]) -> bool {
    let (mut both, mut near) = (0usize, 0usize);
    for (k, b) in &other.hits {
        // The nearest of the frames that both were looked for in; in half a step nothing goes far.
        let at = places.get(*k).map(|place| (place + step / 2) / step);
        if let Some((_, a)) = own.hits.iter().find(|h| Some(h.0) == at) {
            both += 1;
            near += usize::from((a.at - b.at).norm() <= a.side_px + b.side_px + 2.0);
        }
    }
    2 * near > both
}

/// Gain of the chains that go with none of the others, nats, beyond that of the surrogates; the others were looked for in the frames at `places`.
fn gain_beside(seen: &Seen, others: &Evidence, places: &[usize]) -> f64 {
    let own = seen.chains.moving.iter().filter(|c| !others.moving.iter().any(|o| goes_with(c, o, seen.step, places)));
    own.map(|c| c.gain).sum::<f64>() - seen.chains.by_chance[1]
}

/// The lag that is begun with, s.
fn lag_s(tempo: Tempo) -> f64 {
    round(tempo.stretched(SteadiedConfig::default().lag_s))
}

/// What is seen with the usual lag.
fn look(frames: &[Frame], scene: &Scene, tempo: Tempo, info: &SourceInfo) -> Result<Seen> {
    let lag_s = lag_s(tempo);
    let span_s = frames.last().map_or(0.0, |f| f.time.seconds_since(frames[0].time));
    let apart_s = span_s / frames.len().saturating_sub(1).max(1) as f64;
    let step = ((0.25 * lag_s / apart_s) as usize).min(frames.len() / LOOKS).max(1);
    let looked: Vec<Frame> = frames.iter().step_by(step).cloned().collect();
    let mut detector = crate::vision::build(&detector(lag_s, info), info)?;
    let first = looked.iter().take_while(|f| f.time.seconds_since(looked[0].time) <= detector.prime_s()).count();
    detector.prime(&looked[..first])?;
    let (mut scan, mut n, mut sides) = (Scan::default(), 0usize, Vec::new());
    let mut sightings = Vec::with_capacity(looked.len());
    for (k, frame) in looked.iter().enumerate() {
        detector.detect(frame, &mut scan)?;
        n += scan.detections.len();
        sides.extend(scan.detections.iter().map(|d| d.extent.width_px.max(d.extent.height_px)));
        sightings.push(Sightings::of(&scan, scene.ground.get(k * step)));
    }
    sides.sort_by(f64::total_cmp);
    let chains = Evidence::of(&sightings, (info.width * info.height) as f64);
    Ok(Seen {
        camera: scene.camera,
        lag_s,
        per_frame: n as f64 / looked.len().max(1) as f64,
        side_px: sides.get(sides.len() / 2).copied().unwrap_or(0.0),
        step,
        explained: chains.n_hits() as f64 / n.max(1) as f64,
        chains,
    })
}

/// Writes detector and tracker.
pub fn configure(seen: &Seen, tempo: Tempo, info: &SourceInfo, config: &mut Config, reasons: &mut Vec<String>) {
    config.detector = detector(seen.lag_s, info);
    config.detector.camera = CameraConfig::Moving;
    let tracker = &mut config.tracker;
    moving::tracker(seen.side_px.max(LEAST_PX), info, tracker);
    // What differs in one place for a while, as leaves and poles do, is none that goes somewhere.
    tracker.report = Report::Moving;
    // Rims come and go: velocities are known from two of them, not from the size.
    tracker.initiation = InitiationConfig::TwoPoint(TwoPointConfig::default());
    tracker.confirmation = ConfirmationConfig::MOfN(MOfNConfig { hits: 3, scans: 5, ..MOfNConfig::default() });
    stretch::of_tracker(tempo, tracker);
    reasons.push(format!(
        "{} frames {} s and {} s ago, steadied, {:.1} regions a frame move by themselves, median side {:.0} px, {}: so those are \
         detected (detector.threshold.steadied). What stands on the ground is not.",
        if seen.camera == Camera::Moving { "The camera moves, and against" } else { "Against" },
        seen.lag_s,
        round(3.0 * seen.lag_s),
        seen.per_frame,
        seen.side_px,
        seen.chains.words()
    ));
}

/// Writes detector and tracker where it was asked for.
/// # Errors
/// Frames of more than one size or pixel type.
pub fn configure_asked(
    frames: &[Frame],
    scene: &Scene,
    tempo: Tempo,
    info: &SourceInfo,
    config: &mut Config,
    reasons: &mut Vec<String>,
) -> Result<()> {
    let seen = if frames.is_empty() { Seen::default() } else { look(frames, scene, tempo, info)? };
    configure(&Seen { camera: scene.camera, lag_s: lag_s(tempo), ..seen }, tempo, info, config, reasons);
    Ok(())
}
