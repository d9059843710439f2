//! `boresight fuse`: two sensors' tracks become one table.

use boresight::fuse::{FuseConfig, RegistrationConfig, Rule, Timeline, fuse_tables, timelines};
use boresight::io::tables::{TableOptions, TracksCsv, read_tracks};
use boresight::{FrameIndex, Scan, Sink, Timestamp, View};
use std::path::PathBuf;
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
}

/// Fuse two tables of tracks (tracks.csv, MOTChallenge): register, pair, fuse, say where the sensors disagree.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  boresight fuse imaging/tracks.csv radar/tracks.csv -o fused.csv
  boresight fuse a.csv b.csv --register offset,rotation,time --rule independent")]
pub struct Args {
    /// Tracks of the first sensor: its frame of reference and clock are kept.
    a: PathBuf,
    /// Tracks of the second sensor.
    b: PathBuf,
    /// The fused table.
    #[arg(short, long, default_value = "fused.csv")]
    output: PathBuf,
    /// Rule of fusion.
    #[arg(long, value_enum, default_value = "ci")]
    rule: RuleName,
    /// Estimate these from common targets before fusing.
    #[arg(long, value_enum, value_delimiter = ',')]
    register: Vec<Estimate>,
    /// Largest mean squared distance of a pair of tracks (no unit).
    #[arg(long, default_value_t = 9.21)]
    gate: f64,
    /// Acceleration power density between times, px²/s³.
    #[arg(long, default_value_t = 1.0)]
    density: f64,
    /// A sensor's track is predicted at most this long, s.
    #[arg(long, default_value_t = 2.0)]
    max_gap: f64,
}

/// Runs the command.
pub fn run(args: Args) -> anyhow::Result<ExitCode> {
    for (key, value) in [("--gate", args.gate), ("--density", args.density), ("--max-gap", args.max_gap)] {
        if !(value.is_finite() && value >= 0.0) {
            let e = boresight::Error::new(boresight::ErrorKind::Config, "expected a number of 0 or more");
            return Err(e.at(format!("{key} {value}")).into());
        }
    }
    let read = |path: &PathBuf| -> anyhow::Result<Vec<Timeline>> {
        let table = read_tracks(path, &TableOptions::default())?;
        table.warnings.iter().for_each(|w| eprintln!("warning: {}: {w}", path.display()));
        Ok(timelines(table.frames.iter().map(|f| (f.time.as_secs_f64(), f.tracks.as_slice()))))
    };
    let (a, b) = (read(&args.a)?, read(&args.b)?);
    let wanted = |e| args.register.contains(&e);
    let registration = (!args.register.is_empty()).then(|| RegistrationConfig {
        offset: wanted(Estimate::Offset),
        rotation: wanted(Estimate::Rotation),
        time: wanted(Estimate::Time),
    });
    let rule = match args.rule {
        RuleName::Independent => Rule::Independent,
        RuleName::Ci => Rule::CovarianceIntersection,
        RuleName::Ici => Rule::InverseCovarianceIntersection,
    };
    let config = FuseConfig {
        rule,
        gate: args.gate,
        density: args.density,
        max_gap_s: args.max_gap,
        registration,
        ..FuseConfig::default()
    };
    let fused = fuse_tables(&a, &b, &config)?;
    let mut out = TracksCsv::create(&args.output)?;
    for (k, (time_s, tracks)) in fused.frames.iter().enumerate() {
        let scan = Scan { index: FrameIndex(k as u64), time: Timestamp::from_secs_f64(*time_s), ..Scan::default() };
        out.put(&View { frame: None, scan: &scan, tracks })?;
    }
    Box::new(out).finish()?;
    fused.warnings.iter().for_each(|w| eprintln!("warning: {w}"));
    if registration.is_some() {
        let r = &fused.registration;
        eprintln!(
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
    eprintln!(
        "{} + {} tracks, {} paired, {} times: {}",
        a.len(),
        b.len(),
        fused.pairs.len(),
        fused.frames.len(),
        args.output.display()
    );
    Ok(ExitCode::SUCCESS)
}
