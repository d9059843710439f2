//! The tracker for detections made elsewhere: what a score means, noise, motion and speeds, measured on the table itself.
//!
//! Boxes are followed from scan to scan by their overlap (`links`), which needs no tracker; from that come the probability that a
//! detection of a given score is a target's (`scores`), the noise of a centre, the targets' acceleration and speeds. A table of
//! points, or of boxes that are hardly ever linked, keeps assumptions from the boxes' size alone, and says so.

mod links;
mod scores;

use super::detection_statistics::{self, RATE_WITHOUT_EFFECT};
use super::digits::round;
use super::noise::{self, Motions};
use super::stretch;
use crate::io::LengthUnit;
use crate::tempo::Tempo;
use crate::track::{
    AssociationCostConfig, ConfirmationConfig, InitiationConfig, MOfNConfig, MergedMeasurementsConfig, OnePointConfig,
    OverlapConfig, OverlapKind, ReidentificationConfig, TrackerConfig, TwoStageConfig,
};
use crate::{Config, Scan};
use links::{Links, Motion};
use scores::Calibration;

/// A detection that is a target's with at least this probability may initiate a track: below it it is more likely false.
const INITIATES: f64 = 0.5;
/// With at least this one it may continue a track: the track's own prediction speaks for it as well.
const CONTINUES: f64 = 0.1;
/// Acceleration density of things without height, px²/s³ of video, of which the tracker wants more than 0: nothing beside any target's.
const NO_ACCELERATION_PX2_PER_S3: f64 = 1e-4;
/// The largest speed over the one that one step in a thousand exceeds: there are faster targets than those that were seen.
const SPEED_RESERVE: f64 = 1.5;

/// Writes the tracker's configuration for a table of detections.
pub fn for_detections(
    scans: &[Scan],
    rate_hz: f64,
    unit: LengthUnit,
    false_tracks_per_hour: Option<f64>,
    config: &mut Config,
    reasons: &mut Vec<String>,
) {
    config.tracker.reidentification = ReidentificationConfig::default();
    stretch::of_tracker(Tempo::of(1.0 / rate_hz), &mut config.tracker);
    let of_boxes = assumed(scans, rate_hz, unit, config, reasons);
    // What the scans hold that a tracker refuses is said by the run itself.
    let area_px2 = area_px2(scans);
    let motions = if of_boxes { Motions::Driven } else { Motions::DrivenOrForgetful };
    let _ = noise::learn(scans, area_px2, unit, motions, config, reasons);
    if of_boxes {
        if false_tracks_per_hour.is_some() {
            reasons.push(RATE_WITHOUT_EFFECT.to_string());
        }
    } else {
        let _ = detection_statistics::learn(scans, area_px2, false_tracks_per_hour, config, reasons);
    }
}

/// The area over which the detections are spread, px² (m² of a radar's).
pub(super) fn area_px2(scans: &[Scan]) -> f64 {
    let side = |axis: usize| {
        let at = scans.iter().flat_map(|s| &s.detections).map(|d| d.position[axis]).filter(|v| v.is_finite());
        let (least, most) = at.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, m), v| (l.min(v), m.max(v)));
        (most - least).max(1.0)
    };
    side(0) * side(1)
}

/// What is assumed before a tracker has run; whether it is what boxes of an object detector showed.
fn assumed(scans: &[Scan], rate_hz: f64, unit: LengthUnit, config: &mut Config, reasons: &mut Vec<String>) -> bool {
    let px = unit.sign();
    let rate = if rate_hz.is_finite() && rate_hz > 0.0 { rate_hz } else { crate::ASSUMED_RATE_HZ };
    let mut sides: Vec<f64> = scans
        .iter()
        .flat_map(|s| &s.detections)
        .map(|d| d.extent.width_px.min(d.extent.height_px))
        .filter(|s| s.is_finite() && *s > 0.0)
        .collect();
    sides.sort_by(f64::total_cmp);
    let tracker = &mut config.tracker;
    // One size for all is the reader's own, for points.
    // What the links measure is noise and motion of constant velocity; other models keep what sizes allow.
    let boxes = sides.first() < sides.last() && tracker.filter.is_constant_velocity();
    let links = boxes.then(|| Links::of(scans, 1.0 / rate));
    let calibration = links.as_ref().and_then(|l| Calibration::of(l.supported()));
    let high_score = calibration.as_ref().map_or(f32::NEG_INFINITY, |c| c.score_at(INITIATES));
    if let Some(motion) = links.and_then(|l| l.motion(high_score)) {
        for_boxes(tracker, &motion, Tempo::of(1.0 / rate));
        reasons.push(format!(
            "{} steps of boxes that overlap: centres to {:.3} of a box height beyond what is stated, acceleration of density {:.3} heights²/s³, speeds to {:.0} {px}/s, {:.0} % go on.",
            motion.n_steps,
            motion.extra_noise,
            motion.density_per_s3,
            motion.fastest_px_per_s,
            100.0 * motion.p_detection
        ));
        if let Some(c) = calibration {
            let low_score = c.score_at(CONTINUES).min(high_score);
            tracker.two_stage = Some(TwoStageConfig { high_score, low_score });
            reasons.push(format!(
                "Scores by what the scans around say: from {high_score:.3} more likely a target's than not (initiates), from {low_score:.3} with {:.0} % (continues).",
                100.0 * CONTINUES
            ));
        }
        return true;
    }
    let side = sides.get(sides.len() / 2).copied().unwrap_or(0.0);
    // Boxes of larger things jump more: a tenth of the side is what detectors leave in the centre.
    tracker.extra_noise_px = round((0.1 * side).max(0.3));
    tracker.acceleration_density_px2_per_s3 = round((0.005 * side).max(0.03).powi(2) * rate.powi(3));
    tracker.max_speed_px_per_s = round((0.3 * side).max(5.0) * rate);
    reasons.push(format!(
        "Median shorter side {side:.1} {px}: noise {} {px}, acceleration of density {} {px}²/s³, at most {} {px}/s.",
        tracker.extra_noise_px, tracker.acceleration_density_px2_per_s3, tracker.max_speed_px_per_s
    ));
    false
}

/// Boxes of an object detector: every number in heights and seconds, as measured; boxes must overlap to be one target's.
fn for_boxes(tracker: &mut TrackerConfig, motion: &Motion, tempo: Tempo) {
    tracker.extra_noise_per_height = round(motion.extra_noise);
    tracker.acceleration_density_per_height2_per_s3 = round(motion.density_per_s3);
    // All of both was measured in heights.
    tracker.extra_noise_px = 0.0;
    tracker.acceleration_density_px2_per_s3 = tempo.density(NO_ACCELERATION_PX2_PER_S3);
    let hardly_moves = tempo.speed(1.0);
    tracker.max_speed_px_per_s = round(SPEED_RESERVE * motion.fastest_px_per_s).max(hardly_moves);
    tracker.detection_probability = round(motion.p_detection.clamp(0.1, 0.99));
    tracker.initiation = InitiationConfig::OnePoint(OnePointConfig {
        velocity_std_px_per_s: round(motion.speed_std_px_per_s).max(hardly_moves),
    });
    tracker.confirmation = ConfirmationConfig::MOfN(MOfNConfig { hits: 2, scans: 3, ..MOfNConfig::default() });
    // As in `configs/detections-mot.toml`: sizes and overlap decide where places do not.
    tracker.association_cost = AssociationCostConfig {
        size_log_std: Some(0.3),
        overlap: Some(OverlapConfig { kind: OverlapKind::Iou, weight: 40.0, min_overlap: 0.3, buffer: 0.2 }),
        ..AssociationCostConfig::default()
    };
    tracker.appearance_gain = 0.5;
    tracker.merged_measurements = MergedMeasurementsConfig::off();
    tracker.coast_s = tempo.stretched(1.0);
    tracker.coast_scans = 1;
}
