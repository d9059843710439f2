//! Pixel locking: the fractional parts of positions in trackpy's clip of bulk water, beside trackpy's own.
//!
//! Particles that diffuse are at no place of a pixel more often than at another, so fractional parts are uniform; chi-square over 20 bins of each axis.
//! Every fifth frame of the first sixty: within five a particle moves by more than a bin.

use anyhow::Result;
use boresight::vision::fit::FitConfig;
use boresight::vision::threshold::{Polarity, SpotConfig, ThresholdConfig};
use boresight::vision::{DetectorConfig, build};
use boresight::{PositionFit, Scan};
use std::fmt::Write as _;
use std::path::Path;

const BINS: usize = 20;
const EVERY: usize = 5;

/// Chi-square a degree of freedom of the fractional parts along each axis, and the number of positions.
fn uniform(places: &[[f64; 2]]) -> ([f64; 2], usize) {
    let chi2 = [0, 1].map(|axis| {
        let mut bins = [0.0; BINS];
        for p in places {
            bins[((p[axis].rem_euclid(1.0) * BINS as f64) as usize).min(BINS - 1)] += 1.0;
        }
        let expected = places.len() as f64 / BINS as f64;
        bins.iter().map(|b| (b - expected) * (b - expected) / expected).sum::<f64>() / (BINS - 1) as f64
    });
    (chi2, places.len())
}

/// Positions in every fifth frame, and the share of them that is fitted.
fn ours(folder: &Path, fit: Option<FitConfig>) -> Result<(Vec<[f64; 2]>, f64)> {
    let mut source = boresight::io::open(folder.join("frames"), &Default::default())?;
    // Particles of diameter 11 px, darker than the water, as trackpy's walkthrough looks for them.
    let spot = SpotConfig {
        size_px: 11.0,
        k: 4.5,
        polarity: Polarity::Dark,
        min_contrast: 1.0,
        surround: 1.0,
        smooth_px: Some(3.0),
    };
    let mut config = DetectorConfig { threshold: ThresholdConfig::Spot(spot), ..Default::default() };
    config.centroid.fit = fit;
    let mut detector = build(&config, source.info())?;
    let (mut scan, mut places, mut fitted) = (Scan::default(), Vec::new(), 0usize);
    for k in 0..60 {
        let Some(frame) = source.next_frame()? else { break };
        if k % EVERY != 0 {
            continue;
        }
        detector.detect(&frame, &mut scan)?;
        for d in &scan.detections {
            let is_fit = matches!(d.fit, Some(PositionFit::Spot { .. }));
            fitted += usize::from(is_fit);
            places.push([d.position.x, d.position.y]);
        }
    }
    let share = fitted as f64 / places.len().max(1) as f64;
    Ok((places, share))
}

fn trackpys(folder: &Path) -> Result<Vec<[f64; 2]>> {
    let mut out = Vec::new();
    for row in csv::Reader::from_path(folder.join("trackpy_link_first60.csv"))?.records() {
        let row = row?;
        let number = |i: usize| -> Result<f64> { Ok(row.get(i).unwrap_or("").parse()?) };
        if (number(0)? as usize).is_multiple_of(EVERY) {
            out.push([number(2)?, number(3)?]);
        }
    }
    Ok(out)
}

pub fn table(data: &Path, page: &mut String) -> Result<()> {
    let folder = data.join("trackpy_bulk_water");
    if !folder.exists() {
        writeln!(page, "\nBulk water: no data.")?;
        return Ok(());
    }
    writeln!(
        page,
        "\nPixel locking in trackpy's clip of bulk water, every fifth of the first 60 frames, {BINS} bins:\n"
    )?;
    writeln!(
        page,
        "| positions | number | fitted | chi-square a degree of freedom, x | y |\n| --- | --- | --- | --- | --- |"
    )?;
    let mut row = |name: &str, places: &[[f64; 2]], fitted: f64| {
        let ([x, y], n) = uniform(places);
        let fitted = if fitted > 0.0 { format!("{:.1} %", 100.0 * fitted) } else { String::new() };
        writeln!(page, "| {name} | {n} | {fitted} | {x:.2} | {y:.2} |")
    };
    row("trackpy 0.7, `locate`", &trackpys(&folder)?, 0.0)?;
    row("`spot`, its centroid", &ours(&folder, None)?.0, 0.0)?;
    let (places, share) = ours(&folder, Some(FitConfig::default()))?;
    row("`spot`, fitted", &places, share)?;
    writeln!(page, "\n1 ± 0.32 where they are uniform.")?;
    Ok(())
}
