//! Patches of a key frame at the frame's own sharpness: chosen, and found in a later frame to a small part of its pixels.
//!
//! Source: the inverse compositional Lucas-Kanade step of [`super::find_patch`].
//! How: the reduced frame says where texture is ([`super::key_frame`]) and, coarsely, where it has gone; here only windows of the frame around those places are read, in means of
//! blocks where the frame is wider than [`FINE_PX`], smoothed by [1 2 1]/4 both ways: between the pixels of a smoothed image straight lines run nearly where the image does.
//! Each window is looked through for the best whole place within [`REACH`], for the coarse place is only as good as the reduced pixels.
//! Units: fine px. Limits: patches within a window's margin of the border are left out.

use super::find_patch::{Block, bilinear, refine};
use super::fit::Match;
use super::key_frame::{PATCH, Patch};
use super::plane::MOST_MATCHES;
use super::reduce::blocks_of;
use crate::{Homography, Image, Pixels};
use nalgebra::{Matrix2, Vector2};

/// Wider frames are looked at in means of blocks, px.
const FINE_PX: usize = 960;
/// Pixels around a patch that are kept for its turned and zoomed look.
const MARGIN: usize = 4;
const KEPT: usize = PATCH + 2 * MARGIN;
/// How far around the predicted place a patch is looked for, px.
const REACH: i64 = 2;
/// Share of the fine patches that must be found near where the coarse ones lead them, and of their weight that must agree with their plane.
pub(super) const FOUND: f64 = 0.5;
/// Deviation of the fine patches from which on they say nothing, px: places within two pixels at random deviate by more than 1.
pub(super) const LOST_PX: f64 = 0.5;
/// A window around a place: the patch at its farthest place, a step of a pixel and the next pixel beyond.
const WINDOW: usize = PATCH + 2 * REACH as usize + 4;

/// Side of a block for frames of this width, px.
pub(super) fn fine_factor(width: usize) -> usize {
    width.div_ceil(FINE_PX).max(1)
}

/// A patch with what lies around it.
#[derive(Clone, Debug)]
struct FinePatch {
    middle: Vector2<f64>,
    weight: f64,
    pixels: [[f32; KEPT]; KEPT],
}

/// A key frame's patches.
#[derive(Clone, Debug, Default)]
pub(super) struct FinePatches {
    patches: Vec<FinePatch>,
    window: Image<f32>,
}

impl FinePatches {
    /// Forgets them.
    pub fn clear(&mut self) {
        self.patches.clear();
    }

    /// Takes the best-textured patch within each of the places of the reduced frame, whose pixels are blocks of `factor` px of the frame.
    pub fn choose(&mut self, pixels: &Pixels, factor: usize, places: &[Patch]) {
        match pixels {
            Pixels::Gray8(i) => self.choose_in(i, factor, places, f32::from),
            Pixels::Gray16(i) => self.choose_in(i, factor, places, f32::from),
            Pixels::GrayF32(i) => self.choose_in(i, factor, places, |p| p),
            Pixels::Rgb8(i) => self.choose_in(i, factor, places, |p: [u8; 3]| f32::from(p[1])),
        }
    }

    fn choose_in<T: Copy>(
        &mut self,
        image: &Image<T>,
        factor: usize,
        places: &[Patch],
        value: impl Fn(T) -> f32 + Copy,
    ) {
        self.patches.clear();
        let fine = fine_factor(image.width());
        let scale = factor as f64 / fine as f64;
        let side = (PATCH as f64 * scale).round() as usize;
        for p in places.iter().take(MOST_MATCHES) {
            let (left, top) = ((p.x as f64 * scale).round() as i64, (p.y as f64 * scale).round() as i64);
            if !smooth_window(image, fine, (left, top), side + 1, value, &mut self.window) {
                continue;
            }
            // Places side by side that fill the patch of the reduced frame.
            let n = (side / PATCH).max(1);
            let at = |i: usize| i * (side - PATCH) / (n - 1).max(1);
            let places = (0..n * n).map(|k| (at(k % n), at(k / n)));
            let best = places.map(|(x, y)| (texture(&self.window, x, y), x, y)).max_by(|a, b| a.0.total_cmp(&b.0));
            let Some((texture, x, y)) = best else { continue };
            let corner = (left + x as i64, top + y as i64);
            let around = (corner.0 - MARGIN as i64, corner.1 - MARGIN as i64);
            let has_texture = texture.is_finite() && texture > 0.0;
            if !(has_texture && smooth_window(image, fine, around, KEPT, value, &mut self.window)) {
                continue;
            }
            let mut kept = [[0.0; KEPT]; KEPT];
            kept.iter_mut().enumerate().for_each(|(r, line)| line.copy_from_slice(self.window.row(r)));
            let half = 0.5 * (PATCH - 1) as f64;
            let middle = Vector2::new(corner.0 as f64 + half, corner.1 as f64 + half);
            self.patches.push(FinePatch { middle, weight: p.weight, pixels: kept });
        }
    }

    /// Fills `out` with where the patches lie now, near where `predicted` takes them; returns how many should lie in the frame.
    pub fn find(&mut self, pixels: &Pixels, predicted: &Homography, out: &mut Vec<Match>) -> usize {
        match pixels {
            Pixels::Gray8(i) => self.find_in(i, predicted, f32::from, out),
            Pixels::Gray16(i) => self.find_in(i, predicted, f32::from, out),
            Pixels::GrayF32(i) => self.find_in(i, predicted, |p| p, out),
            Pixels::Rgb8(i) => self.find_in(i, predicted, |p: [u8; 3]| f32::from(p[1]), out),
        }
    }

    fn find_in<T: Copy>(
        &mut self,
        image: &Image<T>,
        predicted: &Homography,
        value: impl Fn(T) -> f32 + Copy,
        out: &mut Vec<Match>,
    ) -> usize {
        out.clear();
        let fine = fine_factor(image.width());
        let half = Vector2::repeat(0.5 * (PATCH - 1) as f64);
        let (w, h) = ((image.width() / fine) as f64, (image.height() / fine) as f64);
        let mut n = 0;
        for p in &self.patches {
            let corner = predicted.apply(p.middle) - half;
            if !(corner.x >= 0.0 && corner.y >= 0.0 && corner.x < w && corner.y < h) {
                continue;
            }
            let first = (corner.x.round() as i64 - REACH - 1, corner.y.round() as i64 - REACH - 1);
            if !smooth_window(image, fine, first, WINDOW, value, &mut self.window) {
                continue;
            }
            n += 1;
            let Some(template) = turned(p, predicted) else { continue };
            let best = best_place(&template, &self.window);
            if let Some(part) = refine(&template, &self.window, best) {
                let at = Vector2::new((first.0 + best.0) as f64, (first.1 + best.1) as f64);
                out.push(Match { from: p.middle, to: at + half + part, weight: p.weight });
            }
        }
        n
    }
}

/// Means of blocks of `fine` px from that row and column of them on, `side` each way, smoothed; whether all of it lies in the image.
fn smooth_window<T: Copy>(
    image: &Image<T>,
    fine: usize,
    (left, top): (i64, i64),
    side: usize,
    value: impl Fn(T) -> f32 + Copy,
    out: &mut Image<f32>,
) -> bool {
    let (w, h) = ((image.width() / fine) as i64, (image.height() / fine) as i64);
    // A pixel more on each side for the smoothing.
    if left < 1 || top < 1 || left + side as i64 + 1 > w || top + side as i64 + 1 > h {
        return false;
    }
    out.reset(side, side, 0.0);
    let (left, top) = (left as usize - 1, top as usize - 1);
    let mut line = [0.0f32; MOST_SIDE + 2];
    let mut across = [[0.0f32; MOST_SIDE]; 3];
    for r in 0..side + 2 {
        let line = &mut line[..side + 2];
        blocks_of(image, fine, (left, top + r), value, line);
        let row = &mut across[r % 3][..side];
        for (x, v) in row.iter_mut().enumerate() {
            *v = 0.25 * (line[x] + line[x + 2]) + 0.5 * line[x + 1];
        }
        if r >= 2 {
            let (above, middle, below) = (&across[(r - 2) % 3], &across[(r - 1) % 3], &across[r % 3]);
            for (x, v) in out.row_mut(r - 2).iter_mut().enumerate() {
                *v = 0.25 * (above[x] + below[x]) + 0.5 * middle[x];
            }
        }
    }
    true
}

/// Most pixels of a window's side: a patch of the reduced frame of 4 k px and wider ones.
const MOST_SIDE: usize = 64;

/// The smaller of the mean absolute gradients along x and y of a patch of the window.
fn texture(window: &Image<f32>, x: usize, y: usize) -> f32 {
    let (mut gx, mut gy) = (0.0, 0.0);
    for r in y..y + PATCH {
        let (row, below) = (&window.row(r)[x..x + PATCH + 1], &window.row(r + 1)[x..x + PATCH]);
        for c in 0..PATCH {
            gx += (row[c + 1] - row[c]).abs();
            gy += (below[c] - row[c]).abs();
        }
    }
    f32::min(gx, gy) / (PATCH * PATCH) as f32
}

/// The patch as it should look now.
fn turned(p: &FinePatch, predicted: &Homography) -> Option<Block> {
    let mut out = [[0.0; PATCH]; PATCH];
    let a = predicted.linear_at(p.middle);
    // What moves no pixel of the patch by a tenth of one is only a shift.
    if (a - Matrix2::identity()).norm() <= 0.2 / PATCH as f64 {
        for (line, kept) in out.iter_mut().zip(&p.pixels[MARGIN..]) {
            line.copy_from_slice(&kept[MARGIN..MARGIN + PATCH]);
        }
        return Some(out);
    }
    let back = a.try_inverse()?;
    let half = 0.5 * (PATCH - 1) as f64;
    let middle = Vector2::repeat(half + MARGIN as f64);
    for (r, line) in out.iter_mut().enumerate() {
        for (c, v) in line.iter_mut().enumerate() {
            *v = bilinear(&p.pixels, middle + back * Vector2::new(c as f64 - half, r as f64 - half))?;
        }
    }
    Some(out)
}

/// The whole place of the window, one from its border on, with the least sum of absolute differences.
fn best_place(template: &Block, window: &Image<f32>) -> (i64, i64) {
    let mut best = (f32::INFINITY, 0, 0);
    for y in 1..=2 * REACH as usize + 1 {
        for x in 1..=2 * REACH as usize + 1 {
            let mut sums = [0.0f32; PATCH];
            for (r, line) in template.iter().enumerate() {
                let row = &window.row(y + r)[x..x + PATCH];
                for c in 0..PATCH {
                    sums[c] += (line[c] - row[c]).abs();
                }
            }
            let sum: f32 = sums.iter().sum();
            if sum < best.0 {
                best = (sum, x as i64, y as i64);
            }
        }
    }
    (best.1, best.2)
}
