//! The tracker: predict, gate, associate, update, live, start; one scan at a time.
//!
//! Source: `docs/theory/track-management.md`. Confirmed tracks choose first, tentative ones among what is left, what is
//! left then starts tracks.
//! Method: tracks lie in one vector in the order of their ids; every pass runs through it from front to back. All scratch
//! memory is kept, so a step allocates nothing once the largest scan was seen. A step is refused as a whole before
//! anything changes. Ids are never used twice.
//! Time: every dt comes from the time stamps. A track whose coasting budget ended during a gap is gone before the scan
//! behind the gap is looked at.
//! Limits: detections of a scan share its time; `max_tracks` tracks.

use super::Tracking;
use super::association_cost::Terms;
use super::clutter::Clutter;
use super::config::TrackerConfig;
use super::confirm::rule::{Evidence, Verdict};
use super::merged_measurements::Sharing;
use super::scan_interval::Pace;
use super::single_track::{Outcome, Track};
use super::step::associate::Stage;
use super::step::gate::{Noise, Predicted, ScanTable};
use super::step::initiate::LeftOver;
use super::step::update::{Scratch, shared};
use crate::associate::AssociatorConfig;
use crate::{Error, ErrorKind, Result, Scan, Timestamp, TrackState};
use boresight_filters::Filter;
use nalgebra::Vector2;

/// No track took it.
const NONE: u32 = u32::MAX;

/// Tracks whose neighbourhoods are fetched together, so that the waits for memory overlap.
pub(super) const BATCH: usize = 16;

/// The tracker.
pub struct Tracker {
    pub(super) config: TrackerConfig,
    gate: f64,
    pub(super) tracks: Vec<Track>,
    predicted: Vec<Predicted>,
    pub(super) table: ScanTable,
    pub(super) used: Vec<bool>,
    /// Confirmed tracks, tentative ones, and confirmed ones again with the weak detections.
    stages: [Stage; 3],
    terms: Terms,
    pub(super) clutter: Clutter,
    sharing: Sharing,
    /// Which confirmed track took each detection, and which confirmed tracks took none.
    taker: Vec<u32>,
    silent: Vec<u32>,
    /// Whether the associator is soft, and whether a detection already has an owner (then tracks may be twins).
    is_soft: bool,
    owner: Vec<bool>,
    /// Detections taken by confirmed tracks.
    believed: Vec<bool>,
    tentative: Vec<u32>,
    scratch: Scratch,
    pub(super) left_over: Vec<LeftOver>,
    pub(super) left_over_time: Timestamp,
    pub(super) states: Vec<TrackState>,
    last: Option<Timestamp>,
    pace: Pace,
    pub(super) next_id: u64,
}

opaque_debug!(Tracker);

impl Tracker {
    /// Builds a tracker.
    /// # Errors
    /// A value of the configuration outside its range.
    pub fn new(config: &TrackerConfig) -> Result<Self> {
        config.validate("tracker")?;
        let (hard, budget) = (AssociatorConfig::default(), config.terms.budget());
        Ok(Self {
            gate: config.gate(),
            stages: [Stage::new(&config.associator, budget), Stage::new(&hard, budget), Stage::new(&hard, budget)],
            terms: Terms::new(&config.terms),
            clutter: Clutter::new(&config.clutter, config.clutter_density_per_px2),
            sharing: Sharing::default(),
            taker: Vec::new(),
            silent: Vec::new(),
            is_soft: config.associator.is_soft(),
            owner: Vec::new(),
            believed: Vec::new(),
            tentative: Vec::new(),
            scratch: Scratch::default(),
            config: config.clone(),
            tracks: Vec::new(),
            predicted: Vec::new(),
            table: ScanTable::default(),
            used: Vec::new(),
            left_over: Vec::new(),
            left_over_time: Timestamp::default(),
            states: Vec::new(),
            last: None,
            pace: Pace::default(),
            next_id: 1,
        })
    }

    /// Number of tracks alive.
    pub fn n_tracks(&self) -> usize {
        self.tracks.len()
    }

    /// Deletes what would have been deleted in the scans missing before `now`.
    fn expire(&mut self, now: Timestamp) {
        let budget_s = self.coast_budget_s();
        let pace_s = self.pace.interval_s();
        if pace_s <= 0.0 {
            return; // after one scan nobody can say what a gap is
        }
        self.tracks.retain(|t| {
            let silent_s = now.seconds_since(Timestamp::from_ns(t.life.last_seen_ns()));
            // The newest scan in which the track can still be seen ends the budget, not the gap itself.
            silent_s - pace_s < budget_s - 1e-9 || silent_s <= 1e-9
        });
    }

    /// How long a confirmed track may go without a detection, s.
    fn coast_budget_s(&self) -> f64 {
        self.config.coast_s.max(self.pace.span_s(self.config.coast_scans))
    }

    /// Predicts every track, and gates the confirmed ones while they are at hand.
    fn predict(&mut self, dt_s: f64, scan: &Scan) -> Result<()> {
        let now = scan.time;
        let high = self.config.two_stage.as_ref().map_or(f32::NEG_INFINITY, |c| c.high_score);
        let plain = self.config.two_stage.is_none() && !self.config.terms.any();
        self.predicted.clear();
        self.tentative.clear();
        let speed = self.config.max_speed_px_per_s;
        let survival = self.config.life.survival(dt_s);
        for (batch, tracks) in self.tracks.chunks_mut(BATCH).enumerate() {
            let first = batch * BATCH;
            for t in tracks.iter_mut() {
                t.belief.predict(dt_s)?;
                self.config.life.fade(&mut t.life, survival);
                let p = t.belief.predicted();
                let elapsed_s = now.seconds_since(Timestamp::from_ns(t.life.last_seen_ns()));
                // From where it was last seen the target came at most this far; the prediction may already lie off it.
                let [ax, ay, std] = t.anchor;
                let far = speed * elapsed_s + 3.0 * std;
                let off = (p.mean - Vector2::new(ax, ay)).norm();
                self.predicted.push(Predicted {
                    x: p.mean.x,
                    y: p.mean.y,
                    cov: Noise { xx: p.cov[(0, 0)], xy: p.cov[(0, 1)], yy: p.cov[(1, 1)] },
                    reach: if self.config.gate_within_max_speed { far + off } else { f64::INFINITY },
                });
            }
            self.table.touch(&self.predicted[first..], self.gate);
            for (k, t) in tracks.iter().enumerate() {
                if !t.life.confirmed {
                    self.tentative.push((first + k) as u32);
                    continue;
                }
                let predicted = &self.predicted[first + k];
                let existence = self.config.life.existence(&t.life);
                let (stage, table, config) = (&mut self.stages[0], &self.table, &self.config);
                if plain {
                    stage.add(first + k, predicted, existence, table, self.gate, config, |_| true, |_| 0.0);
                } else {
                    let (terms, look) = (&self.terms, &t.look);
                    let strong = |j: u32| scan.detections[j as usize].score >= high;
                    let cost = |j: u32| terms.cost(predicted.x, predicted.y, look, &scan.detections[j as usize]);
                    stage.add(first + k, predicted, existence, table, self.gate, config, strong, cost);
                }
            }
        }
        Ok(())
    }

    /// Adds a track to a later stage, with the detections that are free and score at least `least_score`.
    fn add_later(&mut self, stage: usize, i: usize, scan: &Scan, least_score: f32) {
        let t = &self.tracks[i];
        let p = &self.predicted[i];
        let (used, terms) = (&self.used, &self.terms);
        let free = |j: u32| !used[j as usize] && scan.detections[j as usize].score >= least_score;
        let cost = |j: u32| terms.cost(p.x, p.y, &t.look, &scan.detections[j as usize]);
        let existence = self.config.life.existence(&t.life);
        self.stages[stage].add(i, p, existence, &self.table, self.gate, &self.config, free, cost);
    }

    /// Associates: the confirmed tracks first, then the tentative ones with what is left, then weak detections.
    fn associate(&mut self, scan: &Scan) {
        let high = self.config.two_stage.as_ref().map_or(f32::NEG_INFINITY, |c| c.high_score);
        self.stages[0].solve(&mut self.used);
        self.silent.clear();
        self.taker.clear();
        let sharing = self.config.sharing.is_some() && self.table.largest_half_px != [0.0; 2];
        if sharing || self.config.two_stage.is_some() {
            self.taker.resize(scan.detections.len(), NONE);
            for (i, shares) in self.stages[0].rows() {
                match shares {
                    [] => self.silent.push(i),
                    [one] => self.taker[one.detection as usize] = i,
                    _ => {}
                }
            }
        }
        if let Some(low) = self.config.two_stage.as_ref().map(|c| c.low_score) {
            let silent = std::mem::take(&mut self.silent);
            for i in &silent {
                self.add_later(2, *i as usize, scan, low);
            }
            self.silent = silent;
            self.stages[2].solve(&mut self.used);
            self.silent.clear();
            for (i, shares) in self.stages[2].rows() {
                match shares {
                    [one] => self.taker[one.detection as usize] = i,
                    _ => self.silent.push(i),
                }
            }
        }
        self.believed.clone_from(&self.used);
        let tentative = std::mem::take(&mut self.tentative);
        for i in &tentative {
            self.add_later(1, *i as usize, scan, high);
        }
        self.tentative = tentative;
        self.stages[1].solve(&mut self.used);
        self.sharing.parts.clear();
        if let (true, Some(config)) = (sharing && !self.silent.is_empty(), &self.config.sharing) {
            let tracks = &self.tracks;
            let half = self.table.largest_half_px;
            let look = |i: u32| tracks[i as usize].look;
            self.sharing.find(config, scan, &self.table, &self.predicted, look, &self.taker, &self.silent, half);
            for part in &self.sharing.parts {
                self.used[part.detection as usize] = true;
            }
        }
        // Weak detections start nothing.
        if self.config.two_stage.is_some() {
            for (used, d) in self.used.iter_mut().zip(&scan.detections) {
                *used |= d.score < high;
            }
        }
    }

    /// Corrects every track, lets it live on or die, and reports it; the order stays.
    fn correct(&mut self, scan: &Scan) {
        let now = scan.time;
        let budget_s = self.coast_budget_s();
        let share_s = self.config.sharing.as_ref().map_or(0.0, |c| c.longest_s);
        let (learn, twin_s) = (self.config.terms.learn, self.config.duplicate_s);
        self.states.clear();
        self.owner.clear();
        self.owner.resize(if self.is_soft { scan.detections.len() } else { 0 }, false);
        let (mut i, mut part) = (0, 0);
        let mut tracks = std::mem::take(&mut self.tracks);
        tracks.retain_mut(|t| {
            if i % BATCH == 0 {
                self.stages[0].touch(scan, BATCH);
            }
            let mut outcome = Outcome { ratio: 1.0, ..Outcome::default() };
            if self.sharing.parts.get(part).is_some_and(|p| p.track as usize == i) {
                outcome = shared(t, &self.predicted[i], &self.sharing.parts[part]);
                part += 1;
                for stage in &mut self.stages {
                    stage.skip(i);
                }
            } else {
                for stage in &mut self.stages {
                    let found =
                        stage.correct(i, t, &self.predicted[i], scan, &self.table, &self.config, &mut self.scratch);
                    if let Some(found) = found {
                        outcome = found;
                    }
                }
            }
            i += 1;
            if learn && let (true, Some(j)) = (outcome.hit, outcome.detection) {
                self.terms.learn(&t.look, &scan.detections[j as usize]);
            }
            let evidence = Evidence { hit: outcome.hit, shared: outcome.shared, ratio: outcome.ratio };
            let mut verdict = self.config.life.advance(&mut t.life, evidence, now.ns);
            if t.life.misses > 0 || outcome.guest {
                // As a guest a track lives so long since it was last alone: two on one target would take turns for ever.
                // Without any detection it coasts from the last, shared or not.
                let (since_ns, longest_s) = if outcome.guest {
                    (t.life.last_hit_ns, budget_s.max(share_s))
                } else {
                    (t.life.last_seen_ns(), budget_s)
                };
                if now.seconds_since(Timestamp::from_ns(since_ns)) >= longest_s - 1e-9 {
                    verdict = Verdict::Delete;
                }
            }
            if self.is_soft && verdict == Verdict::Keep && t.is_lasting_twin(&mut self.owner, &outcome, now, twin_s) {
                verdict = Verdict::Delete;
            }
            let keep = verdict == Verdict::Keep;
            if keep {
                self.states.push(t.state(&outcome, &self.config, self.table.camera));
            }
            keep
        });
        self.tracks = tracks;
    }
}

impl Tracking for Tracker {
    fn step(&mut self, scan: &Scan) -> Result<&[TrackState]> {
        let dt_s = match self.last {
            None => 0.0,
            Some(last) if scan.time >= last => scan.time.seconds_since(last),
            Some(last) => {
                return Err(Error::new(
                    ErrorKind::Damaged,
                    format!("time runs back: {} ns after {} ns", scan.time.ns, last.ns),
                )
                .at(format!("frame {}", scan.index.0))
                .hint("sort the scans by time before tracking"));
            }
        };
        if scan.detections.len() >= u32::MAX as usize {
            return Err(Error::new(ErrorKind::Unsupported, "more than 2³² − 2 detections in one scan"));
        }
        self.table.read(scan, self.config.extra_noise_px, self.config.extra_noise_of_size)?;

        if self.last.is_some() {
            self.expire(scan.time);
            self.pace.note(dt_s);
        } else {
            self.take_cues(scan.time)?;
        }
        self.last = Some(scan.time);
        self.table.sort(scan);
        self.used.clear();
        self.used.resize(scan.detections.len(), false);
        for stage in &mut self.stages {
            stage.begin(scan, &self.clutter);
        }
        self.predict(dt_s, scan)?;
        self.associate(scan);
        self.clutter.learn(scan, &self.believed, dt_s);
        self.correct(scan);
        self.start(scan);
        Ok(&self.states)
    }
}
