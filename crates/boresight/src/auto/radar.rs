//! The tracker for a radar's plots: speeds, noise, motion and confirmation from the stated covariances, the turn of the antenna, and what tracks show.
//!
//! Source: our own. A first pass takes the covariances as they are and lets a target move as fast as two plots of it can seem to; what its confirmed tracks show then
//! gives noise and motion ([`super::noise`]), the largest speed and the spread of speeds at the start. Land, buoys and ships at anchor come again at their places and are
//! reported: a radar sees what is there. Confirmation counts turns: false plots are not spread evenly (they lie where the sea or the land is), so a probability that
//! took them for that would be too sure of them.
//! Symbols: σ m, the larger standard deviation of a plot, T s, the time of a turn. Limits: constant velocity; what is learnt is the first [`first_scans`](super::first_scans)'.

use super::digits::round;
use super::first_scans::first;
use super::{noise, speed};
use crate::io::LengthUnit;
use crate::track::{
    ConfirmationConfig, InitiationConfig, MOfNConfig, MergedMeasurementsConfig, OnePointConfig, Report,
};
use crate::{Config, Detection, Scan, TrackStatus};
use std::collections::BTreeMap;

/// Turns over which a steady target strays by a plot's deviation, as assumed before anything is learnt.
const STRAY_TURNS: f64 = 20.0;
/// Turns for which a confirmed track goes on unseen: plots of small ships come in bursts.
const COAST_TURNS: f64 = 16.0;
/// Turns of a track whose speed is believed.
const LEAST_TURNS: usize = 15;
/// The largest speed over the fastest track's: another one is faster.
const SPEED_RESERVE: f64 = 1.5;
/// Tracks whose speeds tell.
const LEAST_TRACKS: usize = 3;

/// Writes the tracker's configuration for a radar's plots; `turn_s` is the time of a turn of the antenna, `unit` what positions are in.
pub fn for_radar(scans: &[Scan], turn_s: f64, unit: LengthUnit, config: &mut Config, reasons: &mut Vec<String>) {
    let turn_s = if turn_s.is_finite() && turn_s > 0.0 { turn_s } else { 1.0 };
    let sigma = spread(scans);
    let t = &mut config.tracker;
    t.report = Report::All;
    t.extra_noise_px = 0.0;
    t.extra_noise_per_height = 0.0;
    t.acceleration_density_px2_per_s3 = round(3.0 * sigma.powi(2) / (STRAY_TURNS * turn_s).powi(3));
    // Two plots of a target at rest seem to lie √2 σ apart in the mean square: twice that is hardly exceeded.
    t.max_speed_px_per_s = round(2.0 * std::f64::consts::SQRT_2 * sigma / turn_s);
    t.initiation = starting_with(t.max_speed_px_per_s / 4.0);
    t.confirmation = ConfirmationConfig::MOfN(MOfNConfig { hits: 4, scans: 8, tentative_s: round(8.0 * turn_s) });
    t.coast_s = round(COAST_TURNS * turn_s);
    t.coast_scans = COAST_TURNS as u32;
    t.merged_measurements = MergedMeasurementsConfig::off();
    let mut told = vec![format!(
        "Plots of a radar, a turn in {turn_s:.3} s, to {sigma:.0} px at the median: a target may move by {} px/s, a track is unseen for at most {} s.",
        t.max_speed_px_per_s, t.coast_s
    )];
    let area = area_m2(scans);
    // A radar that measures well sees fast targets move far between its turns.
    speed::learn(scans, area, config, &mut told);
    let n_assumed = told.len();
    let _ = noise::learn(scans, area, config, &mut told);
    if let Some(speeds) = speeds(scans, config) {
        let t = &mut config.tracker;
        t.max_speed_px_per_s = round((SPEED_RESERVE * speeds.fastest).max(1.0));
        t.initiation = starting_with(speeds.rms.max(0.1 * t.max_speed_px_per_s));
        told.push(format!(
            "The fastest of {} tracks moves at {:.1} px/s, their speeds are {:.1} px/s in the mean square: a target may move by {} px/s.",
            speeds.n_tracks, speeds.fastest, speeds.rms, t.max_speed_px_per_s
        ));
        let mut again = Vec::new();
        let _ = noise::learn(scans, area, config, &mut again);
        if !again.is_empty() {
            told.remove(n_assumed);
            told.extend(again);
        }
    }
    reasons.extend(told.iter().map(|text| in_unit(text, unit)));
}

/// A sentence that speaks of pixels, in the unit of the positions.
fn in_unit(text: &str, unit: LengthUnit) -> String {
    // Plots have no boxes.
    let text =
        text.replace(" and 0.0000 of a box height beyond them", " beyond them").replace(" and 0.0000 heights²/s³", "");
    text.replace("px", unit.sign())
}

fn starting_with(velocity_std: f64) -> InitiationConfig {
    InitiationConfig::OnePoint(OnePointConfig { velocity_std_px_per_s: round(velocity_std) })
}

/// The median of the plots' larger standard deviations, m.
fn spread(scans: &[Scan]) -> f64 {
    let of = |d: &Detection| d.cov.symmetric_eigenvalues().max().max(0.0).sqrt();
    let mut all: Vec<f64> = first(scans).iter().flat_map(|s| &s.detections).map(of).filter(|v| v.is_finite()).collect();
    all.sort_by(f64::total_cmp);
    all.get(all.len() / 2).copied().filter(|v| *v > 0.0).unwrap_or(1.0)
}

/// The area over which the plots lie, m².
fn area_m2(scans: &[Scan]) -> f64 {
    let side = |axis: usize| {
        let at = scans.iter().flat_map(|s| &s.detections).map(|d| d.position[axis]).filter(|v| v.is_finite());
        let (least, most) = at.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, m), v| (l.min(v), m.max(v)));
        (most - least).max(1.0)
    };
    side(0) * side(1)
}

struct Speeds {
    fastest: f64,
    rms: f64,
    n_tracks: usize,
}

/// How fast confirmed tracks are that have been followed for long; `None` where there are too few of them.
fn speeds(scans: &[Scan], config: &Config) -> Option<Speeds> {
    let mut tracker = crate::track::build(&config.tracker).ok()?;
    let mut tracks: BTreeMap<u64, (usize, f64)> = BTreeMap::new();
    for scan in first(scans) {
        for s in tracker.step(scan).ok()? {
            if s.status != TrackStatus::Confirmed || s.detection.is_none() {
                continue;
            }
            let m = &s.kinematics.mean;
            let of = tracks.entry(s.id.0).or_default();
            of.0 += 1;
            // The last one counts: it has seen the most.
            of.1 = m[1].hypot(m[3]);
        }
    }
    let mut all: Vec<f64> =
        tracks.into_values().filter(|t| t.0 >= LEAST_TURNS && t.1.is_finite()).map(|t| t.1).collect();
    all.sort_by(f64::total_cmp);
    if all.len() < LEAST_TRACKS {
        return None;
    }
    let rms = (all.iter().map(|v| v * v).sum::<f64>() / all.len() as f64).sqrt();
    Some(Speeds { fastest: *all.last()?, rms, n_tracks: all.len() })
}
