//! Associate: which detection each track takes, in three stages and with merged measurements.
//!
//! Source: docs/theory/track-management.md, "One scan"; the second stage for weak detections: Y. Zhang et al., "ByteTrack", ECCV 2022.
//! Method: confirmed tracks choose first; with two-stage association those that missed try the weak detections; tentative tracks
//! choose among what is left. Then confirmed tracks that still miss may share a merged measurement. The associator of the configuration
//! decides in the first stage, global nearest neighbour in the others.
//! Limits: a stage never takes a detection back.

use super::super::association_cost::AssociationCost;
use super::super::clutter::Clutter;
use super::super::config::TrackerConfig;
use super::super::merged_measurements::MergedMeasurements;
use super::super::scan_table::Predicted;
use super::super::score_likelihood::ScanScores;
use super::super::single_track::Track;
use super::context::Context;
use super::stage::Stage;
use crate::Scan;
use crate::associate::{AssociatorConfig, CostKind, GlobalNearestConfig};

/// No track took it.
const NONE: u32 = u32::MAX;

/// The stages: confirmed tracks, tentative ones, and confirmed ones again with the weak detections.
const CONFIRMED: usize = 0;
const TENTATIVE: usize = 1;
const WEAK: usize = 2;

/// The stages with their answers, and who took what; keeps its memory.
pub(in crate::track) struct Association {
    pub(super) stages: [Stage; 3],
    /// Whether each detection is taken.
    pub used: Vec<bool>,
    /// Whether each detection was taken by a confirmed track.
    pub taken_by_confirmed: Vec<bool>,
    /// Which confirmed track took each detection.
    taker: Vec<u32>,
    /// Confirmed tracks that took none.
    missed: Vec<u32>,
    /// Tentative tracks.
    tentative: Vec<u32>,
}

impl Association {
    pub fn new(config: &TrackerConfig) -> Self {
        let cost = if config.score_likelihood.is_some() { CostKind::Likelihood } else { CostKind::Distance };
        let hard = AssociatorConfig::GlobalNearest(GlobalNearestConfig { cost });
        let budget = config.association_cost.budget();
        Self {
            stages: [Stage::new(&config.associator, budget), Stage::new(&hard, budget), Stage::new(&hard, budget)],
            used: Vec::new(),
            taken_by_confirmed: Vec::new(),
            taker: Vec::new(),
            missed: Vec::new(),
            tentative: Vec::new(),
        }
    }

    /// Begins a scan.
    pub fn begin(&mut self, scan: &Scan, clutter: &Clutter, scores: &ScanScores) {
        self.used.clear();
        self.used.resize(scan.detections.len(), false);
        self.tentative.clear();
        for stage in &mut self.stages {
            stage.begin(scan, clutter, scores);
        }
    }

    /// Fetches ahead the detections that the next `n` confirmed tracks took.
    #[inline]
    pub fn touch(&self, scan: &Scan, n: usize) {
        self.stages[CONFIRMED].touch(scan, n);
    }
}

/// Gates the confirmed ones of some tracks, whose first has the index `first`, and notes the tentative ones. `predicted` belongs to
/// `tracks`; `plain` says that neither scores nor costs beside position count.
#[inline]
pub(in crate::track) fn gate_confirmed(
    context: &Context<'_>,
    first: usize,
    tracks: &[Track],
    predicted: &[Predicted],
    cost: &AssociationCost,
    plain: bool,
    association: &mut Association,
) {
    let high = context.high_score();
    for (k, t) in tracks.iter().enumerate() {
        if !t.history.accepted {
            association.tentative.push((first + k) as u32);
            continue;
        }
        let p = &predicted[k];
        let stage = &mut association.stages[CONFIRMED];
        if plain {
            stage.add(first + k, t, p, context, |_| true, |_, _| 0.0);
        } else {
            let detections = &context.scan.detections;
            let strong = |j: u32| detections[j as usize].score >= high;
            let measure = stage.velocity_cost();
            let extra = |p: &Predicted, j: u32| {
                cost.cost(p.x, p.y, &t.appearance, &detections[j as usize])
                    + context.score_cost(t, j)
                    + context.velocity_cost(t, j, measure)
            };
            stage.add(first + k, t, p, context, strong, extra);
        }
    }
}

/// Associates all tracks; the confirmed ones were gated before.
pub(in crate::track) fn associate(
    context: &Context<'_>,
    tracks: &[Track],
    predicted: &[Predicted],
    cost: &AssociationCost,
    association: &mut Association,
    merged: &mut MergedMeasurements,
) {
    let (config, scan) = (context.config, context.scan);
    let Association { stages, used, taken_by_confirmed, taker, missed, tentative } = association;
    stages[CONFIRMED].solve(used);
    missed.clear();
    taker.clear();
    // Members of a merged measurement are compared in one moment.
    let may_merge =
        config.merged_measurements.enabled && context.table.largest_half_px != [0.0; 2] && !context.table.is_timed();
    if may_merge || config.two_stage.is_some() {
        taker.resize(scan.detections.len(), NONE);
        for (i, shares) in stages[CONFIRMED].rows() {
            match shares {
                [] => missed.push(i),
                [one] => taker[one.detection as usize] = i,
                _ => {}
            }
        }
    }
    if let Some(low) = config.two_stage.as_ref().map(|c| c.low_score) {
        for i in missed.iter() {
            add_later(context, &mut stages[WEAK], *i as usize, tracks, predicted, cost, used, low);
        }
        stages[WEAK].solve(used);
        missed.clear();
        for (i, shares) in stages[WEAK].rows() {
            match shares {
                [one] => taker[one.detection as usize] = i,
                _ => missed.push(i),
            }
        }
    }
    taken_by_confirmed.clone_from(used);
    for i in tentative.iter() {
        add_later(context, &mut stages[TENTATIVE], *i as usize, tracks, predicted, cost, used, context.high_score());
    }
    stages[TENTATIVE].solve(used);
    merged.parts.clear();
    if may_merge && !missed.is_empty() {
        let appearance = |i: u32| tracks[i as usize].appearance;
        merged.find(&config.merged_measurements, scan, context.table, predicted, appearance, taker, missed);
        for part in &merged.parts {
            used[part.detection as usize] = true;
        }
    }
    // Weak detections initiate nothing.
    if config.two_stage.is_some() {
        let high = context.high_score();
        for (used, d) in used.iter_mut().zip(&scan.detections) {
            *used |= d.score < high;
        }
    }
}

/// Adds a track to a later stage, with the detections that are free and score at least `min_score`.
fn add_later(
    context: &Context<'_>,
    stage: &mut Stage,
    i: usize,
    tracks: &[Track],
    predicted: &[Predicted],
    cost: &AssociationCost,
    used: &[bool],
    min_score: f32,
) {
    let (t, p, detections) = (&tracks[i], &predicted[i], &context.scan.detections);
    let free = |j: u32| !used[j as usize] && detections[j as usize].score >= min_score;
    let measure = stage.velocity_cost();
    let extra = |p: &Predicted, j: u32| {
        cost.cost(p.x, p.y, &t.appearance, &detections[j as usize])
            + context.score_cost(t, j)
            + context.velocity_cost(t, j, measure)
    };
    stage.add(i, t, p, context, free, extra);
}
