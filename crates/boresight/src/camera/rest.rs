//! Whether the camera is at rest, and where it stays then.
//!
//! Source: our own. A camera at rest stays exactly at rest until a patch has moved by [`STILL`] and by more than chance; it comes to rest again after [`REST_FRAMES`]
//! within that. So compression and noise do not make the ground wander. Nor do things that move by themselves before a ground without texture: what most of them agree with is a
//! motion, by chance, but less than what they move against each other, where a ground's patches keep together ([`Found::apart_px`]).
//! Units: reduced px.

use super::found::Found;
use super::plane::corners_apart;
use crate::{Homography, motion_jacobian};
use nalgebra::Vector2;

/// Motions of the corners below this are none to a camera at rest, reduced px: what compression leaves of a still image.
pub(super) const STILL: f64 = 0.2;
/// χ², 2 degrees of freedom, 1e-4: a place that has moved by less than this allows may not have moved.
const CHANCE: f64 = 18.42;
/// Times that the motion of a ground is larger than how far its patches are apart. Of things that move by themselves, each by a normal deviation σ, two fifths lie within 1.01 σ of the
/// middle; chosen: for fifty of them the motion was found up to 1.35 times that from rest.
const TOGETHER: f64 = 2.0;
/// Frames within [`STILL`] after which the camera is at rest.
const REST_FRAMES: u32 = 10;

/// Whether the camera is at rest; it is at first.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Rest {
    pub moving: bool,
    /// Where it was when the last quiet time began, and how many frames that is ago.
    pub began_at: Homography,
    n_quiet: u32,
}

impl Rest {
    /// Where the background is, by a fit with its covariance: where it was, as long as the camera is at rest. `places` are those that the fit rests on.
    pub fn settle(
        &mut self,
        before: &Homography,
        found: &Found,
        middle: Vector2<f64>,
        places: impl Iterator<Item = Vector2<f64>> + Clone,
    ) -> Homography {
        let fitted = &found.now_from_key;
        if !self.moving {
            if !moves(before, found, middle, places) {
                return *before;
            }
            (self.moving, self.began_at, self.n_quiet) = (true, *fitted, 0);
        } else if corners_apart(fitted, &self.began_at, middle) <= STILL {
            self.n_quiet += 1;
            self.moving = self.n_quiet < REST_FRAMES;
        } else {
            (self.began_at, self.n_quiet) = (*fitted, 0);
        }
        *fitted
    }
}

/// Whether a motion that is no chance says that one of the places has moved by more than [`STILL`] and by more than chance, and all of them, in the root of the mean square, by more than they have moved against each
/// other. Corners without patches, as a sky's, are extrapolated: they say nothing of a camera at rest.
pub(super) fn moves(
    before: &Homography,
    found: &Found,
    middle: Vector2<f64>,
    mut places: impl Iterator<Item = Vector2<f64>> + Clone,
) -> bool {
    let moved = |place| found.now_from_key.apply(place) - before.apply(place);
    let (n, square) = places.clone().fold((0.0, 0.0), |(n, sum), place| (n + 1.0, sum + moved(place).norm_squared()));
    !found.by_chance
        && square > n * (TOGETHER * found.apart_px).powi(2)
        && places.any(|place| {
            let (e, j) = (moved(place), motion_jacobian(found.now_from_key.apply(place) - middle));
            let chance = (j * found.cov * j.transpose()).cholesky().is_some_and(|c| e.dot(&c.solve(&e)) <= CHANCE);
            e.norm() > STILL && !chance
        })
}
