//! `boresight stitch`: fragments of one target become one track; gaps filled and all smoothed if asked for.

use super::table_motion;
use crate::console::say;
use boresight::io::{MotWriter, TableOptions, TracksCsv, read_tracks, refuse_to_overwrite};
use boresight::track::{AccelerationNoise, StitchConfig, join, with_empty_frames};
use boresight::{Scan, Sink, TrackFrame, View};
use std::path::PathBuf;
use std::process::ExitCode;

/// Join fragments of one target after gaps; with --smooth fill the gaps and smooth all tracks.
#[derive(Debug, clap::Args)]
#[command(allow_negative_numbers = true)]
#[command(after_help = "Examples:
  boresight stitch flight.tracks/tracks.csv -o stitched.csv
      fragments at most 2 s apart that fit each other get one id; rows stay as they are; targets move as in
      flight.tracks/config.toml
  boresight stitch tracks.csv --smooth -o smooth.csv
      also fills the gaps and gives every row the estimate of the whole track
  boresight stitch mot.txt --max-gap 1 --acceleration 100 -o mot_stitched.txt
      MOTChallenge in and out")]
pub struct Args {
    /// Table of tracks: tracks.csv, MOTChallenge, any table with a column that names the track.
    tracks: PathBuf,
    /// The new table; `.txt` is written as MOTChallenge, everything else as tracks.csv.
    #[arg(short, long, default_value = "stitched.csv")]
    output: PathBuf,
    /// Smooth all tracks (Rauch-Tung-Striebel) and put rows into the gaps.
    #[arg(long)]
    smooth: bool,
    /// Longest gap, s.
    #[arg(long, default_value_t = StitchConfig::default().max_gap_s)]
    max_gap: f64,
    /// Fragments may overlap by this much, s.
    #[arg(long, default_value_t = StitchConfig::default().max_overlap_s)]
    max_overlap: f64,
    /// Power density of the targets' white acceleration, px²/s³; the motion in config.toml beside the table if absent.
    #[arg(long, value_name = "PX2/S3")]
    acceleration_density: Option<f64>,
    /// Discrete noise instead: standard deviation of an acceleration that is constant during a gap, px/s².
    #[arg(long, value_name = "PX/S2", conflicts_with = "acceleration_density")]
    acceleration: Option<f64>,
    /// Largest speed, px/s; that of config.toml beside the table if absent, else 300.
    #[arg(long, value_name = "PX/S")]
    max_speed: Option<f64>,
    /// Probability that true fragments pass the gate, in (0, 1).
    #[arg(long, default_value_t = StitchConfig::default().gate_probability)]
    gate_probability: f64,
    /// Rate of tables without times, frames/s.
    #[arg(long)]
    rate_hz: Option<f64>,
}

/// Runs the command.
pub fn run(args: Args) -> anyhow::Result<ExitCode> {
    refuse_to_overwrite(&args.tracks, [args.output.as_path()])?;
    let table = read_tracks(&args.tracks, &TableOptions { rate_hz: args.rate_hz, ..TableOptions::default() })?;
    table.warnings.iter().for_each(|w| say!("warning: {}: {w}", args.tracks.display()));
    if table.frames.is_empty() {
        say!("warning: {}: the table has no rows", args.tracks.display());
    }
    let asked = args.acceleration.map(AccelerationNoise::Discrete);
    let asked = asked.or(args.acceleration_density.map(AccelerationNoise::Continuous));
    let is_said = asked.is_some() && args.max_speed.is_some();
    let maker = if is_said { None } else { table_motion::maker(&args.tracks, table.has_states)? };
    let (acceleration, forgetting) = table_motion::of(asked, maker.as_ref(), middle_height_px(&table.frames));
    let usual_speed = maker.map_or(StitchConfig::default().max_speed_px_per_s, |(t, _)| t.max_speed_px_per_s);
    let config = StitchConfig {
        max_gap_s: args.max_gap,
        max_overlap_s: args.max_overlap,
        acceleration,
        forgetting,
        max_speed_px_per_s: args.max_speed.unwrap_or(usual_speed),
        gate_probability: args.gate_probability,
    };
    config.validate("stitch")?;
    // Frames without any track have no rows in a table; a gap needs them.
    let mut scans =
        if args.smooth { with_empty_frames(table.frames, args.max_gap, table.rate_hz) } else { table.frames };
    let done = join(&mut scans, &config, args.smooth)?;
    let mut out: Box<dyn Sink> = if args.output.extension().is_some_and(|e| e == "txt") {
        Box::new(MotWriter::create(&args.output)?.with_coasting(args.smooth))
    } else {
        Box::new(TracksCsv::create(&args.output)?)
    };
    for s in scans.iter().filter(|s| !s.tracks.is_empty()) {
        let scan = Scan::at(s.index, s.time);
        out.put(&View { frame: None, scan: &scan, tracks: &s.tracks })?;
    }
    out.finish()?;
    if done.filtered {
        say!("the table has no velocities: its positions were filtered first");
    }
    say!(
        "{} tracks -> {} ({} joined), {} rows filled, {} coasting rows dropped: {}",
        done.before,
        done.after,
        done.before - done.after,
        done.filled,
        done.dropped,
        args.output.display()
    );
    Ok(ExitCode::SUCCESS)
}

/// The middle height of the boxes of a table, px: fragments move alike.
fn middle_height_px(frames: &[TrackFrame]) -> f64 {
    let mut heights: Vec<f64> = frames.iter().flat_map(|f| &f.tracks).map(|t| t.extent.height_px).collect();
    heights.retain(|h| h.is_finite());
    heights.sort_by(f64::total_cmp);
    heights.get(heights.len() / 2).copied().unwrap_or(0.0)
}
