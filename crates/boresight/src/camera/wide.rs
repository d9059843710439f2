//! A motion that nothing predicts: both frames made smaller still, patches looked for all around their places.
//!
//! Source: coarse-to-fine registration (R. Szeliski, "Image Alignment and Stitching", *Foundations and Trends in Computer Graphics and Vision* 2(1), 2006,
//! section 3.2) by the parts of the reduced frame: [`super::key_frame`], [`super::find_patch`], [`super::fit`].
//! Units: reduced px outside, means of [`FACTOR`] x [`FACTOR`] of them inside. Limits: patches are looked for within 10 of these, 20 reduced px; frames below 96 reduced px a
//! side are too small.

use super::find_patch::find;
use super::fit::{AGREE, BEND, Expected, Match, fit};
use super::key_frame::KeyFrame;
use super::plane::{self, Limits};
use super::reduce::blocks;
use crate::{Homography, Image, Similarity};
use nalgebra::Vector2;

/// Side of a block of reduced pixels.
const FACTOR: usize = 2;

/// The smaller frames.
#[derive(Clone, Debug, Default)]
pub(super) struct Wide {
    small: Image<f32>,
    key: KeyFrame,
    now: Image<f32>,
    sums: Vec<f32>,
    matches: Vec<Match>,
    weights: Vec<f64>,
}

impl Wide {
    /// Where the background of `key` lies in `now`, roughly; `start` is the best guess there is.
    pub fn look(&mut self, key: &Image<f32>, now: &Image<f32>, start: &Similarity) -> Option<Homography> {
        blocks(key, FACTOR, &mut self.small, &mut self.sums, |p| p);
        blocks(now, FACTOR, &mut self.now, &mut self.sums, |p| p);
        self.key.take(&mut self.small);
        let middle = 0.5 * Vector2::new(self.now.width() as f64 - 1.0, self.now.height() as f64 - 1.0);
        let scale = FACTOR as f64;
        let first = Vector2::repeat(0.5 * (scale - 1.0));
        let at = scale * middle + first;
        let predicted = Similarity::about(middle, start.shift_at(at) / scale, start.angle_rad(), start.zoom());
        self.matches.clear();
        for p in &self.key.patches {
            let to = find(&self.key.image, &self.now, *p, &predicted);
            self.matches.extend(to.map(|to| Match { from: p.middle(), to, weight: p.weight }));
        }
        let expected = Expected { predicted, last: predicted, middle, least_turn_px: 0.0, agree_px: AGREE };
        let found = Homography::of_similarity(&fit(&self.matches, &expected, &mut self.weights)?.now_from_key);
        let limits = Limits { most_px: BEND * AGREE, ..Limits::NONE };
        let found = plane::fit(&self.matches, &found, middle, limits).map_or(found, |p| p.to_from);
        let grow = Homography::of_blocks(FACTOR);
        Some(grow.inverse().then(&found).then(&grow))
    }
}
