//! `boresight smooth`: tracks of a whole run, each row told of all the others.

use boresight::io::{TableOptions, TracksCsv, read_tracks};
use boresight::track::smooth::{SmoothConfig, SmoothMethod, filter_track, predict, smooth_track};
use boresight::{Config, Extent, FrameIndex, Scan, Sink, Timestamp, TrackFrame, TrackState, TrackStatus, View};
use boresight_filters::Gaussian;
use std::collections::BTreeMap;
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
    /// Standard deviation of the acceleration, px/s²; that of config.toml beside the table if absent.
    #[arg(long, value_name = "PX/S2")]
    acceleration: Option<f64>,
    /// White noise in continuous time with the density acceleration² times this, s; discrete noise if absent.
    #[arg(long, value_name = "S")]
    hold_s: Option<f64>,
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

/// One track: its rows with their frames.
type Rows = Vec<(FrameIndex, Timestamp, TrackState)>;

/// Runs the command.
pub fn run(args: Args) -> anyhow::Result<ExitCode> {
    let options = TableOptions {
        std_px: args.std_px,
        rate_hz: args.rate_hz,
        skip_bad_rows: args.skip_bad_rows,
        ..TableOptions::default()
    };
    let table = read_tracks(&args.tracks, &options)?;
    table.warnings.iter().for_each(|w| eprintln!("warning: {w}"));
    let own = table.has_states;
    let config = settings(&args, own)?;
    if !own {
        eprintln!("rows are positions of deviation {} px where the table has none: filtered first", args.std_px);
    }
    let mut tracks: BTreeMap<u64, Rows> = BTreeMap::new();
    for frame in &table.frames {
        for track in &frame.tracks {
            tracks.entry(track.id.0).or_default().push((frame.index, frame.time, track.clone()));
        }
    }
    let (mut n_rows, mut n_filled, mut stds) = (0, 0, [Vec::new(), Vec::new()]);
    let mut frames: BTreeMap<FrameIndex, TrackFrame> = BTreeMap::new();
    for (id, rows) in &mut tracks {
        let place = |e: boresight::Error| e.at(format!("track {id} of {}", args.tracks.display()));
        if !own {
            each_belief(rows, |times, beliefs| filter_track(times, beliefs, args.speed_std, &config)).map_err(place)?;
        }
        if args.fill {
            n_filled += fill(rows, &table.frames, &config).map_err(place)?;
        }
        n_rows += rows.len();
        stds[0].extend(rows.iter().map(|r| deviation(&r.2)));
        each_belief(rows, |times, beliefs| smooth_track(times, beliefs, &config)).map_err(place)?;
        stds[1].extend(rows.iter().map(|r| deviation(&r.2)));
        for (index, time, state) in rows.drain(..) {
            let frame = frames.entry(index).or_insert(TrackFrame { index, time, tracks: Vec::new() });
            frame.tracks.push(state);
        }
    }
    let mut out = TracksCsv::create(&args.output)?;
    for frame in frames.values() {
        let scan = Scan::at(frame.index, frame.time);
        out.put(&View { frame: None, scan: &scan, tracks: &frame.tracks })?;
    }
    Box::new(out).finish()?;
    let [before, after] = stds.map(median);
    eprintln!(
        "{} tracks, {n_rows} rows ({n_filled} filled in): median deviation of a position {before:.3} -> {after:.3} px: {}",
        tracks.len(),
        args.output.display()
    );
    Ok(ExitCode::SUCCESS)
}

/// The smoother's settings: as on the command line, else as in the configuration that the tracks were made with.
fn settings(args: &Args, own: bool) -> anyhow::Result<SmoothConfig> {
    let mut config = SmoothConfig::default();
    let beside = args.tracks.with_file_name("config.toml");
    if let Some(std) = args.acceleration {
        config.acceleration_std_px_per_s2 = std;
    } else if own && beside.is_file() {
        let tracker = Config::from_file(&beside)?.tracker;
        config.acceleration_std_px_per_s2 = tracker.acceleration_std_px_per_s2;
        eprintln!("acceleration {} px/s², from {}", config.acceleration_std_px_per_s2, beside.display());
        if !tracker.filter.is_constant_velocity() {
            eprintln!(
                "note: these tracks are of another model than constant velocity; their covariances become approximate"
            );
        }
    } else {
        eprintln!("acceleration {} px/s², the tracker's default (--acceleration)", config.acceleration_std_px_per_s2);
    }
    config.hold_s = args.hold_s;
    config.method = match (args.lag, args.method) {
        (Some(lag), _) => SmoothMethod::FixedLag(lag),
        (None, Method::Rts) => SmoothMethod::Rts,
        (None, Method::SquareRoot) => SmoothMethod::SquareRoot,
    };
    config.validate("smooth")?;
    Ok(config)
}

/// Puts predicted rows into the frames between a track's rows in which it has none; returns how many.
fn fill(rows: &mut Rows, frames: &[TrackFrame], config: &SmoothConfig) -> boresight::Result<usize> {
    let mut filled: Rows = Vec::with_capacity(rows.len());
    let mut n = 0;
    for (index, time, state) in rows.drain(..) {
        let (from, after) = match filled.last() {
            Some((from, after, _)) => (*from, *after),
            None => (index, time),
        };
        for missing in from.0 + 1..index.0 {
            let known = frames.binary_search_by_key(&missing, |f| f.index.0).ok().map(|at| frames[at].time);
            // A frame without any track: its time lies between its neighbours'.
            let share = (missing - from.0) as f64 / (index.0 - from.0) as f64;
            let between = || Timestamp::from_secs_f64(after.as_secs_f64() + share * time.seconds_since(after));
            let at = known.unwrap_or_else(between);
            let Some((_, last, before)) = filled.last() else { break };
            let kinematics = predict(&before.kinematics, at.seconds_since(*last), config)?;
            let row = TrackState { kinematics, status: TrackStatus::Coasting, detection: None, ..before.clone() };
            filled.push((FrameIndex(missing), at, row));
            n += 1;
        }
        filled.push((index, time, state));
    }
    *rows = filled;
    Ok(n)
}

/// Lets `change` work on the beliefs of a track, and moves the boxes with them.
fn each_belief(
    rows: &mut Rows,
    change: impl FnOnce(&[Timestamp], &mut [Gaussian<4>]) -> boresight::Result<()>,
) -> boresight::Result<()> {
    let times: Vec<Timestamp> = rows.iter().map(|r| r.1).collect();
    let mut beliefs: Vec<_> = rows.iter().map(|r| r.2.kinematics).collect();
    change(&times, &mut beliefs)?;
    for ((_, _, state), belief) in rows.iter_mut().zip(beliefs) {
        let (width_px, height_px) = (state.extent.width_px, state.extent.height_px);
        let (left_px, top_px) = (belief.mean[0] - width_px / 2.0, belief.mean[2] - height_px / 2.0);
        state.extent = Extent { left_px, top_px, width_px, height_px };
        state.kinematics = belief;
    }
    Ok(())
}

/// Standard deviation of a position, mean of both axes, px.
fn deviation(state: &TrackState) -> f64 {
    let p = &state.kinematics.cov;
    (0.5 * (p[(0, 0)] + p[(2, 2)])).sqrt()
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(f64::NAN)
}
