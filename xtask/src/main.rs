//! Repository chores: `cargo xtask <NAME>`.

mod video_check;

use clap::{Parser, Subcommand};

#[derive(Parser)]
struct Cli {
    #[command(subcommand)]
    chore: Chore,
}

#[derive(Subcommand)]
enum Chore {
    /// Compare decoded video with ffmpeg's frames, live.
    VideoCheck(video_check::Args),
}

fn main() -> anyhow::Result<()> {
    match Cli::parse().chore {
        Chore::VideoCheck(args) => video_check::run(&args),
    }
}
