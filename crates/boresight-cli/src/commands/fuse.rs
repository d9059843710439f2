//! `boresight fuse`: two sensors' tracks or detections become one table of tracks.

mod input;
mod radar;

use crate::console::say;
use boresight::fuse::{
    FuseConfig, PlaneMap, Registration, RegistrationConfig, Rule, SensorScans, Timeline, fuse_tables, merge_scans,
};
use boresight::io::{LengthUnit, TracksCsv};
use boresight::{Config, FrameIndex, Scan, Sink, Timestamp, TrackState, View};
use input::{MapSpec, Sensor};
use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// How two beliefs become one.
#[derive(Clone, Copy, Debug, clap::ValueEnum)]
enum RuleName {
    /// Errors are independent (state-vector fusion).
    Independent,
    /// Correlation unknown: covariance intersection.
    Ci,
    /// Correlation by common information: inverse covariance intersection.
    Ici,
}

/// What is estimated between the sensors.
#[derive(Clone, Copy, Debug, PartialEq, clap::ValueEnum)]
enum Estimate {
    /// Constant offset.
    Offset,
    /// Rotation.
    Rotation,
    /// Time offset.
    Time,
    /// Range bias of a radar, the second sensor.
    Range,
    /// Azimuth bias of a radar, about where it is.
    Azimuth,
}

/// Where fusion happens.
#[derive(Clone, Copy, Debug, PartialEq, clap::ValueEnum)]
enum Level {
    /// Each sensor's own tracks are fused.
    Tracks,
    /// One tracker takes both sensors' detections.
    Measurements,
}

/// Fuse two tables of tracks or detections: bring them into one frame, register, pair, fuse, say where the sensors disagree.
#[derive(Debug, clap::Args)]
#[command(allow_negative_numbers = true)]
#[command(after_help = "Examples:
  boresight fuse imaging/tracks.csv radar/tracks.csv -o fused.csv
  boresight fuse a.csv b.csv --register offset,rotation,time --rule independent
  boresight fuse ais.csv plots.csv --register range,azimuth                 a radar's biases, from ships' own reports
  boresight fuse imaging/detections.csv radar.csv --config track.toml      two tables of detections: one tracker takes both
  boresight fuse tracks.csv radar.csv --map-b 0.5,0,100,0,0.5,40            the radar's metres into the imager's pixels
  boresight fuse tracks.csv map.csv --map-b homography:points.csv           from points known in both frames (x,y,X,Y)
  boresight fuse a.csv b.csv --map-b affine --common 1=4,2=7                from tracks known to be common")]
pub struct Args {
    /// Tracks or detections of the first sensor: its frame of reference and clock are kept.
    a: PathBuf,
    /// Tracks or detections of the second sensor.
    b: PathBuf,
    /// The fused table.
    #[arg(short, long, default_value = "fused.csv")]
    output: PathBuf,
    /// Rule of fusion of tracks.
    #[arg(long, value_enum, default_value = "ci")]
    rule: RuleName,
    /// Level of fusion; measurements if both tables hold detections, else tracks.
    #[arg(long, value_enum)]
    level: Option<Level>,
    /// Estimate these from common targets before fusing.
    #[arg(long, value_enum, value_delimiter = ',')]
    register: Vec<Estimate>,
    /// Point of the second sensor's frame that --register rotation turns about, and where a radar stands whose table does not say it.
    #[arg(long, value_name = "X,Y", num_args = 1, value_delimiter = ',', allow_negative_numbers = true)]
    pivot: Option<Vec<f64>>,
    /// Map of the first sensor's frame into the common one: 6 numbers (affine), 9 (homography), a file of them, or
    /// `affine:POINTS`, `homography:POINTS` with a table x,y,X,Y.
    #[arg(long, value_name = "MAP")]
    map_a: Option<String>,
    /// Map of the second sensor's frame, likewise; also `affine` or `homography` alone, with --common.
    #[arg(long, value_name = "MAP")]
    map_b: Option<String>,
    /// Tracks known to be common, for --map-b: numbers of the first and the second sensor.
    #[arg(long, value_name = "A=B,...")]
    common: Option<String>,
    /// Configuration whose tracker makes tracks of detections; chosen from the table without it.
    #[arg(short, long, value_name = "FILE")]
    config: Option<PathBuf>,
    /// Largest mean squared distance of a pair of tracks (no unit).
    #[arg(long, default_value_t = 9.21)]
    gate: f64,
    /// Acceleration power density between times, px²/s³.
    #[arg(long, default_value_t = 1.0)]
    density: f64,
    /// A sensor's track is predicted at most this long, s; 2 if absent, 30 for ships' reports.
    #[arg(long)]
    max_gap: Option<f64>,
}

/// How long a track is predicted, and how far ships' reports may lie apart, s.
const MAX_GAP_S: f64 = 2.0;
const REPORTS_GAP_S: f64 = 30.0;

/// Runs the command.
pub fn run(args: Args) -> anyhow::Result<ExitCode> {
    let gap = args.max_gap.unwrap_or(MAX_GAP_S);
    for (key, value) in [("--gate", args.gate), ("--density", args.density), ("--max-gap", gap)] {
        if !(value.is_finite() && value >= 0.0) {
            let e = boresight::Error::new(boresight::ErrorKind::Config, "expected a number of 0 or more");
            return Err(e.at(format!("{key} {value}")).into());
        }
    }
    if args.pivot.as_ref().is_some_and(|p| p.len() != 2 || p.iter().any(|v| !v.is_finite())) {
        let e = boresight::Error::new(boresight::ErrorKind::Config, "expected two numbers").at("--pivot");
        return Err(e.hint("--pivot 0,0 turns about the origin").into());
    }
    refuse_inputs(&args)?;
    let config = args.config.as_deref().map(Config::from_file).transpose()?;
    let (a, mut b) = sensors(&args, gap, config.as_ref())?;
    let wanted = |e| args.register.contains(&e);
    let max_gap_s = args.max_gap.unwrap_or(if a.is_reports { REPORTS_GAP_S } else { MAX_GAP_S });
    if wanted(Estimate::Range) || wanted(Estimate::Azimuth) {
        let what = [wanted(Estimate::Range), wanted(Estimate::Azimuth)];
        radar::register(&a, &mut b, what, args.pivot.as_deref(), max_gap_s, config.as_ref())?;
    }
    let further = [Estimate::Offset, Estimate::Rotation, Estimate::Time].into_iter().any(wanted);
    let registration = further.then(|| RegistrationConfig {
        offset: wanted(Estimate::Offset),
        rotation: wanted(Estimate::Rotation),
        time: wanted(Estimate::Time),
        pivot_px: args.pivot.as_deref().and_then(|p| p.first_chunk().copied()),
    });
    let rule = match args.rule {
        RuleName::Independent => Rule::Independent,
        RuleName::Ci => Rule::CovarianceIntersection,
        RuleName::Ici => Rule::InverseCovarianceIntersection,
    };
    let fuse_config =
        FuseConfig { rule, gate: args.gate, density: args.density, max_gap_s, registration, ..FuseConfig::default() };
    let fused = fuse_tables(&a.tracks, &b.tracks, &fuse_config)?;
    if registration.is_some() {
        say_registration(&fused.registration);
    }
    let level = args.level.unwrap_or(match (&a.scans, &b.scans) {
        (Some(_), Some(_)) => Level::Measurements,
        _ => Level::Tracks,
    });
    fused.warnings.iter().for_each(|w| say!("warning: {w}"));
    let frames = match (level, &a.scans, &b.scans) {
        (Level::Tracks, ..) => fused.frames,
        (Level::Measurements, Some(x), Some(y)) => together(&a, x, y, &fused.registration, config.as_ref())?,
        (Level::Measurements, ..) => {
            let e = boresight::Error::new(boresight::ErrorKind::Config, "both tables must hold detections");
            return Err(e.at("--level measurements").hint("tracks are fused with --level tracks").into());
        }
    };
    let times: Vec<f64> = frames.iter().map(|(t, _)| *t).collect();
    let (numbers, own) = a.number(&times);
    if !own {
        say!("note: the times are not all frames of the first sensor: frames are numbered anew, compare by time_s");
    }
    let unit = [&a, &b].into_iter().find_map(|s| s.radar.as_ref()).map(|r| r.unit).unwrap_or_default();
    write(&args.output, &frames, &numbers, unit)?;
    say!(
        "{} + {} tracks, {} paired; {} at {} times: {}",
        a.tracks.len(),
        b.tracks.len(),
        fused.pairs.len(),
        if level == Level::Tracks { "tracks fused" } else { "measurements fused" },
        frames.len(),
        args.output.display()
    );
    Ok(ExitCode::SUCCESS)
}

/// Refuses an output in the place of a table, a map or the configuration.
fn refuse_inputs(args: &Args) -> boresight::Result<()> {
    let maps = [&args.map_a, &args.map_b].into_iter().flatten();
    let maps = maps.map(|m| Path::new(m.split_once(':').map_or(m.as_str(), |(_, points)| points)));
    let mut inputs = [&args.a, &args.b].into_iter().chain(&args.config).map(PathBuf::as_path).chain(maps);
    inputs.try_for_each(|i| boresight::io::refuse_to_overwrite(i, [args.output.as_path()]))
}

/// Reads both sensors into the common frame.
fn sensors(args: &Args, max_gap_s: f64, config: Option<&Config>) -> anyhow::Result<(Sensor, Sensor)> {
    let spec = |text: &Option<String>| text.as_deref().map(MapSpec::read).transpose();
    let known = match spec(&args.map_a)? {
        None => PlaneMap::IDENTITY,
        Some(MapSpec::Known(map)) => map,
        Some(MapSpec::FromTracks(_)) => {
            let e = boresight::Error::new(boresight::ErrorKind::Config, "only the second sensor's map is estimated");
            return Err(e.at("--map-a").hint("swap the tables, or give --map-b").into());
        }
    };
    let a = input::read(&args.a, config, &known)?;
    let b = match spec(&args.map_b)? {
        None => input::read(&args.b, config, &PlaneMap::IDENTITY)?,
        Some(MapSpec::Known(map)) => input::read(&args.b, config, &map)?,
        Some(MapSpec::FromTracks(kind)) => {
            let raw: Vec<Timeline> = input::read(&args.b, config, &PlaneMap::IDENTITY)?.tracks;
            let pairs = args.common.as_deref().map_or(Ok(Vec::new()), input::common_tracks)?;
            let map = input::map_from_tracks(kind, &a.tracks, &raw, &pairs, max_gap_s)?;
            input::read(&args.b, config, &map)?
        }
    };
    Ok((a, b))
}

/// One tracker takes both sensors' detections.
fn together(
    a: &Sensor,
    x: &[Scan],
    y: &[Scan],
    registration: &Registration,
    config: Option<&Config>,
) -> boresight::Result<Vec<(f64, Vec<TrackState>)>> {
    // The maps are in the detections already.
    let plain = |scans, registration| SensorScans { scans, map: PlaneMap::IDENTITY, registration };
    let (scans, _) = merge_scans(&[plain(x, Registration::IDENTITY), plain(y, *registration)]);
    let config = input::tracker_of(&scans, a.rate_hz, a.radar.as_ref().map(|r| (r.turn_s, r.unit)), config);
    // Of several scans of one time the last one's tracks have taken all of them.
    let mut frames: Vec<(f64, Vec<TrackState>)> = Vec::new();
    for (time_s, tracks) in input::run_tracker(&config, &scans)? {
        match frames.last_mut() {
            Some((t, last)) if *t == time_s => *last = tracks,
            _ => frames.push((time_s, tracks)),
        }
    }
    Ok(frames)
}

fn write(path: &Path, frames: &[(f64, Vec<TrackState>)], numbers: &[u64], unit: LengthUnit) -> boresight::Result<()> {
    let mut out = TracksCsv::create(path)?.with_unit(unit);
    for (k, (time_s, tracks)) in numbers.iter().zip(frames) {
        let scan = Scan::at(FrameIndex(*k), Timestamp::from_secs_f64(*time_s));
        out.put(&View { frame: None, scan: &scan, tracks })?;
    }
    Box::new(out).finish()
}

fn say_registration(r: &Registration) {
    say!(
        "registration from {} common points: offset ({:.3} ± {:.3}, {:.3} ± {:.3}) px, rotation {:.5} ± {:.5} rad about ({:.1}, {:.1}), second clock ahead by {:.4} ± {:.4} s; mean d² {:.2} -> {:.2}",
        r.n_points,
        r.offset_px[0],
        r.std[0],
        r.offset_px[1],
        r.std[1],
        r.rotation_rad,
        r.std[2],
        r.centre_px[0],
        r.centre_px[1],
        r.time_s,
        r.std[3],
        r.mean_d2[0],
        r.mean_d2[1]
    );
}
