//! The command `boresight`: image sequences in, tracks one can trust out.

mod commands;
mod exit;
#[allow(dead_code)] // used by simulate
mod frame_writer;
#[allow(dead_code)] // used by the commands that follow
mod progress;

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
    /// Write completions for a shell, or the manual page.
    Completions(commands::completions::Args),
}

fn main() -> ExitCode {
    let cli = Cli::parse();
    let outcome = match cli.command {
        Command::Completions(args) => commands::completions::run::<Cli>(&args),
    };
    outcome.unwrap_or_else(|error| exit::report(&error))
}
