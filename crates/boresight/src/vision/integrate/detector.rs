//! The detector that sums frames: memory, search, null, places, several targets; a report every T / 2 frames.
//!
//! How: when half of the memory is new, frames become contributions (`memory`), every velocity is summed at every pixel (`sums`), the tops of
//! the best and of the worst are climbed (`refine`), those of the other sign are the null (`null`), and from the highest down a top whose own
//! score (`cancel`) is rarer than asked for is a detection at the newest frame, with its velocity.
//! Frames without a report are blind: they say nothing of whether a target is there.
//! What a tracker may believe: sums overlap by half, yet a line's end is set by the newer half against the older. For a line fitted to T
//! even points the errors of its end in neighbouring reports are correlated by −1/16, of its slope by −1/4. So positions are
//! as good as independent with the covariance stated; velocities serve to start a track, not as further measurements of it.
//! Limits: targets that keep their velocity (to about σ) over T frames; [`CANDIDATES`] tops a sign are looked at. Deviations: 5 σ at a first report.
//! Source of the parts: their files; the bank of matched filters over velocities: I. S. Reed, R. M. Gagliardi & H. M. Shao, IEEE T-AES 19,
//! 898 (1983); its use for faint moving objects: P. J. Whidden et al., Astron. J. 157, 119 (2019).

use super::cancel::{Kept, MOST};
use super::config::IntegrateConfig;
use super::memory::{CELL, Memory, Phi};
use super::null::Null;
use super::refine::{Found, Paths};
use super::sums::{PER_SCORE, Sums};
use super::velocities::Velocities;
use crate::vision::config::DetectorConfig;
use crate::vision::gaussian::WIDTH_PER_DEVIATION;
use crate::vision::pixel::Pixel;
use crate::vision::polarity::Side;
use crate::vision::target_finder::{TargetFinder, TypedFrame};
use crate::{DetectedVelocity, Detection, Error, ErrorKind, Extent, Result};
use nalgebra::{Matrix2, Vector2};

/// Tops of each sign that are climbed, the highest.
const CANDIDATES: usize = 384;
/// Lowest score of a top on the grid that is listed, deviations.
const LEAST: f32 = 3.0;
/// Change of the mean interval between frames from which on the velocities are laid out anew.
const OTHER_INTERVAL: f64 = 1.25;
/// Most velocities: their numbers are kept in 16 bits.
const MOST_VELOCITIES: usize = 1 << 16;

/// A top on the grid.
#[derive(Clone, Copy, Debug)]
struct Top {
    x: u32,
    y: u32,
    score: i16,
    velocity: u16,
}

/// What is built once the interval between frames is known.
#[derive(Debug)]
struct Search {
    velocities: Velocities,
    interval_s: f64,
    sums: Sums,
    null: [Null; 2],
}

/// Finds targets in sums of frames; keeps its memory between frames.
#[derive(Debug)]
pub(in crate::vision) struct IntegrateDetector {
    config: IntegrateConfig,
    memory: Option<(usize, usize, Memory)>,
    search: Option<Search>,
    phi: Phi,
    time_s: f64,
    /// Frames since the last report.
    fresh: u32,
    times_s: Vec<f64>,
    tops: Vec<Top>,
    /// Climbed tops, bright and dark.
    found: [Vec<Found>; 2],
    kept: Kept,
    blind: bool,
}

impl IntegrateDetector {
    /// Builds the detector for a checked configuration.
    pub(in crate::vision) fn new(config: &IntegrateConfig) -> Self {
        Self {
            config: config.clone(),
            memory: None,
            search: None,
            phi: Phi::default(),
            time_s: 0.0,
            fresh: 0,
            times_s: Vec::with_capacity(config.frames as usize),
            tops: Vec::new(),
            found: [Vec::with_capacity(CANDIDATES), Vec::with_capacity(CANDIDATES)],
            kept: Kept::new(),
            blind: true,
        }
    }

    /// Takes a frame into the memory; whether a report is due.
    fn remember<T: Pixel>(&mut self, frame: &TypedFrame<T>) -> bool {
        let (n, size) = (self.config.frames, (frame.image.width(), frame.image.height()));
        if size.0 == 0 || size.1 == 0 {
            return false;
        }
        if self.memory.as_ref().is_none_or(|(w, h, _)| (*w, *h) != size) {
            let memory = Memory::new::<T>(size.0, size.1, n as usize, self.config.sigma_px, self.config.background);
            self.memory = Some((size.0, size.1, memory));
            self.search = None;
            self.fresh = 0;
        }
        let Some((_, _, memory)) = &mut self.memory else { return false };
        // After a gap as long as a sum nothing that was seen before is of use; nor if time stands still or runs back.
        let usual = self.search.as_ref().map_or(f64::INFINITY, |s| s.interval_s * f64::from(n));
        if !memory.is_empty() && (frame.dt_s <= 0.0 || frame.dt_s > usual) {
            memory.clear();
            self.fresh = 0;
        }
        self.time_s += frame.dt_s;
        memory.push(frame.image, self.time_s);
        self.fresh += 1;
        memory.is_full() && self.fresh >= n / 2
    }

    /// Lays the velocities out for the times in memory, where they are not yet.
    /// # Errors
    /// More velocities than can be told apart.
    fn lay_out(&mut self, width: usize, height: usize) -> Result<bool> {
        let n = self.config.frames as usize;
        let interval_s = self.times_s.last().map_or(0.0, |t| t.abs()) / (n - 1) as f64;
        let fits = |s: &Search| {
            let ratio = interval_s / s.interval_s;
            ratio < OTHER_INTERVAL && ratio > 1.0 / OTHER_INTERVAL
        };
        if self.search.as_ref().is_some_and(fits) {
            return Ok(true);
        }
        let (top, speed) = (n.ilog2() as usize, self.config.max_speed_px_per_s);
        // Checked before they are counted one by one.
        let across = 2.0 * speed * interval_s * n as f64 / (1.4 * self.config.sigma_px) + 2.0 * n as f64;
        let velocities = Velocities::new(top, self.config.sigma_px, interval_s, speed);
        let count = if across < 4.0 * (MOST_VELOCITIES as f64).sqrt() { velocities.count() } else { usize::MAX };
        if count > MOST_VELOCITIES {
            if self.search.is_some() {
                // A gap: the frames before it are no use with such speeds.
                return Ok(false);
            }
            let what = format!(
                "{speed} px/s over {n} frames of {interval_s:.4} s need more than {MOST_VELOCITIES} velocities"
            );
            return Err(Error::new(ErrorKind::Config, what)
                .at("detector.threshold.integrate")
                .hint("lower max-speed-px-per-s or frames, or raise sigma-px"));
        }
        let tests = count as f64 * (width * height) as f64;
        self.tops.reserve(width * height / 4 + 1);
        self.search = Some(Search {
            sums: Sums::new(width, height, top, count),
            null: [Null::new(tests), Null::new(tests)],
            velocities,
            interval_s,
        });
        Ok(true)
    }

    /// Sums, and appends what is found.
    fn report(&mut self, out: &mut Vec<Detection>) -> Result<()> {
        let Some((width, height, memory)) = &mut self.memory else { return Ok(()) };
        let (width, height, n) = (*width, *height, self.config.frames as usize);
        let newest = memory.time_s(0);
        self.times_s.clear();
        self.times_s.extend((0..n).map(|age| memory.time_s(age) - newest));
        if !self.lay_out(width, height)? {
            self.fresh = 0;
            if let Some((_, _, memory)) = &mut self.memory {
                memory.clear();
            }
            return Ok(());
        }
        let (Some((_, _, memory)), Some(search)) = (&mut self.memory, &mut self.search) else { return Ok(()) };
        search.velocities.plan(&self.times_s);
        memory.contributions(search.sums.frames_mut(), &mut self.phi);
        search.sums.search(&search.velocities, &self.times_s, &self.phi);
        for (side, found) in [Side::Bright, Side::Dark].into_iter().zip(&mut self.found) {
            list_tops(&search.sums, side, (width, height), &mut self.tops);
            let paths = Paths {
                frames: search.sums.frames(),
                times_s: &self.times_s,
                phi: &self.phi,
                width,
                height,
                sigma_px: self.config.sigma_px,
            };
            climb_tops(&paths, search, &self.tops, side, found);
        }
        self.choose(width, height, out);
        Ok(())
    }

    /// Appends those tops that are rarer than asked for, each with what the higher ones leave it.
    fn choose(&mut self, width: usize, height: usize, out: &mut Vec<Detection>) {
        let Some(search) = &mut self.search else { return };
        let both = [Side::Bright, Side::Dark].iter().all(|s| self.config.polarity.has(*s));
        for (null, found) in search.null.iter_mut().zip(&self.found) {
            null.learn(found.iter().map(|f| f.z));
        }
        let first = out.len();
        let sides = if both { 2.0 } else { 1.0 };
        let per_search = 0.5 * f64::from(self.config.frames);
        for (i, side) in [Side::Bright, Side::Dark].into_iter().enumerate() {
            if !self.config.polarity.has(side) {
                continue;
            }
            let null = &search.null;
            let number = |z: f64| {
                let other = null[1 - i].number(z);
                let n = if both { sides * other.min(null[i].number(z)) } else { other };
                n / per_search
            };
            self.kept.clear();
            for f in &self.found[i] {
                if out.len() - first >= MOST || number(f.z) > self.config.false_alarms_per_frame {
                    break;
                }
                let Some(own) = self.kept.own_score(f, &self.times_s, self.config.sigma_px) else { continue };
                let expected = number(own);
                if expected <= self.config.false_alarms_per_frame {
                    self.kept.keep(f, own);
                    out.push(detection(f, expected, side, self.config.sigma_px, self.phi.unit));
                }
            }
        }
        out.retain(|d| {
            (-0.5..width as f64 - 0.5).contains(&d.position.x) && (-0.5..height as f64 - 0.5).contains(&d.position.y)
        });
        out[first..]
            .sort_unstable_by(|a, b| a.position.y.total_cmp(&b.position.y).then(a.position.x.total_cmp(&b.position.x)));
    }
}

/// Lists the local tops of one sign, the highest [`CANDIDATES`].
fn list_tops(sums: &Sums, side: Side, (width, height): (usize, usize), tops: &mut Vec<Top>) {
    let e = &sums.extremes;
    let (scores, at, sign) = match side {
        Side::Bright => (&e.best, &e.best_at, 1),
        Side::Dark => (&e.worst, &e.worst_at, -1),
    };
    let stride = width.next_multiple_of(CELL);
    let score = |x: usize, y: usize| sign * i32::from(scores[y * stride + x]);
    let least = (LEAST * PER_SCORE) as i32;
    tops.clear();
    for y in 0..height {
        for x in 0..width {
            let here = score(x, y);
            if here < least {
                continue;
            }
            // Of equal neighbours the first is the top.
            let is_top = (y.saturating_sub(1)..(y + 2).min(height)).all(|ny| {
                (x.saturating_sub(1)..(x + 2).min(width)).all(|nx| {
                    let there = score(nx, ny);
                    if (ny, nx) < (y, x) { there < here } else { there <= here }
                })
            });
            if is_top {
                let (score, velocity) = (here.min(i32::from(i16::MAX)) as i16, at[y * stride + x]);
                tops.push(Top { x: x as u32, y: y as u32, score, velocity });
            }
        }
    }
    let order = |a: &Top, b: &Top| b.score.cmp(&a.score).then((a.y, a.x).cmp(&(b.y, b.x)));
    if tops.len() > CANDIDATES {
        tops.select_nth_unstable_by(CANDIDATES, order);
        tops.truncate(CANDIDATES);
    }
    tops.sort_unstable_by(order);
}

/// Climbs each top and sorts what is reached, the highest first; tops that climb to one place are one.
fn climb_tops(paths: &Paths<'_>, search: &Search, tops: &[Top], side: Side, found: &mut Vec<Found>) {
    let sign = if side == Side::Bright { 1.0 } else { -1.0 };
    let v = &search.velocities;
    found.clear();
    found.extend(tops.iter().filter_map(|top| {
        let (i, j) = search.sums.velocities[top.velocity as usize];
        let (i, j) = (i as usize, j as usize);
        let place = Vector2::new(f64::from(top.x) + v.offset(i), f64::from(top.y) + v.offset(j));
        paths.climb(place, Vector2::new(v.velocity(v.top, i), v.velocity(v.top, j)), sign)
    }));
    found.sort_unstable_by(|a, b| {
        b.z.total_cmp(&a.z)
            .then(a.position.y.total_cmp(&b.position.y))
            .then(a.position.x.total_cmp(&b.position.x))
            .then(a.velocity.x.total_cmp(&b.velocity.x))
            .then(a.velocity.y.total_cmp(&b.velocity.y))
    });
    found.dedup_by(|later, earlier| {
        (later.position - earlier.position).norm() < 0.5 * paths.sigma_px && later.z > 0.999 * earlier.z
    });
}

/// The detection of a found path; `expected` false alarms a frame are at least as high. Its peak and sum are those of the spot above the
/// background, below 0 where it is dark.
fn detection(f: &Found, expected: f64, side: Side, sigma_px: f64, unit: f32) -> Detection {
    let axis = f.cov(sigma_px);
    let of = |v: f64| Matrix2::identity() * v;
    // Filtered counts of a spot of height A are A times the root of its energy, √π σ.
    let sign = if side == Side::Bright { 1.0 } else { -1.0 };
    let height = sign * f.amplitude * f64::from(unit) / (std::f64::consts::PI.sqrt() * sigma_px);
    let width = WIDTH_PER_DEVIATION * sigma_px;
    Detection::at(f.position, of(axis[(0, 0)]))
        .with_extent(Extent::around(f.position, width, width))
        .with_area_px((std::f64::consts::FRAC_PI_4 * width * width).round().max(1.0) as u32)
        .with_peak(height as f32)
        .with_sum(height * std::f64::consts::TAU * sigma_px * sigma_px)
        .with_score((-expected.max(1e-300).log10()) as f32)
        .with_velocity(Some(DetectedVelocity {
            mean: f.velocity,
            cov: of(axis[(1, 1)]),
            with_position: of(axis[(0, 1)]),
        }))
}

impl<T: Pixel> TargetFinder<T> for IntegrateDetector {
    fn remembers(&self) -> bool {
        true
    }

    fn find(&mut self, frame: &TypedFrame<T>, _: &DetectorConfig, out: &mut Vec<Detection>) -> Result<()> {
        self.blind = !self.remember(frame);
        if !self.blind {
            self.fresh = 0;
            self.report(out)?;
        }
        Ok(())
    }

    fn is_blind(&self) -> bool {
        self.blind
    }
}

#[cfg(test)]
mod tests;
