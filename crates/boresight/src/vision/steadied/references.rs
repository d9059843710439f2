//! The earlier frames that the present one is compared with, and where their ground lies in it.
//!
//! How: a frame is kept whenever a fourth of the lag has passed, until it is older than 2.5 lags. Where each one's ground lies is carried along with the
//! motion from frame to frame (room `camera`: a plane's, from patches looked for where the last motion goes on, or within 4 % of the frame); the two that are compared with are registered once more, directly,
//! so that no error adds up. Of a recording, frames of its first seconds that were shown beforehand stand in at the start: for an object that moves, later is as good as earlier.
//! Symbols: own, the present frame; other_from_own takes its points to those of a kept one (working px).
//! Limits: where the motion is lost all is forgotten, and nothing is seen until two lags have passed.

use crate::camera::{PlanePatches, Registration, WideSearch};
use crate::{Homography, Image};

/// Frames kept in one lag.
const PER_LAG: f64 = 4.0;
/// Lags after which a frame is forgotten.
const OLDEST: f64 = 2.5;

/// A kept frame.
#[derive(Clone, Debug)]
struct Reference {
    time_s: f64,
    image: Image<f32>,
    other_from_own: Homography,
}

/// The kept frames and the last one.
#[derive(Clone, Debug, Default)]
pub(super) struct References {
    lag_s: f64,
    kept: Vec<Reference>,
    /// Frames whose memory is used again.
    spare: Vec<Image<f32>>,
    last: Image<f32>,
    patches: PlanePatches,
    own_patches: PlanePatches,
    wide: WideSearch,
    /// The last motion from frame to frame.
    motion: Homography,
    time_s: f64,
    started: bool,
}

impl References {
    /// With nothing kept yet.
    pub fn new(lag_s: f64) -> Self {
        Self { lag_s, ..Self::default() }
    }

    /// Whether a frame was seen.
    pub fn has_started(&self) -> bool {
        self.started
    }

    /// Time that frames shown beforehand should cover, s.
    pub fn prime_s(&self) -> f64 {
        if self.started || !self.kept.is_empty() { 0.0 } else { (OLDEST - 0.25) * self.lag_s }
    }

    /// Keeps frames of the first [`Self::prime_s`] seconds, evenly spread, the first among them.
    pub fn prime(&mut self, frames: Vec<Image<f32>>) {
        let step_s = self.prime_s() / frames.len().saturating_sub(1).max(1) as f64;
        let (mut from_first, mut motion) = (Homography::identity(), Homography::identity());
        let mut kept: Vec<Reference> = Vec::new();
        for (i, image) in frames.into_iter().enumerate() {
            if let Some(before) = kept.last() {
                self.patches.choose(&before.image);
                // Whatever cannot be followed is of no use, nor what comes after it.
                let Some(step) = registered(&self.patches, &mut self.wide, &before.image, &image, &motion) else { break };
                (motion, from_first) = (step, from_first.then(&step));
            }
            kept.push(Reference { time_s: i as f64 * step_s, image, other_from_own: from_first });
        }
        self.kept = kept;
    }

    /// Takes the next frame, `dt_s` after the last one; where the ground cannot be followed to it all that was kept is forgotten.
    pub fn step(&mut self, now: &Image<f32>, dt_s: f64) {
        if self.started {
            self.time_s += dt_s;
            match registered(&self.patches, &mut self.wide, &self.last, now, &self.motion) {
                Some(step) => {
                    let back = step.inverse();
                    self.kept.iter_mut().for_each(|r| r.other_from_own = back.then(&r.other_from_own));
                    self.motion = step;
                }
                None => {
                    self.spare.extend(self.kept.drain(..).map(|r| r.image));
                    self.motion = Homography::identity();
                }
            }
        }
        self.started = true;
        self.own_patches.choose(now);
    }

    /// The two kept frames to compare with, each with where it lies; `now` is the frame of the last step.
    pub fn two(&mut self, now: &Image<f32>) -> Option<[(&Image<f32>, Homography); 2]> {
        let places = self.places()?;
        for place in places {
            let r = &mut self.kept[place];
            if let Some(direct) = self.own_patches.register(now, &r.image, &r.other_from_own) {
                r.other_from_own = direct.to_from;
            }
        }
        Some(places.map(|place| (&self.kept[place].image, self.kept[place].other_from_own)))
    }

    /// Places of the newest one that is a lag old and of the newest that is two; where there is none, of others that are a lag away.
    fn places(&self) -> Option<[usize; 2]> {
        let away = |i: usize| (self.time_s - self.kept[i].time_s) / self.lag_s;
        // Half of the time between two kept frames is no matter.
        let reach = |lags: f64| lags - 0.5 / PER_LAG;
        let nearest = |fits: &dyn Fn(usize) -> bool| {
            let all = (0..self.kept.len()).filter(|i| fits(*i));
            all.min_by(|a, b| away(*a).abs().total_cmp(&away(*b).abs()))
        };
        let first = nearest(&|i| away(i) >= reach(1.0)).or_else(|| nearest(&|i| -away(i) >= reach(1.0)))?;
        let second = nearest(&|i| i != first && away(i) >= reach(2.0))
            .or_else(|| nearest(&|i| i != first && -away(i) >= reach(1.0) && away(first) > 0.0))
            .or_else(|| {
                let others = (0..self.kept.len()).filter(|i| *i != first && away(*i).abs() >= reach(1.0));
                others.max_by(|a, b| away(*a).abs().total_cmp(&away(*b).abs()))
            })?;
        Some([first, second])
    }

    /// Keeps the frame of the last step, which is given up, if it is time to.
    pub fn keep(&mut self, now: &mut Image<f32>) {
        let oldest = self.time_s - OLDEST * self.lag_s;
        while let Some(i) = self.kept.iter().position(|r| r.time_s < oldest) {
            self.spare.push(self.kept.remove(i).image);
        }
        let newest = self.kept.iter().map(|r| r.time_s).fold(f64::NEG_INFINITY, f64::max);
        if self.time_s - newest >= (1.0 - 1e-6) * self.lag_s / PER_LAG {
            let mut image = self.spare.pop().unwrap_or_default();
            image.clone_from(now);
            self.kept.push(Reference { time_s: self.time_s, image, other_from_own: Homography::identity() });
        }
        std::mem::swap(&mut self.last, now);
        std::mem::swap(&mut self.patches, &mut self.own_patches);
    }
}

/// The motion from `before` to `now`: near the last one, or looked for.
fn registered(
    patches: &PlanePatches,
    wide: &mut WideSearch,
    before: &Image<f32>,
    now: &Image<f32>,
    motion: &Homography,
) -> Option<Homography> {
    let near = patches.register(before, now, motion);
    if let Some(clear) = near.filter(Registration::is_clear) {
        return Some(clear.to_from);
    }
    let looked = wide.look(before, now).and_then(|rough| patches.register(before, now, &rough));
    // A plane through many patches is a better one, then one that they lie close to.
    let worth = |r: &Registration| r.found / r.spread_px.max(0.05);
    let best = near.into_iter().chain(looked).max_by(|a, b| worth(a).total_cmp(&worth(b)))?;
    Some(best.to_from)
}
