//! `boresight preview`: a page to choose the detector by looking.

use super::command_line;
use crate::console::say;
use boresight::{Config, auto};
use std::ffi::OsString;
use std::path::PathBuf;
use std::process::ExitCode;

/// Arguments of `boresight preview`.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  boresight preview flight.mp4
      twelve moments of the whole file with what each detector finds there, and the command that runs it, on flight.preview.html
  boresight track flight.mp4 --candidate 2
      tracks with the second of them
  boresight preview frames/ --rate-hz 100 -o look.html
      a folder of images")]
pub struct Args {
    /// A video, a folder or glob of images, an image stack.
    #[arg(value_name = "INPUT")]
    input: OsString,
    /// The page; INPUT's name with `.preview.html` if absent.
    #[arg(short, long, value_name = "FILE")]
    output: Option<PathBuf>,
    /// Rate of inputs without times of their own, frames/s.
    #[arg(long, value_name = "HZ")]
    rate_hz: Option<f64>,
    /// Change how the input is read: `input.raw={width=640,height=512,pixel="u16-le"}`. Can be repeated.
    #[arg(long = "set", value_name = "KEY=VALUE")]
    sets: Vec<String>,
    /// Threads to look on; all the machine has if absent. The page is the same for any number.
    #[arg(long, value_name = "N")]
    threads: Option<std::num::NonZeroUsize>,
    /// Print nothing but errors.
    #[arg(short, long)]
    quiet: bool,
}

/// Runs the command.
/// # Errors
/// An input that cannot be read, or is a stream; a page that cannot be written.
pub fn run(args: Args) -> anyhow::Result<ExitCode> {
    let output = args.output.clone().unwrap_or_else(|| super::run_options::default_folder(&args.input, "preview.html"));
    boresight::io::refuse_to_overwrite(&args.input, [output.as_path()])?;
    let mut base = args.sets.iter().try_fold(Config::default(), |c, set| c.with(set))?;
    let mut command = format!("boresight track {}", command_line::os_word(&args.input));
    if let Some(rate) = args.rate_hz {
        base = base.with(&format!("input.rate-hz={rate}"))?;
        command.push_str(&format!(" --rate-hz {rate}"));
    }
    for set in &args.sets {
        command.push_str(&format!(" --set {}", command_line::word(set)));
    }
    let request = auto::Request { threads: args.threads, ..auto::Request::default() };
    let sheet = auto::preview(&args.input, &base, &request, &command)?;
    boresight::io::write_whole(&output, sheet.html().as_bytes())?;
    if !args.quiet {
        for row in &sheet.rows {
            match (&row.refusal, row.gain) {
                (None, Some(gain)) => {
                    say!(
                        "{} {:>26}: {:.3} detections a frame, evidence of motion {gain:.0} nats",
                        row.number,
                        row.name,
                        row.per_frame
                    )
                }
                (why, _) => say!("{} {:>26}: {}", row.number, row.name, why.as_deref().unwrap_or("nothing to show")),
            }
        }
        say!("page: {}", output.display());
    }
    Ok(ExitCode::SUCCESS)
}
