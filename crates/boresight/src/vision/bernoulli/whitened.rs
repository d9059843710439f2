//! A frame as deviations of its noise on a grid: matched to the target, with background and noise estimated from the frames so far.
//!
//! How: the frame is matched to the target's profile (`shape`, `matched`) and read at the middles of cells of `step` x `step` pixels, some σ wide. The background B of a cell is the mean of the
//! frames before, fading over [`MEMORY`] straight times; residual r = frame − B. Noise: 1.4826 times the median of |r| in tiles of cells, as a mean over the frames
//! that fades likewise, each frame brought to one level by its own median over all tiles, with [`PRIOR`] frames of the mean of all; least [`SHARED`] of that mean, and the
//! rounding of whole counts. z = r / noise: N(0, 1) where there is noise alone.
//! Limits: a target that does not move by its width within the memory goes into its own background; noise that changes within a tile.

use super::config::BernoulliConfig;
use super::shape::{Profile, straight_s};
use crate::Image;
use crate::vision::integrate::StillBackground;
use crate::vision::matched::{MAD, filter, finite, median, subtract_surround};
use crate::vision::pixel::Pixel;

/// Time constant of background and noise, in straight times: long beside what a target needs to leave its place.
pub(super) const MEMORY: f64 = 16.0;
/// Frames that the noise of the whole frame counts for in that of a tile.
const PRIOR: f64 = 4.0;
/// Part of the mean noise that every tile, and every frame, has at least.
const SHARED: f32 = 0.5;
/// Least side of a tile: a target of a third of it leaves the median to the noise; 85 independent places of the spot where a cell is a pixel.
const TILE_PX: usize = 32;
/// Least side of a tile in cells.
const TILE_CELLS: usize = 8;
/// Frames of background from which on a frame is judged: the background then adds a quarter to the noise's variance, which is measured with it.
const FEWEST: f64 = 4.0;

/// Half a cell, in σ of a spot.
const RIM: f64 = 0.6;

/// What is carried from frame to frame.
#[derive(Clone, Debug, Default)]
pub(super) struct Whitened {
    width: usize,
    height: usize,
    step: usize,
    /// Cells across and down.
    size: (usize, usize),
    tile: usize,
    kernel: Vec<f32>,
    surround: Option<usize>,
    temporal: bool,
    memory_s: f64,
    rounding: f32,
    raw: Vec<f32>,
    row: Vec<f32>,
    filtered: Vec<f32>,
    means: Vec<f32>,
    sums: Vec<f64>,
    background: Vec<f32>,
    /// Frames in the background, and in the noise; both fade.
    weight: f64,
    noise_weight: f64,
    /// Mean level of each tile, and of the frame's medians.
    noise: Vec<f32>,
    level: f32,
    tiles: Vec<f32>,
    samples: Vec<f32>,
    z: Vec<f32>,
}

/// Side of a cell, px: odd, so that a pixel is its middle; 0.5 to 1.5 σ of a spot from a σ of 2 px on, so that at the rim between two 0.87 of it are left at least; of another
/// shape for the same.
pub(super) fn step_of(profile: &Profile) -> usize {
    let sigma_px = profile.reach(RIM) / RIM;
    2 * (sigma_px / 2.6 + 0.2).floor() as usize + 1
}

impl Whitened {
    /// Makes room for frames of a size.
    pub(super) fn new<T: Pixel>(width: usize, height: usize, config: &BernoulliConfig) -> Self {
        let profile = Profile::new(config);
        let step = step_of(&profile);
        let size = (width.div_ceil(step), height.div_ceil(step));
        let tile = (TILE_PX / step).max(TILE_CELLS);
        let (n, n_tiles) = (size.0 * size.1, size.0.div_ceil(tile) * size.1.div_ceil(tile));
        let spatial = config.background != StillBackground::Temporal;
        Self {
            width,
            height,
            step,
            size,
            tile,
            kernel: profile.kernel(),
            surround: spatial.then(|| profile.half_surround()),
            temporal: config.background != StillBackground::Spatial,
            memory_s: MEMORY * straight_s(config),
            rounding: T::STEP / 12f32.sqrt(),
            raw: vec![0.0; width * height],
            row: vec![0.0; width],
            filtered: vec![0.0; width * height],
            means: vec![0.0; if spatial { width * height } else { 0 }],
            sums: vec![0.0; width + 1],
            background: vec![0.0; n],
            noise: vec![0.0; n_tiles],
            tiles: vec![0.0; n_tiles],
            samples: Vec::with_capacity(n.max(n_tiles)),
            z: vec![0.0; n],
            ..Self::default()
        }
    }

    /// Forgets all frames.
    pub(super) fn clear(&mut self) {
        (self.weight, self.noise_weight) = (0.0, 0.0);
        self.background.fill(0.0);
    }

    /// Cells across and down.
    pub(super) const fn size(&self) -> (usize, usize) {
        self.size
    }

    /// Side of a cell, px.
    pub(super) const fn step(&self) -> usize {
        self.step
    }

    /// Deviations of the noise by cell, row by row.
    pub(super) fn z(&self) -> &[f32] {
        &self.z
    }

    /// Mean noise of a pixel of the matched frame, counts.
    pub(super) const fn noise_counts(&self) -> f32 {
        self.level
    }

    /// Takes a frame in; whether it can be judged.
    pub(super) fn take<T: Pixel>(&mut self, image: &Image<T>, dt_s: f64) -> bool {
        finite(image, &mut self.raw);
        if let Some(half) = self.surround {
            subtract_surround(&mut self.raw, self.width, half, &mut self.means, &mut self.sums);
        }
        filter(&self.raw, self.width, self.height, &self.kernel, &mut self.row, self.width, &mut self.filtered);
        let (cells, step) = (self.size.0, self.step);
        for (cy, row) in self.z.chunks_exact_mut(cells).enumerate() {
            let from = &self.filtered[(cy * step + step / 2).min(self.height - 1) * self.width..][..self.width];
            for (cx, z) in row.iter_mut().enumerate() {
                *z = from[(cx * step + step / 2).min(self.width - 1)];
            }
        }
        let kept = (-dt_s / self.memory_s).exp();
        let known = !self.temporal || self.weight >= FEWEST;
        if self.temporal {
            self.weight = kept * self.weight + 1.0;
            take_out(&mut self.z, &mut self.background, (1.0 / self.weight) as f32);
        }
        if known {
            self.learn_noise(kept);
            self.divide();
        }
        known
    }

    /// The noise of each tile, with this frame.
    fn learn_noise(&mut self, kept: f64) {
        let ((w, h), tile) = (self.size, self.tile);
        let across = w.div_ceil(tile);
        for (i, level) in self.tiles.iter_mut().enumerate() {
            let (x, y) = (i % across * tile, i / across * tile);
            self.samples.clear();
            for row in y..(y + tile).min(h) {
                self.samples.extend(self.z[row * w + x..row * w + (x + tile).min(w)].iter().map(|r| r.abs()));
            }
            *level = (MAD * median(&mut self.samples)).max(self.rounding).max(f32::MIN_POSITIVE.sqrt());
        }
        self.samples.clear();
        self.samples.extend_from_slice(&self.tiles);
        let frame = median(&mut self.samples);
        self.noise_weight = kept * self.noise_weight + 1.0;
        let new = (1.0 / self.noise_weight) as f32;
        self.level += new * (frame - self.level);
        // A frame that shows nothing at all (a dropout) is no witness without noise.
        let frame = frame.max(SHARED * self.level);
        for (noise, now) in self.noise.iter_mut().zip(&mut self.tiles) {
            *noise += new * (*now / frame - *noise);
            let shrunk = (self.noise_weight as f32 * *noise + PRIOR as f32) / (self.noise_weight + PRIOR) as f32;
            *now = frame * shrunk.max(SHARED);
        }
    }

    /// Residuals to deviations.
    fn divide(&mut self) {
        let ((w, _), tile) = (self.size, self.tile);
        let across = w.div_ceil(tile);
        for (y, row) in self.z.chunks_exact_mut(w).enumerate() {
            let tiles = &self.tiles[y / tile * across..][..across];
            for (cells, noise) in row.chunks_mut(tile).zip(tiles) {
                let by = 1.0 / noise;
                cells.iter_mut().for_each(|z| *z *= by);
            }
        }
    }
}

widest! {
    /// r = frame − B, and B takes its share of the frame in.
    fn take_out(frame: &mut [f32], background: &mut [f32], share: f32) {
        for (f, b) in frame.iter_mut().zip(background) {
            *f -= *b;
            *b += share * *f;
        }
    }
}
