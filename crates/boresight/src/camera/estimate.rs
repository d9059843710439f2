//! Camera motion from pixels: how the background moved in the image since the frame before.
//!
//! Source: our own; block matching against a key frame with a consensus, as every video stabiliser does it in some form.
//! How: the frame is made small ([`super::reduce`]) and brought to the light of those before ([`super::light`]); patches of the key frame ([`super::key_frame`]) are looked for where the course so far
//! ([`super::course`]) leads them ([`super::find_patch`]), and, where they are not there, all over a frame made smaller still ([`super::wide`]); a consensus says which of them
//! are the background's ([`super::fit`]). Patches of the frame itself are then found to a small part of a pixel ([`super::fine`]), and a translation, similarity, affine map or homography
//! is chosen by what they say ([`super::plane`]). Where nothing was known before, the motion must explain most of the image's area ([`super::cover`]), and its covariance is that of residuals left out of the fit ([`super::plane_cov`]).
//! Against a key frame errors do not add up. A camera at rest stays exactly at rest ([`super::rest`]).
//! A frame in which nothing is found is bridged: the course goes on and its covariance grows ([`MotionBasis::Held`]); the key frame stays, and is found
//! again or, where the last frame is found, replaced. Where a camera at rest has not moved ([`CameraMotionEstimator::look_at_rest`]) nothing is searched. When the course is too uncertain to look for patches along it, the motion is unknown (`None`).
//! Where nothing is found and the frame as a whole is another one ([`super::other_view`]), another view has begun ([`MotionBasis::Cut`]), and all begins anew.
//! Symbols: from_key, from the key frame to the last frame (reduced px).
//! Limits: one plane. At a new key frame its error stays in the ground for good.

use super::apart::{Pieces, WIDE};
use super::course::Course;
use super::cover::Cover;
use super::find_patch::{SEARCH, find_near};
use super::fine::{FOUND, FinePatches, LOST_PX, fine_factor};
use super::fit::{AGREE, AGREE_EVEN, BEND, Expected, Match};
use super::found::{Found, coarse};
use super::key_frame::{CELLS, KeyFrame, MIN_PATCHES};
use super::light::Light;
use super::other_view::OtherView;
use super::plane::{self, Limits, corners_apart};
use super::plane_cov::plane_cov;
use super::reduce::{factor, reduce};
use super::rest::{Rest, STILL, moves};
use super::scales::{Scales, full_size, of_similarity, scaled, scaled_cov};
use super::searches::Searches;
use super::wide::Wide;
use crate::{CameraMotion, Homography, Image, MotionBasis, MotionCov, Pixels};
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
    /// The background's motion is measured in every frame and taken from every position before tracking.
    Moving,
    /// The camera stays in its place but shakes or nods: frames are brought to the first one's place before anything is detected in them, so that what is made for a camera at rest (`moving`) can be used.
    Shaking,
}

/// An even texture is believed once the image has moved by this, reduced px: a sensor's fixed pattern and a codec's copies never do.
const BELIEVED: f64 = 1.0;
/// The key frame is replaced when it has moved by this share of the image, or turned (rad) or grown (logarithm) by this.
const KEY_SHARE: f64 = 0.25;
const KEY_TURN: f64 = 0.25;
/// Frames that are bridged at most: half a second at 25 frames/s.
const MOST_HELD: u32 = 12;
/// Frames, one after the other, in which the key frame is not found, before the last frame takes its place: a fifth of a second at 25 frames/s. Noise hides it for a frame or two.
const WAIT_FRAMES: u32 = 5;
/// Share of the image's cells from which on the others are not asked.
const CLEAR_COVER: f64 = 0.75;
/// A first motion that does not explain most of the image's area, as below a sky, is believed once it was found in so many frames one after the other. It may be that of a thing, and is not
/// believed, where its patches spread over less than [`WIDE`] of the image's width, and half as many or more stand still: nothing that stands out stands before a camera that moves.
const UNSURE_FRAMES: u32 = 3;
/// Share of the key frame's patches that must lie within [`STILL`] of where they lay, so that the others are not looked for, or share that must lie within a pixel: noise and targets may hide the rest, and
/// targets that are all there is to hold on to have moved by some tenths of a pixel. Of 31 infrared clips whose view was moved by twelve motions of 2 to 32 px, 24 % lie within [`STILL`] by chance at
/// most, and 71 % within a pixel.
const AT_REST: f64 = 0.4;
const NEAR_REST: f64 = 0.85;

/// Follows the background from frame to frame.
#[derive(Clone, Debug, Default)]
pub struct CameraMotionEstimator {
    now: Image<f32>,
    light: Light,
    sums: Vec<f32>,
    key: KeyFrame,
    fine: FinePatches,
    wide: Wide,
    pieces: Pieces,
    cover: Cover,
    view: OtherView,
    /// The last frame: where the key frame is not found it takes its place.
    last: KeyFrame,
    key_is_last: bool,
    from_key: Homography,
    course: Course,
    /// Whether a motion was measured that the course goes on from.
    known: bool,
    /// Frames, one after the other, in which a first motion was found that shows in too few places.
    n_unsure: u32,
    /// Whether turn or zoom changed in the last frame.
    turning: bool,
    rest: Rest,
    n_held: u32,
    /// What is left of the uncertainty of frames that were bridged.
    carried: MotionCov,
    searches: Searches,
    matches: Vec<Match>,
    weights: Vec<f64>,
}

impl CameraMotionEstimator {
    /// Takes the next frame and returns the background's motion since the last one; `None` where nothing can be said.
    pub fn step(&mut self, pixels: &Pixels) -> Option<CameraMotion> {
        reduce(pixels, &mut self.now, &mut self.sums);
        self.light.bring(&mut self.now);
        self.view.take(&self.now);
        let middle = 0.5 * Vector2::new(self.now.width() as f64 - 1.0, self.now.height() as f64 - 1.0);
        let scales = Scales { middle, factor: factor(pixels.width()), fine: fine_factor(pixels.width()) };
        if (self.key.image.width(), self.key.image.height()) != (self.now.width(), self.now.height()) {
            self.start_anew(pixels, &scales);
            return None;
        }
        let mut found = self.find(pixels, &scales);
        found = found.or_else(|| self.find_in_other_light(pixels, &scales));
        let last = if self.key_is_last { &self.key.image } else { &self.last.image };
        if found.is_none() && self.view.is_other(last, &self.now) {
            self.start_anew(pixels, &scales);
            return Some(full_size(&Homography::identity(), &MotionCov::zeros(), MotionBasis::Cut, &scales));
        }
        let is_unsure = !self.known && found.is_some_and(|f| !f.0.covers);
        let is_of_ground = is_unsure && found.is_some_and(|f| !f.0.may_be_a_thing && !f.0.by_chance);
        self.n_unsure = if is_of_ground { self.n_unsure + 1 } else { 0 };
        if is_unsure && self.n_unsure < UNSURE_FRAMES {
            found = None;
        }
        let at_last = found.is_some_and(|f| f.1);
        self.last.forget();
        self.key_is_last = false;
        let (step, cov, basis) = match found {
            Some((found, _)) => self.measured(found, at_last, pixels, &scales),
            None => self.held(pixels, &scales)?,
        };
        if !self.key_is_last {
            self.last.keep(&mut self.now);
        }
        Some(full_size(&step, &cov, basis, &scales))
    }

    /// Forgets all that was; the frame is the key frame.
    fn start_anew(&mut self, pixels: &Pixels, scales: &Scales) {
        self.key.take(&mut self.now);
        self.key_is_last = true;
        self.fine.choose(pixels, scales.factor, &self.key.places);
        self.last.forget();
        self.from_key = Homography::identity();
        self.course = Course::default();
        (self.known, self.turning, self.n_held) = (false, false, 0);
        self.rest = Rest::default();
        self.carried = MotionCov::zeros();
    }

    /// Looks once more where the light has changed; what does not help is undone.
    fn find_in_other_light(&mut self, pixels: &Pixels, scales: &Scales) -> Option<(Found, bool)> {
        let last = if self.key_is_last { &self.key.image } else { &self.last.image };
        let was = self.light.change(&mut self.now, last)?;
        let found =
            self.find(pixels, scales).filter(|f| self.light.is_that_of(&self.key, &self.now, &f.0.now_from_key, was));
        if found.is_none() {
            self.light.is_again(was);
            reduce(pixels, &mut self.now, &mut self.sums);
            self.light.bring(&mut self.now);
        }
        found
    }

    /// Looks for the key frame, then for the last one, then for both all over; whether it was the last one that was found, which is the key frame then.
    fn find(&mut self, pixels: &Pixels, scales: &Scales) -> Option<(Found, bool)> {
        let along = self.course.next(scales.middle);
        let next = Homography::of_similarity(&along);
        let key_next = self.from_key.then(&next);
        if let Some(found) = self.look_at_rest(scales.middle) {
            return Some((found, false));
        }
        if let Some(found) = self.look(false, &key_next, pixels, scales) {
            return Some((found, false));
        }
        // Behind frames that were bridged only the key frame tells where the ground is: it is waited for.
        let waits = self.n_held > 0 && self.n_held < WAIT_FRAMES;
        if !waits {
            self.last.choose();
            if let Some(found) = self.look(true, &next, pixels, scales) {
                return Some((found, true));
            }
        }
        for at_last in [false, true].into_iter().filter(|at_last| !(waits && *at_last)) {
            let (key, start) = if at_last { (&self.last, &next) } else { (&self.key, &key_next) };
            if !key.patches.is_empty()
                && let Some(predicted) = self.wide.look(&key.image, &self.now, &start.similarity_at(scales.middle))
                && let Some(found) = self.look(at_last, &predicted, pixels, scales)
            {
                return Some((found, at_last));
            }
        }
        if self.rest.moving && !self.last.even && !waits {
            // The few patches that stand out do not agree: the many weak ones may.
            self.last.choose_even();
            return self.look(true, &next, pixels, scales).map(|f| (f, true));
        }
        None
    }

    /// Where a camera that was at rest still is: most patches lie where they lay, and their consensus has not moved. Most cameras stand most of the time, and the search around each patch was 46 %
    /// of the instructions of a run over IR_BIRD_031 (callgrind).
    fn look_at_rest(&mut self, middle: Vector2<f64>) -> Option<Found> {
        if !self.known || self.rest.moving {
            return None;
        }
        let (last, key) = (self.from_key, &self.key);
        self.matches.clear();
        for p in &key.patches {
            let to = find_near(&key.image, &self.now, *p, last.apply(p.middle()), &last.similarity_at(p.middle()));
            self.matches.extend(to.map(|to| Match { from: p.middle(), to, weight: p.weight }));
        }
        let n = self.matches.len();
        let n_still = self.matches.iter().filter(|m| (last.apply(m.from) - m.to).norm() <= STILL).count();
        let enough = |n: usize, share: f64| n >= MIN_PATCHES && n as f64 >= share * key.patches.len() as f64;
        if !enough(n_still, AT_REST) && !enough(n, NEAR_REST) {
            return None;
        }
        let agree_px = if key.even { AGREE_EVEN } else { AGREE };
        let found = coarse(&mut self.matches, &last, &last, &mut self.weights, &|predicted, last| Expected {
            predicted,
            last,
            middle,
            least_turn_px: STILL,
            agree_px,
        })?;
        let places = key.patches.iter().map(|p| p.middle());
        let rests = !moves(&last, &found, middle, places);
        rests.then_some(Found { covers: true, n_coarse: n, ..found })
    }

    /// Looks for the patches of the key frame, or of the last frame, where that motion leads them.
    fn look(&mut self, at_last: bool, predicted: &Homography, pixels: &Pixels, scales: &Scales) -> Option<Found> {
        let middle = scales.middle;
        let last = if at_last { Homography::identity() } else { self.from_key };
        let key = if at_last { &self.last } else { &self.key };
        self.matches.clear();
        self.searches.take(key, &self.now, predicted, &mut self.matches);
        let agree_px = if key.even { AGREE_EVEN } else { AGREE };
        let coarse = coarse(&mut self.matches, predicted, &last, &mut self.weights, &|predicted, last| Expected {
            predicted,
            last,
            middle,
            least_turn_px: if self.turning { 0.0 } else { STILL },
            agree_px,
        })?;
        let (n_coarse, alone) = (self.matches.len(), coarse.alone(&self.matches));
        // What is no similarity bends the coarse matches already.
        let limits = Limits { least_px: STILL, most_px: BEND * agree_px };
        let start =
            plane::fit(&self.matches, &coarse.now_from_key, middle, limits).map_or(coarse.now_from_key, |p| p.to_from);
        // Where the patches that agree are not most of the image's, a thing of much texture may have outvoted the rest.
        let agrees = |m: &&Match| (start.apply(m.from) - m.to).norm() <= agree_px;
        let agreeing = || self.matches.iter().filter(agrees).map(|m| m.from.x);
        let n_agree = agreeing().count();
        let ends = agreeing().fold([f64::INFINITY, f64::NEG_INFINITY], |e, x| [e[0].min(x), e[1].max(x)]);
        let is_wide = ends[1] - ends[0] >= WIDE * self.now.width() as f64;
        let mut n_still = 0;
        let n_cells = CELLS.0 * CELLS.1;
        if (n_agree as f64) < CLEAR_COVER * n_cells as f64 {
            n_still = self.searches.n_still(key, &self.now, [predicted, &start, &last], agree_px)?;
        }
        let may_be_a_thing = !is_wide && 2 * n_still >= n_agree;
        let is_first = !self.known || !self.rest.moving;
        let common = (&coarse.now_from_key, if coarse.turned { 4 } else { 2 });
        let by_chance = is_first
            && !key.even
            && self.pieces.may_be_chance((&key.image, key.quiet), common, &self.matches, agree_px);
        let mut found = match if at_last { None } else { self.sharpen(&start, pixels, scales) } {
            Some(fine) => Found { n_coarse, may_be_a_thing, by_chance, apart_px: coarse.apart_px, ..fine },
            None => Found { n_coarse, may_be_a_thing, by_chance, ..alone },
        };
        let moved = corners_apart(&found.now_from_key, &Homography::identity(), middle) > BELIEVED;
        let key = if at_last { &self.last } else { &self.key };
        if key.even && !key.proven && !moved {
            return None;
        }
        // Nothing but the frames themselves speaks for a first motion; what most of the area moves by is the ground's, however few pieces it has. A camera that rests is asked where it would else move.
        let places = key.patches.iter().map(|p| p.middle());
        let would_move = || moves(&last, &Found { by_chance: false, ..found }, middle, places);
        if !self.known || found.by_chance && would_move() {
            let is_most = self.cover.is_most(&key.image, &self.now, &found.now_from_key);
            found.covers &= self.known || is_most;
            found.by_chance &= !is_most;
        }
        if at_last {
            // Another view, or the key frame is too far away: the last frame takes its place.
            std::mem::swap(&mut self.key, &mut self.last);
            self.fine.clear();
            self.from_key = Homography::identity();
            self.rest.began_at = Homography::identity();
        }
        self.key.proven |= moved;
        Some(found)
    }

    /// The motion from the key frame by patches of the frame itself, near a coarse one.
    fn sharpen(&mut self, coarse: &Homography, pixels: &Pixels, scales: &Scales) -> Option<Found> {
        let middle = scales.middle;
        let predicted = scaled(coarse, scales.factor, scales.fine);
        let n = self.fine.find(pixels, &predicted, &mut self.matches);
        if (self.matches.len() as f64) < FOUND * n as f64 {
            return None;
        }
        let scale = scales.factor as f64 / scales.fine as f64;
        let fine_middle = scale * middle + Vector2::repeat(0.5 * (scale - 1.0));
        let limits = Limits { least_px: if self.turning { 0.0 } else { STILL }, ..Limits::NONE };
        let plane = plane::fit(&self.matches, &predicted, fine_middle, limits)?;
        if plane.spread_px > LOST_PX || plane.share < FOUND {
            return None;
        }
        Some(Found {
            now_from_key: scaled(&plane.to_from, scales.fine, scales.factor),
            cov: scaled_cov(&plane_cov(&plane, &self.matches, fine_middle, !self.known)?, 1.0 / scale),
            turned: plane.n_numbers > 2,
            covers: true,
            may_be_a_thing: false,
            by_chance: false,
            n_coarse: 0,
            apart_px: 0.0,
        })
    }

    /// The motion by a fit, to the key frame or, `at_last`, to the frame before.
    fn measured(
        &mut self,
        found: Found,
        at_last: bool,
        pixels: &Pixels,
        scales: &Scales,
    ) -> (Homography, MotionCov, MotionBasis) {
        let middle = scales.middle;
        let before = self.from_key;
        let places = self.key.patches.iter().map(|p| p.middle());
        self.from_key = self.rest.settle(&before, &found, middle, places);
        let step = if self.from_key == before { Homography::identity() } else { before.inverse().then(&self.from_key) };
        self.turning = found.turned && self.rest.moving;
        // A step over bridged frames is none of one frame.
        match self.n_held {
            0 => self.course.learn(&step.similarity_at(middle), middle),
            _ => self.course.found(),
        }
        let basis = if self.n_held > 0 && at_last { MotionBasis::Resumed } else { MotionBasis::Measured };
        (self.known, self.n_held) = (true, 0);
        let own = if self.rest.moving { found.cov } else { MotionCov::zeros() };
        let cov = own + self.carried;
        // Tracks take the ground's new place up with their updates; what is below a thousandth of a pixel is none.
        self.carried = if self.carried.max() > 1e-6 { 0.5 * self.carried } else { MotionCov::zeros() };
        let shift = self.from_key.shift_at(middle).abs();
        let far = shift.x > 2.0 * KEY_SHARE * middle.x || shift.y > 2.0 * KEY_SHARE * middle.y;
        let linear = self.from_key.similarity_at(middle);
        let turned = linear.angle_rad().abs() > KEY_TURN || linear.zoom().ln().abs() > KEY_TURN;
        // Soon too few patches would be left to agree; a camera at rest keeps its key frame, and with it its place.
        let few = self.rest.moving && found.n_coarse < MIN_PATCHES + 2;
        // The last frame's own pixels are gone: this one is as good a key, unless its even texture must first be seen to move.
        let blunt = at_last && !self.key.even;
        if far || turned || few || blunt {
            self.new_key(pixels, scales);
        }
        (step, cov, basis)
    }

    fn new_key(&mut self, pixels: &Pixels, scales: &Scales) {
        self.key.take(&mut self.now);
        self.fine.choose(pixels, scales.factor, &self.key.places);
        self.key_is_last = true;
        self.rest.began_at = self.from_key.inverse().then(&self.rest.began_at);
        self.from_key = Homography::identity();
    }

    /// The motion where nothing was found; `None` where it is unknown.
    fn held(&mut self, pixels: &Pixels, scales: &Scales) -> Option<(Homography, MotionCov, MotionBasis)> {
        if !self.known {
            // An even texture may yet be seen to move; anything else is no key frame.
            let may_move = self.key.even && !self.matches.is_empty();
            if !may_move {
                self.start_anew(pixels, scales);
            }
            return None;
        }
        let step = Homography::of_similarity(&self.course.next(scales.middle));
        let grown = of_similarity(&self.course.hold());
        self.n_held += 1;
        if self.n_held > MOST_HELD || 2.0 * grown[(0, 0)].sqrt() > SEARCH as f64 {
            self.start_anew(pixels, scales);
            return None;
        }
        self.from_key = self.from_key.then(&step);
        self.carried = grown;
        Some((step, grown, MotionBasis::Held))
    }
}

#[cfg(test)]
#[path = "estimate/tests.rs"]
mod tests;
