//! `boresight track`: frames (or detections) in, tracks out.

use super::run_options::{self, InputArgs, Plan, TrackerArgs};
use crate::progress;
use boresight::draw::{AnnotatedVideo, DrawOptions, PngFolder};
use boresight::io::video::Mp4Options;
use boresight::pipeline::{self, Input, Summary};
use boresight::report::{HtmlReport, Notes};
use boresight::{Sink, track};
use std::path::PathBuf;
use std::process::ExitCode;

const EXAMPLES: &str = "Examples:
  boresight track flight.mp4
      chooses everything by itself; writes tracks.csv, detections.csv, mot.txt, annotated.mp4, report.html and config.toml to flight.tracks/
  boresight track frames/ -o out --rate-hz 100
      a folder of images (also 16 bit), 100 frames/s
  boresight track flight.mp4 --config flight.tracks/config.toml
      the identical result again
  boresight track flight.mp4 --set tracker.gate-probability=0.999 --filter ud
      one parameter changed, another filter
  boresight track detections.csv --rate-hz 30
      tracks from detections made elsewhere (also MOTChallenge det.txt)
  boresight track rtsp://camera/stream --no-video
      anything an installed ffmpeg can read; end it with Ctrl-C";

/// Arguments of `boresight track`.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub struct Args {
    #[command(flatten)]
    input: InputArgs,
    #[command(flatten)]
    tracker: TrackerArgs,
    /// Folder for the results; INPUT's name with `.tracks` if absent.
    #[arg(short, long, value_name = "DIR")]
    output: Option<PathBuf>,
    /// Write no annotated video.
    #[arg(long)]
    no_video: bool,
    /// Write no report.
    #[arg(long)]
    no_report: bool,
    /// Also write the annotated frames as PNG files to DIR/frames.
    #[arg(long)]
    png: bool,
    /// Also write every frame's tracks as JSON lines to DIR/tracks.jsonl.
    #[arg(long)]
    json: bool,
    /// Also write how the camera moved, frame by frame with its covariance, to DIR/camera.csv.
    #[arg(long)]
    camera: bool,
}

/// Runs the command.
pub fn run(args: Args) -> anyhow::Result<ExitCode> {
    let plan = run_options::plan(&args.input, &args.tracker)?;
    let dir = args.output.clone().unwrap_or_else(|| run_options::default_folder(&args.input.input, "tracks"));
    run_options::make_folder(&dir)?;
    let tracking = track::build(&plan.config.tracker)?;
    let mut report = (!args.no_report).then(|| HtmlReport::create(dir.join("report.html"))).transpose()?;
    let mut sinks: Vec<Box<dyn Sink + '_>> = sinks(&args, &plan, &dir)?;
    if let Some(report) = &mut report {
        sinks.push(Box::new(report.sink()));
    }
    let mut notes = notes(&args, &plan)?;
    run_options::write_config(&dir, &plan)?;
    let quiet = args.input.quiet;
    if !quiet {
        for reason in &plan.reasons {
            eprintln!("  {reason}");
        }
    }
    let bar = progress::bar(plan.total(), "frames");
    let stop = run_options::stop_on_signal()?;
    let started = std::time::Instant::now();
    let (summary, broken) = pipeline::run(plan.input, Some(tracking), sinks, &mut |so_far| {
        bar.set_position(so_far.frames);
        run_options::go_on(&stop)
    })?;
    bar.finish_and_clear();
    if let Some(report) = report {
        add_outcome(&mut notes, &summary, broken.as_ref());
        report.write(&notes)?;
    }
    if !quiet {
        print_summary(&summary, started.elapsed().as_secs_f64(), &dir);
    }
    run_options::outcome(&summary, broken)
}

fn sinks(args: &Args, plan: &Plan, dir: &std::path::Path) -> boresight::Result<Vec<Box<dyn Sink>>> {
    use boresight::io::{CameraCsv, DetectionsCsv, JsonLines, MotWriter, TracksCsv};
    let mut sinks: Vec<Box<dyn Sink>> = vec![
        Box::new(TracksCsv::create(dir.join("tracks.csv"))?),
        Box::new(DetectionsCsv::create(dir.join("detections.csv"))?),
        Box::new(MotWriter::create(dir.join("mot.txt"))?),
    ];
    if args.json {
        sinks.push(Box::new(JsonLines::create(dir.join("tracks.jsonl"))?));
    }
    if args.camera {
        sinks.push(Box::new(CameraCsv::create(dir.join("camera.csv"))?));
    }
    let pictures = matches!(plan.input, Input::Frames(..));
    if pictures && !args.no_video {
        let path = dir.join("annotated.mp4");
        sinks.push(Box::new(AnnotatedVideo::create(path, DrawOptions::default(), Mp4Options::default())?));
    }
    if pictures && args.png {
        sinks.push(Box::new(PngFolder::create(dir.join("frames"), DrawOptions::default())?));
    }
    Ok(sinks)
}

/// What the report says of the input and the settings.
fn notes(args: &Args, plan: &Plan) -> anyhow::Result<Notes> {
    let mut facts = Vec::new();
    if let Some(info) = &plan.info {
        facts.push(("Read as".to_string(), info.reader.clone()));
        let times = if info.true_times { "the input's own" } else { "made from the nominal rate" };
        facts.push(("Times".to_string(), times.to_string()));
    }
    Ok(Notes {
        input: args.input.input.clone(),
        facts,
        settings: plan.reasons.clone(),
        configuration: Some(plan.config.to_toml()?),
        ..Default::default()
    })
}

/// Adds what is known only at the end.
fn add_outcome(notes: &mut Notes, summary: &Summary, broken: Option<&boresight::Error>) {
    let t = &summary.times;
    let stages = [("read", t.read), ("detect", t.detect), ("track", t.track), ("write", t.write)];
    notes.stages = stages.map(|(name, time)| (name.to_string(), time.as_secs_f64())).to_vec();
    notes.warnings.extend(summary.warnings.iter().cloned());
    if let Some(error) = broken {
        notes.warnings.push(format!("The input broke off: {error}"));
    }
    if summary.interrupted {
        notes.warnings.push("The run was interrupted; the results end there.".to_string());
    }
}

/// A number with its thing, in the plural where it is not one.
fn counted(n: u64, thing: &str) -> String {
    format!("{n} {thing}{}", if n == 1 { "" } else { "s" })
}

/// The summary on the terminal.
fn print_summary(s: &Summary, wall_s: f64, dir: &std::path::Path) {
    let per_frame = |d: std::time::Duration| 1e3 * d.as_secs_f64() / s.frames.max(1) as f64;
    eprintln!(
        "{} ({:.1} s), {}, {} (at most {} at once)",
        counted(s.frames, "frame"),
        s.duration_s,
        counted(s.detections, "detection"),
        counted(s.confirmed_tracks, "confirmed track"),
        s.most_at_once
    );
    if let Some((nis, n)) = s.mean_nis {
        eprintln!("mean NIS {nis:.2} over {n} updates (2 for a filter whose uncertainty is honest)");
    }
    eprintln!(
        "{:.1} frames/s; a frame took {:.2} ms to read, {:.2} to detect, {:.2} to track, {:.2} to write",
        s.frames as f64 / wall_s.max(1e-9),
        per_frame(s.times.read),
        per_frame(s.times.detect),
        per_frame(s.times.track),
        per_frame(s.times.write)
    );
    for w in &s.warnings {
        eprintln!("warning: {w}");
    }
    eprintln!("results: {}", dir.display());
}
