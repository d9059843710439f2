//! `boresight simulate`: frames and truth of a simulated scene to disk.

use crate::frame_writer::{FrameFormat, FrameWriter};
use crate::progress;
use boresight::io::tables::{Output, TracksCsv, mot_box_of_extent};
use boresight::sim::{SceneConfig, SceneSource, Seed, named, scene::Background};
use boresight::{Error, ErrorKind, FrameSource, Scan, Sink, View};
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// Simulate a scene: frames, and the truth in the formats that `track` and `evaluate` read.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  boresight simulate ds2 --seed 1 -o sim           data set II of the thesis: sim/frames/*.png, sim/truth.csv, sim/gt.txt
  boresight simulate scene.toml -o sim             a scene of your own (`--print` shows one to start from)
  boresight simulate ds2 -o - | boresight track -  straight into the tracker (YUV4MPEG2 on standard output)
Scenes by name: ds1, ds2, ds3, d3-s1, d3-s2, lms-sines, lms-singer, montecarlo.")]
pub struct Args {
    /// Name of a scene, or a TOML file.
    scene: String,
    /// Seed: the same seed gives the same bits.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Number of the Monte Carlo run of that seed.
    #[arg(long, default_value_t = 0)]
    run: u64,
    /// Number of frames, instead of the scene's own.
    #[arg(long)]
    frames: Option<u64>,
    /// Folder for the result; `-` streams the frames (YUV4MPEG2) to standard output without truth.
    #[arg(short, long, default_value = "simulated")]
    output: PathBuf,
    /// How frames are written.
    #[arg(long, value_enum, default_value = "png")]
    format: FrameFormat,
    /// Print the scene as TOML and stop.
    #[arg(long)]
    print: bool,
}

/// Runs the command.
pub fn run(args: Args) -> anyhow::Result<ExitCode> {
    let seed = Seed::new(args.seed).of_run(args.run);
    let mut scene = read_scene(&args.scene, seed)?;
    if let Some(n) = args.frames {
        scene.n_frames = n;
    }
    if args.print {
        super::print(toml::to_string(&scene)?.as_bytes())?;
        return Ok(ExitCode::SUCCESS);
    }
    let mut source = build(&scene, seed)?;
    if args.output == Path::new("-") {
        let mut writer = FrameWriter::stream(Box::new(std::io::BufWriter::new(std::io::stdout())), source.info())?;
        while let Some(frame) = source.next_frame()? {
            writer.put(&frame)?;
            source.recycle(frame);
        }
        writer.finish()?;
        return Ok(ExitCode::SUCCESS);
    }
    let dir = &args.output;
    std::fs::create_dir_all(dir)
        .map_err(|e| Error::new(ErrorKind::Output, "the folder cannot be made").at(dir.display()).because(e))?;
    let write = |name: &str, text: &str| {
        let path = dir.join(name);
        std::fs::write(&path, text)
            .map_err(|e| Error::new(ErrorKind::Output, "cannot be written").at(path.display()).because(e))
    };
    let mut frames = FrameWriter::create(dir, args.format, source.info())?;
    let mut truth = TracksCsv::to(Output::file(dir.join("truth.csv"))?)?;
    let (mut gt, mut times) = (String::new(), String::from("frame,time_s\n"));
    let bar = progress::bar(Some(scene.n_frames), "frames");
    let (mut n_frames, mut n_boxes) = (0u64, 0usize);
    while let Some(frame) = source.next_frame()? {
        frames.put(&frame)?;
        let scan = Scan { index: frame.index, time: frame.time, ..Scan::default() };
        truth.put(&View { frame: None, scan: &scan, tracks: source.truth() })?;
        for t in source.truth() {
            let [l, top, w, h] = mot_box_of_extent(&t.extent);
            writeln!(gt, "{},{},{l},{top},{w},{h},1,1,{}", frame.index.0 + 1, t.id.0, t.score)?;
        }
        writeln!(times, "{},{}", frame.index.0, frame.time.as_secs_f64())?;
        n_frames += 1;
        n_boxes += source.truth().len();
        source.recycle(frame);
        bar.inc(1);
    }
    bar.finish_and_clear();
    frames.finish()?;
    Box::new(truth).finish()?;
    write("gt.txt", &gt)?;
    write("frames.csv", &times)?;
    write("scene.toml", &toml::to_string(&scene)?)?;
    eprintln!(
        "{}: {n_frames} frames of {} x {} px at {} frames/s, {n_boxes} truth positions, seed {} run {}\n  {}",
        args.scene,
        source.info().width,
        source.info().height,
        scene.rate_hz,
        args.seed,
        args.run,
        ["frames", "truth.csv", "gt.txt", "frames.csv", "scene.toml"]
            .map(|f| dir.join(f).display().to_string())
            .join("\n  ")
    );
    Ok(ExitCode::SUCCESS)
}

/// A named scene or a file.
fn read_scene(name: &str, seed: Seed) -> boresight::Result<SceneConfig> {
    if !Path::new(name).is_file() {
        return named(name, seed);
    }
    let text = std::fs::read_to_string(name)
        .map_err(|e| Error::new(ErrorKind::NotFound, "cannot be read").at(name).because(e))?;
    SceneConfig::from_toml(&text).map_err(|e| e.at(name))
}

/// Starts the scene, over its background file if it has one.
fn build(scene: &SceneConfig, seed: Seed) -> boresight::Result<SceneSource> {
    match &scene.background {
        Background::File(path) => {
            let options = boresight::io::OpenOptions { rate_hz: scene.rate_hz, ..Default::default() };
            scene.build_over(seed, boresight::io::open(path, &options)?)
        }
        _ => scene.build(seed),
    }
}
