//! Two images of one plane brought to cover each other: patches all over one, refined in the other, and a plane's motion through them.
//!
//! Source: our own; as feature-based alignment in R. Szeliski, "Image Alignment and Stitching", *Foundations and Trends in Computer Graphics and Vision*
//! 2(1), 2006, with patches in the place of features.
//! How: of every cell of a grid of 14 x 8 the best-textured 12 x 12 patch ([`super::key_frame`]); its place in the other image by Lucas-Kanade from
//! the predicted one ([`super::find_patch`]); the motion by [`super::plane`]. Patches at the noise's own texture are left out where others stand out.
//! Units: px of the images given. Limits: the prediction must be right to a pixel.

use super::find_patch::find_near;
use super::fit::Match;
use super::key_frame::{PATCH, Patch};
use super::plane;
use crate::{Homography, Image, Similarity};
use nalgebra::Vector2;

/// Cells in x and y.
const CELLS: (usize, usize) = (14, 8);
/// Texture below this share of the median patch's is not looked for.
const LEAST_SHARE: f32 = 0.1;
/// Steps in which a cell is looked through, px.
const STEP: usize = 6;
/// Of a row of a cell so many are looked at, at most: cells of 960 px are 69 wide.
const MOST_PLACES: usize = 32;

/// Share of patches found, and their deviation, px, from which on a registration is clear.
const CLEAR_FOUND: f64 = 0.8;
const CLEAR_SPREAD_PX: f64 = 0.15;
/// Deviation from which on nothing is registered, px: places within a pixel at random deviate by some 0.5.
const LOST_SPREAD_PX: f64 = 0.3;
/// A match that is none.
pub(super) const NONE: Match = Match { from: Vector2::new(0.0, 0.0), to: Vector2::new(0.0, 0.0), weight: 0.0 };

/// An image's patches.
#[derive(Clone, Debug, Default)]
pub(crate) struct PlanePatches {
    pub(super) patches: Vec<Patch>,
}

/// Where the plane of one image lies in another.
#[derive(Clone, Copy, Debug)]
pub struct Registration {
    /// From the patches' image to the other.
    pub to_from: Homography,
    /// Robust deviation of the patches from it, px an axis: their noise, and what is no plane.
    pub spread_px: f64,
    /// Share of the patches that were found, of those that should lie in the other image.
    pub found: f64,
}

impl Registration {
    /// Whether patches lie about as patches of another picture would: then it says nothing.
    pub fn is_lost(&self) -> bool {
        self.spread_px > LOST_SPREAD_PX
    }

    /// Whether nearly all patches are found where one plane has them: nothing better is to be looked for.
    pub fn is_clear(&self) -> bool {
        self.found >= CLEAR_FOUND && self.spread_px <= CLEAR_SPREAD_PX
    }
}

impl PlanePatches {
    /// Chooses the patches of an image.
    pub fn choose(&mut self, image: &Image<f32>) {
        self.patches.clear();
        let (w, h) = (image.width(), image.height());
        if w < 4 * PATCH || h < 4 * PATCH {
            return;
        }
        let mut textures = [0.0; CELLS.0 * CELLS.1];
        for cy in 0..CELLS.1 {
            for cx in 0..CELLS.0 {
                let (x0, x1) = (w * cx / CELLS.0, w * (cx + 1) / CELLS.0);
                let (y0, y1) = (h * cy / CELLS.1, h * (cy + 1) / CELLS.1);
                let mut top: Option<(f32, usize, usize)> = None;
                let x1 = x1.min(w - PATCH - 1);
                let mut row = [0.0f32; MOST_PLACES];
                let n = x1.saturating_sub(x0).div_ceil(STEP).min(MOST_PLACES);
                for y in (y0..y1).step_by(STEP).filter(|y| y + PATCH + 1 < h) {
                    row_textures(image, x0, x1, y, &mut row[..n]);
                    for (t, x) in row[..n].iter().zip((x0..x1).step_by(STEP)) {
                        if t.is_finite() && top.is_none_or(|b| *t > b.0) {
                            top = Some((*t, x, y));
                        }
                    }
                }
                if let Some((t, x, y)) = top.filter(|t| t.0 > 0.0) {
                    textures[self.patches.len()] = t;
                    self.patches.push(Patch { x, y, weight: 1.0 });
                }
            }
        }
        let mut sorted = textures;
        let sorted = &mut sorted[..self.patches.len()];
        if sorted.is_empty() {
            return;
        }
        let middle = sorted.len() / 2;
        let median = *sorted.select_nth_unstable_by(middle, f32::total_cmp).1;
        let mut kept = textures.iter().map(|t| *t >= LEAST_SHARE * median);
        self.patches.retain(|_| kept.next().unwrap_or(false));
    }

    /// Where the plane of `own`, the image of the patches, lies in `other`.
    pub fn register(&self, own: &Image<f32>, other: &Image<f32>, predicted: &Homography) -> Option<Registration> {
        let mut matches = [NONE; plane::MOST_MATCHES];
        let (mut n, mut n_inside) = (0, 0);
        for p in self.patches.iter().filter(|p| is_inside(other, predicted.apply(p.middle()))) {
            n_inside += 1;
            if let Some(to) = place(own, other, *p, predicted) {
                matches[n] = Match { from: p.middle(), to, weight: 1.0 };
                n += 1;
            }
        }
        // Where half of the patches are not found the prediction is wrong.
        if 2 * n < n_inside {
            return None;
        }
        let found = n as f64 / n_inside.max(1) as f64;
        let middle = 0.5 * Vector2::new(own.width() as f64 - 1.0, own.height() as f64 - 1.0);
        let plane = plane::fit(&matches[..n], predicted, middle, plane::Limits::NONE)?;
        Some(Registration { to_from: plane.to_from, spread_px: plane.spread_px, found })
    }

    /// Appends the middle of each patch and how far from the plane it lies in `other`, px: infinitely where it is not found near it, not at all where it should
    /// lie outside.
    pub fn residuals(
        &self,
        own: &Image<f32>,
        other: &Image<f32>,
        plane: &Homography,
        out: &mut Vec<(Vector2<f64>, Option<f64>)>,
    ) {
        let far = |p: &Patch| {
            let to = plane.apply(p.middle());
            let found = || place(own, other, *p, plane).map_or(f64::INFINITY, |at| (at - to).norm());
            is_inside(other, to).then(found)
        };
        out.extend(self.patches.iter().map(|p| (p.middle(), far(p))));
    }
}

widest! {
    /// The smaller of the mean absolute gradients along x and y of the patches of a row that begin at each [`STEP`]-th pixel from `x0`, in front of `x1`.
    fn row_textures(image: &Image<f32>, x0: usize, x1: usize, y: usize, out: &mut [f32]) {
        for (t, x) in out.iter_mut().zip((x0..x1).step_by(STEP)) {
            // One sum a column: they are added in vectors.
            let (mut gx, mut gy) = ([0.0f32; PATCH], [0.0f32; PATCH]);
            for r in y..y + PATCH {
                let (row, below) = (&image.row(r)[x..x + PATCH + 1], &image.row(r + 1)[x..x + PATCH]);
                for c in 0..PATCH {
                    gx[c] += (row[c + 1] - row[c]).abs();
                    gy[c] += (below[c] - row[c]).abs();
                }
            }
            *t = gx.iter().sum::<f32>().min(gy.iter().sum()) / (PATCH * PATCH) as f32;
        }
    }
}

/// Whether a patch with that middle lies in the image with a pixel to spare.
fn is_inside(image: &Image<f32>, middle: Vector2<f64>) -> bool {
    let reach = 0.5 * PATCH as f64 + 1.0;
    let (w, h) = (image.width() as f64, image.height() as f64);
    middle.x >= reach && middle.y >= reach && middle.x < w - reach && middle.y < h - reach
}

/// Where the middle of a patch of `own` lies in `other`, if it lies within a pixel of the predicted place.
fn place(own: &Image<f32>, other: &Image<f32>, p: Patch, predicted: &Homography) -> Option<Vector2<f64>> {
    let (from, to) = (p.middle(), predicted.apply(p.middle()));
    let a = predicted.linear_at(from);
    let turned = Similarity::with_linear(0.5 * (a[(0, 0)] + a[(1, 1)]), 0.5 * (a[(1, 0)] - a[(0, 1)]), from, to);
    // What neither turns nor zooms by a tenth of a pixel over the patch is only shifted.
    let bends = (turned.linear() - nalgebra::Matrix2::identity()).norm() > 0.1 / PATCH as f64;
    find_near(own, other, p, to, &if bends { turned } else { Similarity::shift(to - from) })
}
