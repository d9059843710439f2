//! Spots in white noise: the rate of false alarms that comes, P_D against SNR, and the SNR for P_D 0.9 against the number of frames.
//!
//! A spot counts as found when a detection lies within 3 px of it in the newest frame of a sum that holds it in all frames. The clairvoyant
//! filter knows the path and has the detector's own threshold z: it needs a mean of z + 1.2816 for P_D = 0.9, and peak SNR ρ gives it ρ σ √(π T).

use super::scenes::{SIGMA, Spot, detector, deviations, frame, random, run};
use anyhow::Result;
use boresight::vision::integrate::IntegrateConfig;
use std::fmt::Write as _;

/// Quantile of P_D = 0.9.
const NINE_TENTHS: f64 = 1.281_552;
/// One false alarm an hour of 25 frames/s.
pub const ONE_AN_HOUR: f64 = 1.0 / 90_000.0;
const SIDE: usize = 256;
/// Spots a frame: apart enough that they do not meet often.
const SPOTS: usize = 8;

pub fn config(frames: u32, rate: f64) -> IntegrateConfig {
    IntegrateConfig {
        frames,
        false_alarms_per_frame: rate,
        sigma_px: SIGMA,
        max_speed_px_per_s: 50.0,
        ..Default::default()
    }
}

/// P_D at an SNR, the number of spots, and (deviations, score) of what was found.
fn detected(frames: u32, snr: f64, windows: u64, seed: u64) -> Result<(f64, Vec<[f64; 2]>)> {
    let mut rng = random(seed);
    let n = u64::from(frames);
    let mut detector = detector([SIDE; 2], config(frames, ONE_AN_HOUR))?;
    let (mut found, mut all, mut scores) = (0usize, 0usize, Vec::new());
    // The first windows hold noise alone, from which background and null are learnt.
    for window in 0..windows + 4 {
        let (from, to) = (window * n, window * n + n - 1);
        let n_spots = if window < 4 { 0 } else { SPOTS };
        let spots: Vec<Spot> = (0..n_spots).map(|_| Spot::random(SIDE, 2.0, from, to, &mut rng)).collect();
        let pictures = (from..=to).map(|k| frame([SIDE; 2], &spots, snr, k, &mut rng));
        run(detector.as_mut(), pictures, |scan| {
            scores.extend(scan.detections.iter().map(|d| [deviations(d, frames), f64::from(d.score)]));
            if scan.index.0 == to {
                all += spots.len();
                found += spots
                    .iter()
                    .filter(|s| {
                        let [x, y] = s.place(to as f64);
                        scan.detections.iter().any(|d| (d.position.x - x).hypot(d.position.y - y) <= 3.0)
                    })
                    .count();
            }
        })?;
    }
    Ok((found as f64 / all.max(1) as f64, scores))
}

/// z at which the score reaches the rate that was asked for: from the detections just above it.
fn threshold(scores: &mut [[f64; 2]]) -> f64 {
    scores.sort_by(|a, b| a[0].total_cmp(&b[0]));
    let lowest: Vec<f64> = scores.iter().take((scores.len() / 20).max(1)).map(|s| s[0]).collect();
    lowest.get(lowest.len() / 2).copied().unwrap_or(f64::NAN)
}

/// SNR at which a curve crosses 0.9, between its points.
fn crossing(curve: &[(f64, f64)]) -> f64 {
    curve
        .windows(2)
        .find(|w| w[0].1 < 0.9 && w[1].1 >= 0.9)
        .map_or(f64::NAN, |w| w[0].0 + (0.9 - w[0].1) / (w[1].1 - w[0].1) * (w[1].0 - w[0].0))
}

/// P_D by SNR of one number of frames.
pub struct Curve {
    pub frames: u32,
    pub points: Vec<(f64, f64)>,
    pub needed: f64,
    pub clairvoyant: f64,
}

/// The tables of P_D and of the SNR needed.
pub fn table_of_detection(windows: u64, page: &mut String) -> Result<Vec<Curve>> {
    let ratios = [0.7, 0.8, 0.9, 1.0, 1.1, 1.25];
    let mut curves = Vec::new();
    for frames in [8u32, 16, 32, 64] {
        let root = (64.0 / f64::from(frames)).sqrt();
        let (mut points, mut scores) = (Vec::new(), Vec::new());
        for (i, ratio) in ratios.iter().enumerate() {
            let snr = 0.5 * ratio * root;
            let (p_d, of) = detected(frames, snr, windows, 100 * u64::from(frames) + i as u64)?;
            points.push((snr, p_d));
            scores.extend(of);
        }
        let z = threshold(&mut scores);
        let clairvoyant = (z + NINE_TENTHS) / (SIGMA * (std::f64::consts::PI * f64::from(frames)).sqrt());
        let needed = crossing(&points);
        eprintln!("{frames} frames: {points:.3?}, threshold {z:.2}, needed {needed:.3}, clairvoyant {clairvoyant:.3}");
        curves.push(Curve { frames, points, needed, clairvoyant });
    }
    writeln!(page, "| frames | {} |", ratios.map(|r| format!("{r} x")).join(" | "))?;
    writeln!(page, "| --- {}|", "| --- ".repeat(ratios.len()))?;
    for c in &curves {
        let cells = c.points.iter().map(|(snr, p)| format!("{snr:.2}: {:.1} %", 100.0 * p)).collect::<Vec<_>>();
        writeln!(page, "| {} | {} |", c.frames, cells.join(" | "))?;
    }
    writeln!(page, "\n| frames | SNR for P_D 0.9 | clairvoyant filter | loss dB |\n| --- | --- | --- | --- |")?;
    for c in &curves {
        let loss = 20.0 * (c.needed / c.clairvoyant).log10();
        writeln!(page, "| {} | {:.3} | {:.3} | {loss:.2} |", c.frames, c.needed, c.clairvoyant)?;
    }
    let ends = curves.first().zip(curves.last());
    if let Some((a, b)) = ends {
        let slope = (b.needed / a.needed).ln() / (f64::from(b.frames) / f64::from(a.frames)).ln();
        writeln!(
            page,
            "\nSlope of SNR against frames in logarithms: {slope:.3} (-0.5 is that of a filter that loses nothing to longer sums)."
        )?;
    }
    Ok(curves)
}

/// False alarms found against asked for, on noise alone.
pub fn table_of_alarms(frames: u32, n_frames: u64, page: &mut String) -> Result<()> {
    let mut rng = random(7);
    let mut detector = detector([SIDE; 2], config(frames, 0.1))?;
    let mut scores = Vec::new();
    let pictures = (0..n_frames).map(|k| frame([SIDE; 2], &[], 0.0, k, &mut rng));
    run(detector.as_mut(), pictures, |scan| scores.extend(scan.detections.iter().map(|d| f64::from(d.score))))?;
    for rate in [0.1, 0.01, 1e-3, 1e-4, ONE_AN_HOUR] {
        let found = scores.iter().filter(|s| **s >= -rate.log10()).count();
        writeln!(page, "| {frames} | {n_frames} | {rate:.1e} | {:.1} | {found} |", rate * n_frames as f64)?;
    }
    Ok(())
}
