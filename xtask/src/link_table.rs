//! Links against two peers' published ones on their own positions: trackpy's bulk water, btrack's cells.
//!
//! The positions of the peer's result are the detections, so every row of its result is a link to be found again: the same
//! particle in two frames that follow each other. Agreement is no truth: where particles pass within a step of each other
//! neither result is certain.

use anyhow::{Context, Result};
use boresight::track::filter::RandomWalkConfig;
use boresight::track::{
    self, ConfirmationConfig, FilterConfig, InitiationConfig, MOfNConfig, MergedMeasurementsConfig, ModelConfig,
    OnePointConfig, TrackerConfig,
};
use boresight::{Detection, FrameIndex, Scan, Timestamp};
use nalgebra::{Matrix2, Vector2};
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

#[derive(clap::Args)]
pub struct Args {
    /// Folder with `trackpy_bulk_water` and `btrack_examples`.
    #[arg(long, env = "BORESIGHT_TEST_DATA", default_value = "../shared/data")]
    data: PathBuf,
}

/// For each frame the peer's track and the position of every row.
type Frames = Vec<Vec<(u64, Vector2<f64>)>>;

fn read(path: &Path, columns: [&str; 4]) -> Result<Frames> {
    let mut reader = csv::Reader::from_path(path).with_context(|| path.display().to_string())?;
    let header = reader.headers()?.clone();
    let place = |name: &str| header.iter().position(|h| h == name).with_context(|| format!("no column {name}"));
    let places = [place(columns[0])?, place(columns[1])?, place(columns[2])?, place(columns[3])?];
    let mut frames = Frames::new();
    for record in reader.records() {
        let record = record?;
        let value = |k: usize| -> Result<f64> { Ok(record.get(places[k]).context("a short row")?.parse()?) };
        let frame = value(0)? as usize;
        if frames.len() <= frame {
            frames.resize(frame + 1, Vec::new());
        }
        frames[frame].push((value(1)? as u64, Vector2::new(value(2)?, value(3)?)));
    }
    Ok(frames)
}

/// A tracker of things that diffuse: every detection is believed at once, as linkers do.
fn linker(diffusion_px2_per_s: f64, reach_px: f64, rate_hz: f64, memory: u32) -> TrackerConfig {
    let model = ModelConfig::RandomWalk(RandomWalkConfig { diffusion_px2_per_s });
    TrackerConfig {
        filter: FilterConfig { model, ..FilterConfig::default() },
        extra_noise_px: 0.0,
        gate_probability: 0.995,
        max_speed_px_per_s: reach_px * rate_hz,
        confirmation: ConfirmationConfig::MOfN(MOfNConfig { hits: 1, scans: 1, ..MOfNConfig::default() }),
        initiation: InitiationConfig::OnePoint(OnePointConfig::default()),
        coast_s: 0.0,
        // Gone for `memory` frames and back in the next.
        coast_scans: memory + 1,
        merged_measurements: MergedMeasurementsConfig::off(),
        ..TrackerConfig::default()
    }
}

fn link(frames: &Frames, config: &TrackerConfig, rate_hz: f64) -> Result<Vec<Vec<u64>>> {
    let mut tracker = track::build(config)?;
    let mut out = Vec::new();
    for (k, rows) in frames.iter().enumerate() {
        let detection = |r: &(u64, Vector2<f64>)| Detection::at(r.1, Matrix2::identity() * 0.09);
        let scan = Scan::at(FrameIndex(k as u64), Timestamp::from_secs_f64(k as f64 / rate_hz))
            .with_detections(rows.iter().map(detection).collect());
        let mut ids = vec![0; rows.len()];
        for s in tracker.step(&scan)? {
            if let Some(j) = s.detection {
                ids[j as usize] = s.id.0;
            }
        }
        out.push(ids);
    }
    Ok(out)
}

/// Links of two numberings of the same rows: in both, in the first, in the second.
fn agreement(frames: &Frames, ours: &[Vec<u64>]) -> (u64, u64, u64) {
    let (mut both, mut theirs, mut own) = (0, 0, 0);
    for k in 1..frames.len() {
        let before: BTreeMap<u64, usize> = frames[k - 1].iter().enumerate().map(|(j, r)| (r.0, j)).collect();
        let ours_before: BTreeSet<u64> = ours[k - 1].iter().copied().collect();
        for (j, (particle, _)) in frames[k].iter().enumerate() {
            let id = ours[k][j];
            own += u64::from(ours_before.contains(&id));
            if let Some(i) = before.get(particle) {
                theirs += 1;
                both += u64::from(ours[k - 1][*i] == id);
            }
        }
    }
    (both, theirs, own)
}

pub fn run(args: &Args) -> Result<()> {
    let sets = [
        (
            "trackpy, bulk water, 60 frames",
            "trackpy_bulk_water/trackpy_link_first60.csv",
            ["frame", "particle", "x", "y"],
            linker(50.0, 5.0, 24.0, 3),
            24.0,
        ),
        (
            "btrack, cells, 500 frames",
            "btrack_examples/tracks.csv",
            ["t", "ID", "x", "y"],
            linker(60.0, 40.0, 1.0, 2),
            1.0,
        ),
    ];
    println!("                                  peer's links   found again   ours not theirs   tracks: peer   ours");
    for (name, path, columns, config, rate_hz) in sets {
        let frames = read(&args.data.join(path), columns)?;
        let ours = link(&frames, &config, rate_hz)?;
        let (both, theirs, own) = agreement(&frames, &ours);
        let particles: BTreeSet<u64> = frames.iter().flatten().map(|r| r.0).collect();
        let ids: BTreeSet<u64> = ours.iter().flatten().copied().collect();
        println!(
            "{name:32} {theirs:13}   {:9.3} %   {:15}   {:12}   {:4}",
            100.0 * both as f64 / theirs as f64,
            own - both,
            particles.len(),
            ids.len()
        );
    }
    Ok(())
}
