//! Growth of the trees: every leaf by a miss and by its gated detections, every detection as a new target.
//!
//! A hypothesis that its confirmation rule or its coasting budget ends is cut at once. New targets start from one point with
//! unknown velocity, or with the one that comes with it; those that the next scans do not bear out fall by their score.

use super::super::appearance::Appearance;
use super::super::association_cost::AssociationCost;
use super::super::clutter::Clutter;
use super::super::config::TrackerConfig;
use super::super::confirm::history::{Decision, Evidence};
use super::super::filter::TrackedFilter;
use super::super::initiation::{from_one_point, from_velocity};
use super::super::scan_table::Predicted;
use super::super::single_track::{Outcome, Track, motion_of, place_of};
use super::super::step::context::Context;
use super::super::step::delete::budget_is_over;
use super::super::step::gate::{gate_row, innovation_cov};
use super::super::step::plot_time::{Carried, gate_row_by_time, seconds};
use super::super::step::predict::predicted_of;
use super::super::step::update::innovation_of;
use super::config::MhtConfig;
use super::hypothesis::{Hypothesis, NONE, Tree, WINDOW};
use crate::Result;
use crate::associate::{Gates, Pair, Prior};
use boresight_filters::{Filter, Measurement, Weighted};
use nalgebra::Vector2;

/// What growth reads.
pub(super) struct Growth<'a> {
    pub context: Context<'a>,
    pub mht: &'a MhtConfig,
    pub cost: &'a AssociationCost,
    pub clutter: &'a Clutter,
    /// How long a hypothesis may go without a detection, s.
    pub coast_budget_s: f64,
}

/// Grows every leaf over the time since the scan before; the trees then hold the leaves of this scan, the best first. `gates` is scratch memory.
/// # Errors
/// A filter that cannot predict over that time.
pub(super) fn grow(growth: &Growth<'_>, trees: &mut Vec<Tree>, gates: &mut Gates) -> Result<()> {
    let (config, mht, dt_s) = (growth.context.config, growth.mht, growth.context.dt_s);
    let survival = config.confirmation.survival(dt_s);
    // All that one tree grows lies here first: what is kept of it takes no more memory than it needs.
    let mut grown: Vec<Hypothesis> = Vec::new();
    for tree in trees.iter_mut() {
        let parents = std::mem::take(&mut tree.leaves);
        for mut leaf in parents {
            let t = &mut leaf.track;
            let before = growth.context.table.is_timed().then(|| t.filter.clone());
            t.filter.predict(dt_s)?;
            config.confirmation.predict_existence(&mut t.history, survival);
            leaf.predicted = predicted_of(&t.filter, t.last_seen(), t.last_place, growth.context.now(), config);
            children(growth, &mut leaf, before, gates, &mut grown);
        }
        grown.sort_by(|a, b| b.score.total_cmp(&a.score).then(a.path.cmp(&b.path)));
        grown.dedup_by(|b, a| a.path == b.path);
        let best = grown.first().map_or(0.0, |l| l.score);
        grown.retain(|l| l.score >= best - mht.max_score_gap);
        grown.truncate(mht.max_leaves as usize);
        tree.leaves.append(&mut grown);
        tree.chosen = None;
    }
    trees.retain(|t| !t.leaves.is_empty());
    // All in all: every target keeps its best, however many there are.
    let total: usize = trees.iter().map(|t| t.leaves.len()).sum();
    if total > mht.max_hypotheses as usize {
        let each = (mht.max_hypotheses as usize / trees.len().max(1)).max(1);
        for tree in trees {
            tree.leaves.truncate(each);
        }
    }
    Ok(())
}

/// Predicts every leaf over `dt_s`: a scan in which nothing could be detected is no miss, and no tree grows by it.
/// # Errors
/// A filter that cannot predict over that time.
pub(super) fn coast(trees: &mut [Tree], dt_s: f64, config: &TrackerConfig) -> Result<()> {
    let survival = config.confirmation.survival(dt_s);
    for leaf in trees.iter_mut().flat_map(|tree| &mut tree.leaves) {
        leaf.track.filter.predict(dt_s)?;
        config.confirmation.predict_existence(&mut leaf.track.history, survival);
        leaf.outcome = Outcome { likelihood_ratio: 1.0, ..Outcome::default() };
    }
    Ok(())
}

/// The children of a predicted leaf: a miss, and one for each gated detection; `before` is its filter at the scan before, where detections have times of their own.
fn children(
    growth: &Growth<'_>,
    leaf: &mut Hypothesis,
    before: Option<TrackedFilter>,
    gates: &mut Gates,
    out: &mut Vec<Hypothesis>,
) {
    let Context { scan, table, config, gate, .. } = growth.context;
    let mut path = [NONE; WINDOW];
    path[1..].copy_from_slice(&leaf.path[..WINDOW - 1]);
    let miss = 1.0 - config.p_detection(leaf.track.history.misses) * config.gate_probability;
    let outcome = Outcome { likelihood_ratio: miss, ..Outcome::default() };
    let mut missed = Hypothesis { path, outcome, ..leaf.clone() };
    missed.score += miss.max(1e-300).ln();
    let evidence = Evidence { hit: false, likelihood_ratio: miss };
    let history = &mut missed.track.history;
    if config.confirmation.decide(history, evidence, scan.time.ns) == Decision::Keep
        && !budget_is_over(history, false, scan.time, growth.coast_budget_s)
    {
        out.push(missed);
    }

    gates.reset(scan.detections.len(), 1.0);
    let is_timed = before.is_some();
    if let Some(before) = before {
        leaf.track.filter = before;
    }
    let (p, t) = (&leaf.predicted, &leaf.track);
    let cost = |p: &Predicted, j: u32| {
        growth.cost.cost(p.x, p.y, &t.appearance, &scan.detections[j as usize]) + growth.context.score_cost(t, j)
    };
    let low = config.two_stage.as_ref().map_or(f32::NEG_INFINITY, |t| t.low_score);
    let free = |j: u32| scan.detections[j as usize].score >= low;
    if is_timed {
        gate_row_by_time(&growth.context, t, p, true, free, cost, gates);
    } else {
        gate_row(table, p, gate, config.max_gated as usize, true, free, cost, gates);
    }
    gates.end_row(Prior { p_detection: 1.0, p_gate: 1.0, existence: 1.0, miss_cost: gate });
    for pair in gates.row(0) {
        if let Some(mut child) = hit(growth, leaf, pair) {
            child.path[1..].copy_from_slice(&leaf.path[..WINDOW - 1]);
            child.path[0] = pair.detection;
            out.push(child);
        }
    }
}

/// A leaf updated by a gated detection; nothing if the filter refuses it or the confirmation rule deletes the track.
fn hit(growth: &Growth<'_>, leaf: &Hypothesis, pair: &Pair) -> Option<Hypothesis> {
    let Context { scan, table, config, .. } = growth.context;
    let d = &scan.detections[pair.detection as usize];
    let mut child = leaf.clone();
    let carried = table.is_timed().then(|| Carried::sure(&growth.context, &mut child.track, pair.detection));
    let predicted = carried.as_ref().map_or(&leaf.predicted, |c| &c.predicted);
    let (position, noise) = growth.context.measured(pair.detection, predicted);
    let measurement = Measurement { position, cov: noise.matrix() };
    child.track.filter.update(&[Weighted { measurement, weight: 1.0 }]).ok()?;
    if let Some(carried) = &carried {
        carried.to_scan(&mut child.track);
    }
    let log_ratio = config.p_detection(leaf.track.history.misses).ln() + pair.log_likelihood
        - (growth.clutter.at(d.position.x, d.position.y) * table.scores.clutter(pair.detection)).max(1e-200).ln();
    child.score += log_ratio;
    let likelihood_ratio = log_ratio.clamp(-100.0, 100.0).exp();
    let told = child.track.evidence_of(config, d, likelihood_ratio, growth.context.dt_s);
    let evidence = Evidence { hit: true, likelihood_ratio: told };
    if config.confirmation.decide(&mut child.track.history, evidence, scan.time.ns) == Decision::Delete {
        return None;
    }
    let (age_ns, log_score) = (growth.context.age_ns(pair.detection), table.scores.log_score(pair.detection));
    child.track.follow(d, age_ns, &noise, log_score, config.appearance_gain);
    child.outcome = Outcome {
        hit: true,
        detection: Some(pair.detection),
        likelihood_ratio,
        innovation: Some(innovation_of(&position, predicted, &innovation_cov(predicted, &noise))),
        ..Outcome::default()
    };
    Some(child)
}

/// Every detection may be a new target.
pub(super) fn initiate(growth: &Growth<'_>, trees: &mut Vec<Tree>) {
    let Context { scan, table, config, .. } = growth.context;
    let third = config.max_speed_px_per_s / 3.0;
    let (velocity, variance) =
        config.initiation.velocity_prior().unwrap_or((Vector2::zeros(), Vector2::repeat(third * third)));
    let high = growth.context.high_score();
    for (j, d) in scan.detections.iter().enumerate() {
        if d.score < high || !config.may_initiate(d.score) || trees.len() >= config.max_tracks as usize {
            continue;
        }
        let noise = table.noise(j as u32);
        let start = match &d.velocity {
            Some(v) => from_velocity(&d.position, &noise.matrix(), v, config.detection_covariance_scale),
            None => from_one_point(&d.position, &noise.matrix(), velocity, variance),
        };
        let Ok(mut filter) = config.start_filter(&start, d.extent.height_px) else { continue };
        let age_ns = growth.context.age_ns(j as u32);
        if age_ns > 0 && filter.predict(seconds(age_ns)).is_err() {
            continue;
        }
        let score_ratio = growth.context.new_target_score_ratio(None, j as u32);
        let density = (growth.clutter.at(d.position.x, d.position.y) / score_ratio).max(1e-200);
        let mut path = [NONE; WINDOW];
        path[0] = j as u32;
        let leaf = Hypothesis {
            track: Track {
                id: 0,
                filter,
                history: config.confirmation.begin(1, scan.time.ns, density, 1.0),
                appearance: Appearance::of(d),
                duplicate_since_ns: None,
                last_place: place_of(d, &noise),
                counted: d.position,
                last_age_ns: age_ns,
                reported: false,
                identified: false,
                log_score: table.scores.log_score(j as u32),
                motion: motion_of(d, &noise, table.camera, config.report),
            },
            score: (growth.mht.new_target_density_per_px2 / density).ln(),
            path,
            predicted: Predicted { x: d.position.x, y: d.position.y, cov: noise, reach: 0.0 },
            outcome: Outcome { hit: true, detection: Some(j as u32), ..Outcome::default() },
        };
        trees.push(Tree { id: 0, leaves: vec![leaf], chosen: None, unchosen: 0 });
    }
}
