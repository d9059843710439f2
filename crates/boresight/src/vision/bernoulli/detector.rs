//! The detector: whitened frames, the density of the whole frame, targets that stand out of it and are followed by themselves.
//!
//! How: the density's mean over velocities and strengths is summed in boxes about as wide as the spot; where the expected number of places of noise that newly come to such a sum in a frame (`null`) is at most what is
//! asked for, the highest first, a target begins: it takes its surroundings of the density with it, and there the
//! frame's own is brought back to what noise is expected to have. From then on its light is taken out of the frame for all others, and the frame's density gains nothing where it is.
//! Its odds begin as one over the expected number of false alarms. Two targets that are at one place now and a straight time ago are one.
//! Limits: [`MOST_TARGETS`] a side; ground that stands out and moves as targets do; a camera that moves by more than the velocities looked for.
//! Source of the parts: their files; taking out what is found: CLEAN, J. A. Högbom, A&AS 15, 417 (1974).

use super::config::BernoulliConfig;
use super::density::{Density, Motion};
use super::grid::{add_light, for_near, sum_boxes};
use super::likelihood::{Levels, STRENGTHS};
use super::memory::fits;
use super::null::Null;
use super::shape::{Profile, shown_at, straight_s};
use super::target::{LEAST_ODDS, Target};
use super::whitened::Whitened;
use crate::vision::config::DetectorConfig;
use crate::vision::pixel::Pixel;
use crate::vision::polarity::{Polarity, Side};
use crate::vision::target_finder::{TargetFinder, TypedFrame};
use crate::{DetectedVelocity, Detection, Error, ErrorKind, Extent, Result};
use nalgebra::Vector2;

/// Most targets of a side.
const MOST_TARGETS: usize = 64;
/// Straight times after which nothing that was there is of use: its velocity is another.
const GAP: f64 = 2.0;
/// Such gaps in a row, with nothing else before, by which frames are too far apart for what is asked.
const ONLY_GAPS: u32 = 3;
/// Distances as those of a spot, in its σ (`Profile::reach`): half side of the box that the density is summed in; where two are one; where a target's own light is taken for its.
const BOX: f64 = 1.5;
const TWIN: f64 = 1.5;
const OWN: f64 = 3.0;
/// Half side of a target's window, in half sides of the box.
const WINDOW: i64 = 5;

/// One sign of contrast.
#[derive(Debug)]
struct OneSide {
    sign: f32,
    /// Whether its targets are reported; else it is there for the null, whose targets are followed as well: what they leave around them is none of noise.
    is_wanted: bool,
    levels: Levels,
    /// Of this side's boxes.
    null: Null,
    density: Density,
    targets: Vec<Target>,
    /// Windows of targets that have gone, for those that come.
    spare: Vec<Target>,
    /// Deviations with the targets' light taken out.
    left: Vec<f32>,
    ratios: [Vec<f32>; STRENGTHS.len()],
    boxes: Vec<f32>,
    row: Vec<f32>,
}

/// What is built once frames have a size.
#[derive(Debug)]
struct Search {
    frame: (usize, usize),
    whitened: Whitened,
    motion: Motion,
    sides: [OneSide; 2],
}

/// Finds targets by the density that it carries from frame to frame.
#[derive(Debug)]
pub(in crate::vision) struct BernoulliDetector {
    config: BernoulliConfig,
    search: Option<Search>,
    /// Gaps before the first frames that were no gap; `None` from then on.
    only_gaps: Option<u32>,
    blind: bool,
}

impl BernoulliDetector {
    /// Builds the detector for a checked configuration.
    pub(in crate::vision) fn new(config: &BernoulliConfig) -> Self {
        Self { config: config.clone(), search: None, only_gaps: Some(0), blind: true }
    }

    fn lay_out<T: Pixel>(&mut self, frame: (usize, usize)) -> Result<()> {
        if self.search.as_ref().is_some_and(|s| s.frame == frame) {
            return Ok(());
        }
        if !fits(&self.config, frame) {
            let speed = self.config.max_speed_px_per_s;
            let what =
                format!("{} x {} px with velocities of up to {speed} px/s take more than 512 MB", frame.0, frame.1);
            let hint = "lower max-speed-px-per-s, or raise acceleration-density-px2-per-s3, sigma-px or side-px, or look at a part of the frame";
            return Err(Error::new(ErrorKind::Config, what).at("detector.threshold.bernoulli").hint(hint));
        }
        let whitened = Whitened::new::<T>(frame.0, frame.1, &self.config);
        let motion = Motion::new(&self.config, whitened.step());
        let ((w, h), nv) = (whitened.size(), motion.count());
        let needed = ((w * h) as f64 / self.config.false_alarms_per_frame).ln();
        let half = box_of(&Profile::new(&self.config).in_cells(whitened.step()));
        let build = |side| OneSide {
            sign: if side == Side::Bright { 1.0 } else { -1.0 },
            is_wanted: self.config.polarity.has(side),
            null: Null::new(w, h, half),
            levels: Levels::new(self.config.least_snr, needed),
            // One cell of so much is enough for a target.
            density: Density::new(
                w,
                h,
                [0, 0],
                nv,
                1.0,
                (needed.max(0.0).exp() * 2.0 * (STRENGTHS.len() * nv * nv) as f64) as f32,
            ),
            targets: Vec::with_capacity(MOST_TARGETS),
            spare: Vec::with_capacity(MOST_TARGETS + 1),
            left: vec![0.0; w * h],
            ratios: [vec![0.0; w * h], vec![0.0; w * h]],
            boxes: vec![0.0; w * h],
            row: vec![0.0; w * h],
        };
        self.search = Some(Search { frame, sides: [build(Side::Bright), build(Side::Dark)], whitened, motion });
        Ok(())
    }
}

impl OneSide {
    /// One frame on.
    fn step(&mut self, config: &BernoulliConfig, motion: &Motion, whitened: &Whitened, dt_s: f64) {
        let size = whitened.size();
        let profile = Profile::new(config).in_cells(whitened.step());
        let straight_s = straight_s(config);
        for (l, z) in self.left.iter_mut().zip(whitened.z()) {
            *l = self.sign * z;
        }
        for t in &self.targets {
            add_light(&mut self.left, size, t.expected(dt_s), -t.existence() * t.snr, &profile);
        }
        let kept = kept(config, dt_s);
        self.levels.learn(&self.left, kept);
        for (strength, ratios) in self.ratios.iter_mut().enumerate() {
            self.levels.ratios(strength, &self.left, ratios);
            for t in &self.targets {
                for_near(size, t.expected(dt_s), profile.reach(OWN), |i, d| {
                    if profile.shows(d) >= shown_at(OWN) {
                        ratios[i] = ratios[i].min(1.0);
                    }
                });
            }
        }
        self.density.step(motion, &self.ratios, 1.0 - motion.survival(), 1.0, [0, 0]);
        let fading = dt_s / straight_s;
        let (levels, left) = (&self.levels, &self.left);
        let contains = |x: i64, y: i64| (0..size.0 as i64).contains(&x) && (0..size.1 as i64).contains(&y);
        let is_left = |t: &mut Target| {
            let (at, light) = (t.expected(dt_s), t.existence() * t.snr);
            let own = |x: i64, y: i64| {
                let d = Vector2::new(x as f64, y as f64) - at;
                let light = light * profile.shows(d);
                if contains(x, y) { left[y as usize * size.0 + x as usize] + light as f32 } else { f32::NEG_INFINITY }
            };
            let is_there = t.step(motion, levels, dt_s, own);
            let at = t.moments.place;
            let (x, y) = (at.x.round() as i64, at.y.round() as i64);
            let inside = contains(x, y);
            if inside {
                t.snr += fading.min(1.0) * (f64::from(own(x, y)) - t.snr);
                t.snr = t.snr.max(0.0);
            }
            is_there && inside
        };
        give_up(&mut self.targets, &mut self.spare, is_left);
        self.join_twins(straight_s, &profile);
        let half = box_of(&profile);
        sum_boxes(&self.density.marginal, size.0, half, &mut self.row, &mut self.boxes);
        self.null.look(&self.boxes, kept);
        let sure = (size.0 as f64 * size.1 as f64 / config.false_alarms_per_frame).ln();
        for t in &self.targets {
            // The blocks that it reaches.
            let reach = profile.reach(2.0);
            for (dx, dy) in [(-1.0, -1.0), (1.0, -1.0), (-1.0, 1.0), (1.0, 1.0)] {
                let (x, y) = (t.moments.place.x + dx * reach, t.moments.place.y + dy * reach);
                self.null.mark(
                    (x.max(0.0) as usize).min(size.0 - 1),
                    (y.max(0.0) as usize).min(size.1 - 1),
                    2.0 * sure,
                );
            }
        }
    }

    /// Of two targets that are at one place now and were a straight time ago, the less sure one goes.
    fn join_twins(&mut self, straight_s: f64, profile: &Profile) {
        let by_odds = |a: &Target, b: &Target| {
            let (pa, pb) = (a.moments.place, b.moments.place);
            b.odds.total_cmp(&a.odds).then(pa.y.total_cmp(&pb.y)).then(pa.x.total_cmp(&pb.x))
        };
        self.targets.sort_unstable_by(by_odds);
        let mut i = 1;
        while i < self.targets.len() {
            let is_twin = self.targets[..i].iter().any(|o| {
                let t = &self.targets[i];
                let (dp, dv) = (t.moments.place - o.moments.place, t.moments.velocity - o.moments.velocity);
                let at_one = |d: Vector2<f64>| profile.shows(d) > shown_at(TWIN);
                at_one(dp) && at_one(dp - dv * straight_s)
            });
            if is_twin {
                self.spare.push(self.targets.remove(i));
            } else {
                i += 1;
            }
        }
    }

    /// Begins the targets that stand out of the frame's density more than those of `null` do.
    fn begin(&mut self, config: &BernoulliConfig, motion: &Motion, whitened: &Whitened, null: &Null) {
        let (w, h) = whitened.size();
        let half = box_of(&Profile::new(config).in_cells(whitened.step()));
        let both = config.polarity == Polarity::Both;
        while self.targets.len() < MOST_TARGETS {
            let best = self.boxes.iter().enumerate().max_by(|a, b| a.1.total_cmp(b.1));
            let Some((i, &sum)) = best else { break };
            let expected = null.number(f64::from(sum));
            // A target takes its odds out of the density: where those are only the null, they have to stay as far as it is fitted, or it would learn that nothing goes higher.
            if expected > config.false_alarms_per_frame || !self.is_wanted && !self.null.is_above(f64::from(sum)) {
                break;
            }
            let is_ghost = both && null.has_been_surer(i % w, i / w, f64::from(sum).ln());
            let (x, y) = ((i % w) as i64, (i / w) as i64);
            let odds = 1.0 / expected;
            let snr = f64::from(self.left[i].max(0.0)).max(config.least_snr);
            let mut target = self.spare.pop().unwrap_or_else(|| Target::empty(motion, WINDOW * half as i64));
            let begins = target.begin(&self.density, motion, [x, y], odds, snr);
            if begins {
                self.density.flatten(target.window((w, h)), 1.0);
            }
            (if begins && !is_ghost { &mut self.targets } else { &mut self.spare }).push(target);
            // The same place is not looked at again in this frame.
            let around = (WINDOW * half as i64) as f64;
            for_near((w, h), Vector2::new(x as f64, y as f64), around, |i, d| {
                if d.norm() <= around {
                    self.boxes[i] = 0.0;
                }
            });
        }
    }
}

/// Keeps those that are left, in another order, and the windows of the others.
fn give_up(targets: &mut Vec<Target>, spare: &mut Vec<Target>, mut is_left: impl FnMut(&mut Target) -> bool) {
    let mut i = 0;
    while i < targets.len() {
        if is_left(&mut targets[i]) {
            i += 1;
        } else {
            spare.push(targets.swap_remove(i));
        }
    }
}

/// What is left of what was learnt before.
fn kept(config: &BernoulliConfig, dt_s: f64) -> f64 {
    (-dt_s / (super::whitened::MEMORY * straight_s(config))).exp()
}

/// Half side of the box that the density is summed in, cells.
fn box_of(profile: &Profile) -> usize {
    (profile.reach(BOX).round() as usize).max(1)
}

impl<T: Pixel> TargetFinder<T> for BernoulliDetector {
    fn remembers(&self) -> bool {
        true
    }

    fn find(&mut self, frame: &TypedFrame<T>, _: &DetectorConfig, out: &mut Vec<Detection>) -> Result<()> {
        self.blind = true;
        let size = (frame.image.width(), frame.image.height());
        if size.0 == 0 || size.1 == 0 {
            return Ok(());
        }
        self.lay_out::<T>(size)?;
        let Some(Search { whitened, motion, sides, .. }) = &mut self.search else { return Ok(()) };
        let straight_s = straight_s(&self.config);
        let mut dt_s = frame.dt_s.max(0.0);
        let is_gap = dt_s > GAP * straight_s;
        if is_gap && let Some(gaps) = &mut self.only_gaps {
            *gaps += 1;
            if *gaps >= ONLY_GAPS {
                let what = format!(
                    "frames are {dt_s:.3} s apart, and a path is straight for {straight_s:.3} s: nothing can be carried from one to the next"
                );
                let density = 3.0 * (Profile::new(&self.config).resolution() / dt_s).powi(2) / dt_s;
                let hint =
                    format!("lower acceleration-density-px2-per-s3: {density:.2e} is straight from frame to frame");
                return Err(Error::new(ErrorKind::Config, what).at("detector.threshold.bernoulli").hint(hint));
            }
        } else if dt_s > 0.0 {
            self.only_gaps = None;
        }
        if frame.dt_s <= 0.0 || is_gap {
            // Nothing of what was there is where it was; the background is what it was, unless time stood still or ran back.
            if frame.dt_s <= 0.0 {
                whitened.clear();
            }
            dt_s = 0.0;
            sides.iter_mut().for_each(|s| {
                s.density.fill(1.0);
                s.spare.append(&mut s.targets);
            });
        }
        motion.advance(dt_s);
        if !whitened.take(frame.image, dt_s) {
            return Ok(());
        }
        self.blind = false;
        let step = whitened.step() as f64;
        let middle = (whitened.step() / 2) as f64;
        let profile = Profile::new(&self.config);
        // After a gap there is one.
        let frames = if dt_s > 0.0 { straight_s / dt_s } else { 1.0 };
        let first = out.len();
        for side in sides.iter_mut() {
            side.step(&self.config, motion, whitened, dt_s);
        }
        let kept = kept(&self.config, dt_s);
        let [bright, dark] = sides;
        bright.null.learn(dark.null.past(), kept);
        dark.null.learn(bright.null.past(), kept);
        bright.begin(&self.config, motion, whitened, &dark.null);
        dark.begin(&self.config, motion, whitened, &bright.null);
        for side in [bright, dark].into_iter().filter(|s| s.is_wanted) {
            for t in side.targets.iter().filter(|t| t.odds >= LEAST_ODDS) {
                let at = t.moments.place * step + Vector2::repeat(middle);
                let [cov, velocity_cov, cross] = t.covariances(motion, frames, step);
                let height = f64::from(side.sign) * t.snr * f64::from(whitened.noise_counts()) / profile.root_energy();
                let width = profile.width();
                out.push(
                    Detection::at(at, cov)
                        .with_extent(Extent::around(at, width, width))
                        .with_area_px(profile.area().round().max(1.0) as u32)
                        .with_peak(height as f32)
                        .with_sum(height * profile.light())
                        .with_score(t.odds.log10() as f32)
                        .with_velocity(Some(DetectedVelocity {
                            mean: t.moments.velocity * step,
                            cov: velocity_cov,
                            with_position: cross,
                        })),
                );
            }
        }
        let (w, h) = (size.0 as f64, size.1 as f64);
        out.retain(|d| (-0.5..w - 0.5).contains(&d.position.x) && (-0.5..h - 0.5).contains(&d.position.y));
        out[first..]
            .sort_unstable_by(|a, b| a.position.y.total_cmp(&b.position.y).then(a.position.x.total_cmp(&b.position.x)));
        Ok(())
    }

    fn is_blind(&self) -> bool {
        self.blind
    }
}

#[cfg(test)]
mod tests;
