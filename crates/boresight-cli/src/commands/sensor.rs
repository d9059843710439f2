//! `boresight sensor`: gain, noise and defects of the sensor behind an input.

mod measured;
mod page;

use crate::console::{self, say};
use boresight::io::{Colour, OpenOptions};
use boresight::sensor::{Level, MeanMap, PhotonTransfer, find_defects};
use boresight::{Config, Error, ErrorKind, Pixels};
use measured::{Measured, text};
use std::ffi::OsString;
use std::path::PathBuf;
use std::process::ExitCode;

/// Frames that defects are looked for in.
const DEFECT_FRAMES: u32 = 32;

/// Arguments of `boresight sensor`.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  boresight sensor flight.mp4
      prints gain, read noise, bad pixels and columns, and the options that use them; draws them on flight.sensor.html
  boresight sensor frames/ --dark dark/ -o sensor.html
      dark frames tell offset and read noise apart
  boresight track frames/ --dark dark/ --flat flat/ --set input.sensor.bad-pixels=true
      mends the frames before it detects")]
pub struct Args {
    /// A video, a folder or glob of images, an image stack, a camera; the light should differ over the frame or in time.
    #[arg(value_name = "INPUT")]
    input: OsString,
    /// Frames taken without light.
    #[arg(long, value_name = "INPUT")]
    dark: Option<String>,
    /// Frames of even light: unequal response is divided out first.
    #[arg(long, value_name = "INPUT")]
    flat: Option<String>,
    /// The page with the curve; INPUT's name with `.sensor.html` if absent.
    #[arg(short, long, value_name = "FILE")]
    output: Option<PathBuf>,
    /// Frames looked at.
    #[arg(long, value_name = "N", default_value_t = 101, value_parser = clap::value_parser!(u32).range(2..))]
    frames: u32,
    /// Change how the input is read: `input.raw={width=640,height=512,pixel="u16-le"}`. Can be repeated.
    #[arg(long = "set", value_name = "KEY=VALUE")]
    sets: Vec<String>,
}

/// Runs the command.
/// # Errors
/// An input that cannot be read, that has colours only or shows too little; a page that cannot be written.
pub fn run(args: Args) -> anyhow::Result<ExitCode> {
    let output = args.output.clone().unwrap_or_else(|| super::run_options::default_folder(&args.input, "sensor.html"));
    boresight::io::refuse_to_overwrite(&args.input, [output.as_path()])?;
    let config = args.sets.iter().try_fold(Config::default(), |c, set| c.with(set))?;
    let measured = measure(&args, &config)?;
    console::print(text(&measured).as_bytes())?;
    boresight::io::write_whole(&output, page::html(&measured).as_bytes())?;
    say!("page: {}", output.display());
    Ok(ExitCode::SUCCESS)
}

fn measure(args: &Args, config: &Config) -> anyhow::Result<Measured> {
    let options = OpenOptions { colour: Colour::Gray, ..config.input.open_options() };
    let mut input = config.input.clone();
    (input.sensor.flat, input.sensor.dark) = (args.flat.clone(), args.flat.as_ref().and(args.dark.clone()));
    let mut source = input.mend(boresight::io::open(&args.input, &options)?)?;
    let (mut transfer, mut map, mut n_frames) = (PhotonTransfer::default(), MeanMap::default(), 0);
    let mut size = (0, 0);
    while n_frames < args.frames
        && let Some(frame) = source.next_frame()?
    {
        size = (frame.pixels.width(), frame.pixels.height());
        transfer.push(&frame.pixels);
        if n_frames < DEFECT_FRAMES {
            map.push(&frame.pixels).map_err(|e| e.at(args.input.display()))?;
        }
        n_frames += 1;
        source.recycle(frame);
    }
    let curve = transfer.curve().ok_or_else(|| {
        Error::new(ErrorKind::Damaged, format!("{n_frames} frames show too little to measure noise in"))
            .at(args.input.display())
            .hint("two frames of 32 x 32 px at least, of one size, not full and not 0")
    })?;
    let (mut dark, mut of_dark) = (None, false);
    if let Some(path) = &args.dark {
        let mut level = PhotonTransfer::default();
        let mut frames = boresight::io::open(path, &options)?;
        let mut dark_map = MeanMap::default();
        while dark_map.n_frames() < args.frames
            && let Some(frame) = frames.next_frame()?
        {
            level.push(&lifted(&frame.pixels));
            dark_map.push(&frame.pixels).map_err(|e| e.at(path))?;
        }
        dark = level.single_level().map(|l| Level { mean: l.mean - LIFT, ..l });
        if dark_map.n_frames() > 1 {
            (map, of_dark) = (dark_map, true);
        }
    }
    let defects = find_defects(&map);
    Ok(Measured { input: args.input.to_string_lossy().into_owned(), size, n_frames, curve, dark, defects, of_dark })
}

/// Counts added to dark frames, where a 0 is a value and not cut off.
const LIFT: f64 = 1.0;

fn lifted(pixels: &Pixels) -> Pixels {
    let lift = |v: f32| v + LIFT as f32;
    let (w, h) = (pixels.width(), pixels.height());
    let values: Vec<f32> = match pixels {
        Pixels::Gray8(i) => i.as_slice().iter().map(|v| lift(f32::from(*v))).collect(),
        Pixels::Gray16(i) => i.as_slice().iter().map(|v| lift(f32::from(*v))).collect(),
        Pixels::GrayF32(i) => i.as_slice().iter().map(|v| lift(*v)).collect(),
        Pixels::Rgb8(_) => Vec::new(),
    };
    boresight::Image::from_vec(w, h, values).map_or_else(|| pixels.clone(), Pixels::GrayF32)
}
