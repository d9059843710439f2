//! A target that differs from its ground by a fifth of a deviation: N(60, 50²) on 9 x 9 px in N(50, 50²), 64 x 64 px, 8 bit, 50 scans.
//!
//! Within 3 px of the truth in what share of scans 11 to 50: the likelihood-ratio grid that is given both distributions, and the detector that is
//! given nothing but a width, with its tracker.

use super::scenes::random;
use anyhow::Result;
use boresight::vision::bernoulli::{BernoulliConfig, TargetShape};
use boresight::vision::integrate::{IntegrateConfig, StillBackground};
use boresight::vision::probability::Level;
use boresight::vision::threshold::ThresholdConfig;
use boresight::vision::{DetectorConfig, LlrTable, ScoreImage, TrackBeforeDetect, build};
use boresight::{Config, Frame, FrameIndex, Image, PixelKind, Pixels, Scan, Timestamp, track};
use rand::RngExt;
use rand_distr::StandardNormal;
use std::fmt::Write as _;

const SIDE: usize = 64;
const SCANS: u64 = 50;
const RUNS: u64 = 25;
/// Width of the Gaussian whose correlation with a square of 9 px is best: 0.43 of its side.
const SIGMA: f64 = 3.9;
const TRACKER: &str = include_str!("../../../configs/below-noise.toml");

fn picture(k: u64, run: u64) -> Image<u8> {
    let mut rng = random(900 + 1000 * run + k);
    let mut image = Image::filled(SIDE, SIDE, 0u8);
    let middle = 9 + k as usize;
    for y in 0..SIDE {
        for (x, v) in image.row_mut(y).iter_mut().enumerate() {
            let mean = if x.abs_diff(middle) <= 4 && y.abs_diff(middle) <= 4 { 60.0 } else { 50.0 };
            *v = (mean + 50.0 * rng.sample::<f64, _>(StandardNormal) + 0.5).floor().clamp(0.0, 255.0) as u8;
        }
    }
    image
}

pub fn table(page: &mut String) -> Result<()> {
    writeln!(page, "| method | told | within 3 px in scans 11 to 50, % |\n| --- | --- | --- |")?;
    let level = |mean| Level { mean, sd: 50.0 };
    let table = LlrTable::new(level(60.0), level(50.0), 256);
    let mut hits = 0;
    for run in 0..RUNS {
        let (mut grid, mut scores) = (TrackBeforeDetect::new(2, 0.02), ScoreImage::default());
        for k in 0..SCANS {
            scores.fill(&picture(k, run), &table, (9, 9));
            let found = grid.step(&scores);
            hits += u64::from(k >= 10 && found.is_some_and(|e| near(e.map.x, e.map.y, k)));
        }
    }
    let all = (RUNS * (SCANS - 10)) as f64;
    writeln!(
        page,
        "| likelihood-ratio grid, one target | both distributions, size, that there is a target | {:.1} |",
        100.0 * hits as f64 / all
    )?;
    let turns = BernoulliConfig::default().acceleration_density_px2_per_s3;
    let told = [
        (TargetShape::Spot, turns, "a width"),
        (TargetShape::Square, turns, "a square's side"),
        (TargetShape::Square, 3.0, "a square's side, and that it hardly turns (3 px²/s³)"),
    ];
    for (shape, acceleration_density_px2_per_s3, told) in told {
        for rate in [0.01, 1.0] {
            let carried = ThresholdConfig::Bernoulli(BernoulliConfig {
                false_alarms_per_frame: rate,
                shape,
                sigma_px: SIGMA,
                side_px: 9.0,
                acceleration_density_px2_per_s3,
                background: StillBackground::Spatial,
                ..BernoulliConfig::default()
            });
            let [found, later] = found(&carried, None)?;
            writeln!(
                page,
                "| density carried from frame to frame | {told}; {rate} false alarms a frame | {found:.1}; {later:.1} in scans 31 to 50 |"
            )?;
        }
    }
    for frames in [8u32, 16] {
        let sums = IntegrateConfig {
            frames,
            sigma_px: SIGMA,
            max_speed_px_per_s: 50.0,
            false_alarms_per_frame: 0.01,
            // In eight frames the target does not leave its own place: a mean over them would take it out.
            background: StillBackground::Spatial,
            ..IntegrateConfig::default()
        };
        let [found, _] = found(&ThresholdConfig::Integrate(sums), Some(TRACKER))?;
        writeln!(page, "| sums of {frames} frames, tracked | a width; 0.01 false alarms a frame | {found:.1} |")?;
    }
    Ok(())
}

/// Share of scans 11 to 50, and of 31 to 50, with a track, or a detection where there is no tracker, near the target, %.
fn found(threshold: &ThresholdConfig, tracker: Option<&str>) -> Result<[f64; 2]> {
    let info = super::scenes::info([SIDE; 2], PixelKind::Gray8);
    let config = DetectorConfig { threshold: threshold.clone(), ..DetectorConfig::default() };
    let tracker = tracker.map(|text| Config::from_toml(text, "configs/below-noise.toml")).transpose()?;
    let mut hits = [0u64; 2];
    for run in 0..RUNS {
        let (mut detector, mut scan) = (build(&config, &info)?, Scan::default());
        let mut tracker = tracker.as_ref().map(|c| track::build(&c.tracker)).transpose()?;
        for k in 0..SCANS {
            let time = Timestamp::from_secs_f64(0.04 * k as f64);
            let frame = Frame { index: FrameIndex(k), time, pixels: Pixels::Gray8(picture(k, run)) };
            detector.detect(&frame, &mut scan)?;
            let found = match &mut tracker {
                Some(tracker) => {
                    tracker.step(&scan)?.iter().any(|s| near(s.kinematics.mean[0], s.kinematics.mean[2], k))
                }
                None => scan.detections.iter().any(|d| near(d.position.x, d.position.y, k)),
            };
            for (hits, from) in hits.iter_mut().zip([10, 30]) {
                *hits += u64::from(k >= from && found);
            }
        }
    }
    let share = |hits: u64, from: u64| 100.0 * hits as f64 / (RUNS * (SCANS - from)) as f64;
    Ok([share(hits[0], 10), share(hits[1], 30)])
}

/// Whether a place is within 3 px of the target in scan `k`.
fn near(x: f64, y: f64, k: u64) -> bool {
    (x - 9.0 - k as f64).hypot(y - 9.0 - k as f64) <= 3.0
}
