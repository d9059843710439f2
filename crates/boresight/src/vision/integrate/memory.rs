//! The memory of frames: each matched to the spot, with background and noise taken out when a sum is made of them.
//!
//! How: a frame I (non-finite pixels take their left neighbour's value) is correlated with the spot P of unit energy, Σ P² = 1, so that white
//! noise keeps its deviation; with `spatial` the mean over a square of half width 8 σ goes first. Filter and mean are linear, so the
//! background B is the mean of filtered frames: over those of this sum and, fading by [`FADE`] a sum, of the ones before. It holds the sum's own frames, which
//! takes v = 0 out exactly and lessens noise there, never adds any. Residual r = filtered − B.
//! Noise: deviation s(cell) of r in cells of [`CELL`] pixels, 1.4826 times the median of |r| over the sum's frames, times a factor g of each frame; least
//! [`SHARED`] of the median of cells and of frames, and the rounding of whole counts. Contributions to the sums: ψ = S r / s², φ = S² / s², S the median of s:
//! a score Σψ / √Σφ of white noise is N(0, 1). ψ is kept as whole numbers of 1/[`PER_UNIT`] (rounding: 2·10⁻⁵ of the noise's variance; ends at 512), so
//! that sums are exact in any order.
//! Limits: noise that changes within a cell; pixels nearer than 3 σ to the border see part of the spot, so their scores are too low.
//! Cost: some 10 ns a pixel and frame.

use super::config::StillBackground;
use crate::Image;
use crate::vision::matched::{MAD, add_scaled, filter, finite, half_surround, kernel, median, subtract_surround};
use crate::vision::pixel::Pixel;

/// Side of a cell of the noise map, px: some 10 independent places of a spot of σ = 1.3 px in each frame.
pub(super) const CELL: usize = 16;
/// Steps of a stored contribution in one deviation of the noise.
pub(super) const PER_UNIT: f32 = 64.0;
/// Part of the older background that is kept at each sum: half of the frames are new, so some eight sums count.
const FADE: f32 = 0.875;
/// Part of the median noise that every cell, and every frame, has at least.
const SHARED: f32 = 0.5;
/// Every which pixel of a cell, and of the frame, its noise is read from: odd, out of step with rows.
const SAMPLED: usize = 5;

/// The last frames, filtered.
#[derive(Clone, Debug, Default)]
pub(super) struct Memory {
    width: usize,
    height: usize,
    /// Width rounded up to whole cells.
    stride: usize,
    kernel: Vec<f32>,
    surround: Option<usize>,
    temporal: bool,
    /// Least noise of a pixel: the rounding of whole counts.
    rounding: f32,
    frames: Vec<Vec<f32>>,
    times_s: Vec<f64>,
    /// Where the next frame goes, and how many there are.
    next: usize,
    filled: usize,
    background: Vec<f32>,
    background_weight: f32,
    raw: Vec<f32>,
    row: Vec<f32>,
    /// Scratch of `spatial`.
    means: Vec<f32>,
    sums: Vec<f64>,
    samples: Vec<f32>,
    cells: Vec<f32>,
}

impl Memory {
    /// Makes room for `n` frames of spots of `sigma_px`.
    pub(super) fn new<T: Pixel>(width: usize, height: usize, n: usize, sigma_px: f64, of: StillBackground) -> Self {
        let stride = width.next_multiple_of(CELL);
        let pixels = stride * height;
        Self {
            width,
            height,
            stride,
            kernel: kernel(sigma_px),
            surround: (of != StillBackground::Temporal).then_some(half_surround(sigma_px)),
            temporal: of != StillBackground::Spatial,
            rounding: T::STEP / 12f32.sqrt(),
            frames: vec![vec![0.0; pixels]; n],
            times_s: vec![0.0; n],
            background: vec![0.0; pixels],
            raw: vec![0.0; width * height],
            row: vec![0.0; width],
            means: vec![0.0; if of == StillBackground::Temporal { 0 } else { width * height }],
            sums: vec![0.0; width + 1],
            samples: Vec::with_capacity(n * (CELL * CELL / SAMPLED + 1).max(pixels / SAMPLED / n.max(1) + 1)),
            cells: vec![0.0; height.div_ceil(CELL) * stride / CELL],
            ..Self::default()
        }
    }

    /// Forgets all frames.
    pub(super) fn clear(&mut self) {
        (self.next, self.filled, self.background_weight) = (0, 0, 0.0);
    }

    /// Whether no frame is there.
    pub(super) fn is_empty(&self) -> bool {
        self.filled == 0
    }

    /// Whether all frames of a sum are there.
    pub(super) fn is_full(&self) -> bool {
        self.filled == self.frames.len()
    }

    /// Place of the frame that is `age` frames older than the newest.
    fn place(&self, age: usize) -> usize {
        (self.next + 2 * self.frames.len() - 1 - age) % self.frames.len()
    }

    /// Time of the frame of an age, s.
    pub(super) fn time_s(&self, age: usize) -> f64 {
        self.times_s[self.place(age)]
    }

    /// Takes a frame in.
    pub(super) fn push<T: Pixel>(&mut self, image: &Image<T>, time_s: f64) {
        let (w, place) = (self.width, self.next);
        finite(image, &mut self.raw);
        if let Some(half) = self.surround {
            subtract_surround(&mut self.raw, w, half, &mut self.means, &mut self.sums);
        }
        filter(&self.raw, w, self.height, &self.kernel, &mut self.row, self.stride, &mut self.frames[place]);
        self.times_s[place] = time_s;
        self.next = (place + 1) % self.frames.len();
        self.filled = (self.filled + 1).min(self.frames.len());
    }

    /// Takes the sum's frames into the background.
    fn learn_background(&mut self) {
        if !self.temporal {
            return;
        }
        let n = self.frames.len();
        // The first time all frames are new, then the newer half.
        let n_new = if self.background_weight == 0.0 { n } else { n / 2 };
        let kept = FADE * self.background_weight;
        let total = kept + n_new as f32;
        scale(&mut self.background, kept / total);
        for age in 0..n_new {
            let place = self.place(age);
            add_scaled(&self.frames[place], 1.0 / total, &mut self.background);
        }
        self.background_weight = total;
    }

    /// Writes what each frame adds to the sums, the newest first, in rows of whole cells; and φ of each cell, summed over the frames.
    pub(super) fn contributions(&mut self, psi: &mut [Vec<i16>], phi: &mut Phi) {
        self.learn_background();
        let n = self.frames.len();
        phi.frames.clear();
        for age in 0..n {
            let frame = &self.frames[self.place(age)];
            self.samples.clear();
            let sampled = frame.iter().zip(&self.background).step_by(SAMPLED);
            self.samples.extend(sampled.map(|(v, b)| (v - b).abs()));
            phi.frames.push((MAD * median(&mut self.samples)).max(self.rounding).max(f32::MIN_POSITIVE.sqrt()));
        }
        // The frames' own levels, and the cells' from frames brought to one level.
        self.samples.clear();
        self.samples.extend_from_slice(&phi.frames);
        let usual = median(&mut self.samples);
        self.noise_of_cells(&phi.frames, usual);
        self.samples.clear();
        self.samples.extend_from_slice(&self.cells);
        let middle = median(&mut self.samples).max(f32::MIN_POSITIVE.sqrt());
        let cells_x = self.stride / CELL;
        phi.cells_x = cells_x;
        phi.cells.clear();
        phi.cells.extend(self.cells.iter().map(|s| (middle / s.max(SHARED * middle)).powi(2)));
        phi.unit = middle;
        // From here on a frame's factor on φ.
        // One that shows nothing at all (a dropout) is no witness without noise.
        phi.frames.iter_mut().for_each(|s| *s = (usual / s.max(SHARED * usual)).powi(2));
        for (age, psi) in psi.iter_mut().enumerate() {
            let frame = &self.frames[self.place(age)];
            for y in 0..self.height {
                let cells = &phi.cells[y / CELL * cells_x..][..cells_x];
                let row = y * self.stride..(y + 1) * self.stride;
                let unit = PER_UNIT * phi.frames[age] / middle;
                whiten(&frame[row.clone()], &self.background[row.clone()], cells, unit, &mut psi[row.clone()]);
                psi[row][self.width..].fill(0);
            }
        }
    }

    /// Deviation of each cell over all frames, each frame brought to the usual level.
    fn noise_of_cells(&mut self, levels: &[f32], usual: f32) {
        let (n, cells_x) = (self.frames.len(), self.stride / CELL);
        for cy in 0..self.height.div_ceil(CELL) {
            for cx in 0..cells_x {
                self.samples.clear();
                let wide = CELL.min(self.width - cx * CELL);
                let rows = cy * CELL..((cy + 1) * CELL).min(self.height);
                let area = wide * rows.len();
                for age in 0..n {
                    let frame = &self.frames[self.place(age)];
                    let factor = usual / levels[age];
                    // Other pixels in every frame.
                    for i in (age % SAMPLED..area).step_by(SAMPLED) {
                        let at = (rows.start + i / wide) * self.stride + cx * CELL + i % wide;
                        self.samples.push(factor * (frame[at] - self.background[at]).abs());
                    }
                }
                self.cells[cy * cells_x + cx] = (MAD * median(&mut self.samples)).max(self.rounding);
            }
        }
    }
}

/// φ of each cell, and the factor of each frame.
#[derive(Clone, Debug, Default)]
pub(super) struct Phi {
    /// By cell, row by row.
    pub(super) cells: Vec<f32>,
    pub(super) cells_x: usize,
    /// By age.
    pub(super) frames: Vec<f32>,
    /// S: what one unit of ψ / φ is in filtered counts.
    pub(super) unit: f32,
}

widest! {
    fn scale(values: &mut [f32], by: f32) {
        values.iter_mut().for_each(|v| *v *= by);
    }
}

widest! {
    fn whiten(frame: &[f32], background: &[f32], cells: &[f32], unit: f32, out: &mut [i16]) {
        for (((o, f), b), &phi) in
            out.chunks_exact_mut(CELL).zip(frame.chunks_exact(CELL)).zip(background.chunks_exact(CELL)).zip(cells)
        {
            let unit = unit * phi;
            for ((o, f), b) in o.iter_mut().zip(f).zip(b) {
                // A cast of a float saturates.
                *o = (unit * (f - b)).round_ties_even() as i16;
            }
        }
    }
}
