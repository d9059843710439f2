//! `boresight detect`: frames in, detections out.

use super::run_options::{self, InputArgs, TrackerArgs};
use super::run_outcome;
use super::stop::Stop;
use crate::console::say;
use crate::progress;
use boresight::io::DetectionsCsv;
use boresight::io::Output;
use boresight::{Sink, pipeline};
use std::path::PathBuf;
use std::process::ExitCode;

/// Arguments of `boresight detect`.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  boresight detect particles.tif -o particles.csv
  boresight detect flight.mp4 -o - | head
  boresight detect flight.mp4 --set detector.threshold.local.k=6 -o flight.csv")]
pub struct Args {
    #[command(flatten)]
    input: InputArgs,
    /// The table of detections; `-` is standard output; INPUT's name with `.detections.csv` if absent.
    #[arg(short, long, value_name = "FILE")]
    output: Option<PathBuf>,
}

/// Runs the command.
pub fn run(args: Args) -> anyhow::Result<ExitCode> {
    let path = args.output.clone().unwrap_or_else(|| run_options::default_folder(&args.input.input, "detections.csv"));
    let to_stdout = path.as_os_str() == "-";
    if to_stdout {
        crate::stdout_at_start::check()?;
    } else {
        boresight::io::refuse_to_overwrite(&args.input.input, [path.as_path()])?;
    }
    let stop = Stop::on_signal()?;
    let plan = run_options::plan(&args.input, &TrackerArgs::default(), None)?;
    let sink = if to_stdout { DetectionsCsv::to(Output::stdout())? } else { DetectionsCsv::create(&path)? };
    let sink = sink.with_fits(plan.config.detector.centroid.fit.is_some()).with_unit(plan.unit);
    if !args.input.quiet {
        plan.reasons.iter().for_each(|r| say!("  {r}"));
    }
    let bar = progress::bar(plan.total(), "frames");
    let sinks: Vec<Box<dyn Sink>> = vec![Box::new(sink)];
    stop.run_begins();
    let done = pipeline::run_on(args.input.threads, plan.input, None, sinks, &mut |so_far| {
        bar.set_position(so_far.frames);
        stop.go_on()
    });
    bar.finish_and_clear();
    if !args.input.quiet {
        say!("{} frames, {} detections", done.summary.frames, done.summary.detections);
        if let Some(fits) = run_outcome::fits(&done.summary) {
            say!("{fits}");
        }
    }
    plan.lost.iter().chain(&done.summary.warnings).for_each(|w| say!("warning: {w}"));
    run_outcome::outcome(&args.input.input, done)
}
