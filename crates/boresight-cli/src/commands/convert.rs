//! `boresight convert`: a table of tracks from one format into another, saying what is lost.

use crate::console::{self, say};
use boresight::io::refuse_to_overwrite;
use boresight::io::tracks::{Format, ReadOptions, TrackFile, ctc_write, read, write, write_path};
use boresight::{Error, ErrorKind};
use std::path::PathBuf;
use std::process::ExitCode;

/// Converts a table of tracks into another format.
#[derive(Debug, clap::Args)]
#[command(
    long_about = "Converts a table of tracks into another format, and says what the other one cannot hold.\n\n\
Frames and pixels are counted as each format does (MOTChallenge from 1, all others from 0): the same place in the image \
stays the same place.",
    after_help = "Examples:
  boresight convert out/tracks.csv result.txt --to mot         for a MOTChallenge evaluation
  boresight convert 0006.txt cars.csv --to csv                 KITTI labels, all columns kept
  boresight convert spots.csv RES --to ctc --size 1024x1024    a folder of label images and res_track.txt
  boresight convert out/tracks.csv tracks.geff --to geff       a graph with covariance ellipsoids, for napari and others
  boresight convert gt.txt - --to trackpy --lossless           fails if a column would be lost"
)]
pub struct Args {
    /// The table: MOTChallenge, KITTI, CSV with named columns, or a Cell Tracking Challenge folder.
    input: PathBuf,
    /// Where to write: a file, a folder for ctc and geff, or - for standard output.
    output: PathBuf,
    /// Format to write.
    #[arg(long, value_parser = super::evaluate::written_format())]
    to: Format,
    /// Format of the input, if its look deceives.
    #[arg(long, value_parser = super::evaluate::format())]
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
    /// Size of the frames as WIDTHxHEIGHT, px, for ctc, cvat and vmti; without it they reach to the last row.
    #[arg(long, value_parser = super::evaluate::size)]
    size: Option<(f64, f64)>,
    /// Fail if anything would be lost.
    #[arg(long)]
    lossless: bool,
}

/// Runs the command.
/// # Errors
/// An input that cannot be read; an output that cannot be written; a loss where none is allowed.
pub fn run(args: Args) -> anyhow::Result<ExitCode> {
    if args.output.as_os_str() != "-" {
        refuse_to_overwrite(&args.input, [args.output.as_path()])?;
    }
    let options = ReadOptions { skip_bad_rows: args.skip_bad_rows, keep_extra: true, frames_from_zero: args.from_zero };
    let mut file = read(&args.input, args.from, options, args.tentative)?;
    file.table.size_px = args.size.map(|(w, h)| [w as u32, h as u32]);
    if let Some(first) = &file.bad.first {
        say!("note: {} malformed rows left out; the first: {first}", file.bad.count);
    }
    if file.bad.without_track > 0 {
        say!("note: {} rows belong to no track and were left out", file.bad.without_track);
    }
    let to_stdout = args.output.as_os_str() == "-";
    if args.to.is_folder() && (to_stdout || args.output.is_file()) {
        return Err(Error::new(ErrorKind::Config, format!("expected a folder: {} is several files", args.to.name()))
            .at(args.output.display())
            .into());
    }
    let mut bytes = Vec::new();
    let place = (!args.lossless).then_some(args.output.as_path());
    let dropped = match args.to {
        _ if to_stdout => write(&file.table, args.to, &mut bytes)?,
        Format::Ctc => to_ctc(&args, &file)?,
        to => write_path(&file.table, to, place)?,
    };
    if !dropped.is_empty() {
        let what = format!("{} does not hold: {}", args.to.name(), dropped.join(", "));
        if args.lossless {
            return Err(Error::new(ErrorKind::Unsupported, what)
                .at(args.input.display())
                .hint("without --lossless it is written without them")
                .into());
        }
        say!("note: {what}");
    }
    let mot = |f: Format| matches!(f, Format::Mot | Format::MotTruth);
    if mot(file.format) && args.to == Format::Kitti || file.format == Format::Kitti && mot(args.to) {
        say!("note: classes keep their numbers: 1 is a car in KITTI and a pedestrian in MOTChallenge");
    }
    if to_stdout {
        console::print(&bytes)?;
        return Ok(ExitCode::SUCCESS);
    }
    if args.lossless && args.to != Format::Ctc {
        write_path(&file.table, args.to, Some(&args.output))?;
    }
    if file.table.n_rows() == 0 {
        say!("warning: {}: the table has no rows", args.input.display());
    }
    say!(
        "{} rows of {} tracks in {} frames: {} -> {}",
        file.table.n_rows(),
        file.table.n_tracks(),
        file.table.n_frames(),
        file.format.name(),
        args.to.name()
    );
    Ok(ExitCode::SUCCESS)
}

/// Writes a folder of label images.
fn to_ctc(args: &Args, file: &TrackFile) -> boresight::Result<Vec<String>> {
    let size = args.size.map(|(w, h)| (w as usize, h as usize));
    let dropped = ctc_write::write_folder(&file.table, None, size)?;
    if args.lossless && !dropped.is_empty() {
        return Ok(dropped);
    }
    ctc_write::write_folder(&file.table, Some(&args.output), size)
}
