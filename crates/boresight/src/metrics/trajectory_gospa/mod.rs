//! Trajectory GOSPA: the distance between two sets of tracks, with a cost for every switch of the assignment.
//!
//! Source: Á. García-Fernández, A. Rahmathullah, L. Svensson, *A metric on the space of finite sets of trajectories for
//! evaluation of multi-target tracking algorithms*, IEEE Trans. Signal Processing 68, 2020: the linear programming metric
//! (definition 2 and section IV), which is the relaxation of the multi-dimensional assignment metric.
//! Symbols: c cutoff, px; p order; γ switch cost, px; w share in 0..=1 to which truth i and result j are assigned in a
//! frame; d distance, px. The sum of the p-th powers is localisation + missed + false + switch, where a frame in which a
//! pair is nearer than c costs w d^p instead of c^p / 2 for a missed truth and for a false result each, and a change of w
//! from one frame to the next costs γ^p / 2 times its size.
//! Departures, without changing the value: the gain c^p − d^p of assigned pairs is maximised, so only pairs that are ever
//! nearer than c are unknowns; pairs that share no track with another are assigned throughout; the rest falls apart
//! into groups that share tracks; frames without a near pair of the group vanish; frames side by side that have only one
//! near pair, the same, are one. Each group is a linear programme (`programme`).
//! Limits: at most [`TrajectoryOptions::max_unknowns`] shares in all.

mod programme;
mod solver;

use super::near::each_near_pair;
use super::pairs::PairIndex;
use super::set::SetOptions;
use crate::union_find::{join, root};
use crate::{Error, ErrorKind, Result, TrackTable};
use programme::{Group, Share};
use serde::Serialize;

/// Cutoff, order and switch cost of trajectory GOSPA.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TrajectoryOptions {
    /// Cutoff c and order p; the assignment rule of OSPA is not looked at.
    pub set: SetOptions,
    /// Switch cost γ, px, above 0. A track that goes over to another number costs γ^p, one that is lost or found γ^p / 2.
    pub switch_px: f64,
    /// Greatest number of unknown shares; above it the distance is refused, for it would take minutes.
    pub max_unknowns: usize,
}

impl Default for TrajectoryOptions {
    fn default() -> Self {
        let set = SetOptions::default();
        Self { set, switch_px: set.cutoff_px / 2.0, max_unknowns: 10_000 }
    }
}

/// Trajectory GOSPA and its parts, summed over the frames.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct TrajectoryGospa {
    /// The distance: (localisation + missed + false + switch)^(1/p), px.
    pub distance: f64,
    /// The same of the mean over the frames, px: it can be compared between sequences of different lengths.
    pub per_frame: f64,
    /// Sum of w d^p of the assigned pairs, px^p.
    pub localisation: f64,
    /// c^p / 2 for each missed truth row, px^p.
    pub missed: f64,
    /// c^p / 2 for each false result row, px^p.
    pub false_: f64,
    /// γ^p / 2 times the changes of assignment, px^p.
    pub switch: f64,
    /// Number of unknown shares that had to be found.
    pub n_unknowns: usize,
}

/// What a pair gains in a frame by being assigned, in units of c^p.
#[derive(Clone, Copy, Debug)]
struct Near {
    frame: u32,
    pair: u32,
    gain: f64,
}

/// All pairs nearer than c, by frame.
fn near_pairs(truth: &TrackTable, result: &TrackTable, c: f64, p: f64) -> (PairIndex, Vec<Near>) {
    let (mut index, mut near) = (PairIndex::default(), Vec::new());
    each_near_pair(truth, result, 0..truth.n_frames(), c, |n| {
        let pair = index.number(n.truth, n.result);
        near.push(Near { frame: n.frame as u32, pair, gain: 1.0 - (n.distance_px / c).powf(p) });
    });
    (index, near)
}

/// The group of each pair: pairs that share a truth or a result are in one. Numbers go by first pair.
fn groups(index: &PairIndex, n_truths: usize, n_results: usize) -> (Vec<u32>, usize) {
    let mut parent: Vec<u32> = (0..(n_truths + n_results) as u32).collect();
    for &(t, r) in index.pairs() {
        join(&mut parent, t, n_truths as u32 + r);
    }
    let mut number = vec![u32::MAX; parent.len()];
    let mut n = 0;
    let of_pair = index.pairs().iter().map(|&(t, _)| {
        let g = &mut number[root(&mut parent, t) as usize];
        if *g == u32::MAX {
            *g = n;
            n += 1;
        }
        *g
    });
    let of_pair = of_pair.collect();
    (of_pair, n as usize)
}

/// Trajectory GOSPA over windows of `window` frames side by side: each window is a sequence of its own, the parts add up.
///
/// The programme of a long crowded sequence grows beyond what can be solved; switches at the borders of windows are free.
/// # Errors
/// As [`trajectory_gospa`]; a window of no frames.
pub fn trajectory_gospa_by_windows(
    truth: &TrackTable,
    result: &TrackTable,
    window: usize,
    options: &TrajectoryOptions,
) -> Result<TrajectoryGospa> {
    if window == 0 {
        return Err(Error::new(ErrorKind::Config, "expected a window of at least 1 frame").at("window = 0"));
    }
    let n_frames = truth.n_frames().max(result.n_frames());
    let p = options.set.order;
    let mut sum = TrajectoryGospa::default();
    for from in (0..n_frames).step_by(window) {
        let inside = |frame: usize, _: usize| frame >= from && frame - from < window;
        let g = trajectory_gospa(&truth.filtered(inside), &result.filtered(inside), options)?;
        sum.localisation += g.localisation;
        sum.missed += g.missed;
        sum.false_ += g.false_;
        sum.switch += g.switch;
        sum.n_unknowns += g.n_unknowns;
    }
    let all = sum.localisation + sum.missed + sum.false_ + sum.switch;
    Ok(TrajectoryGospa { distance: all.powf(1.0 / p), per_frame: (all / n_frames.max(1) as f64).powf(1.0 / p), ..sum })
}

/// Trajectory GOSPA of two tables, by the centres of their rows.
/// # Errors
/// Options out of range; an id twice in a frame; more unknowns than allowed; a programme that the solver cannot finish.
pub fn trajectory_gospa(
    truth: &TrackTable,
    result: &TrackTable,
    options: &TrajectoryOptions,
) -> Result<TrajectoryGospa> {
    options.set.validate("trajectory-gospa")?;
    if !(options.switch_px > 0.0 && options.switch_px.is_finite()) {
        return Err(Error::new(ErrorKind::Config, "expected a switch cost above 0 px")
            .at(format!("trajectory-gospa.switch-px = {}", options.switch_px))
            .hint("half the cutoff is a usual one"));
    }
    super::multi_object::refuse_doubles(truth)?;
    super::multi_object::refuse_doubles(result)?;
    let (c, p) = (options.set.cutoff_px, options.set.order);
    let lambda = 0.5 * (options.switch_px / c).powf(p);
    let (index, near) = near_pairs(truth, result, c, p);
    let (group_of, n_groups) = groups(&index, truth.n_tracks(), result.n_tracks());
    let mut all: Vec<Group> = vec![Group::default(); n_groups];
    // Number of each pair in its group.
    let mut local = Vec::with_capacity(group_of.len());
    for (&(t, r), &g) in index.pairs().iter().zip(&group_of) {
        local.push(all[g as usize].add_pair(t, r));
    }
    for n in &near {
        let share = Share { pair: local[n.pair as usize], gain: n.gain, n: 1 };
        all[group_of[n.pair as usize] as usize].add(n.frame, share);
    }
    let n_unknowns = all.iter_mut().map(Group::close).sum();
    if n_unknowns > options.max_unknowns {
        return Err(Error::new(
            ErrorKind::Unsupported,
            format!("trajectory GOSPA needs {n_unknowns} unknowns, more than {}", options.max_unknowns),
        )
        .hint("a smaller cutoff brings fewer pairs together; or allow more and wait"));
    }
    let (mut matched, mut near_sum, mut changes) = (0.0, 0.0, 0.0);
    for group in &all {
        let s = group.solve(lambda)?;
        matched += s.rows;
        near_sum += s.rows - s.gain;
        changes += s.changes;
    }
    let unit = c.powf(p);
    let missed = (truth.n_rows() as f64 - matched).max(0.0) * unit / 2.0;
    let false_ = (result.n_rows() as f64 - matched).max(0.0) * unit / 2.0;
    let (localisation, switch) = (near_sum.max(0.0) * unit, lambda * changes * unit);
    let sum = localisation + missed + false_ + switch;
    let n_frames = truth.n_frames().max(result.n_frames()).max(1) as f64;
    Ok(TrajectoryGospa {
        distance: sum.powf(1.0 / p),
        per_frame: (sum / n_frames).powf(1.0 / p),
        localisation,
        missed,
        false_,
        switch,
        n_unknowns,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{PixelOrigin, TrackRow};

    fn table(rows: &[(u32, i64, f64)]) -> TrackTable {
        let row = |&(frame, id, x): &_| TrackRow { frame, id, bbox: [x, 0.0, 0.0, 0.0], ..TrackRow::default() };
        TrackTable::from_rows("t", PixelOrigin::Centre0, rows.iter().map(row)).unwrap()
    }

    fn options(c: f64, p: f64, g: f64) -> TrajectoryOptions {
        let set = SetOptions { cutoff_px: c, order: p, ..SetOptions::default() };
        TrajectoryOptions { set, switch_px: g, ..TrajectoryOptions::default() }
    }

    #[test]
    #[cfg_attr(not(feature = "trajectory-gospa"), ignore = "needs the feature trajectory-gospa")]
    fn a_track_cut_in_two_costs_one_switch_where_switches_are_cheap() {
        let truth = table(&[(0, 1, 0.0), (1, 1, 0.0), (2, 1, 0.0), (3, 1, 0.0)]);
        let cut = table(&[(0, 1, 1.0), (1, 1, 1.0), (2, 2, 1.0), (3, 2, 1.0)]);
        // By hand: 4 frames at 1 px, one full switch γ = 2: 4 + 2.
        let g = trajectory_gospa(&truth, &cut, &options(10.0, 1.0, 2.0)).unwrap();
        assert!((g.distance - 6.0).abs() < 1e-9 && (g.switch - 2.0).abs() < 1e-9, "{g:?}");
        // γ = 100: one half stays missed and false: 2 + 2 (5 + 5).
        let g = trajectory_gospa(&truth, &cut, &options(10.0, 1.0, 100.0)).unwrap();
        assert!((g.distance - 22.0).abs() < 1e-9 && g.switch.abs() < 1e-9, "{g:?}");
    }

    #[test]
    #[cfg_attr(not(feature = "trajectory-gospa"), ignore = "needs the feature trajectory-gospa")]
    fn two_truths_that_swap_their_results_cost_two_switches() {
        let truth = table(&[(0, 1, 0.0), (0, 2, 20.0), (1, 1, 0.0), (1, 2, 20.0)]);
        let swapped = table(&[(0, 7, 0.0), (0, 8, 20.0), (1, 8, 0.0), (1, 7, 20.0)]);
        let g = trajectory_gospa(&truth, &swapped, &options(10.0, 2.0, 3.0)).unwrap();
        assert!((g.switch - 18.0).abs() < 1e-8 && g.localisation.abs() < 1e-8, "{g:?}");
    }

    #[test]
    #[cfg_attr(not(feature = "trajectory-gospa"), ignore = "needs the feature trajectory-gospa")]
    fn with_single_frames_it_is_gospa() {
        let truth = table(&[(0, 1, 0.0), (0, 2, 7.0), (0, 3, 50.0)]);
        let result = table(&[(0, 1, 3.0), (0, 2, 6.5)]);
        let t = trajectory_gospa(&truth, &result, &options(5.0, 2.0, 1.0)).unwrap();
        let x = |t: &TrackTable| t.boxes.iter().map(|b| [b[0], b[1]]).collect::<Vec<_>>();
        let g = super::super::set::SetDistance::default().gospa(&x(&truth), &x(&result), &options(5.0, 2.0, 1.0).set);
        assert!((t.distance - g.distance).abs() < 1e-9 && (t.missed - g.missed).abs() < 1e-9, "{t:?} {g:?}");
    }

    #[test]
    #[cfg_attr(not(feature = "trajectory-gospa"), ignore = "needs the feature trajectory-gospa")]
    fn windows_add_up_and_forgive_switches_at_their_borders() {
        let truth = table(&[(0, 1, 0.0), (1, 1, 0.0), (2, 1, 0.0), (3, 1, 0.0)]);
        let cut = table(&[(0, 1, 1.0), (1, 1, 1.0), (2, 2, 1.0), (3, 2, 1.0)]);
        let d = |w| trajectory_gospa_by_windows(&truth, &cut, w, &options(10.0, 1.0, 2.0)).unwrap();
        assert!((d(4).distance - 6.0).abs() < 1e-9 && (d(4).per_frame - 1.5).abs() < 1e-9);
        assert!((d(2).distance - 4.0).abs() < 1e-9 && d(2).switch == 0.0);
        assert!((d(3).distance - 6.0).abs() < 1e-9);
    }

    #[test]
    fn too_many_unknowns_are_refused_with_their_number() {
        let truth = table(&[(0, 1, 0.0), (1, 1, 0.0)]);
        let cut = table(&[(0, 1, 1.0), (1, 2, 1.0)]);
        let o = TrajectoryOptions { max_unknowns: 3, ..options(10.0, 1.0, 2.0) };
        assert!(trajectory_gospa(&truth, &cut, &o).unwrap_err().to_string().contains("4 unknowns"));
    }
}
