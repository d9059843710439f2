//! `boresight smooth`: tracks of a whole run, each row told of all the others.

use super::table_motion;
use crate::console::say;
use boresight::io::{TableOptions, TracksCsv, read_tracks, refuse_to_overwrite};
use boresight::track::smooth::{SmoothConfig, SmoothMethod};
use boresight::track::{AccelerationNoise, smooth_table};
use boresight::{Scan, Sink, View};
use std::path::PathBuf;
use std::process::ExitCode;

/// How smoothing is computed.
#[derive(Clone, Copy, Debug, clap::ValueEnum)]
enum Method {
    /// Rauch-Tung-Striebel, covariance form.
    Rts,
    /// The same in square roots.
    SquareRoot,
}

/// Smooth a table of tracks: each row given all rows of its track (Rauch-Tung-Striebel).
#[derive(Debug, clap::Args)]
#[command(allow_negative_numbers = true)]
#[command(after_help = "Examples:
  boresight smooth flight.tracks/tracks.csv
      writes smoothed.csv; the acceleration is that of flight.tracks/config.toml
  boresight smooth tracks.csv --fill --lag 10 -o live.csv
      rows also for frames in which a track has none; each row knows 10 later ones, as a display 10 frames late would
  boresight smooth other/mot.txt --acceleration 50 --std-px 2
      boxes from elsewhere (MOTChallenge, CSV): their centres are filtered first, then smoothed")]
pub struct Args {
    /// The tracks: tracks.csv, or any table of positions with identities (MOTChallenge, CSV).
    tracks: PathBuf,
    /// The smoothed table.
    #[arg(short, long, default_value = "smoothed.csv")]
    output: PathBuf,
    /// Power density of the white acceleration, px²/s³; that of config.toml beside the table if absent.
    #[arg(long, value_name = "PX2/S3")]
    acceleration_density: Option<f64>,
    /// Discrete noise instead: standard deviation of an acceleration that is constant between two rows, px/s².
    #[arg(long, value_name = "PX/S2", conflicts_with = "acceleration_density")]
    acceleration: Option<f64>,
    /// How it is computed.
    #[arg(long, value_enum, default_value = "rts", conflicts_with = "lag")]
    method: Method,
    /// Each row knows only this many later ones.
    #[arg(long, value_name = "ROWS")]
    lag: Option<u32>,
    /// Also write a row for each frame that a track has none in, between its first and its last.
    #[arg(long)]
    fill: bool,
    /// Standard deviation of positions in tables that have no covariance, px.
    #[arg(long, value_name = "PX", default_value_t = 1.0)]
    std_px: f64,
    /// Standard deviation of the first velocity in such tables, px/s.
    #[arg(long, value_name = "PX/S", default_value_t = 150.0)]
    speed_std: f64,
    /// Rate of tables without times, frames/s.
    #[arg(long, value_name = "HZ")]
    rate_hz: Option<f64>,
    /// Leave out rows that cannot be read, and count them.
    #[arg(long)]
    skip_bad_rows: bool,
}

/// Runs the command.
pub fn run(args: Args) -> anyhow::Result<ExitCode> {
    let options = TableOptions {
        std_px: args.std_px,
        rate_hz: args.rate_hz,
        skip_bad_rows: args.skip_bad_rows,
        ..TableOptions::default()
    };
    refuse_to_overwrite(&args.tracks, [args.output.as_path()])?;
    let table = read_tracks(&args.tracks, &options)?;
    table.warnings.iter().for_each(|w| say!("warning: {w}"));
    if table.frames.is_empty() {
        say!("warning: {}: the table has no rows", args.tracks.display());
    }
    let own = table.has_states;
    let config = settings(&args, own)?;
    if !own {
        say!("rows are positions of deviation {} px where the table has none: filtered first", args.std_px);
    }
    let done = smooth_table(&table.frames, &config, (!own).then_some(args.speed_std), args.fill)
        .map_err(|e| e.at(args.tracks.display()))?;
    let mut out = TracksCsv::create(&args.output)?;
    for frame in &done.frames {
        let scan = Scan::at(frame.index, frame.time);
        out.put(&View { frame: None, scan: &scan, tracks: &frame.tracks })?;
    }
    Box::new(out).finish()?;
    if done.n_cut > 0 {
        say!(
            "note: {} rows do not follow from the one before: their tracks were lost and found again there, or the camera moved; each part was smoothed by itself",
            done.n_cut
        );
    }
    say!(
        "{} tracks, {} rows ({} filled in): median deviation of a position {:.3} -> {:.3} px: {}",
        done.n_tracks,
        done.n_rows,
        done.n_filled,
        done.median_std_before_px,
        done.median_std_after_px,
        args.output.display()
    );
    Ok(ExitCode::SUCCESS)
}

/// The smoother's settings: as on the command line, else as in the configuration that the tracks were made with.
fn settings(args: &Args, own: bool) -> anyhow::Result<SmoothConfig> {
    let asked = args.acceleration.map(AccelerationNoise::Discrete);
    let asked = asked.or(args.acceleration_density.map(AccelerationNoise::Continuous));
    let maker = if asked.is_none() { table_motion::maker(&args.tracks, own)? } else { None };
    let (acceleration, forgetting) = table_motion::of(asked, maker.as_ref(), 0.0);
    let correlated_error_px = maker.as_ref().map_or(0.0, |(t, _)| t.correlated_error_px);
    let density_per_height2_per_s3 = maker.map_or(0.0, |(t, _)| t.acceleration_density_per_height2_per_s3);
    let method = match (args.lag, args.method) {
        (Some(lag), _) => SmoothMethod::FixedLag(lag),
        (None, Method::Rts) => SmoothMethod::Rts,
        (None, Method::SquareRoot) => SmoothMethod::SquareRoot,
    };
    let config = SmoothConfig { acceleration, density_per_height2_per_s3, forgetting, correlated_error_px, method };
    config.validate("smooth")?;
    Ok(config)
}
