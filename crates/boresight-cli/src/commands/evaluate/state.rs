//! Errors of the estimated states against the truth, and whether their stated covariances are true.
//!
//! Rows are matched frame by frame as for the detection measures. Positions are the rows' centres, velocities and
//! covariances come from the columns of boresight's `tracks.csv` where both tables, or the result, have them.

use super::Args;
use super::measures::centre;
use super::sequences::Sequence;
use boresight::io::{TableOptions, read_detections};
use boresight::metrics::MatchOptions;
use boresight::metrics::consistency::{Consistency, average, nis_of_residual, noncredibility, normalised_square};
use boresight::metrics::detection::match_rows;
use boresight::metrics::pcrlb::{LinearModel, pcrlb};
use boresight::metrics::state::{
    BoundedError, StateErrors, bounded_errors, root_sum_square, share_within, state_errors,
};
use boresight::{Result, TrackTable};
use nalgebra::{Matrix1, Matrix1x2, Matrix2, Matrix4, Vector2, Vector4};
use std::collections::BTreeMap;

/// Probability of the bounds of averages.
const LEVEL: f64 = 0.95;

/// State measures of a sequence.
#[derive(Clone, Debug, Default, serde::Serialize)]
pub struct StateScores {
    pub errors: StateErrors,
    pub has_velocity: bool,
    /// Root mean over the frame's matched rows of the squared position error, px, by frame.
    pub rsspe: Vec<(u32, f64)>,
    /// Errors of `[x, vx, y, vy]` beside ±2σ, where the result states variances.
    pub bounded: Vec<BoundedError>,
    /// NEES of the position (2 degrees of freedom).
    pub nees: Option<Consistency>,
    /// NEES of the whole state (4 degrees of freedom).
    pub nees4: Option<Consistency>,
    /// Noncredibility index and inclination of the position.
    pub noncredibility: Option<(f64, f64)>,
    pub nis: Option<Consistency>,
    /// Least RMSPE that the model of `--bound` allows, px.
    pub bound_px: Option<f64>,
    /// Position NEES of single rows, by frame.
    pub nees_by_frame: Vec<(u32, f64)>,
}

/// A column of a table as numbers; `None` if it is not there.
fn column(t: &TrackTable, name: &str) -> Option<Vec<f64>> {
    let values = &t.extra.iter().find(|e| e.0 == name)?.1;
    Some(values.iter().map(|v| v.parse().unwrap_or(f64::NAN)).collect())
}

const COV: [&str; 10] = [
    "var_x_px2",
    "cov_x_vx_px2_per_s",
    "cov_x_y_px2",
    "cov_x_vy_px2_per_s",
    "var_vx_px2_per_s2",
    "cov_vx_y_px2_per_s",
    "cov_vx_vy_px2_per_s2",
    "var_y_px2",
    "cov_y_vy_px2_per_s",
    "var_vy_px2_per_s2",
];

/// Velocities and covariances of a table's rows.
struct States {
    velocity: Option<[Vec<f64>; 2]>,
    position_cov: Option<[Vec<f64>; 3]>,
    cov: Option<Vec<Vec<f64>>>,
}

impl States {
    fn of(t: &TrackTable) -> Self {
        let both = |a: Option<Vec<f64>>, b| Some([a?, b?]);
        let p = [COV[0], COV[2], COV[7]].map(|n| column(t, n));
        let [a, b, c] = p;
        Self {
            velocity: both(column(t, "vx_px_per_s"), column(t, "vy_px_per_s")),
            position_cov: a.zip(b).zip(c).map(|((a, b), c)| [a, b, c]),
            cov: COV.iter().map(|n| column(t, n)).collect(),
        }
    }
    /// `[x, vx, y, vy]`, velocities 0 where unknown.
    fn state(&self, t: &TrackTable, r: usize) -> [f64; 4] {
        let [x, y] = centre(t, r);
        let v = self.velocity.as_ref().map_or([0.0; 2], |v| [v[0][r], v[1][r]]);
        [x, v[0], y, v[1]]
    }
    fn position_cov(&self, r: usize) -> Option<Matrix2<f64>> {
        let [a, b, c] = self.position_cov.as_ref()?;
        Some(Matrix2::new(a[r], b[r], b[r], c[r]))
    }
    fn cov(&self, r: usize) -> Option<Matrix4<f64>> {
        let all = self.cov.as_ref()?;
        let (mut m, mut k) = (Matrix4::zeros(), 0);
        for i in 0..4 {
            for j in i..4 {
                m[(i, j)] = all[k][r];
                m[(j, i)] = all[k][r];
                k += 1;
            }
        }
        Some(m)
    }
}

/// Computes the state measures; `None` if nothing matches.
/// # Errors
/// A table of detections that cannot be read; a model without meaning.
pub fn state(
    args: &Args,
    s: &Sequence,
    t: &TrackTable,
    r: &TrackTable,
    options: &MatchOptions,
    rate_hz: Option<f64>,
    notes: &mut Vec<String>,
) -> Result<Option<StateScores>> {
    let mut matched = Vec::new();
    match_rows(t, r, options, |i, k| matched.push((i, k)));
    if matched.is_empty() {
        return Ok(None);
    }
    let (of_truth, of_result) = (States::of(t), States::of(r));
    let truth: Vec<_> = matched.iter().map(|m| of_truth.state(t, m.0)).collect();
    let result: Vec<_> = matched.iter().map(|m| of_result.state(r, m.1)).collect();
    let mut out = StateScores {
        errors: state_errors(&truth, &result)?,
        has_velocity: of_truth.velocity.is_some() && of_result.velocity.is_some(),
        ..StateScores::default()
    };
    let frame_of = frames(t);
    let squares: Vec<f64> = root_sum_square(&truth, &result)?.iter().map(|e| e[0] * e[0]).collect();
    let frame_numbers: Vec<u32> = matched.iter().map(|m| frame_of[m.0]).collect();
    out.rsspe = mean_by_frame(&frame_numbers, &squares).into_iter().map(|(f, v)| (f, v.sqrt())).collect();
    consistency(&mut out, &of_result, &matched, &truth, &result, &frame_numbers)?;
    let place = args.detections.as_ref().map(|p| p.replace("{seq}", &s.name));
    if let Some(path) = place {
        out.nis = nis(r, &of_result, &path, args.extra_noise, notes)?;
    }
    if let Some(model) = args.bound {
        out.bound_px = Some(bound(model, t, &matched, 1.0 / rate_hz.unwrap_or(25.0))?);
    }
    Ok(Some(out))
}

fn frames(t: &TrackTable) -> Vec<u32> {
    let mut out = vec![0; t.n_rows()];
    for frame in 0..t.n_frames() {
        out[t.rows(frame)].fill(frame as u32);
    }
    out
}

fn mean_by_frame(frames: &[u32], values: &[f64]) -> BTreeMap<u32, f64> {
    let mut sums: BTreeMap<u32, (f64, f64)> = BTreeMap::new();
    for (f, v) in frames.iter().zip(values) {
        let s = sums.entry(*f).or_default();
        *s = (s.0 + v, s.1 + 1.0);
    }
    sums.into_iter().map(|(f, (sum, n))| (f, sum / n)).collect()
}

fn consistency(
    out: &mut StateScores,
    states: &States,
    matched: &[(usize, usize)],
    truth: &[[f64; 4]],
    result: &[[f64; 4]],
    frames: &[u32],
) -> Result<()> {
    let (mut nees, mut nees4, mut errors) = (Vec::new(), Vec::new(), Vec::new());
    for (k, m) in matched.iter().enumerate() {
        let (a, b) = (truth[k], result[k]);
        if let Some(p) = states.position_cov(m.1) {
            let e = Vector2::new(a[0] - b[0], a[2] - b[2]);
            if let Ok(v) = normalised_square(&e, &p) {
                nees.push(v);
                errors.push(e);
                out.nees_by_frame.push((frames[k], v));
            }
        }
        if let (true, Some(p)) = (out.has_velocity, states.cov(m.1)) {
            let e = Vector4::from_fn(|i, _| a[i] - b[i]);
            nees4.extend(normalised_square(&e, &p));
        }
    }
    if nees.is_empty() {
        return Ok(());
    }
    out.nees = Some(average(&nees, 2, LEVEL)?);
    let mse = errors.iter().map(|e| e * e.transpose()).sum::<Matrix2<f64>>() / errors.len() as f64;
    let ideal: Vec<f64> = errors.iter().filter_map(|e| normalised_square(e, &mse).ok()).collect();
    // Errors of exactly 0 have no logarithm; they say nothing of credibility.
    let both: Vec<(f64, f64)> = nees.iter().copied().zip(ideal).filter(|(a, b)| *a > 0.0 && *b > 0.0).collect();
    let (a, b): (Vec<f64>, Vec<f64>) = both.into_iter().unzip();
    out.noncredibility = noncredibility(&a, &b).ok();
    if !nees4.is_empty() {
        out.nees4 = Some(average(&nees4, 4, LEVEL)?);
    }
    if let Some(all) = &states.cov {
        let variance: Vec<_> = matched.iter().map(|m| [0, 4, 7, 9].map(|k| all[k][m.1])).collect();
        out.bounded = bounded_errors(truth, result, &variance, 2.0)?;
    }
    Ok(())
}

/// NIS of the rows that name the detection which updated them.
fn nis(
    r: &TrackTable,
    states: &States,
    path: &str,
    extra_noise_px: f64,
    notes: &mut Vec<String>,
) -> Result<Option<Consistency>> {
    let Some(taken) = column(r, "detection") else {
        notes.push("NIS needs the column detection of boresight's tracks.csv".to_string());
        return Ok(None);
    };
    let table = read_detections(path, &TableOptions::default())?;
    let scans: BTreeMap<u64, _> = table.scans.iter().map(|s| (s.index.0, s)).collect();
    let (mut values, mut n_left_out) = (Vec::new(), 0_u64);
    for frame in 0..r.n_frames() {
        for row in r.rows(frame).filter(|&row| taken[row] >= 0.0) {
            let detection = scans.get(&(frame as u64)).and_then(|s| s.detections.get(taken[row] as usize));
            let (Some(d), Some(p)) = (detection, states.position_cov(row)) else {
                n_left_out += 1;
                continue;
            };
            let [x, y] = centre(r, row);
            let noise = d.cov + Matrix2::identity() * extra_noise_px.powi(2);
            match nis_of_residual(&(d.position - Vector2::new(x, y)), &noise, &p) {
                Ok(v) => values.push(v),
                Err(_) => n_left_out += 1,
            }
        }
    }
    if n_left_out > 0 {
        notes.push(format!(
            "NIS leaves out {n_left_out} rows: no such detection in {path}, or a state no better known than its detection"
        ));
    }
    if values.is_empty() { Ok(None) } else { average(&values, 2, LEVEL).map(Some) }
}

/// Least RMSPE over the matched rows, px: each truth is seen from its first row on, without prior knowledge.
fn bound([r_px2, q, p_d]: [f64; 3], t: &TrackTable, matched: &[(usize, usize)], dt_s: f64) -> Result<f64> {
    let frame_of = frames(t);
    let mut born = vec![u32::MAX; t.n_tracks()];
    for (row, &track) in t.tracks.iter().enumerate() {
        born[track as usize] = born[track as usize].min(frame_of[row]);
    }
    let ages: Vec<usize> = matched.iter().map(|m| (frame_of[m.0] - born[t.tracks[m.0] as usize]) as usize).collect();
    let model = LinearModel {
        transition: Matrix2::new(1.0, dt_s, 0.0, 1.0),
        process_noise: Matrix2::new(dt_s.powi(3) / 3.0, dt_s.powi(2) / 2.0, dt_s.powi(2) / 2.0, dt_s) * q,
        observation: Matrix1x2::new(1.0, 0.0),
        measurement_noise: Matrix1::new(r_px2),
        detection_probability: p_d,
    };
    // Nothing known before: a billion times the variance of a measurement.
    let start = Matrix2::new(1e9 * r_px2, 0.0, 0.0, 1e9 * r_px2 / dt_s.powi(2));
    let bounds = pcrlb(&model, &start, ages.iter().max().map_or(0, |a| a + 1))?;
    let sum: f64 = ages.iter().map(|&a| 2.0 * bounds[a][(0, 0)]).sum();
    Ok((sum / ages.len() as f64).sqrt())
}

fn sentence(what: &str, c: &Consistency) -> String {
    format!(
        "{what} {:.3} over {} values, expected {} within {:.3} to {:.3} (95 %): {}",
        c.average,
        c.n,
        c.expected,
        c.lower,
        c.upper,
        c.verdict()
    )
}

impl StateScores {
    /// The measures by name.
    pub fn values(&self) -> Vec<(&'static str, f64)> {
        let e = &self.errors;
        let mut v = vec![("PFE_x", e.pfe_x), ("PFE_y", e.pfe_y), ("RMSPE", e.rmspe), ("RMSPE/2", e.rmspe_halved)];
        if self.has_velocity {
            v.extend([("RMSVE", e.rmsve), ("RMSVE/2", e.rmsve_halved)]);
        }
        if let Some(bound) = self.bound_px {
            v.extend([("bound", bound), ("RMSPE/bound", e.rmspe / bound)]);
        }
        if !self.bounded.is_empty() {
            let within = share_within(&self.bounded);
            v.extend([("x_in_2s", within[0]), ("y_in_2s", within[2])]);
        }
        for (names, c) in [
            (["ANEES", "ANEES_lower", "ANEES_upper"], &self.nees),
            (["ANEES4", "ANEES4_lower", "ANEES4_upper"], &self.nees4),
            (["ANIS", "ANIS_lower", "ANIS_upper"], &self.nis),
        ] {
            if let Some(c) = c {
                v.extend(names.into_iter().zip([c.average, c.lower, c.upper]));
            }
        }
        if let Some((index, inclination)) = self.noncredibility {
            v.extend([("NCI", index), ("inclination", inclination)]);
        }
        v
    }

    /// What the consistency tests say.
    pub fn sentences(&self) -> Vec<String> {
        let tests = [("position NEES", &self.nees), ("state NEES", &self.nees4), ("NIS", &self.nis)];
        tests.into_iter().filter_map(|(name, c)| c.as_ref().map(|c| sentence(name, c))).collect()
    }
}

/// Averages of the position NEES over several runs, frame by frame.
#[derive(Debug, Default, serde::Serialize)]
pub struct OverRuns {
    /// Frame and average with its bounds, for frames that every run has a value for.
    pub frames: Vec<(u32, Consistency)>,
    pub n_runs: usize,
}

/// Averages over runs: sequences of the same scene drawn with other noise.
pub fn over_runs<'a>(runs: impl Iterator<Item = &'a StateScores>) -> OverRuns {
    let (mut by_frame, mut n_runs) = (BTreeMap::<u32, Vec<f64>>::new(), 0);
    for run in runs.filter(|r| r.nees.is_some()) {
        n_runs += 1;
        run.nees_by_frame.iter().for_each(|(f, v)| by_frame.entry(*f).or_default().push(*v));
    }
    let full = by_frame.into_iter().filter(|(_, v)| n_runs > 1 && v.len() >= n_runs);
    OverRuns { frames: full.filter_map(|(f, v)| Some((f, average(&v, 2, LEVEL).ok()?))).collect(), n_runs }
}

impl OverRuns {
    /// What the averages say, if there are any.
    pub fn sentence(&self) -> Option<String> {
        if self.frames.is_empty() {
            return None;
        }
        let inside = self.frames.iter().filter(|(_, c)| c.is_credible()).count();
        let share = 100.0 * inside as f64 / self.frames.len() as f64;
        Some(format!(
            "position NEES over {} runs: {inside} of {} frames ({share:.1} %) within their 95 % bounds",
            self.n_runs,
            self.frames.len()
        ))
    }
}
