//! Things that move before a moving camera: candidates with several lags, weighed by the evidence of their chains beside that of isolated targets.
//!
//! Source: our own. A lag must be as long as a target takes to move by about its own size; how long that is nobody knows beforehand, so several are tried.
//! Limits: a camera whose motion is not seen has no such candidate.

use super::digits::round;
use super::evidence::{Evidence, SURE_GAIN};
use super::ground::Ground;
use super::scene::{Camera, Scene};
use super::sightings::Sightings;
use super::spread::growing;
use super::{faint, moving, spots};
use crate::camera::CameraConfig;
use crate::track::{ConfirmationConfig, InitiationConfig, MOfNConfig, Report, TwoPointConfig};
use crate::vision::config::DetectorConfig;
use crate::vision::steadied::SteadiedConfig;
use crate::vision::threshold::ThresholdConfig;
use crate::{Config, Frame, Result, Scan, SourceInfo};

/// Lags tried, s: a factor of two apart.
const LAGS_S: [f64; 3] = [0.16, 0.32, 0.64];
/// Fewer frames than this show no steady ground.
const LEAST_FRAMES: usize = 12;
/// Least area of a target as a share of the frame's: 4 px of 512 x 270.
const LEAST_AREA: f64 = 3e-5;
/// And in pixels: fewer make no region.
const LEAST_PX: f64 = 4.0;
/// Share of the regions that chains must explain: the tracker counts hits, and would make tracks of what is mostly clutter.
const LEAST_EXPLAINED: f64 = 0.2;

/// What was seen with one lag.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Seen {
    /// Time to the frames compared with, s.
    pub lag_s: f64,
    /// Regions a frame.
    pub per_frame: f64,
    /// Median of the longer side of their boxes, px.
    pub side_px: f64,
    /// Chains of these in the frames at growing gaps.
    pub chains: Evidence,
    /// Chains of the regions of all frames.
    pub longer: Evidence,
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
    // The rims of one target lie apart.
    config.cluster.distance_px = round((area.max(LEAST_PX).sqrt() * 1.5).max(3.0));
    config
}

/// What moves by itself where the camera moves: the longest lag whose chains in all frames surely gain more than the shorter ones'; none where the camera does not, or too few frames are known.
/// # Errors
/// Frames of more than one size or pixel type.
pub fn look(frames: &[Frame], scene: &Scene, info: &SourceInfo) -> Result<Option<Seen>> {
    if scene.camera != Camera::Moving || frames.len() < LEAST_FRAMES {
        return Ok(None);
    }
    let mut best: Option<Seen> = None;
    for lag_s in LAGS_S {
        let seen = look_at(lag_s, frames, &scene.ground, info)?;
        // The longer the lag, the more of what stands seems to move: it must surely gain.
        if best.as_ref().is_none_or(|b| seen.longer.is_surely_more_than(&b.longer)) {
            best = Some(seen);
        }
    }
    Ok(best)
}

/// As [`look`], if those chains surely gain more than the ones of isolated targets and, where nothing stands clear, of faint ones.
/// # Errors
/// Frames of more than one size or pixel type.
pub fn look_beside(
    isolated: &spots::Seen,
    frames: &[Frame],
    scene: &Scene,
    info: &SourceInfo,
    n_threads: usize,
) -> Result<Option<Seen>> {
    let Some(seen) = look(frames, scene, info)? else { return Ok(None) };
    let (polarity, of_isolated) = isolated.most();
    if !seen.chains.is_sure() || of_isolated.is_surely_more_than(&seen.chains) {
        return Ok(None);
    }
    if seen.explained < LEAST_EXPLAINED {
        return Ok(None);
    }
    // Slow things hardly move between the first frames looked at: all of them tell more.
    let all: Vec<usize> = (0..frames.len()).collect();
    let in_all = spots::look_at(frames, &all, &scene.ground, polarity, info, n_threads)?.chains;
    // What isolated targets show as well is placed better by them.
    if seen.longer.gain_beside(&in_all) <= SURE_GAIN {
        return Ok(None);
    }
    if !seen.chains.is_surely_more_than(of_isolated) && !seen.longer.is_surely_more_than(&in_all) {
        return Ok(None);
    }
    if isolated.is_poor() {
        let faint = faint::better(faint::count(frames, &scene.ground, info, n_threads)?.0);
        if !seen.chains.is_surely_more_than(&faint.chains) {
            return Ok(None);
        }
    }
    Ok(Some(seen))
}

/// What is seen with a lag.
fn look_at(lag_s: f64, frames: &[Frame], ground: &[Ground], info: &SourceInfo) -> Result<Seen> {
    let mut detector = crate::vision::build(&detector(lag_s, info), info)?;
    let start = frames[0].time;
    let first = frames.iter().take_while(|f| f.time.seconds_since(start) <= detector.prime_s()).count();
    detector.prime(&frames[..first])?;
    let (mut scan, mut n, mut sides) = (Scan::default(), 0usize, Vec::new());
    let mut sightings = Vec::with_capacity(frames.len());
    for (k, frame) in frames.iter().enumerate() {
        detector.detect(frame, &mut scan)?;
        n += scan.detections.len();
        sides.extend(scan.detections.iter().map(|d| d.extent.width_px.max(d.extent.height_px)));
        sightings.push(Sightings::of(&scan, ground.get(k)));
    }
    sides.sort_by(f64::total_cmp);
    let area_px2 = (info.width * info.height) as f64;
    let some: Vec<Sightings> = growing(frames.len()).into_iter().map(|k| sightings[k].clone()).collect();
    let longer = Evidence::of(&sightings, area_px2);
    let hits: usize = longer.moving.iter().map(|c| c.hits.len()).sum();
    Ok(Seen {
        lag_s,
        per_frame: n as f64 / frames.len().max(1) as f64,
        side_px: sides.get(sides.len() / 2).copied().unwrap_or(0.0),
        chains: Evidence::of(&some, area_px2),
        explained: hits as f64 / n.max(1) as f64,
        longer,
    })
}

/// Writes detector and tracker.
pub fn configure(seen: &Seen, info: &SourceInfo, config: &mut Config, reasons: &mut Vec<String>) {
    config.detector = detector(seen.lag_s, info);
    config.detector.camera = CameraConfig::Moving;
    let tracker = &mut config.tracker;
    moving::tracker(seen.side_px.max(LEAST_PX), info, tracker);
    // What differs in one place for a while, as leaves and poles do, is none that goes somewhere.
    tracker.report = Report::Moving;
    // Rims come and go: velocities are known from two of them, not from the size.
    tracker.initiation = InitiationConfig::TwoPoint(TwoPointConfig::default());
    tracker.confirmation = ConfirmationConfig::MOfN(MOfNConfig { hits: 3, scans: 5, ..MOfNConfig::default() });
    reasons.push(format!(
        "The camera moves, and against frames {} s and {} s ago, steadied, {:.1} regions a frame move by themselves, median side {:.0} px, {}: so those are \
         detected (detector.threshold.steadied). What stands on the ground is not.",
        seen.lag_s,
        2.0 * seen.lag_s,
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
    info: &SourceInfo,
    config: &mut Config,
    reasons: &mut Vec<String>,
) -> Result<()> {
    let mut scene = scene.clone();
    scene.camera = Camera::Moving;
    let seen = look(frames, &scene, info)?;
    let assumed = || Seen { lag_s: SteadiedConfig::default().lag_s, ..Seen::default() };
    configure(&seen.unwrap_or_else(assumed), info, config, reasons);
    Ok(())
}
