//! The tracker: predict, gate, associate, update, live, start; one scan at a time.
//!
//! Source: SPEC D.5. Confirmed tracks choose first, tentative ones among what is left, what is left then starts tracks.
//! Method: tracks lie in one vector in the order of their ids; every pass runs through it from front to back. All scratch
//! memory is kept, so a step allocates nothing once the largest scan was seen. A step is refused as a whole before
//! anything changes. Ids are never used twice.
//! Time: every dt comes from the time stamps. A track whose coasting budget ended during a gap is gone before the scan
//! behind the gap is looked at.
//! Limits: detections of a scan share its time; `max_tracks` tracks.

use super::Tracking;
use super::belief::Belief;
use super::config::TrackerConfig;
use super::correct::Scratch;
use super::gating::{Noise, Predicted, ScanTable};
use super::life::{Evidence, Life, Verdict};
use super::pace::Pace;
use super::proof::Proof;
use super::stage::Stage;
use super::starts::LeftOver;
use crate::associate::AssociatorConfig;
use crate::record::Innovation;
use crate::{Detection, Error, ErrorKind, Extent, Result, Scan, Timestamp, TrackId, TrackState, TrackStatus};
use boresight_filters::Filter;
use nalgebra::Vector2;

/// One living track.
#[derive(Clone)]
pub(super) struct Track {
    pub id: u64,
    pub belief: Belief,
    pub life: Life,
    /// Smoothed width and height of the box, px.
    pub size: [f64; 2],
    /// Where it was at its last detection, and how sure (standard deviation), px: the centre of its possible reach.
    pub anchor: [f64; 3],
    /// What it has shown beside its life's rule.
    pub proof: Proof,
}

/// What one scan brought a track.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Outcome {
    pub hit: bool,
    /// The detection of the largest weight.
    pub detection: Option<u32>,
    /// Λ of the scan.
    pub ratio: f64,
    pub innovation: Option<Innovation>,
}

/// How much a new box moves the smoothed one.
const SIZE_GAIN: f64 = 0.3;

/// The tracker.
pub struct Tracker {
    pub(super) config: TrackerConfig,
    gate: f64,
    pub(super) tracks: Vec<Track>,
    predicted: Vec<Predicted>,
    pub(super) table: ScanTable,
    pub(super) used: Vec<bool>,
    /// Confirmed tracks, then tentative ones.
    stages: [Stage; 2],
    tentative: Vec<u32>,
    scratch: Scratch,
    pub(super) left_over: Vec<LeftOver>,
    pub(super) left_over_time: Timestamp,
    pub(super) states: Vec<TrackState>,
    last: Option<Timestamp>,
    pace: Pace,
    pub(super) next_id: u64,
}

impl Tracker {
    /// Builds a tracker.
    /// # Errors
    /// A value of the configuration outside its range.
    pub fn new(config: &TrackerConfig) -> Result<Self> {
        config.validate("tracker")?;
        Ok(Self {
            gate: config.gate(),
            stages: [Stage::new(&config.associator), Stage::new(&AssociatorConfig::default())],
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
        self.tracks.retain(|t| {
            let silent_s = now.seconds_since(Timestamp::from_ns(t.life.last_hit_ns));
            // The newest scan in which the track can still be seen ends the budget, not the gap itself.
            silent_s - pace_s < budget_s - 1e-9 || silent_s <= 1e-9
        });
    }

    /// How long a confirmed track may go without a detection, s.
    fn coast_budget_s(&self) -> f64 {
        self.config.coast_s.max(f64::from(self.config.coast_scans) * self.pace.interval_s())
    }

    /// Predicts every track, and gates the confirmed ones while they are at hand.
    fn predict(&mut self, dt_s: f64, now: Timestamp) -> Result<()> {
        self.predicted.clear();
        self.tentative.clear();
        let speed = self.config.max_speed_px_per_s;
        let survival = self.config.life.survival(dt_s);
        for (i, t) in self.tracks.iter_mut().enumerate() {
            t.belief.predict(dt_s)?;
            self.config.life.fade(&mut t.life, survival);
            let p = t.belief.predicted();
            let elapsed_s = now.seconds_since(Timestamp::from_ns(t.life.last_hit_ns));
            // From where it was last seen the target came at most this far; the prediction may already lie off it.
            let [ax, ay, std] = t.anchor;
            let far = speed * elapsed_s + 3.0 * std;
            let off = (p.mean - Vector2::new(ax, ay)).norm();
            let predicted = Predicted {
                x: p.mean.x,
                y: p.mean.y,
                cov: Noise { xx: p.cov[(0, 0)], xy: p.cov[(0, 1)], yy: p.cov[(1, 1)] },
                reach: if self.config.gate_within_max_speed { far + off } else { f64::INFINITY },
            };
            self.predicted.push(predicted);
            if t.life.confirmed {
                let existence = self.config.life.existence(&t.life);
                self.stages[0].add(i, &predicted, existence, &self.table, self.gate, &self.config, |_| true);
            } else {
                self.tentative.push(i as u32);
            }
        }
        Ok(())
    }

    /// Associates: the confirmed tracks first, then the tentative ones with what is left.
    fn associate(&mut self) {
        self.stages[0].solve(&mut self.used);
        for i in &self.tentative {
            let i = *i as usize;
            let existence = self.config.life.existence(&self.tracks[i].life);
            let used = &self.used;
            self.stages[1]
                .add(i, &self.predicted[i], existence, &self.table, self.gate, &self.config, |j| !used[j as usize]);
        }
        self.stages[1].solve(&mut self.used);
    }

    /// Corrects every track, lets it live on or die, and reports it; the order stays.
    fn correct(&mut self, scan: &Scan) {
        let now = scan.time;
        let budget_s = self.coast_budget_s();
        self.states.clear();
        let mut kept = 0;
        for i in 0..self.tracks.len() {
            let t = &mut self.tracks[i];
            let mut outcome = Outcome::default();
            for stage in &mut self.stages {
                if let Some(found) =
                    stage.correct(i, t, &self.predicted[i], scan, &self.table, &self.config, &mut self.scratch)
                {
                    outcome = found;
                }
            }
            let evidence = Evidence { hit: outcome.hit, ratio: outcome.ratio };
            let mut verdict = self.config.life.advance(&mut t.life, evidence, now.ns);
            if t.life.misses > 0 {
                let silent_s = now.seconds_since(Timestamp::from_ns(t.life.last_hit_ns));
                if silent_s >= budget_s - 1e-9 {
                    verdict = Verdict::Delete;
                }
            }
            if verdict == Verdict::Keep {
                self.states.push(t.state(&outcome, &self.config));
                if kept != i {
                    self.tracks.swap(kept, i);
                }
                kept += 1;
            }
        }
        self.tracks.truncate(kept);
    }
}

impl Track {
    /// Takes in the box and place of a detection that is (most likely) its own.
    #[inline]
    pub(super) fn seen(&mut self, d: &Detection, noise: &Noise) {
        let new = [d.extent.width_px, d.extent.height_px];
        for a in 0..2 {
            self.size[a] += SIZE_GAIN * (new[a] - self.size[a]);
        }
        self.anchor = [d.position.x, d.position.y, noise.xx.max(noise.yy).sqrt()];
        self.proof.seen(d.score);
    }

    /// What is said of the track after a scan.
    #[inline]
    pub(super) fn state(&mut self, outcome: &Outcome, config: &TrackerConfig) -> TrackState {
        let kinematics = self.belief.kinematics();
        let proven = self.proof.holds(&config.proof, [kinematics.mean[0], kinematics.mean[2]], outcome.hit);
        let [width_px, height_px] = self.size;
        TrackState {
            id: TrackId(self.id),
            status: match (self.life.confirmed && proven, outcome.hit) {
                (false, _) => TrackStatus::Tentative,
                (true, true) => TrackStatus::Confirmed,
                (true, false) => TrackStatus::Coasting,
            },
            extent: Extent {
                left_px: kinematics.mean[0] - 0.5 * width_px,
                top_px: kinematics.mean[2] - 0.5 * height_px,
                width_px,
                height_px,
            },
            kinematics,
            detection: outcome.detection,
            innovation: outcome.innovation,
            score: config.life.confidence(&self.life),
        }
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
        self.table.read(scan, self.config.extra_noise_px)?;

        if self.last.is_some() {
            self.expire(scan.time);
            self.pace.note(dt_s);
        }
        self.last = Some(scan.time);
        self.table.sort(scan);
        self.used.clear();
        self.used.resize(scan.detections.len(), false);
        for stage in &mut self.stages {
            stage.begin(scan.detections.len(), self.config.clutter_density_per_px2);
        }
        self.predict(dt_s, scan.time)?;
        self.associate();
        self.correct(scan);
        self.start(scan);
        Ok(&self.states)
    }
}
