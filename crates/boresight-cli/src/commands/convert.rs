//! `boresight convert`: a table of tracks from one format into another, saying what is lost.

use boresight::io::tracks::{Format, ReadOptions, read, write};
use boresight::{Error, ErrorKind};
use std::path::PathBuf;
use std::process::ExitCode;

/// Converts a table of tracks into another format.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The table: MOTChallenge, KITTI, CSV with named columns, or a Cell Tracking Challenge folder.
    input: PathBuf,
    /// Where to write; - is standard output.
    output: PathBuf,
    /// Format to write.
    #[arg(long, value_parser = super::evaluate::format)]
    to: Format,
    /// Format of the input, if its look deceives.
    #[arg(long, value_parser = super::evaluate::format)]
    from: Option<Format>,
    /// Leave out malformed rows and count them.
    #[arg(long)]
    skip_bad_rows: bool,
    /// Keep rows of boresight's tables whose status is tentative.
    #[arg(long)]
    tentative: bool,
    /// Frames of a MOTChallenge input count from 0 in the file.
    #[arg(long)]
    from_zero: bool,
    /// Fail if anything would be lost.
    #[arg(long)]
    lossless: bool,
}

/// Runs the command.
/// # Errors
/// An input that cannot be read; an output that cannot be written; a loss where none is allowed.
pub fn run(args: Args) -> anyhow::Result<ExitCode> {
    let options = ReadOptions { skip_bad_rows: args.skip_bad_rows, keep_extra: true, frames_from_zero: args.from_zero };
    let file = read(&args.input, args.from, options, args.tentative)?;
    if let Some(first) = &file.bad.first {
        eprintln!("note: {} malformed rows left out; the first: {first}", file.bad.count);
    }
    let mut bytes = Vec::new();
    let dropped = write(&file.table, args.to, &mut bytes)?;
    if !dropped.is_empty() {
        let what = format!("{} does not hold: {}", args.to.name(), dropped.join(", "));
        if args.lossless {
            return Err(Error::new(ErrorKind::Unsupported, what)
                .at(args.input.display())
                .hint("without --lossless it is written without them")
                .into());
        }
        eprintln!("note: {what}");
    }
    if args.output.as_os_str() == "-" {
        super::print(&bytes)?;
    } else {
        std::fs::write(&args.output, &bytes)
            .map_err(|e| Error::new(ErrorKind::Output, "cannot be written").at(args.output.display()).because(e))?;
        eprintln!(
            "{} rows of {} tracks in {} frames: {} -> {}",
            file.table.n_rows(),
            file.table.n_tracks(),
            file.table.n_frames(),
            file.format.name(),
            args.to.name()
        );
    }
    Ok(ExitCode::SUCCESS)
}
