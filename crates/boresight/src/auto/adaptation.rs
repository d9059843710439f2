//! The slow adaptation of a run that goes on: noise, motion, clutter and detection probability follow what the confirmed tracks show, within bounds.
//!
//! Source: our own. R and q: two factors on what the first choice learnt, by the likelihood of the innovations of `noise/fit.rs`, with each innovation weighted
//! by e^(−age / τ), and a prior that they drift slowly ([`DRIFT_STD`]). P_D, P_D after a miss and the clutter: the counts of `detection_statistics.rs`, forgotten with the same τ.
//! The series are filtered here, from the detections of confirmed tracks, so that what was adapted does not feed on itself except by the gate.
//! Derivation of τ: n weighted innovations in two axes tell a variance to √(2 / 2n) of itself, and n = 2 r τ for r innovations a second. For 10 % with one target at
//! 2 scans a second n = 100, τ = 25 s; [`MEMORY_S`] is the next round number. With less than [`LEAST_WEIGHT`] nothing is changed.
//! All times are those of the scans. Nothing changes before τ has passed: until then the first choice knows more.
//! Limits: R and q of constant velocity only, without several hypotheses and without the discrete noise; clutter only where the field is known; at most [`MOST_TRACKS`] tracks
//! and [`MOST_STEPS`] detections are looked at, so many targets at a high rate are remembered for less than τ.

use super::digits::round;
use super::first_scans::Shares;
use super::noise::fit::{Noise, Step, fit_factors};
use super::noise::follow::is_copy;
use super::noise::given::assumed;
use crate::camera::SteadyGround;
use crate::track::{ModelConfig, TrackerConfig, TrackerParameters};
use crate::{Scan, Timestamp, TrackState, TrackStatus};
use std::collections::{BTreeMap, VecDeque};

/// Time constant of forgetting, s.
const MEMORY_S: f64 = 30.0;
/// Older innovations weigh less than 5 % and are dropped, s.
const LONGEST_S: f64 = 3.0 * MEMORY_S;
/// Time between two updates, s.
const EVERY_S: f64 = 5.0;
/// What is new at an update, as a share of what is remembered: an innovation is told to several updates, and counts once in all of them.
const NEW_SHARE: f64 = EVERY_S / MEMORY_S;
/// Deviation of the logarithm of a variance that drifts between two updates: ln 2 · √([`EVERY_S`] / [`MEMORY_S`]), a factor of two in [`MEMORY_S`]. What the
/// innovations hardly tell stays what it was: without it q went up and down by a factor of ten from update to update, for 64 targets whose last second is remembered.
const DRIFT_STD: f64 = 0.283;
/// The same where nothing drifts, since a value was set by hand: any other factor costs more than all innovations give.
const HELD: f64 = f64::MIN_POSITIVE;
/// Weight of innovations, or of scans, from which on they count: 10 % of a variance.
const LEAST_WEIGHT: f64 = 100.0;
/// R and q stay within this factor of the first choice's, to either side: a deviation within a factor of 4.
const MOST_NOISE_FACTOR: f64 = 16.0;
/// The clutter density, and the odds of detection, within this one.
const MOST_COUNT_FACTOR: f64 = 4.0;
/// Counts that the first choice weighs.
const PRIOR: f64 = 10.0;
/// Tracks that are looked at: each gives some innovations a second.
const MOST_TRACKS: usize = 64;
/// Detections that are fitted, the newest: these tell a variance to 3 %.
const MOST_STEPS: usize = 2048;

/// The keys of the configuration that change together.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct Frozen {
    measurement: bool,
    motion: bool,
    detection: bool,
    clutter: bool,
}

#[derive(Debug, Default)]
struct Followed {
    steps: VecDeque<(Timestamp, Step)>,
    /// Seen scans since its last detection.
    missed: u32,
    is_there: bool,
}

/// Counts that fade.
#[derive(Clone, Copy, Debug, Default)]
struct Faded {
    /// Scans, false detections in them.
    scans: f64,
    unclaimed: f64,
    /// After a detection: detected again, missed; after a miss: detected, missed.
    hit: [f64; 2],
    found: [f64; 2],
    /// Sum of the normalised squared innovations, and their number.
    nis: [f64; 2],
}

impl Faded {
    fn fade(&mut self, keep: f64) {
        let Self { scans, unclaimed, hit, found, nis } = self;
        let pairs = hit.iter_mut().chain(found).chain(nis);
        pairs.chain([scans, unclaimed]).for_each(|v| *v *= keep);
    }
}

/// Follows what a live run shows, and says which parameters suit it.
#[derive(Debug)]
pub struct Adaptation {
    first: TrackerParameters,
    now: TrackerParameters,
    frozen: Frozen,
    /// Factors on R and q now.
    factors: [f64; 2],
    speed_std: f64,
    field_px2: Option<f64>,
    tracks: BTreeMap<u64, Followed>,
    faded: Faded,
    shares: Shares,
    ground: SteadyGround,
    began: Option<Timestamp>,
    last: Option<Timestamp>,
    due: Option<Timestamp>,
}

impl Adaptation {
    /// Begins with what was chosen; `None` where the tracker is of a kind that is not followed.
    pub fn of(chosen: &TrackerConfig) -> Option<Self> {
        // R and q are those of constant velocity; of a velocity that is forgotten they stay as the first choice learnt them.
        let driven = chosen.filter.is_constant_velocity();
        let forgetful = matches!(chosen.filter.model, ModelConfig::OrnsteinUhlenbeck(_));
        let suits = (driven || forgetful) && chosen.mht.is_none() && chosen.acceleration_std_px_per_s2.is_none();
        suits.then(|| Self {
            first: TrackerParameters::of(chosen),
            now: TrackerParameters::of(chosen),
            frozen: Frozen { measurement: !driven, motion: !driven, ..Frozen::default() },
            factors: [1.0; 2],
            speed_std: chosen.max_speed_px_per_s / 3.0,
            field_px2: chosen.field_px.map(|[w, h]| w * h).filter(|a| *a > 0.0),
            tracks: BTreeMap::new(),
            faded: Faded::default(),
            shares: Shares::default(),
            ground: SteadyGround::default(),
            began: None,
            last: None,
            due: None,
        })
    }

    /// Leaves alone what a key of the configuration (`tracker.extra-noise-px`) says by hand.
    pub fn freeze(&mut self, key: &str) {
        let frozen = &mut self.frozen;
        match key.trim() {
            "tracker.detection-covariance-scale" | "tracker.extra-noise-px" | "tracker.extra-noise-per-height" => {
                frozen.measurement = true;
            }
            "tracker.acceleration-density-px2-per-s3" | "tracker.acceleration-density-per-height2-per-s3" => {
                frozen.motion = true;
            }
            "tracker.detection-probability" | "tracker.redetection-probability" => frozen.detection = true,
            "tracker.clutter-density-per-px2" => frozen.clutter = true,
            // The table as a whole.
            "tracker" => *frozen = Frozen { measurement: true, motion: true, detection: true, clutter: true },
            _ => {}
        }
    }

    /// Takes what a tracker that began anew assumes: its tracks are others, and so are what is frozen.
    pub fn restart(&mut self, config: &TrackerConfig) {
        let (frozen, given) = (self.frozen, TrackerParameters::of(config));
        if frozen.measurement {
            self.first.detection_covariance_scale = given.detection_covariance_scale;
            self.first.extra_noise_px = given.extra_noise_px;
            self.first.extra_noise_per_height = given.extra_noise_per_height;
            self.factors[0] = 1.0;
        }
        if frozen.motion {
            self.first.acceleration_density_px2_per_s3 = given.acceleration_density_px2_per_s3;
            self.first.acceleration_density_per_height2_per_s3 = given.acceleration_density_per_height2_per_s3;
            self.factors[1] = 1.0;
        }
        self.now = given;
        self.tracks.clear();
    }

    /// Mean of the normalised squared innovations of confirmed tracks lately; 2 where the filters are consistent.
    pub fn mean_nis(&self) -> Option<f64> {
        let [sum, n] = self.faded.nis;
        (n >= 1.0).then(|| sum / n)
    }

    /// Takes in a scan and its tracks; gives the parameters for the scans that follow, where they are others.
    pub fn step(&mut self, scan: &Scan, states: &[TrackState]) -> Option<TrackerParameters> {
        let began = *self.began.get_or_insert(scan.time);
        let due = *self.due.get_or_insert(after(began, MEMORY_S));
        let dt_s = self.last.map_or(0.0, |last| scan.time.seconds_since(last).max(0.0));
        self.last = Some(scan.time);
        self.faded.fade((-dt_s / MEMORY_S).exp());
        self.ground = self.ground.after(scan);
        if !scan.blind {
            self.look(scan, states);
        }
        if scan.time < due {
            return None;
        }
        self.due = Some(after(scan.time, EVERY_S));
        let next = self.learn(scan.time);
        (next != self.now).then(|| {
            self.now = next;
            next
        })
    }

    fn look(&mut self, scan: &Scan, states: &[TrackState]) {
        self.shares.count(scan.detections.len(), states);
        self.tracks.values_mut().for_each(|t| t.is_there = false);
        let (mut own, mut n_followed) = (0, 0);
        for s in states.iter().filter(|s| s.status != TrackStatus::Tentative) {
            let alone = s.detection.filter(|j| self.shares.is_one(*j));
            own += usize::from(alone.is_some());
            if let Some(nis) = s.innovation.as_ref().map(|i| i.nis).filter(|v| v.is_finite()) {
                self.faded.nis = [self.faded.nis[0] + nis, self.faded.nis[1] + 1.0];
            }
            if n_followed >= MOST_TRACKS {
                continue;
            }
            n_followed += 1;
            let of = self.tracks.entry(s.id.0).or_default();
            of.is_there = true;
            let Some(j) = s.detection else {
                of.missed += 1;
                continue;
            };
            // A gap counts when it is over: a target that has gone is none that was missed.
            if !of.steps.is_empty() {
                let gap = f64::from(of.missed.min(1));
                self.faded.hit = [self.faded.hit[0] + 1.0 - gap, self.faded.hit[1] + gap];
                let more = f64::from(of.missed.saturating_sub(1));
                self.faded.found = [self.faded.found[0] + gap, self.faded.found[1] + more];
            }
            of.missed = 0;
            if alone.is_none() {
                continue;
            }
            let d = self.ground.detection_on_ground(&scan.detections[j as usize]);
            let position = [d.position.x, d.position.y];
            let before = of.steps.back();
            // A picture that is shown again measures nothing anew.
            if before.is_some_and(|(_, step)| is_copy(position, step)) {
                continue;
            }
            let time = Timestamp::from_ns(scan.time.ns.saturating_sub_unsigned(d.age_ns));
            let dt_s = before.map_or(0.0, |(at, _)| time.seconds_since(*at).max(0.0));
            let variance = [d.cov[(0, 0)], d.cov[(1, 1)]];
            let step = Step { dt_s, position, variance, height_px: d.extent.height_px, weight: 1.0 };
            of.steps.push_back((time, step));
        }
        self.faded.scans += 1.0;
        self.faded.unclaimed += scan.detections.len().saturating_sub(own) as f64;
        if self.tracks.values().map(|t| t.steps.len()).sum::<usize>() > 2 * MOST_STEPS
            || self.tracks.len() > 2 * MOST_STEPS
        {
            self.forget(scan.time);
        }
    }

    /// Drops what is too old, and the oldest of what is too much.
    fn forget(&mut self, now: Timestamp) {
        let mut times: Vec<i64> = self.tracks.values().flat_map(|t| t.steps.iter().map(|(at, _)| at.ns)).collect();
        let mut since = after(now, -LONGEST_S).ns;
        if times.len() > MOST_STEPS {
            let k = times.len() - MOST_STEPS;
            since = since.max(*times.select_nth_unstable(k).1);
        }
        for t in self.tracks.values_mut() {
            while t.steps.front().is_some_and(|(at, _)| at.ns < since) {
                t.steps.pop_front();
            }
        }
        self.tracks.retain(|_, t| t.is_there || !t.steps.is_empty());
    }

    fn learn(&mut self, now: Timestamp) -> TrackerParameters {
        self.forget(now);
        let mut next = self.now;
        let weigh = |(at, step): &(Timestamp, Step)| Step {
            weight: NEW_SHARE * (-now.seconds_since(*at) / MEMORY_S).exp(),
            ..*step
        };
        let series: Vec<Vec<Step>> = self.tracks.values().map(|t| t.steps.iter().map(weigh).collect()).collect();
        let weight: f64 = series.iter().flatten().map(|s| s.weight).sum();
        if weight >= NEW_SHARE * LEAST_WEIGHT && !(self.frozen.measurement && self.frozen.motion) {
            // The field only says how rare a stranger is; an unknown one is as large as a small picture.
            let area_px2 = self.field_px2.unwrap_or(1e5);
            // What is held is the truth for the other: a position's error beyond a given R is motion.
            let drift = [self.frozen.measurement, self.frozen.motion].map(|held| if held { HELD } else { DRIFT_STD });
            let noise = assumed(&self.first);
            self.factors =
                fit_factors(&series, &noise, self.factors, MOST_NOISE_FACTOR, drift, self.speed_std, area_px2);
            self.put(&noise.times(self.factors), &mut next);
        }
        let c = &self.faded;
        if c.hit[0] + c.hit[1] >= LEAST_WEIGHT && !self.frozen.detection {
            next.detection_probability = share(c.hit, self.first.detection_probability);
            next.redetection_probability = self.first.redetection_probability.map(|p| share(c.found, p));
        }
        if let Some(area_px2) = self.field_px2.filter(|_| c.scans >= LEAST_WEIGHT && !self.frozen.clutter) {
            let (first, most) = (self.first.clutter_density_per_px2, MOST_COUNT_FACTOR);
            next.clutter_density_per_px2 =
                round((c.unclaimed / (c.scans * area_px2)).clamp(first / most, first * most));
        }
        next
    }

    fn put(&self, noise: &Noise, next: &mut TrackerParameters) {
        if !self.frozen.measurement {
            next.detection_covariance_scale = round(noise.scale);
            next.extra_noise_px = round(noise.extra_px);
            next.extra_noise_per_height = round(noise.extra_per_height);
        }
        if !self.frozen.motion {
            next.acceleration_density_px2_per_s3 = round(noise.density);
            next.acceleration_density_per_height2_per_s3 = round(noise.density_per_height2);
        }
    }
}

/// Share of the first of two counts, with what was learnt first as a prior; its odds within [`MOST_COUNT_FACTOR`] of that.
fn share([yes, no]: [f64; 2], first: f64) -> f64 {
    let odds = first / (1.0 - first).max(1e-3);
    let found = (yes + PRIOR * first) / (no + PRIOR * (1.0 - first)).max(1e-3);
    let odds = found.clamp(odds / MOST_COUNT_FACTOR, odds * MOST_COUNT_FACTOR);
    round(odds / (1.0 + odds))
}

fn after(time: Timestamp, s: f64) -> Timestamp {
    Timestamp::from_ns(time.ns.saturating_add((s * 1e9) as i64))
}

#[cfg(test)]
mod tests;
