//! Errors of the estimated states against the truth, and whether their stated covariances are true.
//!
//! Rows are matched frame by frame as for the detection measures. Positions are the rows' centres; velocities and
//! covariances are those of the tables, where both tables, or the result, have them.

use super::note::Note;
use super::options::{BoundModel, EvaluateOptions};
use super::sequence::Sequence;
use crate::metrics::consistency::{Consistency, average, nis_of_residual, noncredibility, normalised_square};
use crate::metrics::detection::match_rows;
use crate::metrics::multi_object::MatchOptions;
use crate::metrics::near::centre;
use crate::metrics::pcrlb::{LinearModel, pcrlb};
use crate::metrics::state::{BoundedError, StateErrors, bounded_errors, root_sum_square, state_errors};
use crate::{Detection, Result, Scan, TrackTable};
use nalgebra::{Matrix1, Matrix1x2, Matrix2, Vector2, Vector4};
use serde::Serialize;
use std::collections::BTreeMap;

/// Probability of the bounds of averages.
pub(super) const LEVEL: f64 = 0.95;
/// Standard deviations of the bounds beside the errors.
const N_SIGMA: f64 = 2.0;
/// Variance of a target of which nothing is known, in variances of a measurement.
const UNKNOWN: f64 = 1e9;

/// State measures of a sequence.
#[derive(Clone, Debug, Default, Serialize)]
#[non_exhaustive]
pub struct StateMeasures {
    /// Errors over all matched rows.
    pub errors: StateErrors,
    /// Matched rows.
    pub n_rows: u64,
    /// Σ x² and Σ y² of the truth over them: what the percentage fit errors are shares of, px².
    #[serde(skip)]
    pub(super) norm2: [f64; 2],
    /// Whether both tables have velocities.
    pub has_velocity: bool,
    /// Root mean over the frame's matched rows of the squared position error, px, by frame.
    pub rsspe: Vec<(u32, f64)>,
    /// Errors of `[x, vx, y, vy]` beside ±2σ, where the result states variances.
    pub bounded: Vec<BoundedError>,
    /// NEES of the position (2 degrees of freedom).
    pub nees: Option<Consistency>,
    /// NEES of the whole state (4 degrees of freedom).
    pub nees4: Option<Consistency>,
    /// Noncredibility index and inclination of the position, dB.
    pub noncredibility: Option<(f64, f64)>,
    /// NIS of the rows that name the detection which updated them (2 degrees of freedom).
    pub nis: Option<Consistency>,
    /// Least RMSPE that the model of the options allows, px.
    pub bound_px: Option<f64>,
    /// Position NEES of single rows, by frame.
    pub nees_by_frame: Vec<(u32, f64)>,
}

/// `[x, vx, y, vy]` of a row; velocities are 0 in a table without them, NaN in a row without one.
fn state(t: &TrackTable, r: usize) -> [f64; 4] {
    let [x, y] = centre(t, r);
    let unknown = if t.has_velocity() { f64::NAN } else { 0.0 };
    let v = t.velocity(r).unwrap_or(Vector2::repeat(unknown));
    [x, v.x, y, v.y]
}

/// The matched rows: what is true, what was estimated, and when.
#[derive(Default)]
struct Matched {
    /// Rows of the truth and of the result.
    rows: Vec<(usize, usize)>,
    frames: Vec<u32>,
    truth: Vec<[f64; 4]>,
    result: Vec<[f64; 4]>,
}

impl StateMeasures {
    /// Computes the measures; `None` if nothing matches.
    pub(super) fn of(
        s: &Sequence<'_>,
        options: &EvaluateOptions,
        matching: &MatchOptions,
        notes: &mut Vec<Note>,
    ) -> Result<Option<Self>> {
        let (t, r) = (s.truth, s.result);
        let mut m = Matched::default();
        match_rows(t, r, matching, |i, k| m.rows.push((i, k)));
        if m.rows.is_empty() {
            return Ok(None);
        }
        let frame_of = frames(t);
        m.frames = m.rows.iter().map(|m| frame_of[m.0]).collect();
        m.truth = m.rows.iter().map(|m| state(t, m.0)).collect();
        m.result = m.rows.iter().map(|m| state(r, m.1)).collect();
        let mut out = Self {
            errors: state_errors(&m.truth, &m.result)?,
            n_rows: m.rows.len() as u64,
            norm2: [0, 2].map(|k| m.truth.iter().map(|t| t[k] * t[k]).sum()),
            has_velocity: t.has_velocity() && r.has_velocity(),
            ..Self::default()
        };
        let squares = root_sum_square(&m.truth, &m.result)?.into_iter().map(|e| e[0] * e[0]);
        out.rsspe = mean_by_frame(m.frames.iter().copied().zip(squares)).map(|(f, v)| (f, v.sqrt())).collect();
        out.consistency(r, &m)?;
        if let Some(scans) = s.detections {
            out.nis = nis(r, scans, options, notes)?;
        }
        if let Some(model) = options.bound {
            out.bound_px = Some(least_rmspe(&model, t, &m.rows, s.dt_s())?);
        }
        Ok(Some(out))
    }

    /// NEES, noncredibility and errors beside their bounds, where the result states covariances.
    fn consistency(&mut self, result: &TrackTable, m: &Matched) -> Result<()> {
        let (mut nees, mut nees4, mut errors) = (Vec::new(), Vec::new(), Vec::new());
        for (k, rows) in m.rows.iter().enumerate() {
            let (a, b) = (m.truth[k], m.result[k]);
            if let Some(p) = result.position_cov(rows.1) {
                let e = Vector2::new(a[0] - b[0], a[2] - b[2]);
                if let Ok(v) = normalised_square(&e, &p) {
                    nees.push(v);
                    errors.push(e);
                    self.nees_by_frame.push((m.frames[k], v));
                }
            }
            if let (true, Some(p)) = (self.has_velocity, result.state_cov(rows.1)) {
                let e = Vector4::from_fn(|i, _| a[i] - b[i]);
                nees4.extend(normalised_square(&e, &p));
            }
        }
        if nees.is_empty() {
            return Ok(());
        }
        self.nees = Some(average(&nees, 2, LEVEL)?);
        self.noncredibility = credibility(&nees, &errors);
        if !nees4.is_empty() {
            self.nees4 = Some(average(&nees4, 4, LEVEL)?);
        }
        let variances = m.rows.iter().map(|rows| result.state_cov(rows.1).map(|p| p.diagonal().into()));
        let stated: Vec<(usize, [f64; 4])> = variances.enumerate().filter_map(|(k, v)| Some((k, v?))).collect();
        if !stated.is_empty() {
            let (truth, estimate): (Vec<_>, Vec<_>) = stated.iter().map(|&(k, _)| (m.truth[k], m.result[k])).unzip();
            let variances: Vec<[f64; 4]> = stated.into_iter().map(|(_, v)| v).collect();
            self.bounded = bounded_errors(&truth, &estimate, &variances, N_SIGMA)?;
        }
        Ok(())
    }
}

/// Noncredibility index and inclination: the NEES beside that with the true mean square error.
fn credibility(nees: &[f64], errors: &[Vector2<f64>]) -> Option<(f64, f64)> {
    let mse = errors.iter().map(|e| e * e.transpose()).sum::<Matrix2<f64>>() / errors.len() as f64;
    let ideal: Vec<f64> = errors.iter().filter_map(|e| normalised_square(e, &mse).ok()).collect();
    // Errors of exactly 0 have no logarithm; they say nothing of credibility.
    let both = nees.iter().copied().zip(ideal).filter(|(a, b)| *a > 0.0 && *b > 0.0);
    let (a, b): (Vec<f64>, Vec<f64>) = both.unzip();
    noncredibility(&a, &b).ok()
}

/// Frame of each row.
fn frames(t: &TrackTable) -> Vec<u32> {
    let mut out = vec![0; t.n_rows()];
    for frame in 0..t.n_frames() {
        out[t.rows(frame)].fill(frame as u32);
    }
    out
}

fn mean_by_frame(values: impl Iterator<Item = (u32, f64)>) -> impl Iterator<Item = (u32, f64)> {
    let mut sums: BTreeMap<u32, (f64, f64)> = BTreeMap::new();
    for (frame, v) in values {
        let s = sums.entry(frame).or_default();
        *s = (s.0 + v, s.1 + 1.0);
    }
    sums.into_iter().map(|(frame, (sum, n))| (frame, sum / n))
}

/// NIS of the rows that name the detection which updated them, at their own time (of one seen before it the row does not tell the residual).
fn nis(
    r: &TrackTable,
    scans: &[Scan],
    options: &EvaluateOptions,
    notes: &mut Vec<Note>,
) -> Result<Option<Consistency>> {
    if !r.has_detections() {
        notes.push(Note::NoDetectionColumn);
        return Ok(None);
    }
    let scans: BTreeMap<u64, &Scan> = scans.iter().map(|s| (s.index.0, s)).collect();
    let (mut values, mut n_left_out) = (Vec::new(), 0_u64);
    for frame in 0..r.n_frames() {
        for (row, taken) in r.rows(frame).filter_map(|row| Some((row, r.states.detection.get(row)?))) {
            let detection = scans.get(&(frame as u64)).and_then(|s| s.detections.get(taken as usize));
            let (Some(d @ Detection { age_ns: 0, .. }), Some(p)) = (detection, r.position_cov(row)) else {
                n_left_out += 1;
                continue;
            };
            let [x, y] = centre(r, row);
            let extra = options.extra_noise_px.powi(2) + (options.extra_noise_per_height * d.extent.height_px).powi(2);
            let noise = d.cov + Matrix2::identity() * extra;
            match nis_of_residual(&(d.position - Vector2::new(x, y)), &noise, &p) {
                Ok(v) => values.push(v),
                Err(_) => n_left_out += 1,
            }
        }
    }
    if n_left_out > 0 {
        notes.push(Note::NisRowsLeftOut(n_left_out));
    }
    if values.is_empty() { Ok(None) } else { average(&values, 2, LEVEL).map(Some) }
}

/// Least RMSPE over the matched rows, px: each truth is seen from its first row on, without prior knowledge.
fn least_rmspe(model: &BoundModel, t: &TrackTable, matched: &[(usize, usize)], dt_s: f64) -> Result<f64> {
    let frame_of = frames(t);
    let mut first = vec![u32::MAX; t.n_tracks()];
    for (row, &track) in t.tracks.iter().enumerate() {
        first[track as usize] = first[track as usize].min(frame_of[row]);
    }
    let ages: Vec<usize> = matched.iter().map(|m| (frame_of[m.0] - first[t.tracks[m.0] as usize]) as usize).collect();
    let (r_px2, q) = (model.measurement_var_px2, model.acceleration_density_px2_per_s3);
    let linear = LinearModel {
        transition: Matrix2::new(1.0, dt_s, 0.0, 1.0),
        process_noise: Matrix2::new(dt_s.powi(3) / 3.0, dt_s.powi(2) / 2.0, dt_s.powi(2) / 2.0, dt_s) * q,
        observation: Matrix1x2::new(1.0, 0.0),
        measurement_noise: Matrix1::new(r_px2),
        detection_probability: model.p_detection,
    };
    let start = Matrix2::new(UNKNOWN * r_px2, 0.0, 0.0, UNKNOWN * r_px2 / dt_s.powi(2));
    let bounds = pcrlb(&linear, &start, ages.iter().max().map_or(0, |a| a + 1))?;
    let sum: f64 = ages.iter().map(|&a| 2.0 * bounds[a][(0, 0)]).sum();
    Ok((sum / ages.len() as f64).sqrt())
}

/// Averages of the position NEES over several runs, frame by frame.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
#[non_exhaustive]
pub struct NeesOverRuns {
    /// Frame and average with its bounds, for frames that every run has a value for.
    pub frames: Vec<(u32, Consistency)>,
    /// Number of runs.
    pub n_runs: usize,
}

/// Averages over runs: sequences of the same scene drawn with other noise. No frames for a single run.
pub fn nees_over_runs<'a>(runs: impl Iterator<Item = &'a StateMeasures>) -> NeesOverRuns {
    let (mut by_frame, mut n_runs) = (BTreeMap::<u32, Vec<f64>>::new(), 0);
    for run in runs.filter(|r| r.nees.is_some()) {
        n_runs += 1;
        run.nees_by_frame.iter().for_each(|(f, v)| by_frame.entry(*f).or_default().push(*v));
    }
    let full = by_frame.into_iter().filter(|(_, v)| n_runs > 1 && v.len() >= n_runs);
    NeesOverRuns { frames: full.filter_map(|(f, v)| Some((f, average(&v, 2, LEVEL).ok()?))).collect(), n_runs }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::metrics::evaluation::{Evaluation, Matching};
    use crate::metrics::pcrlb::rmspe_without_prior;
    use crate::{FrameIndex, PixelOrigin, RowState, TrackRow, TrackTableBuilder};

    /// Points of one track: frame, x, y, and what they say of the state.
    fn table(rows: &[(u32, f64, f64, RowState)]) -> TrackTable {
        let mut b = TrackTableBuilder::new("t", PixelOrigin::Centre0);
        for &(frame, x, y, ref state) in rows {
            let row = TrackRow { frame, id: 1, bbox: [x - 2.0, y - 2.0, 4.0, 4.0], ..TrackRow::default() };
            b.push_with_state(&row, state).unwrap();
        }
        b.finish(0).unwrap()
    }

    fn moving(vx: f64, vy: f64) -> RowState {
        RowState { velocity: Some([vx, vy]), ..RowState::default() }
    }

    /// Covariance diag(4, 1, 16, 9) of `[x, vx, y, vy]`.
    const COV: [f64; 10] = [4.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 16.0, 0.0, 9.0];

    fn by_centres(t: &TrackTable, r: &TrackTable, scans: Option<&[Scan]>, o: &mut EvaluateOptions) -> Evaluation {
        o.matching = Matching::Centre;
        o.max_distance_px = 20.0;
        let mut s = Sequence::new(t, r);
        s.detections = scans;
        s.rate_hz = Some(1.0);
        s.evaluate(o).unwrap()
    }

    fn state(e: &Evaluation) -> &StateMeasures {
        e.optional.as_ref().unwrap().state.as_ref().unwrap()
    }

    #[test]
    fn errors_and_nees_are_those_of_a_hand_computed_pair_of_rows() {
        let truth = table(&[(0, 10.0, 20.0, moving(1.0, 2.0)), (1, 30.0, 40.0, moving(1.0, 2.0))]);
        let cov = RowState { velocity: Some([2.0, 5.0]), cov: Some(COV), ..RowState::default() };
        let result = table(&[(0, 12.0, 24.0, cov), (1, 26.0, 40.0, cov)]);
        let e = by_centres(&truth, &result, None, &mut EvaluateOptions::default());
        let s = state(&e);
        // Errors (−2, −1, −4, −3) and (4, −1, 0, −3).
        assert!((s.errors.rmspe - 18.0_f64.sqrt()).abs() < 1e-12 && (s.errors.rmsve - 10.0_f64.sqrt()).abs() < 1e-12);
        assert_eq!(s.rsspe, [(0, 20.0_f64.sqrt()), (1, 4.0)]);
        // 10² + 30² and 20² + 40².
        assert_eq!(s.norm2, [1000.0, 2000.0]);
        // Position NEES: 4/4 + 16/16 = 2 and 16/4 = 4; with the velocities 1/1 + 9/9 = 2 more.
        assert_eq!(s.nees_by_frame, [(0, 2.0), (1, 4.0)]);
        assert!((s.nees.unwrap().average - 3.0).abs() < 1e-12 && (s.nees4.unwrap().average - 5.0).abs() < 1e-12);
        assert_eq!((s.nees.unwrap().expected, s.nees4.unwrap().expected), (2.0, 4.0));
        // ±2σ: 4, 2, 8, 6.
        assert_eq!(s.bounded[1].bound, [4.0, 2.0, 8.0, 6.0]);
        assert_eq!(s.bounded[1].error, [4.0, -1.0, 0.0, -3.0]);
        // The mean square error is [[10, 4], [4, 8]]: NEES with it (by its inverse [[8, −4], [−4, 10]] / 64) are 2 each.
        let (index, inclination) = s.noncredibility.unwrap();
        let want = (0.0 + 10.0 * 2.0_f64.log10()) / 2.0;
        assert!((index - want).abs() < 1e-9 && (inclination - want).abs() < 1e-9, "{index} {inclination}");
    }

    #[test]
    fn a_table_without_velocities_or_covariances_has_position_errors_only() {
        let truth = table(&[(0, 10.0, 20.0, moving(1.0, 2.0))]);
        let result = table(&[(0, 13.0, 24.0, RowState::default())]);
        let e = by_centres(&truth, &result, None, &mut EvaluateOptions::default());
        let s = state(&e);
        assert!(!s.has_velocity && s.nees.is_none() && s.nees4.is_none() && s.bounded.is_empty() && s.nis.is_none());
        assert!((s.errors.rmspe - 5.0).abs() < 1e-12);
        assert!(s.values().iter().all(|v| v.name != "RMSVE"));
        let far = table(&[(0, 500.0, 24.0, RowState::default())]);
        assert!(by_centres(&truth, &far, None, &mut EvaluateOptions::default()).optional.unwrap().state.is_none());
    }

    #[test]
    fn the_nis_is_that_of_the_innovation_and_rows_without_a_detection_are_counted() {
        // One axis: P = 3, R = 1: gain 3/4, posterior 3/4. Innovation (2, 0) leaves the residual (0.5, 0); NIS 4 / (3 + 1).
        let updated = RowState { position_cov: Some([0.75, 0.0, 0.75]), detection: Some(0), ..RowState::default() };
        let lost = RowState { detection: Some(7), ..updated };
        let truth = table(&[(0, 10.0, 20.0, RowState::default()), (1, 10.0, 20.0, RowState::default())]);
        let result = table(&[(0, 10.0, 20.0, updated), (1, 10.0, 20.0, lost)]);
        let at = Vector2::new(10.5, 20.0);
        let scan = |k: u64, cov: Matrix2<f64>| Scan {
            index: FrameIndex(k),
            detections: vec![Detection { position: at, cov, ..detection() }],
            ..Scan::default()
        };
        let scans = [scan(0, Matrix2::identity()), scan(1, Matrix2::identity())];
        let mut o = EvaluateOptions::default();
        let e = by_centres(&truth, &result, Some(&scans), &mut o);
        assert!((state(&e).nis.unwrap().average - 1.0).abs() < 1e-12);
        assert!(e.notes.contains(&Note::NisRowsLeftOut(1)), "{:?}", e.notes);
        let mut seen_before = scans.clone();
        seen_before[0].detections[0].age_ns = 1;
        let e = by_centres(&truth, &result, Some(&seen_before), &mut o);
        assert!(state(&e).nis.is_none() && e.notes.contains(&Note::NisRowsLeftOut(2)), "{:?}", e.notes);
        // The same noise told as 0.84 of the detection and 0.4 px of the tracker.
        o.extra_noise_px = 0.4;
        let scans = [scan(0, Matrix2::identity() * 0.84)];
        let e = by_centres(&truth, &result, Some(&scans), &mut o);
        assert!((state(&e).nis.unwrap().average - 1.0).abs() < 1e-12);
        let bare = table(&[(0, 10.0, 20.0, RowState::default()), (1, 10.0, 20.0, RowState::default())]);
        assert!(by_centres(&truth, &bare, Some(&scans), &mut o).notes.contains(&Note::NoDetectionColumn));
    }

    fn detection() -> Detection {
        Detection::point(0.0, 0.0, 1.0)
    }

    #[test]
    fn the_bound_without_process_noise_is_that_of_a_straight_line_fit() {
        let rows: Vec<_> = (3..11).map(|k| (k, f64::from(k), 5.0, RowState::default())).collect();
        let (truth, result) = (table(&rows), table(&rows));
        let mut o = EvaluateOptions::default();
        o.bound = Some(BoundModel { measurement_var_px2: 0.5, acceleration_density_px2_per_s3: 0.0, p_detection: 1.0 });
        let e = by_centres(&truth, &result, None, &mut o);
        let bound = state(&e).bound_px.unwrap();
        // The line fit of 8 scans from the truth's first row on; prior knowledge of 1e9 variances counts for nothing.
        assert!((bound - rmspe_without_prior(0.5, 8)).abs() < 1e-6, "{bound}");
        o.bound = Some(BoundModel { p_detection: 0.5, ..o.bound.unwrap() });
        assert!(state(&by_centres(&truth, &result, None, &mut o)).bound_px.unwrap() > bound);
    }

    #[test]
    fn averages_over_runs_need_two_runs_and_a_value_of_each() {
        let run = |values: &[(u32, f64)]| StateMeasures {
            nees: average(&[2.0], 2, LEVEL).ok(),
            nees_by_frame: values.to_vec(),
            ..StateMeasures::default()
        };
        let (a, b) = (run(&[(0, 1.0), (1, 3.0)]), run(&[(1, 5.0), (2, 2.0)]));
        let over = nees_over_runs([&a, &b, &StateMeasures::default()].into_iter());
        assert_eq!(over.n_runs, 2);
        assert_eq!(over.frames.iter().map(|(f, c)| (*f, c.average, c.n)).collect::<Vec<_>>(), [(1, 4.0, 2)]);
        assert!(nees_over_runs([&a].into_iter()).frames.is_empty());
    }
}
