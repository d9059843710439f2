//! `cargo xtask choices`: what the automatic choice says of every public clip, one line each.
//!
//! Shows that a change of the choice for one kind of input leaves the others alone.

use anyhow::Result;
use boresight::Config;
use boresight::auto;
use boresight::vision::DetectorConfig;
use boresight::vision::threshold::ThresholdConfig;
use std::path::{Path, PathBuf};

/// Arguments of `choices`.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Inputs; every public clip if none is given.
    inputs: Vec<String>,
    /// Folder of the public data.
    #[arg(long)]
    data: Option<PathBuf>,
    /// Print all reasons.
    #[arg(long, short)]
    verbose: bool,
}

/// The clips and image folders of the public data.
fn all(data: &Path) -> Result<Vec<String>> {
    let mut out = Vec::new();
    for folder in ["ir_drone_svanstrom", "vis_drone_svanstrom"] {
        for row in csv::Reader::from_path(data.join(folder).join("index.csv"))?.records() {
            out.push(data.join(folder).join(format!("{}.mp4", &row?[0])));
        }
    }
    for name in [
        "pets09_vtest/vtest.avi",
        "ball_green_trflorian/ball.mp4",
        "ball_green_trflorian/ball2.mp4",
        "traffic_bgslibrary/demo.avi",
        "traffic_bgslibrary/video02.avi",
        "intel_sample_videos/car-detection.mp4",
        "animals_tracktor/mouse_video.mp4",
        "trackpy_bulk_water/frames",
        "cells_ctc_gowt1/01/frames",
        "cells_hela_16bit/frames",
        "dctracking_pets_tud/TUD-Campus/img1",
        "uav_uavdt_S1001/frames",
    ] {
        out.push(data.join(name));
    }
    Ok(out.into_iter().filter(|p| p.exists()).map(|p| p.display().to_string()).collect())
}

/// The chosen detector in a few words.
fn name(detector: &DetectorConfig) -> String {
    match &detector.threshold {
        ThresholdConfig::Isolated(c) => format!("isolated {:?}", c.polarity),
        ThresholdConfig::Cfar(c) => format!("cfar {:?}", c.polarity),
        ThresholdConfig::Spot(c) => format!("spot {:?} {} px", c.polarity, c.size_px),
        ThresholdConfig::Colour(c) => format!("colour {:?}", c.reference),
        ThresholdConfig::Moving(_) => "moving".to_string(),
        other => format!("{other:?}"),
    }
}

/// Prints the choices.
pub fn run(args: &Args) -> Result<()> {
    let data = args.data.clone().unwrap_or_else(crate::data::test_data);
    let inputs = if args.inputs.is_empty() { all(&data)? } else { args.inputs.clone() };
    for input in &inputs {
        let base = Config::default();
        let started = std::time::Instant::now();
        let (_, choice) = auto::open_and_choose(input, &base, &auto::Request::default())?;
        let elapsed = started.elapsed().as_secs_f64();
        let short: Vec<&str> = input.rsplit('/').take(2).collect();
        println!(
            "{:<44} {:<24} {elapsed:.2} s",
            short.into_iter().rev().collect::<Vec<_>>().join("/"),
            name(&choice.config.detector)
        );
        if args.verbose {
            choice.reasons.iter().for_each(|r| println!("    {r}"));
        }
    }
    Ok(())
}
