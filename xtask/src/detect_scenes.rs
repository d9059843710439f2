//! Frames for `cargo xtask detect-exam`: simulated ground, spots, and the public single frames with their truth.
//!
//! Ground has the deviation 20 counts about 500 (whole numbers) or 0.5 (floats, deviation 0.02). `one-over-f` is a sum of noise
//! over octaves of equal strength, each smoothed as it is enlarged; its spectrum falls about as 1/f².

use anyhow::{Context, Result, ensure};
use boresight::io::{Colour, OpenOptions, open};
use boresight::{Image, Pixels};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;
use std::collections::HashMap;
use std::path::{Path, PathBuf};

/// What simulated ground looks like.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ground {
    White,
    /// White noise smoothed by a Gaussian of about 1.5 px.
    Correlated,
    OneOverF,
}

/// The pixel type of simulated frames.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Depth {
    Eight,
    Sixteen,
    Float,
}

/// Standard normal noise.
pub fn noise(width: usize, height: usize, rng: &mut ChaCha8Rng) -> Image<f32> {
    let values = (0..width * height).map(|_| rng.sample::<f32, _>(StandardNormal)).collect();
    Image::from_vec(width, height, values).unwrap_or_default()
}

/// [1 2 1]/4 in both directions, mirrored.
fn smooth(image: &Image<f32>) -> Image<f32> {
    let (w, h) = (image.width(), image.height());
    let mut out = image.clone();
    for y in 0..h {
        for x in 0..w {
            let at = |x: usize, y: usize| image.row(y)[x];
            let (l, r) = (x.saturating_sub(1), (x + 1).min(w - 1));
            let (a, b) = (y.saturating_sub(1), (y + 1).min(h - 1));
            let row = |y: usize| at(l, y) + 2.0 * at(x, y) + at(r, y);
            out.row_mut(y)[x] = (row(a) + 2.0 * row(y) + row(b)) / 16.0;
        }
    }
    out
}

fn octaves(width: usize, height: usize, rng: &mut ChaCha8Rng) -> Image<f32> {
    if width.min(height) < 8 {
        return noise(width, height, rng);
    }
    let coarse = octaves(width.div_ceil(2), height.div_ceil(2), rng);
    let mut fine = noise(width, height, rng);
    let mut large = Image::filled(width, height, 0.0f32);
    for y in 0..height {
        for x in 0..width {
            large.row_mut(y)[x] = coarse.row(y / 2)[x / 2];
        }
    }
    let large = smooth(&smooth(&large));
    fine.as_mut_slice().iter_mut().zip(large.as_slice()).for_each(|(f, l)| *f += 2.0 * l);
    fine
}

/// Simulated ground of deviation 1 and mean 0.
pub fn ground(kind: Ground, width: usize, height: usize, seed: u64) -> Image<f32> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut image = match kind {
        Ground::White => return noise(width, height, &mut rng),
        Ground::Correlated => (0..5).fold(noise(width, height, &mut rng), |i, _| smooth(&i)),
        Ground::OneOverF => octaves(width, height, &mut rng),
    };
    let n = (width * height) as f32;
    let mean = image.as_slice().iter().sum::<f32>() / n;
    let sd = (image.as_slice().iter().map(|v| (v - mean).powi(2)).sum::<f32>() / n).sqrt();
    image.as_mut_slice().iter_mut().for_each(|v| *v = (*v - mean) / sd);
    image
}

/// The ground as pixels of a type, its deviation `sd` counts (0.001 of that for floats).
pub fn pixels(image: &Image<f32>, depth: Depth, sd: f32) -> Pixels {
    let (w, h) = (image.width(), image.height());
    let values = image.as_slice();
    match depth {
        Depth::Eight => Image::from_vec(w, h, values.iter().map(|v| (v * sd + 128.0).round() as u8).collect())
            .map_or(Pixels::Gray8(Image::default()), Pixels::Gray8),
        Depth::Sixteen => Image::from_vec(w, h, values.iter().map(|v| (v * sd + 5000.0).round() as u16).collect())
            .map_or(Pixels::Gray16(Image::default()), Pixels::Gray16),
        Depth::Float => Image::from_vec(w, h, values.iter().map(|v| v * sd * 1e-3 + 0.5).collect())
            .map_or(Pixels::GrayF32(Image::default()), Pixels::GrayF32),
    }
}

/// Adds `n` Gaussian spots at random places at least 14 px apart and 8 px from the border; returns their positions.
pub fn add_spots(image: &mut Image<f32>, n: usize, height: f64, sigma: f64, seed: u64) -> Vec<(f64, f64)> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let (w, h) = (image.width() as f64, image.height() as f64);
    let mut places: Vec<(f64, f64)> = Vec::new();
    let mut tries = 0;
    while places.len() < n && tries < 100 * n {
        tries += 1;
        let at = (8.0 + rng.random::<f64>() * (w - 17.0), 8.0 + rng.random::<f64>() * (h - 17.0));
        if places.iter().all(|p| (p.0 - at.0).hypot(p.1 - at.1) > 14.0) {
            places.push(at);
        }
    }
    let reach = (4.0 * sigma).ceil() as i64;
    for &(x0, y0) in &places {
        for y in y0 as i64 - reach..=y0 as i64 + reach {
            for x in x0 as i64 - reach..=x0 as i64 + reach {
                if x >= 0 && y >= 0 && x < w as i64 && y < h as i64 {
                    let d2 = (x as f64 - x0).powi(2) + (y as f64 - y0).powi(2);
                    image.row_mut(y as usize)[x as usize] += (height * (-d2 / (2.0 * sigma * sigma)).exp()) as f32;
                }
            }
        }
    }
    places
}

/// A frame of a public set: its pixels, the centroids of its targets, and which pixels are target.
pub struct Labelled {
    pub image: Image<u8>,
    pub targets: Vec<(f64, f64)>,
    pub mask: Image<u8>,
}

/// Reads one still as 8-bit grey.
pub fn still(path: &Path) -> Result<Image<u8>> {
    let options = OpenOptions { colour: Colour::Gray, ..OpenOptions::default() };
    let mut source = open(path, &options)?;
    match source.next_frame()?.map(|f| f.pixels) {
        Some(Pixels::Gray8(image)) => Ok(image),
        other => anyhow::bail!("{}: expected 8-bit grey, found {:?}", path.display(), other.map(|p| p.kind())),
    }
}

/// The images of a folder in the order of their names.
pub fn images(folder: &Path) -> Result<Vec<PathBuf>> {
    let mut out: Vec<PathBuf> = std::fs::read_dir(folder)
        .with_context(|| folder.display().to_string())?
        .filter_map(|e| e.ok().map(|e| e.path()))
        .filter(|p| p.extension().is_some_and(|e| e == "png" || e == "bmp"))
        .collect();
    out.sort();
    ensure!(!out.is_empty(), "{}: no images", folder.display());
    Ok(out)
}

/// A set with `images/`, `masks/` and `targets.csv`.
pub fn labelled(folder: &Path) -> Result<Vec<Labelled>> {
    let mut truth: HashMap<String, Vec<(f64, f64)>> = HashMap::new();
    for record in csv::Reader::from_path(folder.join("targets.csv"))?.deserialize() {
        let row: HashMap<String, String> = record?;
        let number = |key: &str| -> Result<f64> { Ok(row.get(key).context("a column is missing")?.parse()?) };
        let name = row.get("image").context("no column image")?.clone();
        truth.entry(name).or_default().push((number("x_px")?, number("y_px")?));
    }
    images(&folder.join("images"))?
        .iter()
        .map(|path| {
            let name = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
            let mask = folder.join("masks").join(path.file_name().unwrap_or_default());
            Ok(Labelled { image: still(path)?, targets: truth.remove(&name).unwrap_or_default(), mask: still(&mask)? })
        })
        .collect()
}
