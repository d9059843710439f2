//! The exam's grey clips seen in another way: what a target is does not depend on any of it, so figures that fall were fitted to the clips as they are.
//!
//! Each variant is written as YUV4MPEG2 (8 bit, grey) with its truth as a table and goes the way of every clip. Colour is turned into luminance (Rec. 601).

use super::clips::{self, Clip, Columns};
use super::disturbed;
use super::variant::Variant;
use anyhow::{Context, Result, bail};
use boresight::io::OpenOptions;
use boresight::{Image, Pixels, TrackRow};
use rand::{RngExt, SeedableRng};
use rand_distr::{Distribution, Normal};
use std::fmt::Write as _;
use std::io::Write as _;
use std::path::Path;

/// Deviation of the noise added, counts.
const NOISE_COUNTS: f64 = 3.0;
/// Time in which the light falls and comes back, s, and its mean and half of its range.
const DIMMING_S: f64 = 6.0;
const DIMMED: [f64; 2] = [0.75, 0.25];
/// More frames than this are not held in memory.
const MOST_FRAMES: usize = 4000;

/// Kinds whose frames are more than eight bits deep, or whose pixels are the targets' size.
const NOT_OF: [&str; 3] = ["particles", "cells", "car from the air"];

/// Whether a clip has variants.
pub fn is_possible(clip: &Clip) -> bool {
    !NOT_OF.contains(&clip.kind)
}

/// Writes a clip's variant to `folder` and returns it as a clip; none of a clip of more than `MOST_FRAMES` frames, and a line that says so.
pub fn clip(of: &Clip, variant: Variant, folder: &Path) -> Result<Option<Clip>> {
    let mut source = boresight::io::open(&of.input, &OpenOptions::default())?;
    let mut rate_hz = source.info().rate_hz.unwrap_or(25.0);
    let mut frames = Vec::new();
    while let Some(frame) = source.next_frame()? {
        frames.push(grey(frame.pixels)?);
        if frames.len() > MOST_FRAMES {
            println!("{}: left out, more than {MOST_FRAMES} frames", of.name);
            return Ok(None);
        }
    }
    let mut rows = clips::truth(&of.truth, &of.columns)?;
    let (n, width) = (frames.len() as u32, frames.first().context("no frame")?.width());
    match variant {
        Variant::Same => {}
        Variant::Mirrored => {
            frames.iter_mut().for_each(|f| (0..f.height()).for_each(|y| f.row_mut(y).reverse()));
            rows.iter_mut().for_each(|r| r.bbox[0] = width as f64 - 1.0 - r.bbox[0]);
        }
        Variant::Reversed => {
            frames.reverse();
            rows.retain(|r| r.frame < n);
            rows.iter_mut().for_each(|r| r.frame = n - 1 - r.frame);
        }
        Variant::Late => {
            frames.drain(..n as usize / 3);
            rows.retain(|r| r.frame >= n / 3);
            rows.iter_mut().for_each(|r| r.frame -= n / 3);
        }
        Variant::HalfRate => {
            frames = frames.into_iter().step_by(2).collect();
            rows.retain(|r| r.frame % 2 == 0);
            rows.iter_mut().for_each(|r| r.frame /= 2);
            rate_hz /= 2.0;
        }
        Variant::Negative => frames.iter_mut().for_each(|f| f.as_mut_slice().iter_mut().for_each(|p| *p = 255 - *p)),
        Variant::HalfSize => {
            frames = frames.iter().map(halved).collect::<Result<_>>()?;
            // The middle of the first of two pixels is a quarter of a pixel before that of their mean.
            for r in &mut rows {
                r.bbox = [0.5 * r.bbox[0] - 0.25, 0.5 * r.bbox[1] - 0.25, 0.5 * r.bbox[2], 0.5 * r.bbox[3]];
            }
        }
        Variant::Noisy => add_noise(&mut frames)?,
        Variant::Dimming => dim(&mut frames, rate_hz),
        other => rate_hz = disturbed::apply(other, &mut frames, &mut rows, rate_hz)?,
    }
    rows.sort_by_key(|r| (r.frame, r.id));
    let stem = of.name.replace(['/', '.', ' ', ','], "_");
    let (input, truth) = (folder.join(format!("{stem}.y4m")), folder.join(format!("{stem}.csv")));
    write(&frames, rate_hz, &input)?;
    std::fs::write(&truth, table(&rows))?;
    let name = format!("{} {variant:?}", of.name).to_lowercase();
    Ok(Some(Clip { name, input, truth, columns: Columns::CORNERS, ..*of }))
}

fn grey(pixels: Pixels) -> Result<Image<u8>> {
    match pixels {
        Pixels::Gray8(image) => Ok(image),
        Pixels::Rgb8(image) => {
            let luma =
                |p: &[u8; 3]| (299 * u32::from(p[0]) + 587 * u32::from(p[1]) + 114 * u32::from(p[2]) + 500) / 1000;
            let values = image.as_slice().iter().map(|p| luma(p) as u8).collect();
            Image::from_vec(image.width(), image.height(), values).context("an image of another size")
        }
        _ => bail!("frames of more than 8 bits have no variants"),
    }
}

fn halved(image: &Image<u8>) -> Result<Image<u8>> {
    let (w, h) = (image.width() / 2, image.height() / 2);
    let mut out = Vec::with_capacity(w * h);
    for y in 0..h {
        let [above, below] = [image.row(2 * y), image.row(2 * y + 1)];
        let four = |x: usize| [above[x], above[x + 1], below[x], below[x + 1]].map(u32::from).iter().sum::<u32>();
        out.extend((0..w).map(|x| ((four(2 * x) + 2) / 4) as u8));
    }
    Image::from_vec(w, h, out).context("an image of another size")
}

/// Lets the light fall and come back. What falls between two counts is rounded up as often as it is near the upper one: a sensor's noise does that, and without it a smooth sky's steps from one
/// count to the next would walk.
fn dim(frames: &mut [Image<u8>], rate_hz: f64) {
    let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(1);
    for (k, frame) in frames.iter_mut().enumerate() {
        let turns = k as f64 / rate_hz / DIMMING_S;
        let light = DIMMED[0] + DIMMED[1] * (std::f64::consts::TAU * turns).cos();
        frame.as_mut_slice().iter_mut().for_each(|p| *p = (light * f64::from(*p) + rng.random::<f64>()) as u8);
    }
}

fn add_noise(frames: &mut [Image<u8>]) -> Result<()> {
    let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(1);
    let normal = Normal::new(0.0, NOISE_COUNTS)?;
    for p in frames.iter_mut().flat_map(|f| f.as_mut_slice()) {
        *p = (f64::from(*p) + normal.sample(&mut rng)).round().clamp(0.0, 255.0) as u8;
    }
    Ok(())
}

/// Writes grey frames as YUV4MPEG2.
pub fn write(frames: &[Image<u8>], rate_hz: f64, path: &Path) -> Result<()> {
    let mut out = std::io::BufWriter::new(std::fs::File::create(path)?);
    let first = frames.first().context("no frame")?;
    let rate = (1000.0 * rate_hz).round();
    writeln!(out, "YUV4MPEG2 W{} H{} F{rate}:1000 Ip A1:1 Cmono", first.width(), first.height())?;
    for frame in frames {
        writeln!(out, "FRAME")?;
        out.write_all(frame.as_slice())?;
    }
    Ok(out.flush()?)
}

/// Frame, id, left, top, width, height; all from 0.
fn table(rows: &[TrackRow]) -> String {
    let mut text = String::from("frame,id,x,y,w,h\n");
    for r in rows {
        let [x, y, w, h] = r.bbox;
        let _ = writeln!(text, "{},{},{},{},{w},{h}", r.frame, r.id, x + 0.5 - 0.5 * w, y + 0.5 - 0.5 * h);
    }
    text
}
