//! The earlier frames that the present one is compared with, and where their ground lies in it.
//!
//! How: a frame is kept whenever a fourth of the lag has passed, until it is older than 3.5 lags. Where each one's ground lies is carried along with the
//! motion from frame to frame (room `camera`: a plane's, from patches looked for where the last motion goes on, or within 4 % of the frame); the two that are compared with are registered once more, directly,
//! so that no error adds up. Of a recording, frames of its first seconds that were shown beforehand stand in at the start: for an object that moves, later is as good as earlier.
//! Symbols: own, the present frame; other_from_own takes its points to those of a kept one (working px).
//! Limits: where the motion is lost all is forgotten, and nothing is seen until three lags have passed.

use crate::camera::PlaneFollower;
use crate::{Homography, Image};

/// Frames kept in one lag.
const PER_LAG: f64 = 4.0;
/// Lags after which a frame is forgotten.
const OLDEST: f64 = 3.5;
/// Lags to the second frame: what a target moved by in two lags it does not cover twice.
pub(crate) const SECOND_LAG: f64 = 3.0;
/// Lags that frames shown beforehand cover: enough to have one a lag and one three lags away at every time.
const SHOWN: f64 = 3.75;

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
    plane: PlaneFollower,
    time_s: f64,
}

impl References {
    /// With nothing kept yet.
    pub fn new(lag_s: f64) -> Self {
        Self { lag_s, ..Self::default() }
    }

    /// Whether a frame was seen.
    pub fn has_started(&self) -> bool {
        self.plane.has_started()
    }

    /// Time that frames shown beforehand should cover, s.
    pub fn prime_s(&self) -> f64 {
        if self.has_started() || !self.kept.is_empty() { 0.0 } else { SHOWN * self.lag_s }
    }

    /// Keeps frames of the first [`Self::prime_s`] seconds, each with its time since the first, which is among them.
    pub fn prime(&mut self, frames: Vec<(f64, Image<f32>)>) {
        let (mut plane, mut from_first) = (PlaneFollower::default(), Homography::identity());
        let mut kept: Vec<Reference> = Vec::new();
        for (i, (time_s, image)) in frames.into_iter().enumerate() {
            match plane.step(&image) {
                Some(step) => from_first = from_first.then(&step.to_from),
                // Whatever cannot be followed is of no use, nor what comes after it.
                None if i > 0 => break,
                None => {}
            }
            plane.keep(&mut image.clone());
            kept.push(Reference { time_s, image, other_from_own: from_first });
        }
        self.kept = kept;
    }

    /// Takes the next frame, `dt_s` after the last one; where the ground cannot be followed to it all that was kept is forgotten.
    pub fn step(&mut self, now: &Image<f32>, dt_s: f64) {
        let is_first = !self.has_started();
        self.time_s += if is_first { 0.0 } else { dt_s };
        match self.plane.step(now) {
            Some(step) => {
                let back = step.to_from.inverse();
                self.kept.iter_mut().for_each(|r| r.other_from_own = back.then(&r.other_from_own));
            }
            // Frames shown beforehand are already told from the first one.
            None if is_first => {}
            None => self.spare.extend(self.kept.drain(..).map(|r| r.image)),
        }
    }

    /// The two kept frames to compare with, each with where it lies; `now` is the frame of the last step.
    pub fn two(&mut self, now: &Image<f32>) -> Option<[(&Image<f32>, Homography); 2]> {
        let places = self.places()?;
        for place in places {
            let r = &mut self.kept[place];
            if let Some(direct) = self.plane.patches().register(now, &r.image, &r.other_from_own) {
                r.other_from_own = direct.to_from;
            }
        }
        Some(places.map(|place| (&self.kept[place].image, self.kept[place].other_from_own)))
    }

    /// Places of the newest one that is a lag old and of the newest that is three; where there is none, of others as far away, the later one of them if need
    /// be a lag after the present frame: a target is then in three places all the same.
    fn places(&self) -> Option<[usize; 2]> {
        let away = |i: usize| (self.time_s - self.kept[i].time_s) / self.lag_s;
        // Half of the time between two kept frames is no matter, nor are the digits of a sum of times.
        let reach = |lags: f64| lags - 0.5 / PER_LAG - 1e-6;
        let nearest = |fits: &dyn Fn(f64) -> bool| {
            let all = (0..self.kept.len()).filter(|i| fits(away(*i)));
            all.min_by(|a, b| away(*a).abs().total_cmp(&away(*b).abs()))
        };
        let first = nearest(&|lags| lags >= reach(1.0)).or_else(|| nearest(&|lags| -lags >= reach(1.0)))?;
        let is_old = away(first) > 0.0;
        let second = nearest(&|lags| lags >= reach(SECOND_LAG))
            .or_else(|| nearest(&|lags| is_old && -lags >= reach(1.0)))
            .or_else(|| nearest(&|lags| -lags >= reach(SECOND_LAG)))?;
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
        self.plane.keep(now);
    }
}
