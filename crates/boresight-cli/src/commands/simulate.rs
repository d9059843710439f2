//! `boresight simulate`: frames, radar plots and truth of a simulated scene to disk; or radars on any table of tracks.

mod config;
mod plots;

use crate::console::{self, say};
use crate::frame_writer::{FrameFormat, FrameWriter};
use crate::progress;
use boresight::io::{
    Output, TableOptions, TracksCsv, mot_box_of_extent, read_tracks, refuse_to_overwrite, write_whole,
};
use boresight::sim::{SceneConfig, SceneSource, Seed, named, scene::Background};
use boresight::{Error, ErrorKind, FrameSource, Scan, Sink, View};
use std::ffi::{OsStr, OsString};
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// Simulate a scene: frames, and the truth in the formats that `track` and `evaluate` read.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  boresight simulate ds2 --seed 1 -o sim           data set II of the thesis: sim/frames/*.png, sim/truth.csv, sim/gt.txt
  boresight track sim/frames --config sim/track.toml -o out && boresight evaluate sim/truth.csv out/tracks.csv
  boresight simulate scene.toml -o sim             a scene of your own (`--print` shows one to start from)
  boresight simulate imager-radar -o sim              an imager and a radar: sim/frames, sim/radar.csv
  boresight simulate tracks.csv --radars radars.toml -o sim   radars that look at trajectories of your own
  boresight simulate ds2 -o - | boresight track - --config sim/track.toml -o out   straight into the tracker
Scenes by name: ds1, ds2, ds3, imager-1, imager-2, imager-radar, imager-radar-loss, lms-sines, lms-singer, montecarlo.")]
pub struct Args {
    /// Name of a scene, a TOML file, or (with --radars) a table of tracks that radars look at.
    scene: OsString,
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
    /// Radars instead of the scene's own: a TOML file with `[[radars]]`, keys as in a scene.
    #[arg(long, value_name = "FILE")]
    radars: Option<PathBuf>,
    /// Print the scene as TOML and stop.
    #[arg(long)]
    print: bool,
}

/// Runs the command.
pub fn run(args: Args) -> anyhow::Result<ExitCode> {
    let seed = Seed::new(args.seed).of_run(args.run);
    if boresight::io::is_table(&args.scene) && Path::new(&args.scene).extension().is_none_or(|e| e != "toml") {
        return on_tracks(&args, seed);
    }
    let mut scene = read_scene(&args.scene, seed)?;
    if let Some(file) = &args.radars {
        scene.radars = plots::read_radars(file)?;
        scene.validate("scene")?;
    }
    if let Some(n) = args.frames {
        scene.n_frames = n;
    }
    if args.print {
        console::print(toml::to_string(&scene)?.as_bytes())?;
        return Ok(ExitCode::SUCCESS);
    }
    let mut source = build(&scene, seed)?;
    if args.output == Path::new("-") {
        crate::stdout_at_start::check()?;
        let mut writer = FrameWriter::stream(Box::new(std::io::BufWriter::new(std::io::stdout())), source.info())?;
        while let Some(frame) = source.next_frame()? {
            writer.put(&frame)?;
            source.recycle(frame);
        }
        writer.finish()?;
        return Ok(ExitCode::SUCCESS);
    }
    let dir = &args.output;
    refuse_inputs(&args, &scene)?;
    // A folder is one scene: what another one left under these names goes when this one is whole.
    let earlier = dir.join("scene.toml").is_file();
    std::fs::create_dir_all(dir)
        .map_err(|e| Error::new(ErrorKind::Output, "the folder cannot be made").at(dir.display()).because(e))?;
    let write = |name: &str, text: &str| write_whole(dir.join(name), text.as_bytes());
    let mut truth = TracksCsv::to(Output::file(dir.join("truth.csv"))?)?;
    let mut frames = FrameWriter::create(dir, args.format, source.info())?;
    let mut radars = plots::Radars::create(dir, &scene.radars, seed)?;
    let (mut gt, mut times) = (String::new(), String::from("frame,time_s\n"));
    let bar = progress::bar(Some(scene.n_frames), "frames");
    let (mut n_frames, mut n_boxes) = (0u64, 0usize);
    while let Some(frame) = source.next_frame()? {
        frames.put(&frame)?;
        let scan = Scan::at(frame.index, frame.time);
        truth.put(&View { frame: None, scan: &scan, tracks: source.truth() })?;
        for t in source.truth() {
            let [l, top, w, h] = mot_box_of_extent(&t.extent);
            writeln!(gt, "{},{},{l},{top},{w},{h},1,1,{}", frame.index.0 + 1, t.id.0, t.score)?;
        }
        writeln!(times, "{},{}", frame.index.0, frame.time.as_secs_f64())?;
        radars.see(frame.time.as_secs_f64(), source.truth())?;
        n_frames += 1;
        n_boxes += source.truth().len();
        source.recycle(frame);
        bar.inc(1);
    }
    bar.finish_and_clear();
    frames.finish()?;
    Box::new(truth).finish()?;
    let mut written = vec!["frames".to_string(), "truth.csv".into(), "gt.txt".into(), "frames.csv".into()];
    written.extend(radars.finish()?);
    if let Some(config) = config::for_scene(&args.scene.to_string_lossy(), &scene) {
        write("track.toml", &config.to_toml()?)?;
        written.push("track.toml".into());
    } else if earlier {
        let _ = std::fs::remove_file(dir.join("track.toml"));
    }
    if earlier {
        FrameWriter::remove_others(dir, args.format);
    }
    written.push("scene.toml".into());
    write("gt.txt", &gt)?;
    write("frames.csv", &times)?;
    write("scene.toml", &toml::to_string(&scene)?)?;
    say!(
        "{}: {n_frames} frames of {} x {} px at {} frames/s, {n_boxes} truth positions, seed {} run {}\n  {}",
        args.scene.display(),
        source.info().width,
        source.info().height,
        boresight::shown_rate(scene.rate_hz),
        args.seed,
        args.run,
        written.iter().map(|f| dir.join(f).display().to_string()).collect::<Vec<_>>().join("\n  ")
    );
    Ok(ExitCode::SUCCESS)
}

/// Refuses files of the scene in the place of what it is made from.
fn refuse_inputs(args: &Args, scene: &SceneConfig) -> boresight::Result<()> {
    const NAMES: [&str; 7] = ["frames", "frames.y4m", "truth.csv", "gt.txt", "frames.csv", "track.toml", "scene.toml"];
    let radars = scene.radars.iter().flat_map(|r| plots::names(&r.name));
    let outputs: Vec<PathBuf> =
        NAMES.map(String::from).into_iter().chain(radars).map(|n| args.output.join(n)).collect();
    let mut inputs = vec![PathBuf::from(&args.scene)];
    inputs.extend(args.radars.clone());
    if let Background::File(path) = &scene.background {
        inputs.push(path.into());
    }
    inputs.iter().try_for_each(|i| refuse_to_overwrite(i, outputs.iter().map(PathBuf::as_path)))
}

/// Radars that look at a table of tracks.
fn on_tracks(args: &Args, seed: Seed) -> anyhow::Result<ExitCode> {
    let Some(file) = &args.radars else {
        let e =
            Error::new(ErrorKind::Config, "a table of tracks needs radars that look at it").at(args.scene.display());
        return Err(e.hint("give --radars FILE with [[radars]]; docs/simulate.md shows one").into());
    };
    let table = read_tracks(&args.scene, &TableOptions::default())?;
    table.warnings.iter().for_each(|w| say!("warning: {}: {w}", args.scene.display()));
    std::fs::create_dir_all(&args.output)
        .map_err(|e| Error::new(ErrorKind::Output, "the folder cannot be made").at(args.output.display()).because(e))?;
    let configs = plots::read_radars(file)?;
    let outputs: Vec<PathBuf> =
        configs.iter().flat_map(|r| plots::names(&r.name)).map(|n| args.output.join(n)).collect();
    for input in [Path::new(&args.scene), file] {
        refuse_to_overwrite(input, outputs.iter().map(PathBuf::as_path))?;
    }
    let mut radars = plots::Radars::create(&args.output, &configs, seed)?;
    for frame in &table.frames {
        radars.see(frame.time.as_secs_f64(), &frame.tracks)?;
    }
    for name in radars.finish()? {
        say!("{}", args.output.join(name).display());
    }
    Ok(ExitCode::SUCCESS)
}

/// A named scene or a file.
fn read_scene(name: &OsStr, seed: Seed) -> boresight::Result<SceneConfig> {
    if !Path::new(name).is_file() {
        return named(&name.to_string_lossy(), seed);
    }
    let text = std::fs::read_to_string(name)
        .map_err(|e| Error::new(ErrorKind::NotFound, "cannot be read").at(name.display()).because(e))?;
    SceneConfig::from_toml(&text).map_err(|e| e.at(name.display()))
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
