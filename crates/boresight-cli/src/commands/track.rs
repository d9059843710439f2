//! `boresight track`: frames (or detections) in, tracks out.

use super::also;
use super::command_line;
use super::run_folder::RunFolder;
use super::run_options::{self, InputArgs, Plan, TrackerArgs};
use super::run_outcome;
use super::run_summary::RunSummary;
use super::stop::Stop;
use super::video_scale::{self, VideoScale};
use crate::console::say;
use crate::progress;
use boresight::draw::{AnnotatedVideo, Colours, DrawOptions, PngFolder, SteadyView, Thumbnail};
use boresight::io::LengthUnit;
use boresight::io::video::Mp4Options;
use boresight::pipeline::{self, Input, Outcome, Summary};
use boresight::report::{HtmlReport, Notes};
use boresight::verdict::Observed;
use boresight::{Error, ErrorKind, Sink, track};
use std::ffi::{OsStr, OsString};
use std::path::PathBuf;
use std::process::ExitCode;
use std::time::{Duration, Instant};

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
  boresight track det/det.txt --frames img1/
      the same, drawn on its pictures
  boresight track flight.mp4 --also geff,cvat
      also for napari and CVAT
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
    /// Pictures of a table of detections, to draw on: a folder, a quoted pattern or a video. MOTChallenge's frame 1 is 000001.jpg.
    #[arg(long, value_name = "INPUT")]
    frames: Option<OsString>,
    /// Write only rows in which something was measured to the tables of tracks, no predicted ones.
    #[arg(long)]
    measured: bool,
    /// Write no annotated video.
    #[arg(long)]
    no_video: bool,
    /// Size of the annotated video beside the frames': 1, 2 to 8 times, or 1/2 to 1/32; absent, small frames are enlarged until they can be read, and those of more than 1280 x 720 pixels
    /// reduced, by a whole number.
    #[arg(long, value_name = "SCALE", value_parser = video_scale::parse, conflicts_with = "no_video")]
    video_scale: Option<VideoScale>,
    /// Write no report.
    #[arg(long)]
    no_report: bool,
    /// Also write the annotated frames as PNG files to DIR/frames.
    #[arg(long)]
    png: bool,
    /// Write the annotated video, and the frames of --png, as a camera at rest would see them: the ground of the first frame stands still.
    #[arg(long)]
    steady: bool,
    /// Also write every frame's tracks as JSON lines to DIR/tracks.jsonl.
    #[arg(long)]
    json: bool,
    /// Also write how the camera moved, frame by frame with its covariance, to DIR/camera.csv.
    #[arg(long)]
    camera: bool,
    /// Also write counts, verdict and warnings to DIR/summary.json.
    #[arg(long)]
    summary: bool,
    /// Also write a small picture, the first of the frames with the most tracks, to DIR/thumbnail.png.
    #[arg(long)]
    thumbnail: bool,
    /// Also write the confirmed tracks for other programs: geff, trackmate-xml, cvat, mot-zip, napari, mcap, vmti, parquet ..
    #[arg(long, value_name = "FORMATS", value_delimiter = ',', value_parser = also::file_name())]
    also: Vec<&'static str>,
    /// End at once when standard input ends: for a program that starts this one and may be killed.
    #[arg(long, hide = true)]
    end_with_stdin: bool,
}

impl Args {
    /// The file of the configuration that is asked for.
    pub fn configuration(&self) -> Option<&std::path::Path> {
        self.input.config.as_deref()
    }
}

/// Runs the command.
pub fn run(args: Args) -> anyhow::Result<ExitCode> {
    if args.end_with_stdin {
        super::stop::end_with_stdin();
    }
    let input = args.input.input.as_os_str();
    let dir = args.output.clone().unwrap_or_else(|| run_options::default_folder(input, "tracks"));
    let mut folder = RunFolder::new(dir, made(&args), input)?;
    if let Some(frames) = &args.frames {
        folder.spares(frames)?;
    }
    let stop = Stop::on_signal()?;
    let opened = Instant::now();
    let plan = run_options::plan(&args.input, &args.tracker, args.frames.as_deref())?;
    let looked = opened.elapsed();
    if matches!(plan.input, Input::Scans(..)) {
        folder.leave_out(&["annotated.mp4", "frames/", "thumbnail.png"]);
    }
    let unit = plan.unit;
    if plan.radar.is_some() || unit == LengthUnit::Metre {
        folder.leave_out(&["mot.txt"]);
    }
    if let (LengthUnit::Metre, Some(name)) = (unit, args.also.first()) {
        let e = Error::new(ErrorKind::Config, "these formats hold pixels, and these tracks are in metres");
        return Err(e.at(format!("--also ({name})")).hint("leave it out: tracks.csv names its units").into());
    }
    folder.make()?;
    let tracking = track::build(&plan.config.tracker)?;
    let mut report = (!args.no_report)
        .then(|| HtmlReport::create(folder.path("report.html")))
        .transpose()?
        .map(|r| r.with_unit(unit));
    if let Some(radar) = &plan.radar {
        report = report.map(|r| r.with_map(radar.clone()));
    }
    let mut observed = plan.info.as_ref().map_or_else(Observed::default, |i| Observed::of_frames(i.width, i.height));
    let mut sinks: Vec<Box<dyn Sink + '_>> = sinks(&folder, &plan, &args, unit)?;
    if let Some(report) = &mut report {
        sinks.push(Box::new(report.sink()));
    }
    sinks.push(Box::new(observed.sink()));
    let mut notes = notes(&args, &plan)?;
    let size_px = plan.info.as_ref().map(|i| [i.width as u32, i.height as u32]);
    let settings = plan.config.clone();
    let config = folder.begin_config(&plan, input)?;
    let quiet = args.input.quiet;
    if !quiet {
        plan.reasons.iter().for_each(|r| say!("  {r}"));
    }
    let bar = progress::bar(plan.total(), "frames");
    let started = Instant::now();
    stop.run_begins();
    let mut done = pipeline::run_on(args.input.threads, plan.input, Some(tracking), sinks, &mut |so_far| {
        bar.set_position(so_far.frames);
        stop.go_on()
    });
    bar.finish_and_clear();
    let verdict = observed.verdict(&settings, &done.summary);
    let next = verdict.next.clone().filter(|options| can_be_added(&args, options));
    let can_be_looked_at = args.input.config.is_none() && is_on_disk(input);
    let look = (verdict.is_to_be_looked_at && can_be_looked_at)
        .then(|| format!("boresight preview {}", command_line::os_word(input)));
    let warnings: Vec<String> = plan.lost.iter().chain(&done.summary.warnings).cloned().collect();
    if done.summary.frames > 0 {
        notes.warnings = warnings.clone();
        notes.verdict = Some((verdict.sentence.clone(), verdict.is_doubtful));
        notes.next = next.clone();
        notes.look = look.clone();
        add_outcome(&mut notes, &done);
        if let Some(report) = report {
            done.unwritten.extend(report.write(&notes).err());
        }
        // An earlier run's table may still stand under the name of one that failed.
        let failed = |e: &boresight::Error| e.place().is_some_and(|place| place.contains("tracks.csv"));
        if !done.unwritten.iter().any(failed) {
            done.unwritten.extend(also::write(&folder, &args.also, size_px, quiet));
        }
        if folder.makes("summary.json") {
            let told =
                RunSummary::new(&input.to_string_lossy(), &done.summary, &verdict, next.as_deref(), &notes.warnings);
            done.unwritten.extend(told.write(&folder.path("summary.json")).err());
        }
        match config.finish(&notes.warnings) {
            Ok(left_over) if done.unwritten.is_empty() => left_over.remove(),
            Ok(_) => {}
            Err(e) => done.unwritten.push(e),
        }
    }
    if !quiet {
        print_summary(&done.summary, looked, started.elapsed());
    }
    warnings.iter().for_each(|w| say!("warning: {w}"));
    if !quiet && done.summary.frames > 0 {
        say!("results: {}", folder.dir().display());
        say!("verdict: {}{}", if verdict.is_doubtful { "doubtful: " } else { "" }, verdict.sentence);
        if let Some(next) = next {
            say!("try next: {}", command_line::given_with(&next));
        }
        if let Some(look) = look {
            say!("or look:  {look}");
        }
    }
    run_outcome::outcome(input, done)
}

/// Whether an input is frames on disk.
fn is_on_disk(input: &OsStr) -> bool {
    let says = |what: fn(&str) -> bool| input.to_str().is_some_and(what);
    let on_disk = std::path::Path::new(input).exists() && !says(|t| t.starts_with("/dev/"));
    (on_disk || says(|t| t.contains('*') && !t.contains("://"))) && !boresight::io::is_table(input)
}

/// Whether these options may stand beside those given.
fn can_be_added(args: &Args, options: &str) -> bool {
    let of_choice = args.input.config.is_none();
    if options.starts_with("--detector") {
        of_choice
            && args.input.detector.is_none()
            && args.input.candidate.is_none()
            && !boresight::io::is_table(&args.input.input)
    } else if options.starts_with("--false-tracks-per-hour") {
        of_choice && args.tracker.false_tracks_per_hour.is_none()
    } else {
        true
    }
}

/// The files that a run with frames makes.
fn made(args: &Args) -> Vec<&'static str> {
    let asked = [
        ("tracks.csv", true),
        ("detections.csv", true),
        ("mot.txt", true),
        ("tracks.jsonl", args.json),
        ("camera.csv", args.camera),
        ("annotated.mp4", !args.no_video),
        ("frames/", args.png),
        ("report.html", !args.no_report),
        ("summary.json", args.summary),
        ("thumbnail.png", args.thumbnail),
        ("config.toml", true),
    ];
    asked.into_iter().filter_map(|(name, asked)| asked.then_some(name)).chain(args.also.iter().copied()).collect()
}

fn sinks(folder: &RunFolder, plan: &Plan, args: &Args, unit: LengthUnit) -> boresight::Result<Vec<Box<dyn Sink>>> {
    use boresight::io::{CameraCsv, DetectionsCsv, JsonLines, MeasuredOnly, MotWriter, TracksCsv};
    let with_fits = plan.config.detector.centroid.fit.is_some();
    let input = args.input.input.as_os_str();
    let of_tracks = |sink: Box<dyn Sink>| if args.measured { Box::new(MeasuredOnly::new(sink)) } else { sink };
    let mut sinks: Vec<Box<dyn Sink>> = vec![
        of_tracks(Box::new(TracksCsv::create(folder.path("tracks.csv"))?.with_unit(unit))),
        Box::new(
            DetectionsCsv::create(folder.path("detections.csv"))?
                .with_fits(with_fits)
                .with_ages(plan.radar.is_some())
                .with_unit(unit),
        ),
    ];
    if folder.makes("mot.txt") {
        sinks.push(of_tracks(Box::new(MotWriter::create(folder.path("mot.txt"))?)));
    }
    if folder.makes("tracks.jsonl") {
        sinks.push(of_tracks(Box::new(JsonLines::create(folder.path("tracks.jsonl"))?.with_unit(unit))));
    }
    if folder.makes("camera.csv") {
        sinks.push(Box::new(CameraCsv::create(folder.path("camera.csv"))?));
    }
    if folder.makes("annotated.mp4") {
        let path = folder.path("annotated.mp4");
        let coded = Mp4Options { still_as_before: true, ..Mp4Options::default() };
        let video = AnnotatedVideo::create(path, video_scale::drawn(args.video_scale), coded)?;
        sinks.push(match args.steady {
            true => Box::new(SteadyView::new(Box::new(video)).with_colours(colours(plan, input))),
            false => Box::new(video.with_colours(colours(plan, input))),
        });
    }
    if folder.makes("frames/") {
        let pictures = PngFolder::create(folder.path("frames/"), DrawOptions::default())?;
        sinks.push(match args.steady {
            true => Box::new(SteadyView::new(Box::new(pictures)).with_colours(colours(plan, input))),
            false => Box::new(pictures.with_colours(colours(plan, input))),
        });
    }
    if folder.makes("thumbnail.png") {
        sinks.push(Box::new(Thumbnail::create(folder.path("thumbnail.png"), DrawOptions::default())?));
    }
    Ok(sinks)
}

/// The colours of a file that is detected in as grey, unless it is asked for as grey or mended.
fn colours(plan: &Plan, input: &OsStr) -> Option<Colours> {
    use boresight::{PixelKind, io::Colour, io::OpenOptions};
    let own = &plan.config.input;
    let is_grey = plan.info.as_ref().is_some_and(|i| i.kind != PixelKind::Rgb8);
    if !is_grey || own.colour == Colour::Gray || own.sensor.is_active() || !is_on_disk(input) {
        return None;
    }
    let options = OpenOptions { colour: Colour::Rgb, ..own.open_options() };
    boresight::io::open(input, &options).ok().and_then(Colours::of)
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
        input: args.input.input.to_string_lossy().into_owned(),
        facts,
        settings: plan.reasons.clone(),
        configuration: Some(plan.config.to_toml()?),
        ..Default::default()
    })
}

/// Adds what is known only at the end.
fn add_outcome(notes: &mut Notes, done: &Outcome) {
    // The times of the stages are said, not written: the same input gives the same report.
    if let Some(error) = &done.broken {
        notes.warnings.push(format!("The input broke off: {error}"));
    }
    if done.summary.interrupted {
        notes.warnings.push("The run was interrupted; the results end there.".to_string());
    }
    notes.warnings.extend(done.unwritten.iter().map(|e| format!("An output is missing: {e}")));
}

/// A number with its thing, in the plural where it is not one.
fn counted(n: u64, thing: &str) -> String {
    format!("{n} {thing}{}", if n == 1 { "" } else { "s" })
}

/// The summary on the terminal; `looked` is the time that opening and the choice took, in which the first frames are read and detected already.
fn print_summary(s: &Summary, looked: Duration, run: Duration) {
    let per_frame = |d: Duration| 1e3 * d.as_secs_f64() / s.frames.max(1) as f64;
    say!(
        "{} ({:.1} s), {}, {} (at most {} at once)",
        counted(s.frames, "frame"),
        s.duration_s,
        counted(s.detections, "detection"),
        counted(s.confirmed_tracks, "confirmed track"),
        s.most_at_once
    );
    if let Some(fits) = run_outcome::fits(s) {
        say!("{fits}");
    }
    if let Some((nis, n)) = s.mean_nis {
        say!("mean NIS {nis:.2} over {n} updates (2 for a filter whose uncertainty is honest)");
    }
    say!(
        "{:.1} frames/s in all; {:.2} s to open and choose, then for each frame {:.2} ms to read, {:.2} to detect, {:.2} to track, {:.2} to write",
        s.frames as f64 / (looked + run).as_secs_f64().max(1e-9),
        looked.as_secs_f64(),
        per_frame(s.times.read),
        per_frame(s.times.detect),
        per_frame(s.times.track),
        per_frame(s.times.write)
    );
}
