//! Whether the camera is at rest, and where it stays then.
//!
//! Source: our own. A camera at rest stays exactly at rest until a patch has moved by [`STILL`] and by more than chance; it comes to rest again after [`REST_FRAMES`]
//! within that. So compression and noise do not make the ground wander. Nor do things that move by themselves before a ground without texture: the mean of their motions is one of the whole, of chance, but less
//! than what they move against each other, where a ground's patches keep together ([`Found::apart_px`]).
//! Units: reduced px.

use super::found::Found;
use super::plane::corners_apart;
use crate::{Homography, motion_jacobian};
use nalgebra::Vector2;

/// Motions of the corners below this are none to a camera at rest, reduced px: what compression leaves of a still image.
pub(super) const STILL: f64 = 0.2;
/// χ², 2 degrees of freedom, 1e-4: a place that has moved by less than this allows may not have moved.
const CHANCE: f64 = 18.42;
/// Times that the motion of a ground is larger than how far its patches are apart. Of things that move by themselves, each by a normal deviation σ, the majority lies within 1.01 σ of the motion that most of them
/// agree with, and where some forty of them are seen this lies up to 1.4 σ from rest.
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
        places: impl Iterator<Item = Vector2<f64>>,
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

/// Whether one of the places has moved by more than [`STILL`] and by more than chance, and all of them, in the root of the mean square, by more than they have moved against each other. Corners without patches, as a sky's, are extrapolated: they say nothing of a camera at rest.
pub(super) fn moves(
    before: &Homography,
    found: &Found,
    middle: Vector2<f64>,
    places: impl Iterator<Item = Vector2<f64>>,
) -> bool {
    let (mut n, mut square, mut surely) = (0usize, 0.0, false);
    for place in places {
        let to = found.now_from_key.apply(place);
        let (e, j) = (to - before.apply(place), motion_jacobian(to - middle));
        let chance = (j * found.cov * j.transpose()).cholesky().is_some_and(|c| e.dot(&c.solve(&e)) <= CHANCE);
        surely |= e.norm() > STILL && !chance;
        (n, square) = (n + 1, square + e.norm_squared());
    }
    surely && square > n as f64 * (TOGETHER * found.apart_px).powi(2)
}
