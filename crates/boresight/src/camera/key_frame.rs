//! The key frame and its patches: what the frames after it are compared with.
//!
//! Source: our own. The best-textured 12 x 12 patch of every cell of an 8 x 6 grid is kept; texture is the smaller of the mean absolute
//! gradients along x and y, for an edge alone does not hold a patch. A patch votes with its texture above twice that of the image's quiet
//! quarter: before a sky the quiet quarter is noise, whose fixed pattern stands still whatever the camera does.
//! Where fewer than [`MIN_PATCHES`] stand out so, the texture is even (fields, a forest from the air) or there is none: then every cell's
//! best has the same vote, and the key frame is marked `even`: its word is to be believed only once it has seen the image move.
//! Besides, the best of each half of a cell is a place where the frame itself is looked at ([`super::fine`]): two for each patch, by the same rules.
//! Units: reduced px. Limits: frames below 48 reduced px a side have no patches.

use crate::Image;
use nalgebra::Vector2;

/// Side of a patch, reduced px.
pub(super) const PATCH: usize = 12;
/// Patches that must agree.
pub(super) const MIN_PATCHES: usize = 6;
/// Cells of the key frame in x and y, each with one patch.
pub(super) const CELLS: (usize, usize) = (8, 6);
/// From one place that a patch is looked for at to the next, reduced px.
pub(super) const STEP: usize = 4;
/// Texture below this many times that of the image's quiet quarter does not stand out.
const QUIET_TIMES: f32 = 2.0;

/// A patch of a key frame.
#[derive(Clone, Copy, Debug)]
pub(super) struct Patch {
    /// First column and row.
    pub x: usize,
    pub y: usize,
    /// Weight of its vote: the texture above the noise, capped; in (0, 1].
    pub weight: f64,
}

impl Patch {
    /// Its middle, reduced px.
    pub fn middle(&self) -> Vector2<f64> {
        let half = 0.5 * (PATCH - 1) as f64;
        Vector2::new(self.x as f64 + half, self.y as f64 + half)
    }
}

/// The most textured patch of a cell.
#[derive(Clone, Copy, Debug)]
struct Textured {
    texture: f32,
    /// Number of the cell, row by row.
    cell: usize,
    x: usize,
    y: usize,
}

/// A frame with its patches.
#[derive(Clone, Debug, Default)]
pub(super) struct KeyFrame {
    pub image: Image<f32>,
    pub patches: Vec<Patch>,
    /// The best of the other cells, which have no vote but may object.
    pub weak: Vec<Patch>,
    /// Where the frame itself is worth a look.
    pub places: Vec<Patch>,
    /// No patch stands out from the others.
    pub even: bool,
    /// It has seen the image move.
    pub proven: bool,
    chosen: bool,
    /// Texture above which a patch stands out, where it is not even.
    pub quiet: f32,
    textures: Vec<f32>,
    /// By column, the sums of the absolute gradients along x and y over the rows of a patch.
    gradients: Vec<[f32; 2]>,
    best: Vec<Textured>,
    best_of_halves: Vec<Textured>,
}

impl KeyFrame {
    /// Takes a frame over (the old one is given in exchange) and chooses its patches.
    pub fn take(&mut self, frame: &mut Image<f32>) {
        self.keep(frame);
        self.choose();
    }

    /// Takes a frame over whose patches may be chosen later.
    pub fn keep(&mut self, frame: &mut Image<f32>) {
        std::mem::swap(&mut self.image, frame);
        self.chosen = false;
        self.patches.clear();
        self.weak.clear();
        self.places.clear();
    }

    /// Is to be looked for no more.
    pub fn forget(&mut self) {
        self.patches.clear();
        self.weak.clear();
        self.places.clear();
        self.best.clear();
        self.best_of_halves.clear();
        self.chosen = true;
    }

    /// Lets all cells vote, though some patches stand out.
    pub fn choose_even(&mut self) {
        (self.chosen, self.even, self.proven) = (true, true, false);
        self.patches.clear();
        self.weak.clear();
        let textured = self.best.iter().filter(|b| b.texture > 0.0);
        self.patches.extend(textured.map(|b| Patch { x: b.x, y: b.y, weight: 1.0 }));
        self.places.clear();
        let textured = self.best_of_halves.iter().filter(|b| b.texture > 0.0);
        self.places.extend(textured.map(|b| Patch { x: b.x, y: b.y, weight: 1.0 }));
    }

    /// Chooses the patches, if that was not done.
    pub fn choose(&mut self) {
        if self.chosen {
            return;
        }
        (self.chosen, self.even, self.proven) = (true, false, false);
        self.find_best();
        if self.textures.is_empty() {
            return;
        }
        self.textures.sort_unstable_by(f32::total_cmp);
        let quiet = QUIET_TIMES * self.textures[(self.textures.len() - 1) / 4];
        self.quiet = quiet;
        self.best.sort_unstable_by(|a, b| b.texture.total_cmp(&a.texture).then(a.cell.cmp(&b.cell)));
        let n_clear = self.best.iter().take_while(|b| b.texture > quiet).count();
        if n_clear < MIN_PATCHES {
            self.choose_even();
            return;
        }
        // A few outstanding things may be targets: they count no more than the next. The square holds down the many weak ones, which
        // in a compressed video are often mere copies of the frame before.
        let cap = self.best[MIN_PATCHES - 1].texture - quiet;
        let patch =
            |b: &Textured| Patch { x: b.x, y: b.y, weight: f64::from((b.texture - quiet).min(cap) / cap).powi(2) };
        self.patches.extend(self.best[..n_clear].iter().map(patch));
        let weak = self.best[n_clear..].iter().filter(|b| b.texture > 0.0);
        self.weak.extend(weak.map(|b| Patch { x: b.x, y: b.y, weight: 1.0 }));
        self.places.extend(self.best_of_halves.iter().filter(|b| b.texture > quiet).map(patch));
    }

    fn find_best(&mut self) {
        let image = &self.image;
        let (w, h) = (image.width(), image.height());
        self.textures.clear();
        self.best.clear();
        self.best_of_halves.clear();
        if w < 4 * PATCH || h < 4 * PATCH {
            return;
        }
        for cy in 0..CELLS.1 {
            let mut tops: [[Option<Textured>; 2]; CELLS.0] = [[None; 2]; CELLS.0];
            for y in (h * cy / CELLS.1..h * (cy + 1) / CELLS.1).step_by(STEP).take_while(|y| y + PATCH + 1 < h) {
                self.gradients.clear();
                self.gradients.resize(w - 1, [0.0; 2]);
                for r in y..y + PATCH {
                    add_gradients(image.row(r), image.row(r + 1), &mut self.gradients);
                }
                for (cx, halves) in tops.iter_mut().enumerate() {
                    let (first, end) = (w * cx / CELLS.0, w * (cx + 1) / CELLS.0);
                    let columns = (first..end).step_by(STEP);
                    for x in columns.take_while(|x| x + PATCH + 1 < w) {
                        let texture = texture(&self.gradients[x..x + PATCH]);
                        if texture.is_finite() {
                            self.textures.push(texture);
                            let top = &mut halves[usize::from(2 * x >= first + end)];
                            if top.as_ref().is_none_or(|t| texture > t.texture) {
                                *top = Some(Textured { texture, cell: cy * CELLS.0 + cx, x, y });
                            }
                        }
                    }
                }
            }
            // Of two alike the left one, as in the order that they were looked at.
            let best = |h: [Option<Textured>; 2]| match h {
                [Some(a), Some(b)] if b.texture > a.texture => Some(b),
                [a, b] => a.or(b),
            };
            self.best.extend(tops.into_iter().filter_map(best));
            self.best_of_halves.extend(tops.into_iter().flatten().flatten());
        }
    }
}

widest! {
    /// Adds the absolute gradients along x and y of a row to those of each column.
    pub(super) fn add_gradients(row: &[f32], below: &[f32], sums: &mut [[f32; 2]]) {
        let n = sums.len();
        let (left, right, below) = (&row[..n], &row[1..][..n], &below[..n]);
        for x in 0..n {
            sums[x][0] += (right[x] - left[x]).abs();
            sums[x][1] += (below[x] - left[x]).abs();
        }
    }
}

/// The smaller of the mean absolute gradients along x and y of a patch, from the sums of its columns.
pub(super) fn texture(columns: &[[f32; 2]]) -> f32 {
    let (mut gx, mut gy) = (0.0, 0.0);
    for [x, y] in columns {
        gx += x;
        gy += y;
    }
    gx.min(gy) / (PATCH * PATCH) as f32
}

#[cfg(test)]
mod tests {
    use super::*;

    fn key(f: impl Fn(usize, usize) -> f32) -> KeyFrame {
        let mut image = Image::filled(160, 120, 0f32);
        for y in 0..120 {
            image.row_mut(y).iter_mut().enumerate().for_each(|(x, v)| *v = f(x, y));
        }
        let mut key = KeyFrame::default();
        key.take(&mut image);
        key
    }

    /// Waves both ways, `height` counts.
    fn waves(x: usize, y: usize, height: f32) -> f32 {
        height * ((x as f32 * 0.7).sin() + (y as f32 * 0.9).sin())
    }

    #[test]
    fn trees_before_a_sky_vote_alone() {
        let key = key(|x, y| waves(x, y, if y > 80 { 50.0 } else { 0.5 }));
        assert!(!key.even && key.patches.len() >= MIN_PATCHES);
        assert!(key.patches.iter().all(|p| p.y + PATCH > 80), "{:?}", key.patches);
    }

    #[test]
    fn an_even_texture_votes_all_over_and_says_so() {
        let key = key(|x, y| waves(x, y, 20.0));
        assert!(key.even && key.patches.len() > 40);
    }

    #[test]
    fn stripes_and_plain_walls_have_no_patches() {
        assert!(key(|x, _| (x as f32).sin()).patches.is_empty());
        assert!(key(|_, _| 7.0).patches.is_empty());
    }
}
