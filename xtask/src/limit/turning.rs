//! Spots below the noise that turn: sums along straight paths beside the density that is carried from frame to frame, each with its tracker.
//!
//! Paths are driven by white acceleration; a spot is held in a frame when a track lies within 3 px of it, a track is false that is never within 6 px of any.

use super::scenes::{SIGMA, Spot, detector_of, frame, random};
use super::white::ONE_AN_HOUR;
use anyhow::Result;
use boresight::track::{self, TrackerConfig};
use boresight::vision::bernoulli::BernoulliConfig;
use boresight::vision::threshold::ThresholdConfig;
use boresight::{Config, Scan};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;
use std::collections::BTreeMap;
use std::fmt::Write as _;

const SIDE: usize = 256;
const SPOTS: usize = 8;
/// Frames that the spots are there, and those of noise before.
const THERE: u64 = 128;
const BEFORE: u64 = 64;
/// Frames after which a spot is asked for.
const AFTER: [u64; 4] = [16, 32, 64, 128];
const STRAIGHT: &str = include_str!("../../../configs/below-noise.toml");
const TURNING: &str = include_str!("../../../configs/below-noise-turning.toml");

/// Places of a spot that turns, px, frame by frame; within the picture, no faster than 2 px a frame along an axis.
fn path(density: f64, rng: &mut ChaCha8Rng) -> Vec<[f64; 2]> {
    let dt: f64 = 0.04;
    loop {
        let mut place = [0, 1].map(|_| 8.0 + rng.random::<f64>() * (SIDE as f64 - 16.0));
        let mut v = [0, 1].map(|_| 40.0 * (2.0 * rng.random::<f64>() - 1.0));
        let mut all = Vec::new();
        for _ in 0..THERE {
            all.push(place);
            for a in 0..2 {
                place[a] += v[a] * dt;
                v[a] = (v[a] + (density * dt).sqrt() * rng.sample::<f64, _>(StandardNormal)).clamp(-50.0, 50.0);
            }
        }
        if all.iter().flatten().all(|c| (4.0..SIDE as f64 - 5.0).contains(c)) {
            return all;
        }
    }
}

/// What a detector and its tracker make of spots of an SNR.
#[derive(Default)]
struct Reached {
    /// Shares of the spots.
    after: [f64; AFTER.len()],
    held: f64,
    false_tracks: usize,
    /// Squared error over what the tracks state, of those within 6 px: 2 is right.
    nees: f64,
    ms: f64,
}

fn reached(threshold: &ThresholdConfig, tracker: &TrackerConfig, density: f64, snr: f64, runs: u64) -> Result<Reached> {
    let (mut r, mut n_nees, mut n_frames) = (Reached::default(), 0usize, 0usize);
    for run in 0..runs {
        let mut rng = random(4000 + run);
        let (mut detector, mut tracker) = (detector_of([SIDE; 2], threshold.clone())?, track::build(tracker)?);
        let paths: Vec<_> = (0..SPOTS).map(|_| path(density, &mut rng)).collect();
        let mut scan = Scan::default();
        let mut nearest_of: BTreeMap<u64, f64> = BTreeMap::new();
        for k in 0..BEFORE + THERE {
            let now = |p: &Vec<[f64; 2]>| p[(k - BEFORE) as usize];
            let places: Vec<[f64; 2]> = if k < BEFORE { Vec::new() } else { paths.iter().map(now).collect() };
            let spot = |p: &[f64; 2]| Spot { place: *p, velocity: [0.0; 2], at: k as f64 };
            let picture = frame([SIDE; 2], &places.iter().map(spot).collect::<Vec<_>>(), snr, k, &mut rng);
            let began = std::time::Instant::now();
            detector.detect(&picture, &mut scan)?;
            r.ms += began.elapsed().as_secs_f64() * 1e3;
            n_frames += 1;
            let mut found = [false; SPOTS];
            for state in tracker.step(&scan)? {
                let (mean, cov) = (&state.kinematics.mean, &state.kinematics.cov);
                let off = |p: &[f64; 2]| (mean[0] - p[0]).hypot(mean[2] - p[1]);
                let nearest = nearest_of.entry(state.id.0).or_insert(f64::INFINITY);
                for (p, found) in places.iter().zip(&mut found) {
                    *nearest = nearest.min(off(p));
                    *found |= off(p) <= 3.0;
                    if off(p) <= 6.0 {
                        let c = nalgebra::Matrix2::new(cov[(0, 0)], cov[(0, 2)], cov[(2, 0)], cov[(2, 2)]);
                        let e = nalgebra::Vector2::new(mean[0] - p[0], mean[2] - p[1]);
                        r.nees += c.try_inverse().map_or(0.0, |c| (e.transpose() * c * e)[0]);
                        n_nees += 1;
                    }
                }
            }
            if k < BEFORE {
                continue;
            }
            let n = found.iter().filter(|f| **f).count() as f64;
            r.held += n;
            for (share, after) in r.after.iter_mut().zip(AFTER) {
                *share += if k + 1 == BEFORE + after { n } else { 0.0 };
            }
        }
        r.false_tracks += nearest_of.values().filter(|d| **d > 6.0).count();
    }
    let all = (runs as usize * SPOTS) as f64;
    r.after = r.after.map(|n| n / all);
    r.held /= all * THERE as f64;
    r.nees /= n_nees.max(1) as f64;
    r.ms /= n_frames.max(1) as f64;
    Ok(r)
}

pub fn table(runs: u64, page: &mut String) -> Result<()> {
    writeln!(
        page,
        "| acceleration px²/s³ | SNR | detector | held 16, 32, 64, 128 frames after it came | held | false tracks in {} s | eᵀ C⁻¹ e | ms a frame |",
        runs * (BEFORE + THERE) / 25
    )?;
    writeln!(page, "| --- | --- | --- | --- | --- | --- | --- | --- |")?;
    let tracker = |text: &str| Ok::<_, anyhow::Error>(Config::from_toml(text, "configs")?.tracker);
    let (straight, turning) = (tracker(STRAIGHT)?, tracker(TURNING)?);
    let sums = |frames| ThresholdConfig::Integrate(super::white::config(frames, ONE_AN_HOUR));
    let carried = ThresholdConfig::Bernoulli(BernoulliConfig {
        false_alarms_per_frame: ONE_AN_HOUR,
        sigma_px: SIGMA,
        ..BernoulliConfig::default()
    });
    for density in [1.0, 30.0, 300.0] {
        for snr in [0.35, 0.5, 0.7, 1.0] {
            let all = [
                ("sums of 16", sums(16), &turning),
                ("sums of 64", sums(64), &straight),
                ("carried", carried.clone(), &turning),
            ];
            for (name, threshold, tracker) in all {
                let r = reached(&threshold, tracker, density, snr, runs)?;
                let after = r.after.map(|f| format!("{:.0}", 100.0 * f)).join(", ");
                writeln!(
                    page,
                    "| {density} | {snr} | {name} | {after} % | {:.1} % | {} | {:.1} | {:.1} |",
                    100.0 * r.held,
                    r.false_tracks,
                    r.nees,
                    r.ms
                )?;
            }
        }
    }
    Ok(())
}
