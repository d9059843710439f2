//! A plane's motion that nothing predicts: both images made small, patches looked for all around their places.
//!
//! Source: coarse-to-fine registration (R. Szeliski, "Image Alignment and Stitching", *Foundations and Trends in Computer Graphics and Vision* 2(1), 2006,
//! section 3.2); block matching and plane of our own ([`super::find_patch`], [`super::plane`]).
//! Units: px of the images given. Limits: patches are looked for within 10 of the small pixels, 40 of 960 px.

use super::find_patch::find;
use super::fit::Match;
use super::plane;
use super::reduce::blocks;
use super::register::{NONE, PlanePatches};
use crate::{Homography, Image, Similarity};
use nalgebra::Vector2;

/// Width of the small images, px.
const SMALL_PX: usize = 240;

/// Both images made small, for motions that nothing predicts.
#[derive(Clone, Debug, Default)]
pub(crate) struct WideSearch {
    own: Image<f32>,
    other: Image<f32>,
    sums: Vec<f32>,
    patches: PlanePatches,
}

impl WideSearch {
    /// Where the plane of `own` lies in `other`, roughly: to be sharpened by [`PlanePatches::register`].
    pub fn look(&mut self, own: &Image<f32>, other: &Image<f32>) -> Option<Homography> {
        let factor = own.width().div_ceil(SMALL_PX).max(1);
        blocks(own, factor, &mut self.own, &mut self.sums, |p| p);
        blocks(other, factor, &mut self.other, &mut self.sums, |p| p);
        self.patches.choose(&self.own);
        let mut matches = [NONE; plane::MOST_MATCHES];
        let mut n = 0;
        for p in &self.patches.patches {
            if let Some(to) = find(&self.own, &self.other, *p, &Similarity::identity()) {
                matches[n] = Match { from: p.middle(), to, weight: 1.0 };
                n += 1;
            }
        }
        let matches = &matches[..n];
        if n == 0 {
            return None;
        }
        // The middle shift of both axes is near enough to begin with.
        let mut shift = [0.0; 2];
        for (axis, s) in shift.iter_mut().enumerate() {
            let mut all = [0.0; plane::MOST_MATCHES];
            all.iter_mut().zip(matches).for_each(|(a, m)| *a = m.to[axis] - m.from[axis]);
            *s = *all[..n].select_nth_unstable_by(n / 2, f64::total_cmp).1;
        }
        let start = Homography::of_similarity(&Similarity::shift(Vector2::from(shift)));
        let middle = 0.5 * Vector2::new(self.own.width() as f64 - 1.0, self.own.height() as f64 - 1.0);
        let small = plane::fit(matches, &start, middle, plane::Limits::NONE)?.to_from;
        let grow = Homography::of_blocks(factor);
        Some(grow.inverse().then(&small).then(&grow))
    }
}
