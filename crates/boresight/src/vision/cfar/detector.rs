//! The detector of a stated false-alarm rate: pyramid, extremes, null, one detection a place, region and position.
//!
//! Kept are candidates of which fewer than the number asked for are expected; the rarest come first, and what lies in the region
//! or within 2.5 level pixels of a rarer one is part of it. Score: -log10 of that number. Position: a fitted Gaussian for targets up to
//! 9 px, else the region's centroid with the covariance 2 σ²/z² of a matched filter plus the rounding of the level's pixels.
//! Limits: frames with a side below 7 px have no detections. Cost: a few ns a pixel; 115 000 instructions a fitted detection (callgrind, spots of deviation 1.6 px).

use super::config::CfarConfig;
use super::contrast::Contrast;
use super::merge::Places;
use super::noise::NoiseMap;
use super::pyramid::{Pyramid, View, sigma_px};
use super::region::{Region, Seed};
use super::spot_fit::{Guess, Spot, fit};
use super::tail::{Strengths, nulls, strength};
use crate::vision::config::DetectorConfig;
use crate::vision::gaussian::WIDTH_PER_DEVIATION;
use crate::vision::pixel::Pixel;
use crate::vision::polarity::Side;
use crate::vision::target_finder::{TargetFinder, TypedFrame};
use crate::{Detection, Extent, Image, Result};
use nalgebra::{Matrix2, Vector2};

/// Part of the frame's shorter side that the largest target has, if nothing else is asked for.
const LARGEST: f64 = 0.4;
/// Coarsest level whose targets are fitted as spots.
const FITTED: usize = 2;
/// Strength below which an extreme is never a detection: white noise shows one in twenty.
const LEAST_STRENGTH: f32 = 3.0;
/// Noise of the contrast of white noise of deviation 1 on level 0; it halves with each level.
const CONTRAST_PER_NOISE: f32 = 0.4;

/// An extreme that may be a detection.
#[derive(Clone, Copy, Debug)]
struct Candidate {
    level: usize,
    x: u32,
    y: u32,
    v: f32,
    z: f32,
    strength: f32,
    /// Expected number of false alarms a frame at least as strong.
    number: f64,
}

/// A square of pixels that belongs to a detection's region.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cell {
    /// Left column, px; may lie outside the frame.
    pub left: i32,
    /// Upper row, px; may lie outside the frame.
    pub top: i32,
    /// Side, px.
    pub side: i32,
}

/// A detection and its cells.
#[derive(Clone, Debug)]
struct Found {
    detection: Detection,
    cells: std::ops::Range<usize>,
}

/// Finds targets at a stated false-alarm rate; keeps its memory between frames.
#[derive(Clone, Debug)]
pub struct CfarDetector {
    config: CfarConfig,
    pyramid: Pyramid,
    contrast: Contrast,
    noise: NoiseMap,
    /// Strengths of the listed extremes, bright and dark.
    strengths: [Vec<f32>; 2],
    candidates: Vec<Candidate>,
    places: Places,
    /// The frame where pixels without a value were mended.
    mended: Vec<f32>,
    region: Region,
    /// Which blocks of 2 x 2 pixels belong to a detection.
    taken: Vec<bool>,
    cells: Vec<Cell>,
    found: Vec<Found>,
}

impl<T: Pixel> TargetFinder<T> for CfarDetector {
    fn remembers(&self) -> bool {
        false
    }

    fn find(&mut self, frame: &TypedFrame<T>, _: &DetectorConfig, out: &mut Vec<Detection>) -> Result<()> {
        self.detect(frame.image, out);
        Ok(())
    }
}

impl CfarDetector {
    /// Builds the detector for a checked configuration.
    pub fn new(config: &CfarConfig) -> Self {
        Self {
            config: config.clone(),
            pyramid: Pyramid::default(),
            contrast: Contrast::default(),
            noise: NoiseMap::default(),
            strengths: Default::default(),
            candidates: Vec::new(),
            places: Places::default(),
            mended: Vec::new(),
            region: Region::default(),
            taken: Vec::new(),
            cells: Vec::new(),
            found: Vec::new(),
        }
    }

    /// Appends the detections of a frame, from top to bottom.
    pub fn detect<T: Pixel>(&mut self, image: &Image<T>, out: &mut Vec<Detection>) {
        self.found.clear();
        self.cells.clear();
        self.candidates.clear();
        let (w, h) = (image.width(), image.height());
        if w == 0 || h == 0 {
            return;
        }
        let largest = self.config.largest_px.unwrap_or(LARGEST * w.min(h) as f64);
        let mut mended = std::mem::take(&mut self.mended);
        let frame = View { pixels: T::mended(image.as_slice(), &mut mended), ..View::of(image) };
        self.search(frame, largest);
        self.choose();
        self.taken.clear();
        self.taken.resize(w.div_ceil(2) * h.div_ceil(2), false);
        let candidates = std::mem::take(&mut self.candidates);
        for c in &candidates {
            self.measure(c, frame, largest);
        }
        self.candidates = candidates;
        self.mended = mended;
        self.found.sort_unstable_by(|a, b| {
            let (a, b) = (a.detection.position, b.detection.position);
            a.y.total_cmp(&b.y).then(a.x.total_cmp(&b.x))
        });
        out.extend(self.found.iter().map(|f| f.detection.clone()));
    }

    /// The regions of the last frame's detections, in their order.
    pub fn regions(&self) -> impl Iterator<Item = &[Cell]> {
        self.found.iter().map(|f| &self.cells[f.cells.clone()])
    }

    /// Levels whose targets have the sizes asked for: `from..to`.
    fn levels(&self, largest: f64) -> (usize, usize) {
        let half_octave = std::f64::consts::SQRT_2;
        let size = |k: usize| WIDTH_PER_DEVIATION * sigma_px(k);
        let from = (0..16).find(|&k| size(k) * half_octave >= self.config.smallest_px).unwrap_or(16);
        let to = (0..16).find(|&k| size(k) > largest * half_octave).unwrap_or(16);
        (from, to.max(from + 1))
    }

    /// Lists the extremes of all levels with their strengths.
    fn search<T: Pixel>(&mut self, frame: View<'_, T>, largest: f64) {
        let (from, to) = self.levels(largest);
        let n = self.pyramid.fill(frame, to);
        let size = |k: usize| (frame.width.div_ceil(1 << k), frame.height.div_ceil(1 << k));
        self.places.clear((0..n).map(size));
        let mut counts = [0, 0];
        let mut finest = None;
        self.strengths.iter_mut().for_each(Vec::clear);
        // Sums of floats round by some parts in ten million of the values.
        let most = |m: f32, v: f32| m.max(v.abs());
        let magnitude = match n {
            0 => 0.0,
            1 => frame.pixels.iter().map(|v| v.value_f32()).fold(0.0, most),
            _ => self.pyramid.level(n - 1).pixels.iter().copied().fold(0.0, most),
        };
        for k in from..n {
            match k {
                0 => self.contrast.run(frame),
                _ => self.contrast.run(self.pyramid.level(k)),
            }
            let rounding = T::STEP / 12f32.sqrt() * CONTRAST_PER_NOISE / (1 << k) as f32;
            self.noise.fill(&self.contrast, rounding + 3e-6 * magnitude + f32::MIN_POSITIVE);
            counts[0] += self.contrast.n_bright;
            counts[1] += self.contrast.n_dark;
            self.list(k, size(k));
            finest.get_or_insert_with(|| (self.strengths.each_ref().map(Vec::len), counts));
        }
        let (finest_listed, finest_count) = finest.unwrap_or_default();
        let sides = [Side::Bright, Side::Dark].iter().filter(|s| self.config.polarity.has(**s)).count();
        let [bright, dark] = &mut self.strengths;
        let of = |i: usize, listed| Strengths {
            listed,
            count: counts[i],
            finest_listed: finest_listed[i],
            finest_count: finest_count[i],
        };
        let nulls = nulls(of(0, bright), of(1, dark), sides);
        let rate = self.config.rate(frame.width * frame.height);
        let least = nulls.map(|n| n.strength_of(rate));
        self.candidates.retain_mut(|c| {
            let side = usize::from(c.v < 0.0);
            let is_rare = f64::from(c.strength) >= least[side];
            if is_rare {
                c.number = nulls[side].number(f64::from(c.strength));
            }
            is_rare
        });
    }

    /// Lists the strengths of the extremes of level `k`, and which may be detections.
    fn list(&mut self, k: usize, (w, h): (usize, usize)) {
        let extremes = &self.contrast.extremes;
        // Written by place, not by side: which of the two it is cannot be foreseen.
        let [bright, dark] = &mut self.strengths;
        let begun = [bright.len(), dark.len()];
        bright.resize(begun[0] + extremes.len(), 0.0);
        dark.resize(begun[1] + extremes.len(), 0.0);
        let sides = [&mut bright[begun[0]..], &mut dark[begun[1]..]];
        let is_wanted = [Side::Bright, Side::Dark].map(|side| self.config.polarity.has(side));
        let (mut done, mut n_dark) = (0, 0);
        let edges = (w as u32 - 1, h as u32 - 1);
        for of_row in extremes.chunk_by(|a, b| a.y == b.y) {
            let y = of_row[0].y;
            let noise = self.noise.row(y, w);
            // On the outermost pixels a mirrored pair is one pixel twice: its noise has twice the variance.
            let row = if y == 0 || y == edges.1 { std::f32::consts::SQRT_2 } else { 1.0 };
            for e in of_row {
                let column = if e.x == 0 || e.x == edges.0 { std::f32::consts::SQRT_2 } else { 1.0 };
                let z = (e.v.abs() / (noise.at(e.x) * column * row)).min(1e4);
                let strength = strength(z);
                let is_dark = usize::from(e.v < 0.0);
                let at = if is_dark == 0 { done - n_dark } else { n_dark };
                sides[is_dark][at] = strength;
                done += 1;
                n_dark += is_dark;
                if strength > LEAST_STRENGTH && is_wanted[is_dark] {
                    self.candidates.push(Candidate { level: k, x: e.x, y: e.y, v: e.v, z, strength, number: 0.0 });
                }
            }
        }
        bright.truncate(begun[0] + done - n_dark);
        dark.truncate(begun[1] + n_dark);
    }

    /// Orders the candidates, the rarest first, and keeps one a place.
    fn choose(&mut self) {
        self.candidates.sort_unstable_by(|a, b| {
            let number = a.number.total_cmp(&b.number).then(b.strength.total_cmp(&a.strength));
            number.then((a.level, a.y, a.x).cmp(&(b.level, b.y, b.x)))
        });
        let places = &mut self.places;
        self.candidates.retain(|c| places.keep(c.level, c.x, c.y));
    }

    /// Makes a detection of a candidate, unless it lies in one already made or is too large.
    fn measure<T: Pixel>(&mut self, c: &Candidate, full: View<'_, T>, largest: f64) {
        let taken_width = full.width.div_ceil(2);
        let half = |v: u32| ((v << c.level) / 2) as usize;
        if self.taken[half(c.y).min(full.height.div_ceil(2) - 1) * taken_width + half(c.x).min(taken_width - 1)] {
            return;
        }
        let on_level = c.level.saturating_sub(1);
        let zoom = 1 << (c.level - on_level);
        let side = 1i32 << on_level;
        let (x, y) = (c.x as i32, c.y as i32);
        let at = match c.level {
            0 => full.value(x, y, true),
            k => self.pyramid.level(k).value(x, y, true),
        };
        let at = at.unwrap_or(0.0);
        let seed = Seed { x: x * zoom, y: y * zoom, zoom, smooth: c.level > 0, sign: c.v.signum(), ground: at - c.v };
        match on_level {
            0 => self.region.grow(full, &seed),
            k => self.region.grow(self.pyramid.level(k), &seed),
        }
        let [left, top, right, bottom] = self.region.bounds();
        let longest = (right - left).max(bottom - top) + 1;
        if f64::from(longest * side) > largest.max(f64::from(side)) {
            return;
        }
        let first = self.cells.len();
        for &(x, y) in &self.region.pixels {
            // A pixel of a coarser level stands for the square around its centre.
            let cell = Cell { left: x * side - side / 2, top: y * side - side / 2, side };
            self.cells.push(cell);
            let span =
                |from: i32, n: usize| (from.max(0) / 2) as usize..(((from + side + 1) / 2).max(0) as usize).min(n);
            for row in span(cell.top, full.height.div_ceil(2)) {
                for column in span(cell.left, taken_width) {
                    self.taken[row * taken_width + column] = true;
                }
            }
        }
        let area = self.region.pixels.len() as f64 * f64::from(side * side);
        let (position, cov) = self.position(c, &seed, area, full, f64::from(side));
        let side = f64::from(side);
        let detection = Detection {
            position,
            cov,
            extent: Extent {
                left_px: (f64::from(left) - 0.5) * side,
                top_px: (f64::from(top) - 0.5) * side,
                width_px: f64::from(right - left + 1) * side,
                height_px: f64::from(bottom - top + 1) * side,
            },
            area_px: area as u32,
            peak: self.region.peak,
            sum: self.region.sum * side * side,
            score: (-c.number.max(1e-300).log10()) as f32,
            class: None,
            velocity: None,
            fit: None,
            age_ns: 0,
            plot: None,
        };
        self.found.push(Found { detection, cells: first..self.cells.len() });
    }

    /// Position and covariance of a detection whose region has been grown.
    fn position<T: Pixel>(
        &self,
        c: &Candidate,
        seed: &Seed,
        area: f64,
        full: View<'_, T>,
        side: f64,
    ) -> (Vector2<f64>, Matrix2<f64>) {
        let centre = Vector2::new(self.region.centre.0 * side, self.region.centre.1 * side);
        let sigma = sigma_px(c.level);
        if c.level <= FITTED {
            let guess = Guess {
                x: centre.x,
                y: centre.y,
                height: f64::from(self.region.peak - seed.ground),
                ground: f64::from(seed.ground),
                // A region that ends at half of a Gaussian's height has the area 2 π ln(2) σ².
                sigma: (area / 4.355).sqrt().clamp(0.6, 1.6 * sigma),
            };
            let rounding = f64::from(T::STEP).powi(2) / 12.0;
            if let Some(Spot { position, cov, .. }) = fit(full, &guess, rounding.max(1e-12)) {
                return (position, cov);
            }
        }
        let variance = 2.0 * (sigma / f64::from(c.z)).powi(2) + side * side / 12.0;
        (centre, Matrix2::identity() * variance)
    }
}

#[cfg(test)]
mod tests;
