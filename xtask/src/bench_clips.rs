//! The clips of `bench-run`: a sample, a public video, and scenes with fixed seeds, written once.

use anyhow::{Result, ensure};
use boresight::FrameSource;
use boresight::io::video::{Mp4Options, Mp4Writer};
use boresight::sim::{SceneConfig, Seed};
use boresight::{Image, Pixels};
use std::fmt::Write as _;
use std::io::Write as _;
use std::path::{Path, PathBuf};

/// An input of the bench.
pub struct Clip {
    pub name: &'static str,
    pub input: PathBuf,
    pub frames: u64,
    /// Whether other decoders read it.
    pub is_video: bool,
    /// Keys that name a detector, for a run that chooses nothing.
    pub given: &'static [&'static str],
}

/// Quantiser of the simulated videos: 50 spots at 1080p are some 5 Mbit/s.
const QUANTISER: u8 = 26;

/// The clips whose names are wanted, the simulated ones of `frames` frames.
pub fn clips(folder: &Path, frames: u64, wanted: impl Fn(&str) -> bool) -> Result<Vec<Clip>> {
    std::fs::create_dir_all(folder)?;
    let mut clips = vec![Clip {
        name: "sample, 320 x 256",
        input: "samples/ir_drone/IR_DRONE_046.mp4".into(),
        frames: 302,
        is_video: true,
        given: &[],
    }];
    let data = std::env::var("BORESIGHT_TEST_DATA").unwrap_or_else(|_| "../shared/data".into());
    let pets = Path::new(&data).join("pets09_vtest/vtest.avi");
    if pets.exists() {
        clips.push(Clip { name: "PETS09, 768 x 576, by ffmpeg", input: pets, frames: 795, is_video: true, given: &[] });
    }
    clips.retain(|c| wanted(c.name));
    const BAND: &[&str] = &["detector.threshold.band={low=90,high=255}"];
    for (name, scene, video, given) in [
        ("50 spots, 1080p", spots((1920, 1080), 50, "mean = 30.0\nstd = 4.0", 8), true, BAND),
        ("1000 spots, 1080p", spots((1920, 1080), 1000, "mean = 30.0\nstd = 4.0", 8), true, BAND),
        ("noise, 1080p", spots((1920, 1080), 3, "mean = 110.0\nstd = 30.0", 8), true, &[]),
        ("50 spots, 4K", spots((3840, 2160), 50, "mean = 30.0\nstd = 4.0", 8), true, BAND),
        ("5000 particles, 1080p, raw", spots((1920, 1080), 5000, "mean = 30.0\nstd = 4.0", 8), false, BAND),
        ("16 bit, 640 x 512, raw", spots((640, 512), 10, "mean = 8000.0\nstd = 60.0", 16), false, &[]),
    ] {
        if !wanted(name) {
            continue;
        }
        let slug: String = name.chars().filter(char::is_ascii_alphanumeric).collect();
        let input = folder.join(format!("{slug}-{frames}{}", if video { ".mp4" } else { "" }));
        if !input.exists() {
            write(&scene, frames, &input, video)?;
        }
        clips.push(Clip { name, input, frames, is_video: video, given });
    }
    Ok(clips)
}

/// Round spots that move on straight lines over white noise.
fn spots((width, height): (usize, usize), n: usize, background: &str, bits: u32) -> String {
    let mut text = format!(
        "width-px = {width}\nheight-px = {height}\nn-frames = 100000\nrate-hz = 30.0\nbits = {bits}\n\
         [background.white]\n{background}\n"
    );
    // 2.2 px wide and 180 counts high (20 deviations of 60 in 16 bits), as in the comparison with peers: 2 pi 2.2 ** 2 = 30.4.
    let total = 30.4 * if bits > 8 { 1200.0 } else { 180.0 };
    let mut state = 1u64;
    let mut uniform = move || {
        state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (state >> 11) as f64 / (1u64 << 53) as f64
    };
    for _ in 0..n {
        let (x, y) = (60.0 + (width as f64 - 120.0) * uniform(), 60.0 + (height as f64 - 120.0) * uniform());
        let (vx, vy) = (120.0 * (uniform() - 0.5), 120.0 * (uniform() - 0.5));
        let _ = writeln!(
            text,
            "[[targets]]\nstart-px = [{x:.2}, {y:.2}]\nvelocity-px-per-s = [{vx:.2}, {vy:.2}]\n\
             shape.spot = {{ sigma-px = 0.5, psf-sigma-px = 2.15, total = {total} }}"
        );
    }
    text
}

/// Simulates a scene into a video or a folder of PGM files.
fn write(scene: &str, frames: u64, to: &Path, video: bool) -> Result<()> {
    let mut source = SceneConfig::from_toml(scene)?.build(Seed { seed: 5, run: 0 })?;
    let mut writer = None;
    let part = to.with_extension("unfinished");
    if !video {
        std::fs::create_dir_all(&part)?;
    }
    for k in 0..frames {
        let Some(frame) = source.next_frame()? else { break };
        let (width, height) = (frame.pixels.width(), frame.pixels.height());
        match &frame.pixels {
            Pixels::Gray8(image) if video => {
                let rgb = Image::from_vec(width, height, image.as_slice().iter().map(|v| [*v; 3]).collect());
                let options = Mp4Options { quantiser: QUANTISER, ..Mp4Options::default() };
                if writer.is_none() {
                    writer = Some(Mp4Writer::create(to, width, height, options)?);
                }
                if let (Some(writer), Some(rgb)) = (&mut writer, rgb) {
                    writer.write(rgb, frame.time)?;
                }
            }
            pixels => {
                let mut file = std::fs::File::create(part.join(format!("frame_{k:06}.pgm")))?;
                let (most, bytes) = match pixels {
                    Pixels::Gray8(i) => (255, i.as_slice().to_vec()),
                    Pixels::Gray16(i) => (65535, i.as_slice().iter().flat_map(|v| v.to_be_bytes()).collect()),
                    _ => anyhow::bail!("a scene gives grey frames"),
                };
                write!(file, "P5\n{width} {height}\n{most}\n")?;
                file.write_all(&bytes)?;
            }
        }
    }
    ensure!(video == writer.is_some(), "a video needs 8 bits");
    match writer {
        Some(writer) => Ok(writer.finish()?),
        None => Ok(std::fs::rename(part, to)?),
    }
}
