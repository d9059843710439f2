//! Camera motion from pixels: how far the background moved in the image since the frame before.
//!
//! Source: our own; block matching against a key frame with a consensus, as every video stabiliser does it in some form.
//! How: the frame is reduced to about 320 px. In the key frame the best-textured 12 x 12 patch of every cell of an 8 x 6 grid is
//! kept. In each new frame every patch is looked for near where the consensus was (sum of absolute differences, sub-pixel by a
//! parabola) and votes with its texture above the noise; the shift that has most of the weight is the background's, targets
//! and trees in the wind are outvoted.
//! Against a key frame errors do not add up; a shift within 0.2 px of the last one is the last one, so a fixed camera is exactly fixed.
//! Symbols: reduction f; shift (px of the full frame).
//! Limits: translation only, at most 10 reduced px a frame; less than 6 textured patches, or no majority, says nothing (`None`).

use crate::{Image, Pixels};
use nalgebra::Vector2;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Whether the camera's motion is followed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum CameraConfig {
    /// The camera stands still, or its motion is none of the tracker's business.
    #[default]
    Fixed,
    /// The background's shift is measured in every frame and taken from every position before tracking.
    Moving,
}

/// Side of a patch, reduced px.
const PATCH: usize = 12;
/// How far a patch is looked for around where the last one was found, reduced px.
const SEARCH: i64 = 10;
/// Cells of the key frame in x and y, each with one patch.
const CELLS: (usize, usize) = (8, 6);
/// Patches that must agree.
const MIN_PATCHES: usize = 6;
/// Wider frames are reduced to at most this width, px.
const REDUCED_PX: usize = 320;
/// Texture below this many times that of the image's quiet quarter has no vote.
const QUIET_TIMES: f32 = 2.0;
/// Votes within this distance agree, reduced px.
const AGREE: f64 = 0.7;
/// Share of all weight that the winner needs.
const MAJORITY: f64 = 0.4;
/// Shifts nearer than this to the last one are the last one, reduced px.
const STILL: f64 = 0.2;

#[derive(Clone, Copy, Debug)]
struct Patch {
    x: usize,
    y: usize,
    /// Weight of its vote: the texture above the noise, capped.
    weight: f64,
}

/// The most textured patch of a cell of the key frame.
#[derive(Clone, Copy, Debug)]
struct Textured {
    texture: f32,
    /// Number of the cell, row by row.
    cell: usize,
    x: usize,
    y: usize,
}

/// Where one patch was found, relative to the key frame, reduced px.
#[derive(Clone, Copy, Debug)]
struct Vote {
    shift: Vector2<f64>,
    weight: f64,
}

/// Follows the background from frame to frame.
#[derive(Clone, Debug, Default)]
pub struct CameraMotionEstimator {
    now: Image<f32>,
    key: Image<f32>,
    patches: Vec<Patch>,
    /// Shift of the key frame since the first frame, and of the last frame since the key frame, reduced px.
    key_at: Vector2<f64>,
    from_key: Vector2<f64>,
    votes: Vec<Vote>,
    textures: Vec<f32>,
    best: Vec<Textured>,
}

impl CameraMotionEstimator {
    /// Takes the next frame and returns the background's shift since the last one, px; `None` where nothing can be said.
    pub fn step(&mut self, pixels: &Pixels) -> Option<Vector2<f64>> {
        let factor = pixels.width().div_ceil(REDUCED_PX).max(1);
        match pixels {
            Pixels::Gray8(i) => reduce(i, factor, &mut self.now, f32::from),
            Pixels::Gray16(i) => reduce(i, factor, &mut self.now, f32::from),
            Pixels::GrayF32(i) => reduce(i, factor, &mut self.now, |p| p),
            // The green channel stands for the light.
            Pixels::Rgb8(i) => reduce(i, factor, &mut self.now, |p| f32::from(p[1])),
        }
        if (self.key.width(), self.key.height()) != (self.now.width(), self.now.height()) {
            self.new_key();
            return None;
        }
        let before = self.key_at + self.from_key;
        let found = self.consensus();
        if let Some(shift) = found
            && (shift - self.from_key).norm() > STILL
        {
            self.from_key = shift;
        }
        let after = self.key_at + self.from_key;
        // A key frame that can no longer be followed is replaced; what has moved so far is kept.
        let (w, h) = (self.now.width() as f64, self.now.height() as f64);
        if found.is_none() || self.from_key.x.abs() > 0.25 * w || self.from_key.y.abs() > 0.25 * h {
            self.key_at = after;
            self.new_key();
        }
        found.map(|_| (after - before) * factor as f64)
    }

    fn new_key(&mut self) {
        std::mem::swap(&mut self.key, &mut self.now);
        self.from_key = Vector2::zeros();
        self.patches.clear();
        let image = &self.key;
        let (w, h) = (image.width(), image.height());
        if w < 4 * PATCH || h < 4 * PATCH {
            return;
        }
        self.textures.clear();
        self.best.clear();
        for cy in 0..CELLS.1 {
            for cx in 0..CELLS.0 {
                let (x0, x1) = (w * cx / CELLS.0, w * (cx + 1) / CELLS.0);
                let (y0, y1) = (h * cy / CELLS.1, h * (cy + 1) / CELLS.1);
                let mut top: Option<Textured> = None;
                for y in (y0..y1).step_by(4) {
                    for x in (x0..x1).step_by(4) {
                        if x + PATCH + 1 >= w || y + PATCH + 1 >= h {
                            continue;
                        }
                        let texture = texture(image, x, y);
                        if texture.is_finite() {
                            self.textures.push(texture);
                            if top.as_ref().is_none_or(|t| texture > t.texture) {
                                top = Some(Textured { texture, cell: cy * CELLS.0 + cx, x, y });
                            }
                        }
                    }
                }
                self.best.extend(top);
            }
        }
        if self.textures.is_empty() {
            return;
        }
        self.textures.sort_unstable_by(f32::total_cmp);
        // Before a sky the quiet quarter is noise, whose fixed pattern stands still whatever the camera does, and the most textured
        // of many patches of noise has a little more of it: only what is above has a vote, and the more the stronger.
        let quiet = QUIET_TIMES * self.textures[(self.textures.len() - 1) / 4];
        self.best.retain(|b| b.texture > quiet);
        self.best.sort_unstable_by(|a, b| b.texture.total_cmp(&a.texture).then(a.cell.cmp(&b.cell)));
        // A few outstanding things may be targets: they count no more than the next. The square holds down the many weak ones, which
        // in a compressed video are often mere copies of the frame before.
        let Some(cap) = self.best.get(MIN_PATCHES - 1).map(|b| b.texture - quiet) else { return };
        self.patches.extend(self.best.iter().map(|b| Patch {
            x: b.x,
            y: b.y,
            weight: f64::from((b.texture - quiet).min(cap) / cap).powi(2),
        }));
    }

    /// The shift from the key frame that has most of the weight, reduced px.
    fn consensus(&mut self) -> Option<Vector2<f64>> {
        let around = (self.from_key.x.round() as i64, self.from_key.y.round() as i64);
        self.votes.clear();
        for p in &self.patches {
            let found = find(&self.key, &self.now, *p, around);
            self.votes.extend(found.map(|shift| Vote { shift, weight: p.weight }));
        }
        let near = |s: Vector2<f64>| self.votes.iter().filter(move |v| (v.shift - s).norm() <= AGREE);
        let weight = |s: Vector2<f64>| near(s).map(|v| v.weight).sum::<f64>();
        let (winner, won) = self
            .votes
            .iter()
            .map(|v| (v.shift, weight(v.shift)))
            .fold((Vector2::zeros(), 0.0), |best, one| if one.1 > best.1 { one } else { best });
        let all: f64 = self.votes.iter().map(|v| v.weight).sum();
        if near(winner).count() < MIN_PATCHES || won <= MAJORITY * all {
            return None;
        }
        Some(near(winner).map(|v| v.shift * v.weight).sum::<Vector2<f64>>() / won)
    }
}

/// Mean over blocks of `factor` x `factor` pixels.
fn reduce<T: Copy>(image: &Image<T>, factor: usize, out: &mut Image<f32>, value: impl Fn(T) -> f32) {
    let (w, h) = (image.width() / factor, image.height() / factor);
    out.reset(w, h, 0.0);
    let scale = 1.0 / (factor * factor) as f32;
    for y in 0..h {
        for dy in 0..factor {
            let row = image.row(y * factor + dy);
            for (o, block) in out.row_mut(y).iter_mut().zip(row.chunks_exact(factor)) {
                *o += scale * block.iter().map(|&p| value(p)).sum::<f32>();
            }
        }
    }
}

/// The smaller of the mean absolute gradients along x and y: an edge alone does not hold a patch.
fn texture(image: &Image<f32>, x: usize, y: usize) -> f32 {
    let (mut gx, mut gy) = (0.0, 0.0);
    for r in y..y + PATCH {
        let (row, below) = (image.row(r), image.row(r + 1));
        for c in x..x + PATCH {
            gx += (row[c + 1] - row[c]).abs();
            gy += (below[c] - row[c]).abs();
        }
    }
    gx.min(gy) / (PATCH * PATCH) as f32
}

/// Where a key frame's patch lies now, relative to where it was, sub-pixel; `None` at the search's or the image's border.
fn find(key: &Image<f32>, now: &Image<f32>, p: Patch, around: (i64, i64)) -> Option<Vector2<f64>> {
    const SIDE: usize = 2 * SEARCH as usize + 1;
    let (w, h) = (now.width() as i64, now.height() as i64);
    let mut costs = [[f32::INFINITY; SIDE]; SIDE];
    let mut best = (f32::INFINITY, 0, 0);
    for (i, line) in costs.iter_mut().enumerate() {
        let y = p.y as i64 + around.1 + i as i64 - SEARCH;
        if y < 0 || y + PATCH as i64 > h {
            continue;
        }
        for (j, cost) in line.iter_mut().enumerate() {
            let x = p.x as i64 + around.0 + j as i64 - SEARCH;
            if x < 0 || x + PATCH as i64 > w {
                continue;
            }
            let mut sum = 0.0;
            for r in 0..PATCH {
                let a = &key.row(p.y + r)[p.x..p.x + PATCH];
                let b = &now.row(y as usize + r)[x as usize..x as usize + PATCH];
                sum += a.iter().zip(b).map(|(a, b)| (a - b).abs()).sum::<f32>();
            }
            *cost = sum;
            if sum < best.0 {
                best = (sum, i, j);
            }
        }
    }
    let (cost, i, j) = best;
    if !cost.is_finite() || i == 0 || j == 0 || i + 1 == SIDE || j + 1 == SIDE {
        return None;
    }
    let vertex = |before: f32, at: f32, after: f32| -> Option<f64> {
        let bend = before - 2.0 * at + after;
        (bend.is_finite() && bend > 0.0).then(|| f64::from(0.5 * (before - after) / bend))
    };
    let dx = vertex(costs[i][j - 1], cost, costs[i][j + 1])?;
    let dy = vertex(costs[i - 1][j], cost, costs[i + 1][j])?;
    Some(Vector2::new(
        (around.0 + j as i64 - SEARCH) as f64 + dx.clamp(-0.5, 0.5),
        (around.1 + i as i64 - SEARCH) as f64 + dy.clamp(-0.5, 0.5),
    ))
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    /// A textured ground seen from (x, y), with one bright thing that moves on its own.
    fn view(ground: &Image<u8>, x: usize, y: usize, thing: usize) -> Pixels {
        let mut frame = Image::filled(160, 120, 0u8);
        for r in 0..120 {
            frame.row_mut(r).copy_from_slice(&ground.row(y + r)[x..x + 160]);
        }
        for r in 50..60 {
            frame.row_mut(r)[thing..thing + 10].fill(250);
        }
        Pixels::Gray8(frame)
    }

    fn ground() -> Image<u8> {
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let coarse: Vec<f64> = (0..60 * 60).map(|_| 200.0 * rng.random::<f64>()).collect();
        let mut image = Image::filled(400, 400, 0u8);
        for y in 0..400 {
            for x in 0..400 {
                // Smooth between the knots, so that half pixels exist.
                let (fx, fy) = (x as f64 / 7.0, y as f64 / 7.0);
                let (i, j) = (fx as usize, fy as usize);
                let (a, b) = (fx - i as f64, fy - j as f64);
                let at = |i: usize, j: usize| coarse[j * 60 + i];
                let v = at(i, j) * (1.0 - a) * (1.0 - b)
                    + at(i + 1, j) * a * (1.0 - b)
                    + at(i, j + 1) * (1.0 - a) * b
                    + at(i + 1, j + 1) * a * b;
                image.row_mut(y)[x] = v as u8;
            }
        }
        image
    }

    #[test]
    fn a_pan_is_followed_whatever_a_target_does() {
        let ground = ground();
        let mut camera = CameraMotionEstimator::default();
        assert_eq!(camera.step(&view(&ground, 100, 100, 10)), None, "the first frame has no shift");
        let mut sum = Vector2::zeros();
        for k in 1..30 {
            let shift = camera.step(&view(&ground, 100 + 4 * k, 100 + k, 10 + 2 * k)).expect("a textured ground");
            sum += shift;
            assert!((sum - Vector2::new(-4.0 * k as f64, -(k as f64))).norm() < 0.5, "frame {k}: {sum}");
        }
    }

    #[test]
    fn a_fixed_camera_is_exactly_fixed_under_noise() {
        let ground = ground();
        let mut rng = ChaCha8Rng::seed_from_u64(2);
        let mut camera = CameraMotionEstimator::default();
        for k in 0..20 {
            let Pixels::Gray8(mut frame) = view(&ground, 50, 50, 10 + k) else { unreachable!() };
            frame.as_mut_slice().iter_mut().for_each(|p| *p = p.saturating_add(rng.random_range(0..6)));
            let shift = camera.step(&Pixels::Gray8(frame));
            assert!(k == 0 || shift == Some(Vector2::zeros()), "frame {k}: {shift:?}");
        }
    }

    #[test]
    fn an_even_sky_and_tiny_frames_say_nothing() {
        for (w, h) in [(320, 256), (1, 1), (5, 300), (0, 0)] {
            let mut camera = CameraMotionEstimator::default();
            for _ in 0..3 {
                assert_eq!(camera.step(&Pixels::Gray8(Image::filled(w, h, 7))), None);
                assert_eq!(camera.clone().step(&Pixels::GrayF32(Image::filled(w, h, f32::NAN))), None);
            }
        }
    }
}
