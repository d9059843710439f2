//! `boresight convert`: a table of tracks from one format into another, saying what is lost.

use crate::console::{self, say};
use boresight::io::refuse_to_overwrite;
use boresight::io::tracks::{
    Dialect, Format, ReadOptions, TrackFile, add_mass, ctc_write, measured_rows, read, write, write_path,
};
use boresight::io::{TableOptions, read_detections};
use boresight::{Error, ErrorKind, TrackTable};
use std::path::{Path, PathBuf};
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
  boresight convert out/tracks.csv p.csv --to trackpy          measured rows with mass; --predicted keeps the others
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
    /// Keep rows that were only predicted in trackpy's table, which holds measured ones.
    #[arg(long)]
    predicted: bool,
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
    let options =
        ReadOptions { skip_bad_rows: args.skip_bad_rows, keep_extra: true, first_frame: args.from_zero.then_some(0) };
    let mut file = read(&args.input, args.from, options, args.tentative)?;
    file.table.size_px = args.size.map(|(w, h)| [w as u32, h as u32]);
    if let Some(first) = &file.bad.first {
        say!("note: {} malformed rows left out; the first: {first}", file.bad.count);
    }
    if file.bad.without_track > 0 {
        say!("note: {} rows belong to no track and were left out", file.bad.without_track);
    }
    if args.to == Format::Named(Dialect::Trackpy) {
        file.table = of_trackpy(file.table, &args.input, args.predicted, false);
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

/// A run's table as trackpy would have it: measured rows, unless predicted ones are asked for, with the mass that `detections.csv` beside it says.
pub fn of_trackpy(mut table: TrackTable, path: &Path, predicted: bool, quiet: bool) -> TrackTable {
    let names_detections = (0..table.n_rows()).any(|r| table.states.detection.get(r).is_some());
    if names_detections {
        let beside = path.with_file_name("detections.csv");
        let found = read_detections(&beside, &TableOptions::default());
        let has_mass = found.is_ok_and(|d| add_mass(&mut table, &d.scans));
        if !has_mass && !quiet {
            say!("note: no column mass: {} does not say it", beside.display());
        }
    }
    if predicted {
        return table;
    }
    let measured = measured_rows(&table);
    let n = table.n_rows() - measured.n_rows();
    if n > 0 && !quiet {
        say!("note: {n} predicted rows are left out");
    }
    measured
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
