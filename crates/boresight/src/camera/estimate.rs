//! Camera motion from pixels: how the background moved in the image since the frame before.
//!
//! Source: our own; block matching against a key frame with a consensus, as every video stabiliser does it in some form.
//! How: the frame is made small ([`super::reduce`]); patches of the key frame ([`super::key_frame`]) are looked for where the course so far
//! ([`super::course`]) leads them ([`super::find_patch`]); a shift, or a shift with turn and zoom, is fitted to where they are ([`super::fit`]).
//! Against a key frame errors do not add up. A camera at rest stays exactly at rest until its corners have moved by [`STILL`]; it comes to rest
//! again after [`REST_FRAMES`] within that.
//! A frame in which nothing is found is bridged: the course goes on and its covariance grows ([`MotionBasis::Held`]); the key frame stays, and is found
//! again or, where the last frame is found, replaced by that one. When the course is too uncertain to look for patches along it, the motion is unknown (`None`).
//! Symbols: from_key, from the key frame to the last frame (reduced px).
//! Limits: one plane; [`SEARCH`] reduced px a frame beyond what the course expects. At a new key frame its error stays in the ground for good.

use super::course::Course;
use super::find_patch::{SEARCH, find};
use super::fit::{AGREE, AGREE_EVEN, Expected, Fit, Match, fit};
use super::key_frame::{KeyFrame, MIN_PATCHES};
use super::reduce::{factor, reduce};
use crate::{CameraMotion, Image, MotionBasis, Pixels, Similarity};
use nalgebra::{Matrix4, Vector2, Vector4};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Whether the camera's motion is followed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum CameraConfig {
    /// The camera stands still, or its motion is none of the tracker's business.
    #[default]
    Fixed,
    /// The background's motion is measured in every frame and taken from every position before tracking.
    Moving,
}

/// Motions of the corners below this are none to a camera at rest, reduced px: what compression leaves of a still image.
const STILL: f64 = 0.2;
/// Frames within [`STILL`] after which the camera is at rest.
const REST_FRAMES: u32 = 10;
/// An even texture is believed once the image has moved by this, reduced px: a sensor's fixed pattern and a codec's copies never do.
const BELIEVED: f64 = 1.0;
/// The key frame is replaced when it has moved by this share of the image, or turned (rad) or grown (logarithm) by this.
const KEY_SHARE: f64 = 0.25;
const KEY_TURN: f64 = 0.25;
/// Frames that are bridged at most: half a second at 25 frames/s.
const MOST_HELD: u32 = 12;

/// Follows the background from frame to frame.
#[derive(Clone, Debug, Default)]
pub struct CameraMotionEstimator {
    now: Image<f32>,
    sums: Vec<f32>,
    key: KeyFrame,
    /// The last frame: where the key frame is not found it takes its place.
    last: KeyFrame,
    key_is_last: bool,
    from_key: Similarity,
    course: Course,
    /// Whether a motion was measured that the course goes on from.
    known: bool,
    /// Whether turn or zoom changed in the last frame.
    turning: bool,
    rest: Rest,
    n_held: u32,
    /// What is left of the uncertainty of frames that were bridged.
    carried: Matrix4<f64>,
    matches: Vec<Match>,
    weights: Vec<f64>,
}

/// Whether the camera is at rest; it is at first.
#[derive(Clone, Copy, Debug, Default)]
struct Rest {
    moving: bool,
    /// Where it was when the last quiet time began, and how many frames that is ago.
    began_at: Similarity,
    n_quiet: u32,
}

impl CameraMotionEstimator {
    /// Takes the next frame and returns the background's motion since the last one; `None` where nothing can be said.
    pub fn step(&mut self, pixels: &Pixels) -> Option<CameraMotion> {
        reduce(pixels, &mut self.now, &mut self.sums);
        let factor = factor(pixels.width());
        if (self.key.image.width(), self.key.image.height()) != (self.now.width(), self.now.height()) {
            self.start_anew();
            return None;
        }
        let middle = self.middle();
        let mut found = self.look(false, middle);
        let at_last = found.is_none();
        if found.is_none() {
            self.last.choose();
            found = self.look(true, middle);
        }
        if found.is_none() && self.rest.moving && !self.last.even {
            // The few patches that stand out do not agree: the many weak ones may.
            self.last.choose_even();
            found = self.look(true, middle);
        }
        self.last.forget();
        self.key_is_last = false;
        let (step, cov, basis) = match found {
            Some(found) => self.measured(found, at_last, middle),
            None => self.held(middle)?,
        };
        if !self.key_is_last {
            self.last.keep(&mut self.now);
        }
        Some(full_size(&step, &cov, basis, middle, factor))
    }

    fn middle(&self) -> Vector2<f64> {
        0.5 * Vector2::new(self.now.width() as f64 - 1.0, self.now.height() as f64 - 1.0)
    }

    /// Forgets all that was; the frame is the key frame.
    fn start_anew(&mut self) {
        self.key.take(&mut self.now);
        self.last.forget();
        self.from_key = Similarity::identity();
        self.course = Course::default();
        (self.known, self.turning, self.n_held) = (false, false, 0);
        self.rest = Rest::default();
        self.carried = Matrix4::zeros();
    }

    /// Looks for the patches of the key frame, or of the last frame.
    fn look(&mut self, at_last: bool, middle: Vector2<f64>) -> Option<Fit> {
        let (key, last) = match at_last {
            true => (&self.last, Similarity::identity()),
            false => (&self.key, self.from_key),
        };
        let predicted = last.then(&self.course.next(middle));
        self.matches.clear();
        for p in &key.patches {
            let to = find(&key.image, &self.now, *p, &predicted);
            self.matches.extend(to.map(|to| Match { from: p.middle(), to, weight: p.weight }));
        }
        let least_turn_px = if self.turning { 0.0 } else { STILL };
        let agree_px = if key.even { AGREE_EVEN } else { AGREE };
        let expected = Expected { predicted, last, middle, least_turn_px, agree_px };
        let found = fit(&self.matches, &expected, &mut self.weights)?;
        let moved = corners_apart(&found.now_from_key, &Similarity::identity(), middle) > BELIEVED;
        if key.even && !key.proven && !moved {
            return None;
        }
        if at_last {
            // Another view, or the key frame is too far away: the last frame takes its place.
            std::mem::swap(&mut self.key, &mut self.last);
            self.from_key = Similarity::identity();
            self.rest.began_at = Similarity::identity();
        }
        self.key.proven |= moved;
        Some(found)
    }

    /// The motion by a fit, to the key frame or, `at_last`, to the frame before.
    fn measured(&mut self, found: Fit, at_last: bool, middle: Vector2<f64>) -> (Similarity, Matrix4<f64>, MotionBasis) {
        let before = self.from_key;
        self.from_key = self.rest.settle(&before, &found.now_from_key, middle);
        let step = if self.from_key == before { Similarity::identity() } else { before.inverse().then(&self.from_key) };
        self.turning = found.turned && self.rest.moving;
        // A step over bridged frames is none of one frame.
        match self.n_held {
            0 => self.course.learn(&step, middle),
            _ => self.course.found(),
        }
        let basis = if self.n_held > 0 && at_last { MotionBasis::Resumed } else { MotionBasis::Measured };
        (self.known, self.n_held) = (true, 0);
        let own = if self.rest.moving { found.cov } else { Matrix4::zeros() };
        let cov = own + self.carried;
        // Tracks take the ground's new place up with their updates; what is below a thousandth of a pixel is none.
        self.carried = if self.carried.max() > 1e-6 { 0.5 * self.carried } else { Matrix4::zeros() };
        let shift = self.from_key.shift_at(middle).abs();
        let far = shift.x > 2.0 * KEY_SHARE * middle.x || shift.y > 2.0 * KEY_SHARE * middle.y;
        let turned = self.from_key.angle_rad().abs() > KEY_TURN || self.from_key.zoom().ln().abs() > KEY_TURN;
        // Soon too few patches would be left to agree; a camera at rest keeps its key frame, and with it its place.
        let few = self.rest.moving && self.matches.len() < MIN_PATCHES + 2;
        if far || turned || few {
            self.new_key();
        }
        (step, cov, basis)
    }

    fn new_key(&mut self) {
        self.key.take(&mut self.now);
        self.key_is_last = true;
        self.rest.began_at = self.from_key.inverse().then(&self.rest.began_at);
        self.from_key = Similarity::identity();
    }

    /// The motion where nothing was found; `None` where it is unknown.
    fn held(&mut self, middle: Vector2<f64>) -> Option<(Similarity, Matrix4<f64>, MotionBasis)> {
        if !self.known {
            // An even texture may yet be seen to move; anything else is no key frame.
            let may_move = self.key.even && !self.matches.is_empty();
            if !may_move {
                self.start_anew();
            }
            return None;
        }
        let step = self.course.next(middle);
        let grown = self.course.hold();
        self.n_held += 1;
        if self.n_held > MOST_HELD || 2.0 * grown[(0, 0)].sqrt() > SEARCH as f64 {
            self.start_anew();
            return None;
        }
        self.from_key = self.from_key.then(&step);
        self.carried = grown;
        Some((step, grown, MotionBasis::Held))
    }
}

impl Rest {
    /// Where the background is, by a fit: where it was, as long as the camera is at rest.
    fn settle(&mut self, before: &Similarity, fitted: &Similarity, middle: Vector2<f64>) -> Similarity {
        if !self.moving {
            if corners_apart(fitted, before, middle) <= STILL {
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

/// The farthest distance between what two motions make of the image's corners.
fn corners_apart(a: &Similarity, b: &Similarity, middle: Vector2<f64>) -> f64 {
    let corners =
        [(0.0, 0.0), (2.0, 0.0), (0.0, 2.0), (2.0, 2.0)].map(|(x, y)| Vector2::new(x * middle.x, y * middle.y));
    if a.is_shift() && b.is_shift() {
        return (a.shift_at(middle) - b.shift_at(middle)).norm();
    }
    corners.into_iter().map(|c| (a.apply(c) - b.apply(c)).norm()).fold(0.0, f64::max)
}

/// A motion of the reduced frame as that of the frame: a reduced pixel's middle is that of its block.
fn full_size(
    step: &Similarity,
    cov: &Matrix4<f64>,
    basis: MotionBasis,
    middle: Vector2<f64>,
    factor: usize,
) -> CameraMotion {
    let f = factor as f64;
    let first = Vector2::repeat(0.5 * (f - 1.0));
    let centre_px = f * middle + first;
    let now_from_before = if step.is_shift() {
        Similarity::shift(f * step.shift_at(middle))
    } else {
        Similarity::about(centre_px, f * step.shift_at(middle), step.angle_rad(), step.zoom())
    };
    let scale = Matrix4::from_diagonal(&Vector4::new(f, f, 1.0, 1.0));
    CameraMotion { now_from_before, centre_px, cov: scale * cov * scale, basis }
}

#[cfg(test)]
#[path = "estimate/tests.rs"]
mod tests;
