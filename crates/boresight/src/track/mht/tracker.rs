//! The multiple-hypothesis tracker: predict, gate and grow, initiate, select, prune, report; one scan at a time.
//!
//! Source: T. Kurien, "Issues in the design of practical multitarget tracking algorithms", in *Multitarget-Multisensor
//! Tracking*, 1990 (track-oriented form, N-scan pruning); S. S. Blackman, "Multiple hypothesis tracking for multiple target
//! tracking", IEEE AES Magazine 19(1), 2004 (scores).
//! Method: each target is a tree whose leaves are its possible histories; every scan each leaf grows by a miss and by its
//! gated detections, and every detection may be a new target. The best set of compatible leaves (no detection used
//! twice within the window) is the answer; leaves that disagree with it `n_scan` scans back are cut.
//! Memory is bounded: `max_leaves` a tree and `max_hypotheses` in all; the selection has a budget of steps (`select`).
//! Symbols: score = Σ ln(P_D l / λ) over hits + Σ ln(1 − P_D P_G) over misses, from ln(β_new / λ) at the start.
//! Limits: `n_scan` ≤ 7. Targets start from one detection whatever `initiation` says (its velocities hold where the detection has none); `merged-measurements` and
//! `duplicate-s` have no effect here: compatible hypotheses share nothing.

use super::super::association_cost::AssociationCost;
use super::super::clock::Clock;
use super::super::clutter::Clutter;
use super::super::config::TrackerConfig;
use super::super::scan_table::ScanTable;
use super::super::step::context::Context;
use super::super::step::delete::{coast_budget_s, expired_in_gap};
use super::super::step::report::report;
use super::super::tracking::Tracking;
use super::config::MhtConfig;
use super::grow::{Growth, coast, grow, initiate};
use super::hypothesis::{Hypothesis, Tree};
use super::prune::prune;
use super::select::Select;
use crate::associate::Gates;
use crate::memory_budget::afford_all;
use crate::{Result, Scan, Timestamp, TrackState};

/// The multiple-hypothesis tracker.
pub struct Mht {
    config: TrackerConfig,
    mht: MhtConfig,
    gate: f64,
    clock: Clock,
    trees: Vec<Tree>,
    next_id: u64,
    clutter: Clutter,
    cost: AssociationCost,
    table: ScanTable,
    gates: Gates,
    select: Select,
    /// Detections taken by confirmed tracks of the answer.
    taken_by_confirmed: Vec<bool>,
    states: Vec<TrackState>,
}

opaque_debug!(Mht);

impl Mht {
    /// Builds the tracker.
    /// # Errors
    /// A value of the configuration outside its range.
    pub fn new(config: &TrackerConfig, mht: &MhtConfig) -> Result<Self> {
        config.validate("tracker")?;
        Ok(Self {
            gate: config.gate(),
            mht: mht.clone(),
            clock: Clock::default(),
            trees: Vec::new(),
            next_id: 1,
            clutter: Clutter::new(&config.clutter, config.clutter_density_per_px2),
            cost: AssociationCost::new(&config.association_cost),
            table: ScanTable::default(),
            gates: Gates::new(),
            select: Select::default(),
            taken_by_confirmed: Vec::new(),
            states: Vec::new(),
            config: config.clone(),
        })
    }

    /// Deletes hypotheses whose coasting budget ended during a gap before `now`.
    fn delete_in_gap(&mut self, now: Timestamp) {
        let (interval_s, budget_s) =
            (self.clock.interval.interval_s(), coast_budget_s(&self.config, &self.clock.interval));
        if interval_s > 0.0 {
            for tree in &mut self.trees {
                tree.leaves.retain(|l| !expired_in_gap(&l.track.history, now, budget_s, interval_s));
            }
            self.trees.retain(|t| !t.leaves.is_empty());
        }
    }

    /// Refuses a scan whose histories might not fit into memory, before any of them grows.
    fn afford(&self, n_detections: usize) -> Result<()> {
        let (most, gated) = (self.mht.max_leaves as usize, n_detections.min(self.config.max_gated as usize));
        // Kept of each target, grown of the one at work, begun by each detection.
        let kept: usize = self.trees.iter().map(|t| most.min(t.leaves.len().saturating_mul(1 + gated))).sum();
        let of_one = self.trees.iter().map(|t| t.leaves.len().saturating_mul(1 + gated)).max().unwrap_or(0);
        let n = kept.saturating_add(of_one).saturating_add(n_detections);
        afford_all(n, size_of::<Hypothesis>() as u64, "histories of targets")
    }

    /// Notes which detections confirmed tracks of the answer took.
    fn note_taken(&mut self, n_detections: usize) {
        self.taken_by_confirmed.clear();
        self.taken_by_confirmed.resize(n_detections, false);
        for leaf in self.trees.iter().filter_map(Tree::answer) {
            if let (true, Some(j)) = (leaf.track.history.accepted, leaf.outcome.detection) {
                self.taken_by_confirmed[j as usize] = true;
            }
        }
    }

    /// Reports the answer, in the order of the ids.
    fn report(&mut self) {
        self.states.clear();
        for tree in &mut self.trees {
            let Some(leaf) = tree.chosen.map(|c| &mut tree.leaves[c]) else { continue };
            if tree.id == 0 {
                tree.id = self.next_id;
                self.next_id += 1;
            }
            leaf.track.id = tree.id;
            self.states.push(report(&mut leaf.track, &leaf.outcome, &self.config, self.table.camera));
        }
        self.states.sort_by_key(|s| s.id);
    }
}

impl Tracking for Mht {
    fn step(&mut self, scan: &Scan) -> Result<&[TrackState]> {
        let step_s = self.clock.step_s(scan)?;
        let c = &self.config;
        self.table.read(scan, c.detection_covariance_scale, c.extra_noise_px, c.extra_noise_per_height)?;
        self.table.read_plots(scan, c.radar_update, c.detection_covariance_scale, c.extra_noise_px);
        if !c.filter.form.takes_any_time() {
            self.table.forget_ages();
        }
        self.table.scores.read(c.score_likelihood.as_ref(), &scan.detections);
        if step_s.is_some() {
            self.delete_in_gap(scan.time);
        }
        if scan.is_cut() {
            self.trees.clear();
            self.clutter = Clutter::new(&self.config.clutter, self.config.clutter_density_per_px2);
        }
        self.clock.advance(scan);
        let dt_s = step_s.unwrap_or(0.0);
        if scan.blind {
            coast(&mut self.trees, dt_s, &self.config)?;
            self.report();
            return Ok(&self.states);
        }
        self.afford(scan.detections.len())?;
        self.table.sort(scan);
        let growth = Growth {
            context: Context { scan, table: &self.table, config: &self.config, gate: self.gate, dt_s },
            mht: &self.mht,
            cost: &self.cost,
            clutter: &self.clutter,
            coast_budget_s: coast_budget_s(&self.config, &self.clock.interval),
        };
        grow(&growth, &mut self.trees, &mut self.gates)?;
        initiate(&growth, &mut self.trees);
        self.select.choose(&mut self.trees, self.mht.max_steps);
        prune(&mut self.trees, self.mht.n_scan as usize);
        self.note_taken(scan.detections.len());
        self.clutter.learn(scan, &self.taken_by_confirmed, dt_s);
        self.report();
        Ok(&self.states)
    }

    fn retrospective_s(&self) -> f64 {
        self.config.retrospective_s
    }
}
