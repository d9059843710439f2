//! The tracker: predict, gate, associate, update, confirm, delete, report, initiate, reidentify; one scan at a time.
//!
//! Source: docs/theory/track-management.md. Confirmed tracks choose first, tentative ones among what is left, what is left then
//! initiates tracks. The parts are in [`step`](super::step), the confirmation rules in [`confirm`](super::confirm).
//! Method: tracks lie in one vector in the order of their initiation; every pass runs through it from front to back. All scratch
//! memory is kept, so a step allocates nothing once the largest scan was seen. A step is refused as a whole before
//! anything changes. An id is given once; only reidentification hands it on.
//! Time: every dt comes from the time stamps. A track whose coasting budget ended during a gap is gone before the scan
//! behind the gap is looked at.
//! Where another view begins (a film's cut) all tracks end.
//! A detection may have a time of its own within the scan (a radar's turn): then the filters stay at the scan before until they are updated (`step/plot_time.rs`).
//! Limits: `max_tracks` tracks.

use super::association_cost::AssociationCost;
use super::backward::Backward;
use super::clock::Clock;
use super::clutter::Clutter;
use super::config::TrackerConfig;
use super::confirm::history::{Decision, Evidence};
use super::confirm::status::status;
use super::merged_measurements::MergedMeasurements;
use super::parameters::TrackerParameters;
use super::reidentify::{Field, Identity, Reidentification, Stay};
use super::scan_table::{Predicted, ScanTable};
use super::single_track::{BATCH, Outcome, Track};
use super::step::associate::{Association, associate, gate_confirmed};
use super::step::context::Context;
use super::step::delete::{budget_is_over, coast_budget_s, expired_in_gap, is_lasting_duplicate, save_time_alone};
use super::step::initiate::{NewTracks, Pending, from_initial_tracks, initiate};
use super::step::plot_time::look_ahead;
use super::step::predict::predict;
use super::step::report::report;
use super::step::update::update;
use super::tracking::{Tracking, renumber_states};
use crate::{Error, ErrorKind, Result, Scan, Timestamp, TrackId, TrackState, TrackStatus};
use boresight_filters::Weighted;

/// The tracker.
pub struct Tracker {
    config: TrackerConfig,
    gate: f64,
    clock: Clock,
    tracks: Vec<Track>,
    next_id: u64,
    clutter: Clutter,
    cost: AssociationCost,
    /// Detections that wait for a second point.
    pending: Pending,
    // What is made anew in each scan.
    table: ScanTable,
    predicted: Vec<Predicted>,
    association: Association,
    merged: MergedMeasurements,
    lost: Reidentification,
    /// Tracks that were reported for the first time in this scan, by their place in `tracks`.
    new: Vec<u32>,
    /// Tracks that got another id in this scan: the old one and the new one.
    renamed: Vec<(TrackId, TrackId)>,
    weighted: Vec<Weighted>,
    /// Whether the associator is soft (then tracks may be duplicates), and which detections already have a track.
    is_soft: bool,
    owned: Vec<bool>,
    states: Vec<TrackState>,
}

opaque_debug!(Tracker);

impl Tracker {
    /// Builds a tracker.
    /// # Errors
    /// A value of the configuration outside its range.
    pub fn new(config: &TrackerConfig) -> Result<Self> {
        config.validate("tracker")?;
        Ok(Self {
            gate: config.gate(),
            clock: Clock::default(),
            tracks: Vec::new(),
            next_id: 1,
            clutter: Clutter::new(&config.clutter, config.clutter_density_per_px2),
            cost: AssociationCost::new(&config.association_cost),
            pending: Pending::default(),
            table: ScanTable::default(),
            predicted: Vec::new(),
            association: Association::new(config),
            merged: MergedMeasurements::default(),
            lost: Reidentification::default(),
            new: Vec::new(),
            renamed: Vec::new(),
            weighted: Vec::new(),
            is_soft: config.associator.is_soft(),
            owned: Vec::new(),
            states: Vec::new(),
            config: config.clone(),
        })
    }

    /// Number of tracks alive.
    pub fn n_tracks(&self) -> usize {
        self.tracks.len()
    }

    /// Another view has begun: no track has a place in it, and what was learnt of the clutter was learnt of places.
    fn forget_view(&mut self) {
        self.tracks.clear();
        self.pending = Pending::default();
        self.lost = Reidentification::default();
        self.clutter = Clutter::new(&self.config.clutter, self.config.clutter_density_per_px2);
    }

    /// Deletes what would have been deleted in the scans missing before `now`.
    fn delete_in_gap(&mut self, now: Timestamp) {
        let budget_s = coast_budget_s(&self.config, &self.clock.interval);
        let interval_s = self.clock.interval.interval_s();
        // After one scan nobody can say what a gap is.
        if interval_s > 0.0 {
            let Self { tracks, lost, config, clock, .. } = self;
            tracks.retain(|t| {
                let expired = expired_in_gap(&t.history, now, budget_s, interval_s);
                if expired {
                    lost.remember(&config.reidentification, t, clock.now());
                }
                !expired
            });
        }
    }

    /// Predicts every track, and gates the confirmed ones while they are at hand.
    fn predict_and_gate(&mut self, scan: &Scan, dt_s: f64) -> Result<()> {
        let Self { config, tracks, table, predicted, association, cost, gate, .. } = self;
        let context = Context { scan, table, config, gate: *gate, dt_s };
        let plain = config.two_stage.is_none()
            && config.score_likelihood.is_none()
            && !config.association_cost.any()
            && !table.has_velocities();
        let survival = config.confirmation.survival(dt_s);
        predicted.clear();
        for (batch, tracks) in tracks.chunks_mut(BATCH).enumerate() {
            let first = batch * BATCH;
            if table.is_timed() {
                look_ahead(&context, tracks, survival, predicted)?;
            } else {
                predict(tracks, scan.time, dt_s, survival, config, predicted)?;
            }
            table.touch(&predicted[first..], *gate);
            gate_confirmed(&context, first, tracks, &predicted[first..], cost, plain, association);
        }
        Ok(())
    }

    /// Predicts and reports every track: a scan in which nothing could be detected is no miss.
    fn coast(&mut self, scan: &Scan, dt_s: f64) -> Result<()> {
        let Self { config, tracks, table, predicted, states, .. } = self;
        predicted.clear();
        predict(tracks, scan.time, dt_s, config.confirmation.survival(dt_s), config, predicted)?;
        states.clear();
        let outcome = Outcome { likelihood_ratio: 1.0, ..Outcome::default() };
        states.extend(tracks.iter_mut().map(|t| report(t, &outcome, config, table.camera)));
        Ok(())
    }

    /// Updates every track, confirms or deletes it, and reports it; the order stays.
    fn update_confirm_delete(&mut self, scan: &Scan, dt_s: f64) {
        let Self {
            config,
            tracks,
            table,
            predicted,
            association,
            merged,
            weighted,
            cost,
            owned,
            states,
            lost,
            new,
            ..
        } = self;
        let context = Context { scan, table, config, gate: self.gate, dt_s };
        let now = scan.time;
        let coast_s = coast_budget_s(config, &self.clock.interval);
        let secondary_s = config.merged_measurements.max_secondary_s;
        lost.next_scan();
        states.clear();
        new.clear();
        owned.clear();
        owned.resize(if self.is_soft { scan.detections.len() } else { 0 }, false);
        let mut parts = merged.parts.iter().peekable();
        let mut i = 0;
        tracks.retain_mut(|t| {
            if i % BATCH == 0 {
                association.touch(scan, BATCH);
            }
            let part = parts.next_if(|p| p.track as usize == i);
            let outcome = update(&context, i, t, &predicted[i], part, association, weighted);
            i += 1;
            if config.association_cost.learn
                && let (true, Some(j)) = (outcome.hit, outcome.detection)
            {
                cost.learn(&t.appearance, &scan.detections[j as usize]);
            }
            let likelihood_ratio = match outcome.detection.filter(|_| outcome.hit && !outcome.merged) {
                Some(j) => t.evidence_of(config, &scan.detections[j as usize], outcome.likelihood_ratio, dt_s),
                None => outcome.likelihood_ratio,
            };
            let evidence = Evidence { hit: outcome.hit, likelihood_ratio };
            save_time_alone(&mut t.history, &outcome, now, coast_s, secondary_s);
            t.history.note_alone(outcome.hit && !outcome.merged);
            let deleted = config.confirmation.decide(&mut t.history, evidence, now.ns) == Decision::Delete
                || budget_is_over(&t.history, outcome.secondary, now, coast_s)
                || (self.is_soft && is_lasting_duplicate(t, owned, &outcome, now, config.duplicate_s));
            if deleted {
                lost.remember(&config.reidentification, t, now);
            } else {
                let state = report(t, &outcome, config, table.camera);
                let is_reported = state.status != TrackStatus::Tentative;
                if (t.history.accepted && !t.identified) || (is_reported && !t.reported) {
                    new.push(states.len() as u32);
                }
                states.push(state);
            }
            !deleted
        });
    }

    /// Gives tracks that their rule confirmed in this scan, or that are reported for the first time, the id of a lost one that they continue; states and
    /// tracks lie in one order. Those from `first_begun` on were begun in it.
    fn reidentify(&mut self, now: Timestamp, first_begun: usize) {
        let Self { config, tracks, states, lost, new, renamed, clock, .. } = self;
        let is_reported = |s: &TrackState| s.status != TrackStatus::Tentative;
        new.extend((first_begun..states.len()).filter(|&i| tracks[i].history.accepted).map(|i| i as u32));
        lost.forget(&config.reidentification, &clock.interval, now);
        if new.is_empty() {
            return;
        }
        if config.reidentification.max_gap_s <= 0.0 {
            for &i in new.iter() {
                let track = &mut tracks[i as usize];
                (track.identified, track.reported) = (true, track.reported || is_reported(&states[i as usize]));
            }
            return;
        }
        let n_reported = tracks.iter().filter(|t| t.reported).count();
        let n_still = tracks.iter().filter(|t| t.history.accepted && !t.reported).count();
        let scans_per_s = 1.0 / clock.interval.interval_s().max(1e-9);
        let density = config.confirmation.new_target_density_per_px2();
        let of_rule = config.field_px.zip(density).map(|([w, h], d)| d * w * h * scans_per_s);
        let new_per_s = of_rule.or_else(|| lost.new_per_s(now));
        let stay = Stay { survival_per_s: config.confirmation.survival(1.0), new_per_s };
        let field = Field::new(config.field_px, config.max_speed_px_per_s, stay, [n_reported, n_still]);
        for k in 0..new.len() {
            let i = new[k] as usize;
            let is_first = !std::mem::replace(&mut tracks[i].identified, true);
            let has_moved = is_reported(&states[i]);
            tracks[i].reported |= has_moved;
            let identity = lost.identify(&config.reidentification, tracks, i, has_moved, now, &field);
            if matches!(identity, Identity::New) {
                if is_first {
                    lost.note_new(now);
                }
            } else {
                tracks[i].motion.pass();
                tracks[i].reported = true;
                renamed.push((states[i].id, TrackId(tracks[i].id)));
                states[i].id = TrackId(tracks[i].id);
                states[i].status = status(&tracks[i].history, true, states[i].detection.is_some());
            }
            if let Identity::Replaces(r) = identity {
                tracks.remove(r);
                states.remove(r);
                // It was reported before, so it is none of those still to come.
                new[k + 1..].iter_mut().filter(|i| **i as usize > r).for_each(|i| *i -= 1);
            }
        }
    }
}

impl Tracking for Tracker {
    fn step(&mut self, scan: &Scan) -> Result<&[TrackState]> {
        let step_s = self.clock.step_s(scan)?;
        self.renamed.clear();
        if scan.detections.len() >= u32::MAX as usize {
            return Err(Error::new(ErrorKind::Unsupported, "more than 2³² − 2 detections in one scan"));
        }
        let c = &self.config;
        self.table.read(scan, c.detection_covariance_scale, c.extra_noise_px, c.extra_noise_per_height)?;
        self.table.read_plots(scan, c.radar_update, c.detection_covariance_scale, c.extra_noise_px);
        if !c.filter.form.takes_any_time() {
            self.table.forget_ages();
        }
        self.table.scores.read(c.score_likelihood.as_ref(), &scan.detections);

        match step_s {
            None => from_initial_tracks(&self.config, scan.time, &mut self.tracks, &mut self.next_id)?,
            Some(_) => self.delete_in_gap(scan.time),
        }
        if scan.is_cut() {
            self.forget_view();
        }
        self.clock.advance(scan);
        let dt_s = step_s.unwrap_or(0.0);
        if scan.blind {
            self.coast(scan, dt_s)?;
            return Ok(&self.states);
        }
        self.table.sort(scan);
        self.association.begin(scan, &self.clutter, &self.table.scores);
        self.predict_and_gate(scan, dt_s)?;
        let context = Context { scan, table: &self.table, config: &self.config, gate: self.gate, dt_s };
        let (association, merged) = (&mut self.association, &mut self.merged);
        associate(&context, &self.tracks, &self.predicted, &self.cost, association, merged);
        self.clutter.learn(scan, &self.association.taken_by_confirmed, dt_s);
        self.update_confirm_delete(scan, dt_s);
        let context = Context { scan, table: &self.table, config: &self.config, gate: self.gate, dt_s };
        let mut new = NewTracks { tracks: &mut self.tracks, states: &mut self.states, next_id: &mut self.next_id };
        let first_begun = new.states.len();
        initiate(&context, &self.clutter, &mut self.association.used, &mut self.pending, &mut new);
        self.reidentify(scan.time, first_begun);
        Ok(&self.states)
    }

    fn adapt(&mut self, parameters: &TrackerParameters) -> Result<bool> {
        let before = self.config.acceleration_density_px2_per_s3;
        self.config = parameters.in_config(&self.config)?;
        self.clutter.set_given(self.config.clutter_density_per_px2);
        let factor = self.config.acceleration_density_px2_per_s3 / before;
        self.tracks.iter_mut().for_each(|t| t.filter.scale_density(factor));
        Ok(true)
    }

    fn renamed(&self) -> &[(TrackId, TrackId)] {
        &self.renamed
    }

    fn twin(&self) -> Option<Box<dyn Tracking>> {
        let twin = Self::new(&self.config).ok()?;
        Some(Box::new(Self {
            clock: self.clock,
            tracks: self.tracks.clone(),
            next_id: self.next_id,
            clutter: self.clutter.clone(),
            cost: self.cost.clone(),
            pending: self.pending.clone(),
            lost: self.lost.clone(),
            ..twin
        }))
    }

    fn next_id(&self) -> TrackId {
        TrackId(self.next_id)
    }

    fn renumber(&mut self, next: TrackId, pairs: &[(TrackId, TrackId)]) -> &[TrackState] {
        self.next_id = self.next_id.max(next.0);
        renumber_states(&mut self.states, pairs);
        for t in &mut self.tracks {
            if let Some((_, to)) = pairs.iter().find(|(from, _)| from.0 == t.id) {
                t.id = to.0;
            }
        }
        &self.states
    }

    fn retrospective_s(&self) -> f64 {
        self.config.retrospective_s
    }

    fn backward(&self) -> Option<Backward> {
        Backward::of(&self.config)
    }
}
