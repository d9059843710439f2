//! Multiple-hypothesis tracking: decisions are put off for a few scans, until the data have made them.
//!
//! Source: T. Kurien, "Issues in the design of practical multitarget tracking algorithms", in *Multitarget-Multisensor
//! Tracking*, 1990 (track-oriented form, N-scan pruning); S. S. Blackman, "Multiple hypothesis tracking for multiple target
//! tracking", IEEE AES Magazine 19(1), 2004 (scores).
//! Method: each target is a tree whose leaves are its possible histories; every scan each leaf grows by a miss and by its
//! gated detections, and every detection may be a new target. The best set of compatible leaves (no detection used
//! twice within the window) is the answer; leaves that disagree with it `n_scan` scans back are cut.
//! Memory is bounded: `max_leaves` a tree and `max_hypotheses` in all; the selection has a budget of steps (`select`).
//! Symbols: score = Σ ln(P_D l / λ) over hits + Σ ln(1 − P_D P_G) over misses, from ln(β / λ) at the start.
//! Limits: `n_scan` ≤ 7. Targets start from one point whatever `birth` says (its velocities hold); `sharing` and `duplicate-s` have no
//! effect here: compatible histories share nothing.

mod grow;
mod select;

use super::Tracking;
use super::association_cost::{Look, Terms};
use super::clutter::Clutter;
use super::config::TrackerConfig;
use super::confirm::confirmation_gate::Proof;
use super::confirm::rule::Life;
use super::filter::Belief;
use super::scan_interval::Pace;
use super::single_track::{Outcome, state_of};
use super::step::gate::{Predicted, ScanTable};
use crate::associate::Gates;
use crate::validate::{check, positive};
use crate::{Error, ErrorKind, Result, Scan, Timestamp, TrackState};
use boresight_filters::Filter;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Multiple-hypothesis tracking.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct MhtConfig {
    /// Scans after which a decision is final, 1..=7. More resolves longer ambiguities and costs more.
    pub n_scan: u32,
    /// Most histories kept of one target, the best, 1..=1000.
    pub max_leaves: u32,
    /// Most histories in all, the best of each target first, 1 or more.
    pub max_hypotheses: u32,
    /// A history whose score lies this far below its target's best is cut, above 0 (natural units).
    pub max_gap: f64,
    /// New targets per px² and scan, above 0.
    pub birth_density_per_px2: f64,
    /// Steps spent on selecting among targets that compete, 1 or more; beyond them the best found so far is taken.
    pub max_steps: u32,
}

impl Default for MhtConfig {
    fn default() -> Self {
        Self {
            n_scan: 3,
            max_leaves: 12,
            max_hypotheses: 20_000,
            max_gap: 12.0,
            birth_density_per_px2: 1e-6,
            max_steps: 2000,
        }
    }
}

impl MhtConfig {
    /// Checks all values; `at` names the place in the configuration.
    /// # Errors
    /// The first value outside its range.
    pub fn validate(&self, at: &str) -> Result<()> {
        check((1..=7).contains(&self.n_scan), at, "n-scan", self.n_scan, "1..=7 scans", "3 is usual")?;
        check((1..=1000).contains(&self.max_leaves), at, "max-leaves", self.max_leaves, "1..=1000", "12 is usual")?;
        let some = "a whole number of 1 or more";
        check(self.max_hypotheses >= 1, at, "max-hypotheses", self.max_hypotheses, some, "20000 is usual")?;
        check(self.max_steps >= 1, at, "max-steps", self.max_steps, some, "2000 is usual")?;
        positive(at, "max-gap", self.max_gap, "12: one in 160 000")?;
        positive(
            at,
            "birth-density-per-px2",
            self.birth_density_per_px2,
            "1e-6 is one new target in three scans of 640 x 512 px",
        )
    }
}

/// No detection in that scan.
const NONE: u32 = u32::MAX;

/// Scans remembered by a history.
const WINDOW: usize = 8;

/// One possible history of a target.
#[derive(Clone)]
struct Leaf {
    belief: Belief,
    score: f64,
    /// Detections of the last scans, the newest first.
    path: [u32; WINDOW],
    life: Life,
    look: Look,
    proof: Proof,
    anchor: [f64; 3],
    predicted: Predicted,
    outcome: Outcome,
}

/// One target that may exist.
struct Tree {
    /// Given when it is first part of an answer; 0 before.
    id: u64,
    leaves: Vec<Leaf>,
    /// The leaf in the answer, if it is in it.
    chosen: Option<usize>,
    /// Scans in a row without being in the answer.
    unchosen: u32,
}

/// The multiple-hypothesis tracker.
pub struct Mht {
    config: TrackerConfig,
    mht: MhtConfig,
    gate: f64,
    trees: Vec<Tree>,
    table: ScanTable,
    gates: Gates,
    terms: Terms,
    clutter: Clutter,
    believed: Vec<bool>,
    select: select::Select,
    states: Vec<TrackState>,
    last: Option<Timestamp>,
    pace: Pace,
    next_id: u64,
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
            trees: Vec::new(),
            table: ScanTable::default(),
            gates: Gates::new(),
            terms: Terms::new(&config.terms),
            clutter: Clutter::new(&config.clutter, config.clutter_density_per_px2),
            believed: Vec::new(),
            select: select::Select::default(),
            states: Vec::new(),
            last: None,
            pace: Pace::default(),
            next_id: 1,
            config: config.clone(),
        })
    }

    fn coast_budget_s(&self) -> f64 {
        self.config.coast_s.max(self.pace.span_s(self.config.coast_scans))
    }

    /// Cuts histories whose coasting budget ended during a gap before `now`.
    fn expire(&mut self, now: Timestamp) {
        let (pace_s, budget_s) = (self.pace.interval_s(), self.coast_budget_s());
        if pace_s > 0.0 {
            for tree in &mut self.trees {
                tree.leaves.retain(|l| {
                    let silent_s = now.seconds_since(Timestamp::from_ns(l.life.last_seen_ns()));
                    silent_s - pace_s < budget_s - 1e-9
                });
            }
            self.trees.retain(|t| !t.leaves.is_empty());
        }
    }

    /// Cuts what disagrees with the answer `n_scan` scans back, and targets that were not part of it for as long.
    fn prune(&mut self) {
        let n = self.mht.n_scan as usize;
        let mut settled = Vec::new();
        for tree in &self.trees {
            if let Some(chosen) = tree.chosen {
                settled.push(tree.leaves[chosen].path[n]);
            }
        }
        settled.retain(|d| *d != NONE);
        settled.sort_unstable();
        for tree in &mut self.trees {
            if let Some(chosen) = tree.chosen {
                // The chosen leaf goes first and stays, since it agrees with itself.
                tree.leaves.swap(0, chosen);
                let mine = tree.leaves[0].path[n];
                tree.leaves.retain(|l| l.path[n] == mine);
                tree.chosen = Some(0);
                tree.unchosen = 0;
            } else {
                tree.unchosen += 1;
                tree.leaves.retain(|l| l.path[n] == NONE || settled.binary_search(&l.path[n]).is_err());
            }
        }
        self.trees.retain(|t| !t.leaves.is_empty() && t.unchosen as usize <= n + 1);
    }

    fn report(&mut self) {
        self.states.clear();
        for tree in &mut self.trees {
            let Some(leaf) = tree.chosen.map(|c| &mut tree.leaves[c]) else { continue };
            if tree.id == 0 {
                tree.id = self.next_id;
                self.next_id += 1;
            }
            let kinematics = leaf.belief.kinematics();
            let at = [kinematics.mean[0], kinematics.mean[2]];
            let proven = leaf.proof.holds(&self.config.proof, at, leaf.look.size, self.table.camera, leaf.outcome.hit);
            let state = state_of(tree.id, kinematics, &leaf.look, &leaf.life, proven, &leaf.outcome, &self.config);
            self.states.push(state);
        }
        self.states.sort_by_key(|s| s.id);
    }
}

impl Tracking for Mht {
    fn step(&mut self, scan: &Scan) -> Result<&[TrackState]> {
        let dt_s = self.last.map_or(0.0, |last| scan.time.seconds_since(last));
        if self.last.is_some_and(|last| scan.time < last) {
            return Err(Error::new(ErrorKind::Damaged, "time runs back")
                .at(format!("frame {}", scan.index.0))
                .hint("sort the scans by time before tracking"));
        }
        self.table.read(scan, self.config.extra_noise_px, self.config.extra_noise_of_size)?;
        if self.last.is_some() {
            self.expire(scan.time);
            self.pace.note(dt_s);
        }
        self.last = Some(scan.time);
        self.table.sort(scan);
        self.grow(scan, dt_s)?;
        self.start(scan);
        self.select.choose(&mut self.trees, self.mht.max_steps);
        self.prune();
        self.believed.clear();
        self.believed.resize(scan.detections.len(), false);
        for tree in &self.trees {
            if let Some(leaf) = tree.chosen.map(|c| &tree.leaves[c])
                && let (true, Some(j)) = (leaf.life.confirmed, leaf.outcome.detection)
            {
                self.believed[j as usize] = true;
            }
        }
        self.clutter.learn(scan, &self.believed, dt_s);
        self.report();
        Ok(&self.states)
    }
}
