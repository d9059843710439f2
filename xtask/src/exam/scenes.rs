//! Simulated scenes of the exam: a moving camera over a textured ground, and spots near the noise; their truth is exact.
//!
//! Each scene is written as YUV4MPEG2, or as H.264, with its truth as a table and then goes the way of every clip. The seeds are fixed; half A and half B are
//! two seeds of the same scene.

use super::clips::{Clip, Columns, Near, is_wanted};
use anyhow::{Context, Result};
use boresight::io::video::{Mp4Options, Mp4Writer};
use boresight::sim::ground::{CameraPathConfig, Ground};
use boresight::sim::scene::{Background, Shape, Spot, Target, White};
use boresight::sim::{Purpose, SceneConfig, Seed};
use boresight::{FrameSource, Image, Pixels, Timestamp};
use rand::RngExt;
use std::fmt::Write as _;
use std::io::Write as _;
use std::path::Path;

/// Frames a second; the cameras' motions below are per frame.
const RATE_HZ: f64 = 25.0;
const N_FRAMES: u64 = 120;
const SIZE_PX: [usize; 2] = [320, 240];
/// Two standard deviations of a spot: what counts as near.
const NEAR_PX: f64 = 3.0;
const SEEDS: [u64; 2] = [1, 2];
/// The kind that an encoder has seen, and its quantiser: some 2.4 Mbit/s.
const COMPRESSED: &str = "simulated: 50 spots, 720p, H.264";
const QUANTISER: u8 = 26;

/// Kind, pan (px a frame), shake (px), turn (degrees a frame), growth (share a frame).
const CAMERAS: [(&str, [f64; 2], f64, f64, f64); 11] = [
    ("simulated: still", [0.0, 0.0], 0.0, 0.0, 0.0),
    ("simulated: pan 1", [1.0, 0.2], 0.0, 0.0, 0.0),
    ("simulated: pan 2", [2.0, 0.5], 0.0, 0.0, 0.0),
    ("simulated: pan 5", [5.0, -1.0], 0.0, 0.0, 0.0),
    ("simulated: pan 10", [10.0, -2.0], 0.0, 0.0, 0.0),
    ("simulated: pan 20", [20.0, 4.0], 0.0, 0.0, 0.0),
    ("simulated: shake 2.5", [0.0, 0.0], 2.5, 0.0, 0.0),
    ("simulated: turn 1 deg", [0.0, 0.0], 0.0, 1.0, 0.0),
    ("simulated: turn 2 deg", [0.0, 0.0], 0.0, 2.0, 0.0),
    ("simulated: zoom 1 %", [0.0, 0.0], 0.0, 0.0, 0.01),
    ("simulated: zoom 2 %", [0.0, 0.0], 0.0, 0.0, 0.02),
];

/// Writes the scenes that are asked for to a folder and returns all as clips.
pub fn clips(folder: &Path, only: &[String]) -> Result<Vec<Clip>> {
    let mut out = Vec::new();
    let mut add = |kind: &'static str, seed: u64, scene: SceneConfig| -> Result<()> {
        let name = format!("{kind}, seed {seed}");
        let stem = format!("scene{}", out.len());
        let ending = if kind == COMPRESSED { "mp4" } else { "y4m" };
        let (input, truth) = (folder.join(format!("{stem}.{ending}")), folder.join(format!("{stem}.csv")));
        // One that is not asked for counts all the same: the halves go by turns.
        if is_wanted(only, &name) {
            write(&scene, seed, &input, &truth)?;
        }
        let near = Near::Px(NEAR_PX);
        out.push(Clip { kind, name, input, truth, columns: Columns::POINTS, near, whole: true, contrast: None });
        Ok(())
    };
    for (kind, pan, shake_px, turn_deg, growth) in CAMERAS {
        for seed in SEEDS {
            add(kind, seed, over_ground(pan, shake_px, turn_deg, growth))?;
        }
    }
    for seed in SEEDS {
        add("simulated: spots of SNR 5", seed, DIM.scene(seed))?;
    }
    for seed in SEEDS {
        add(COMPRESSED, seed, BRIGHT.scene(seed))?;
    }
    Ok(out)
}

/// Three targets that cross a textured ground at 1 to 3 px a frame, kept in view by where they start and by when.
fn over_ground(pan: [f64; 2], shake_px: f64, turn_deg: f64, growth: f64) -> SceneConfig {
    let camera = CameraPathConfig {
        pan_px_per_s: pan.map(|v| RATE_HZ * v),
        rotation_deg_per_s: RATE_HZ * turn_deg,
        zoom_per_s: RATE_HZ * growth,
    };
    let middle = [0.5 * SIZE_PX[0] as f64, 0.5 * SIZE_PX[1] as f64];
    // In the image at the sequence's middle, from where they came at their speed on the ground (px a frame).
    let half = 0.5 * N_FRAMES as f64;
    let target = |from_middle: [f64; 2], speed: [f64; 2]| {
        let shape =
            Shape::Spot(Spot { sigma_px: 0.0, psf_sigma_px: 1.5, total: 100.0 * std::f64::consts::TAU * 1.5 * 1.5 });
        // A panning camera goes with the targets: they move against the ground all the same.
        // What is left of the pan in the image is a fifth of it, and at most 2 px a frame: faster, they would be out of it within half the sequence.
        let goes_with = f64::max(0.8, 1.0 - 2.0 / pan[0].hypot(pan[1]).max(1.0));
        let own = [0, 1].map(|i| speed[i] - goes_with * pan[i]);
        let at = |i: usize| middle[i] + from_middle[i] - half * (own[i] + pan[i]);
        Target { start_px: [at(0), at(1)], velocity_px_per_s: own.map(|v| RATE_HZ * v), shape, ..Target::default() }
    };
    let zoomed = if growth > 0.0 { 0.25 } else { 1.0 };
    let slow = |v: [f64; 2]| v.map(|s| s * zoomed);
    SceneConfig {
        width_px: SIZE_PX[0],
        height_px: SIZE_PX[1],
        n_frames: N_FRAMES,
        rate_hz: RATE_HZ,
        background: Background::Ground(Ground { mean: 70.0, std: 12.0, length_px: 20.0, noise_std: 1.5 }),
        targets: vec![
            target([-30.0, -20.0], slow([1.0, 0.3])),
            target([10.0, 15.0], slow([-1.2, 0.2])),
            target([20.0, -15.0], slow([0.6, -0.9])),
        ],
        camera,
        sensor: boresight::sim::scene::Sensor { jitter_px: shake_px, ..Default::default() },
        ..SceneConfig::default()
    }
}

/// Spots in white noise before a fixed camera, straight on.
struct Spots {
    size_px: [usize; 2],
    n: usize,
    /// Deviation, px, and height of their peak, counts.
    sigma_px: f64,
    height: f64,
    background: White,
    /// Largest speed along each axis, px/s.
    speed_px_per_s: f64,
}

/// Twenty of five deviations of the noise, slow.
const DIM: Spots = Spots {
    size_px: SIZE_PX,
    n: 20,
    sigma_px: 1.3,
    height: 40.0,
    background: White { mean: 60.0, std: 8.0 },
    speed_px_per_s: 12.0,
};
/// Fifty bright ones, some out of the frame: of white noise an encoder makes specks that stay for many frames.
const BRIGHT: Spots = Spots {
    size_px: [1280, 720],
    n: 50,
    sigma_px: 2.2,
    height: 180.0,
    background: White { mean: 30.0, std: 4.0 },
    speed_px_per_s: 60.0,
};

impl Spots {
    fn scene(&self, seed: u64) -> SceneConfig {
        let mut rng = Seed::new(seed).stream(Purpose::Scenario, 1);
        let shape = Shape::Spot(Spot {
            sigma_px: 0.0,
            psf_sigma_px: self.sigma_px,
            total: self.height * std::f64::consts::TAU * self.sigma_px * self.sigma_px,
        });
        let v = self.speed_px_per_s;
        let targets = (0..self.n).map(|_| Target {
            start_px: self.size_px.map(|side| rng.random_range(40.0..side as f64 - 40.0)),
            velocity_px_per_s: [rng.random_range(-v..v), rng.random_range(-v..v)],
            shape: shape.clone(),
            ..Target::default()
        });
        SceneConfig {
            width_px: self.size_px[0],
            height_px: self.size_px[1],
            n_frames: N_FRAMES,
            rate_hz: RATE_HZ,
            background: Background::White(self.background.clone()),
            targets: targets.collect(),
            ..SceneConfig::default()
        }
    }
}

/// Where a scene's frames go.
enum Video {
    Y4m(std::io::BufWriter<std::fs::File>),
    H264(Box<Mp4Writer>),
}

impl Video {
    /// As the ending of the path says.
    fn create(path: &Path, [width, height]: [usize; 2]) -> Result<Self> {
        if path.extension().is_some_and(|e| e == "mp4") {
            let options = Mp4Options { quantiser: QUANTISER, ..Mp4Options::default() };
            return Ok(Self::H264(Box::new(Mp4Writer::create(path, width, height, options)?)));
        }
        let mut out = std::io::BufWriter::new(std::fs::File::create(path)?);
        writeln!(out, "YUV4MPEG2 W{width} H{height} F{RATE_HZ}:1 Ip A1:1 Cmono")?;
        Ok(Self::Y4m(out))
    }

    fn put(&mut self, image: &Image<u8>, time: Timestamp) -> Result<()> {
        match self {
            Self::Y4m(out) => {
                out.write_all(b"FRAME\n")?;
                out.write_all(image.as_slice())?;
            }
            Self::H264(writer) => {
                let rgb = image.as_slice().iter().map(|v| [*v; 3]).collect();
                writer.write(Image::from_vec(image.width(), image.height(), rgb).context("a whole image")?, time)?;
            }
        }
        Ok(())
    }

    fn finish(self) -> Result<()> {
        match self {
            Self::Y4m(mut out) => Ok(out.flush()?),
            Self::H264(writer) => Ok(writer.finish()?),
        }
    }
}

/// Writes a scene's frames and truth (frame, id, x, y).
fn write(scene: &SceneConfig, seed: u64, video: &Path, truth: &Path) -> Result<()> {
    let mut source = scene.build(Seed::new(seed))?;
    let mut out = Video::create(video, [scene.width_px, scene.height_px])?;
    let mut table = String::from("frame,id,x,y\n");
    while let Some(frame) = source.next_frame()? {
        let Pixels::Gray8(image) = &frame.pixels else { anyhow::bail!("a scene of 8 bits") };
        out.put(image, frame.time)?;
        for t in source.truth() {
            let (x, y) = (t.kinematics.mean[0], t.kinematics.mean[2]);
            let inside = |v: f64, size: usize| (0.0..=size as f64 - 1.0).contains(&v);
            if inside(x, scene.width_px) && inside(y, scene.height_px) {
                writeln!(table, "{},{},{x},{y}", frame.index.0, t.id.0)?;
            }
        }
        source.recycle(frame);
    }
    out.finish()?;
    Ok(std::fs::write(truth, table)?)
}
