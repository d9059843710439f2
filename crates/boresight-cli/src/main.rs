//! The command `boresight`: image sequences in, tracks one can trust out.
// They panic where nothing can be written: `console` says and prints.
#![deny(clippy::print_stderr, clippy::print_stdout)]

mod commands;
mod console;
mod exit;
mod frame_writer;
mod progress;
mod stdout_at_start;

use clap::{Parser, Subcommand};
use std::process::ExitCode;

/// Turns image sequences into tracks one can trust.
#[derive(Debug, Parser)]
#[command(name = "boresight", version, about, long_about = None, max_term_width = 110, after_help = exit::HELP)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Track what moves in a video, an image sequence or a table of detections.
    Track(commands::track::Args),
    /// Track what a camera or a stream shows while it happens: on a page, on a wire, in a record.
    #[cfg(feature = "live")]
    Live(Box<commands::live::Args>),
    /// See what each detector finds in an input, on one page, before anything is run.
    Preview(commands::preview::Args),
    /// Track many videos, each in a process of its own; go on after a kill; verify.
    Batch(commands::batch::Args),
    /// Detect what stands out in a video or an image sequence.
    Detect(commands::detect::Args),
    /// Score tracks, detections or centroids against a truth.
    Evaluate(Box<commands::evaluate::Args>),
    /// Fuse the tracks of two sensors into one table.
    Fuse(commands::fuse::Args),
    /// Smooth a table of tracks: each row given all the others.
    Smooth(commands::smooth::Args),
    /// Join fragments of tracks after gaps; smooth them.
    Stitch(commands::stitch::Args),
    /// Convert tables of tracks between formats.
    Convert(commands::convert::Args),
    /// Print, check and explain configurations.
    Config(commands::config::Args),
    /// Reproduce the papers' tables and figures.
    Reproduce(commands::reproduce::Args),
    /// Measure gain, noise and defects of the sensor behind frames.
    Sensor(commands::sensor::Args),
    /// Simulate a scene: frames and their truth.
    Simulate(commands::simulate::Args),
    /// Write completions for a shell, or the manual page.
    Completions(commands::completions::Args),
}

fn main() -> ExitCode {
    let cli = match Cli::try_parse() {
        Ok(cli) => cli,
        Err(words) => return exit::usage(&words),
    };
    let outcome = match cli.command {
        Command::Track(args) => commands::track::run(args),
        #[cfg(feature = "live")]
        Command::Live(args) => commands::live::run_live(&args),
        Command::Preview(args) => commands::preview::run(args),
        Command::Batch(args) => commands::batch::run(args),
        Command::Detect(args) => commands::detect::run(args),
        Command::Evaluate(args) => commands::evaluate::run(*args),
        Command::Fuse(args) => commands::fuse::run(args),
        Command::Smooth(args) => commands::smooth::run(args),
        Command::Stitch(args) => commands::stitch::run(args),
        Command::Convert(args) => commands::convert::run(args),
        Command::Config(args) => commands::config::run(&args),
        Command::Reproduce(args) => commands::reproduce::run(args),
        Command::Sensor(args) => commands::sensor::run(args),
        Command::Simulate(args) => commands::simulate::run(args),
        Command::Completions(args) => commands::completions::run::<Cli>(&args),
    };
    outcome.unwrap_or_else(|error| exit::report(&error))
}
