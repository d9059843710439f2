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
use super::birth::{BirthConfig, from_one_point, from_two_points};
use super::config::TrackerConfig;
use super::gating::{Noise, Predicted, ScanTable};
use super::life::{Evidence, Life, Verdict};
use super::pace::Pace;
use super::stage::Stage;
use crate::associate::AssociatorConfig;
use crate::record::Innovation;
use crate::{Error, ErrorKind, Extent, Result, Scan, Timestamp, TrackId, TrackState, TrackStatus};
use boresight_filters::{Filter, Gaussian};
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
}

/// What one scan brought a track.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Outcome {
    pub hit: bool,
    /// The detection of the largest weight.
    pub detection: Option<u32>,
    pub log_ratio: f64,
    pub innovation: Option<Innovation>,
}

/// A detection that no track took, kept for the next scan.
#[derive(Clone, Copy, Debug)]
struct LeftOver {
    position: Vector2<f64>,
    noise: Noise,
}

/// How much a new box moves the smoothed one.
const SIZE_GAIN: f64 = 0.3;

/// The tracker.
pub struct Tracker {
    pub(super) config: TrackerConfig,
    pub(super) gate: f64,
    pub(super) tracks: Vec<Track>,
    pub(super) predicted: Vec<Predicted>,
    pub(super) outcomes: Vec<Outcome>,
    pub(super) table: ScanTable,
    pub(super) used: Vec<bool>,
    confirmed_stage: Stage,
    tentative_stage: Stage,
    left_over: Vec<LeftOver>,
    left_over_time: Timestamp,
    states: Vec<TrackState>,
    last: Option<Timestamp>,
    pace: Pace,
    next_id: u64,
}

impl Tracker {
    /// Builds a tracker.
    /// # Errors
    /// A value of the configuration outside its range.
    pub fn new(config: &TrackerConfig) -> Result<Self> {
        config.validate("tracker")?;
        Ok(Self {
            gate: config.gate(),
            confirmed_stage: Stage::new(&config.associator),
            tentative_stage: Stage::new(&AssociatorConfig::default()),
            config: config.clone(),
            tracks: Vec::new(),
            predicted: Vec::new(),
            outcomes: Vec::new(),
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

    fn predict(&mut self, dt_s: f64, now: Timestamp) -> Result<()> {
        self.predicted.clear();
        let speed = self.config.max_speed_px_per_s;
        for t in &mut self.tracks {
            t.belief.predict(dt_s)?;
            self.config.life.fade(&mut t.life, dt_s);
            let p = t.belief.predicted();
            let elapsed_s = now.seconds_since(Timestamp::from_ns(t.life.last_hit_ns));
            // From where it was last seen the target came at most this far; the prediction may already lie off it.
            let [ax, ay, std] = t.anchor;
            let off = (p.mean.x - ax).hypot(p.mean.y - ay);
            let far = speed * elapsed_s + 3.0 * std;
            let reach = if self.config.gate_within_max_speed { far + off } else { f64::INFINITY };
            self.predicted.push(Predicted {
                x: p.mean.x,
                y: p.mean.y,
                cov: Noise { xx: p.cov[(0, 0)], xy: p.cov[(0, 1)], yy: p.cov[(1, 1)] },
                reach2: reach * reach,
            });
        }
        Ok(())
    }

    /// Life of every track after the scan; the dead leave, the order stays.
    fn live_on(&mut self, now: Timestamp) {
        let budget_s = self.coast_budget_s();
        let mut kept = 0;
        for i in 0..self.tracks.len() {
            let outcome = self.outcomes[i];
            let t = &mut self.tracks[i];
            let evidence = Evidence { hit: outcome.hit, log_ratio: outcome.log_ratio };
            let mut verdict = self.config.life.advance(&mut t.life, evidence, now.ns);
            let silent_s = now.seconds_since(Timestamp::from_ns(t.life.last_hit_ns));
            if t.life.confirmed && t.life.misses > 0 && silent_s >= budget_s - 1e-9 {
                verdict = Verdict::Delete;
            }
            if verdict == Verdict::Keep {
                self.tracks.swap(kept, i);
                self.outcomes[kept] = outcome;
                kept += 1;
            }
        }
        self.tracks.truncate(kept);
        self.outcomes.truncate(kept);
    }

    /// Starts tracks from what is left over.
    fn start(&mut self, scan: &Scan) {
        let now = scan.time;
        let room = (self.config.max_tracks as usize).saturating_sub(self.tracks.len());
        let first_new = self.tracks.len();
        match self.config.birth {
            BirthConfig::OnePoint(ref c) => {
                let variance = Vector2::repeat(c.velocity_std_px_per_s.powi(2));
                for j in 0..scan.detections.len() {
                    if !self.used[j] && self.tracks.len() - first_new < room {
                        let r = self.table.noise[j].matrix();
                        let start = from_one_point(&scan.detections[j].position, &r, Vector2::zeros(), variance);
                        self.begin(scan, j, &start, 1);
                    }
                }
            }
            BirthConfig::TwoPoint {} | BirthConfig::VelocityBounds(_) => {
                let dt_s = now.seconds_since(self.left_over_time);
                let left_over = std::mem::take(&mut self.left_over);
                if dt_s > 0.0 {
                    for first in &left_over {
                        if self.tracks.len() - first_new >= room {
                            break;
                        }
                        if let Some(j) = self.partner(scan, first, dt_s) {
                            self.used[j] = true;
                            let r = self.table.noise[j].matrix();
                            let z = &scan.detections[j].position;
                            let start = from_two_points(&first.position, &first.noise.matrix(), z, &r, dt_s);
                            self.begin(scan, j, &start, 2);
                        }
                    }
                }
                self.left_over = left_over;
                self.left_over.clear();
                self.left_over.extend(scan.detections.iter().zip(&self.table.noise).zip(&self.used).filter_map(
                    |((d, noise), used)| (!used).then_some(LeftOver { position: d.position, noise: *noise }),
                ));
                self.left_over_time = now;
            }
        }
    }

    /// The nearest left-over detection that a target at `first` can have reached.
    fn partner(&self, scan: &Scan, first: &LeftOver, dt_s: f64) -> Option<usize> {
        let far = self.config.max_speed_px_per_s * dt_s;
        let mut best: Option<(f64, u32)> = None;
        let mut looked_at = 0;
        self.table.grid().near(first.position.x, first.position.y, far, far, |p| {
            looked_at += 1;
            let (dx, dy) = (p.x - first.position.x, p.y - first.position.y);
            let distance2 = dx * dx + dy * dy;
            let nearer = best.is_none_or(|(d, i)| distance2 < d || (distance2 == d && p.index < i));
            let possible = match &self.config.birth {
                BirthConfig::VelocityBounds(b) => [dx, dy]
                    .iter()
                    .enumerate()
                    .all(|(a, d)| (b.min_px_per_s[a]..=b.max_px_per_s[a]).contains(&(d / dt_s))),
                _ => true,
            };
            if distance2 <= far * far && nearer && possible && !self.used[p.index as usize] {
                best = Some((distance2, p.index));
            }
            looked_at < super::gating::MOST_LOOKED_AT
        });
        debug_assert!(best.is_none_or(|(_, i)| (i as usize) < scan.detections.len()));
        best.map(|(_, i)| i as usize)
    }

    fn begin(&mut self, scan: &Scan, detection: usize, start: &Gaussian<4>, n_points: u32) {
        let d = &scan.detections[detection];
        let n = &self.table.noise[detection];
        self.tracks.push(Track {
            id: self.next_id,
            belief: self.config.belief(start),
            life: self.config.life.begin(n_points, scan.time.ns),
            size: [d.extent.width_px, d.extent.height_px],
            anchor: [d.position.x, d.position.y, n.xx.max(n.yy).sqrt()],
        });
        self.outcomes.push(Outcome { hit: true, detection: Some(detection as u32), ..Outcome::default() });
        self.next_id += 1;
    }

    fn report(&mut self) {
        self.states.clear();
        for (t, o) in self.tracks.iter().zip(&self.outcomes) {
            let kinematics = t.belief.kinematics();
            let [width_px, height_px] = t.size;
            self.states.push(TrackState {
                id: TrackId(t.id),
                status: match (t.life.confirmed, o.hit) {
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
                detection: o.detection,
                innovation: o.innovation,
                score: self.config.life.confidence(&t.life),
            });
        }
    }
}

impl Track {
    /// Takes in the box and place of a detection that is (most likely) its own.
    pub(super) fn seen(&mut self, scan: &Scan, detection: u32, noise: &Noise) {
        let d = &scan.detections[detection as usize];
        let new = [d.extent.width_px, d.extent.height_px];
        for a in 0..2 {
            self.size[a] += SIZE_GAIN * (new[a] - self.size[a]);
        }
        self.anchor = [d.position.x, d.position.y, noise.xx.max(noise.yy).sqrt()];
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
        self.predict(dt_s, scan.time)?;
        self.table.sort(scan);
        self.used.clear();
        self.used.resize(scan.detections.len(), false);
        self.outcomes.clear();
        self.outcomes.resize(self.tracks.len(), Outcome::default());

        let mut stage = std::mem::take(&mut self.confirmed_stage);
        stage.run(self, scan, |t| t.life.confirmed);
        self.confirmed_stage = stage;
        let mut stage = std::mem::take(&mut self.tentative_stage);
        stage.run(self, scan, |t| !t.life.confirmed);
        self.tentative_stage = stage;

        self.live_on(scan.time);
        self.start(scan);
        self.report();
        Ok(&self.states)
    }
}
