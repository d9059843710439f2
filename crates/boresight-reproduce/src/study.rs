//! A Monte Carlo study: one scene, many runs on all cores, many (reading, tuning, filter) jobs on the same frames.
//!
//! Runs are independent and seeded by their number; results are gathered in the order of the runs, so that sums do not depend
//! on the number of threads. Only the four numbers of a run are kept. A run is lost if it ends more than 5 px off the truth;
//! lost runs are counted and left out of the means, as in the reference's tables.

use super::follow::{Tuning, follow};
use super::scene_study::{Reading, run_scene};
use super::score::{four_numbers, lost};
use boresight::Result;
use boresight::sim::{SceneConfig, Seed};
use boresight_filters::model::ConstantVelocity;
use boresight_filters::{FuzzySrif, Gaussian, Kf, Srif, Start, Ud};
use nalgebra::{Vector2, Vector4};
use rayon::prelude::*;

/// A run that ends farther off than this is lost, px.
pub const LOST_PX: f64 = 5.0;

/// How much is computed.
#[derive(Clone, Copy)]
pub struct Options<'a> {
    /// Monte Carlo runs of each study.
    pub runs: u64,
    /// Seed of all studies.
    pub seed: u64,
    /// Called after each finished run of a study (from any thread), for a progress bar.
    pub progress: &'a (dyn Fn(u64) + Sync),
}

/// The filter of a job.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FilterKind {
    /// Kalman filter (NNKF).
    Kf,
    /// U-D filter (CTUDF).
    Ud,
    /// Square-root information filter (CTSRIF).
    Srif,
    /// The same with the fuzzy-logic correlator (CTFSRIF).
    FuzzySrif,
}

/// One way to follow the target of a scene.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Job {
    /// How frames are read.
    pub reading: Reading,
    /// R, q, start.
    pub tuning: Tuning,
    /// The filter.
    pub filter: FilterKind,
}

/// What a job gave: the four numbers of every run that was not lost, in order.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Outcome {
    /// PFE_x, PFE_y, RMSPE, RMSVE of each run kept.
    pub values: Vec<[f64; 4]>,
    /// Runs lost.
    pub lost: usize,
    /// Largest position and velocity error over the scans of each run kept.
    pub peaks: Vec<[f64; 2]>,
}

impl Outcome {
    /// Column `i` of the values.
    pub fn column(&self, i: usize) -> Vec<f64> {
        self.values.iter().map(|v| v[i]).collect()
    }

    /// Gathers runs in order.
    pub fn gather<'a>(runs: impl Iterator<Item = &'a Scored>) -> Self {
        let mut out = Self::default();
        for r in runs {
            if r.lost {
                out.lost += 1;
            } else {
                out.values.push(r.values);
                out.peaks.push(r.peaks);
            }
        }
        out
    }
}

/// The numbers of one run.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scored {
    /// PFE_x, PFE_y, RMSPE, RMSVE.
    pub values: [f64; 4],
    /// Largest position and velocity error.
    pub peaks: [f64; 2],
    /// Ended off the target.
    pub lost: bool,
}

impl Scored {
    /// Scores the estimates of a run.
    pub fn new(truth: &[Vector4<f64>], estimates: &[Vector4<f64>]) -> Self {
        let peak = |i: usize| {
            truth.iter().zip(estimates).map(|(t, e)| (t[i] - e[i]).hypot(t[i + 2] - e[i + 2])).fold(0.0, f64::max)
        };
        Self {
            values: four_numbers(truth, estimates),
            peaks: [peak(0), peak(1)],
            lost: lost(truth, estimates, LOST_PX),
        }
    }
}

/// Follows the target of one run with the job's filter.
/// # Errors
/// A filter that refuses a step.
pub fn estimates(job: &Job, scans: &[Vec<Vector2<f64>>], truth: &[Vector4<f64>]) -> Result<Vec<Vector4<f64>>> {
    let model = ConstantVelocity::discrete(job.tuning.q.sqrt())?;
    let all = |_| false;
    match job.filter {
        FilterKind::Kf => follow(|b: Gaussian<4>| Ok(Kf::<_, 4>::start(model, b)?), &job.tuning, scans, truth, all),
        FilterKind::Srif => follow(|b: Gaussian<4>| Ok(Srif::<_, 4>::start(model, b)?), &job.tuning, scans, truth, all),
        FilterKind::FuzzySrif => {
            follow(|b: Gaussian<4>| Ok(<FuzzySrif<_, 4>>::start(model, b)?), &job.tuning, scans, truth, all)
        }
        FilterKind::Ud => follow(|b: Gaussian<4>| Ok(Ud::<_, 4>::start(model, b)?), &job.tuning, scans, truth, all),
    }
}

/// Runs a scene `options.runs` times and does all jobs on each run.
/// # Errors
/// A scene or a filter that refuses.
pub fn study(scene: &SceneConfig, options: &Options<'_>, jobs: &[Job]) -> Result<Vec<Outcome>> {
    let mut readings: Vec<Reading> = Vec::new();
    for job in jobs {
        if !readings.contains(&job.reading) {
            readings.push(job.reading);
        }
    }
    let runs = monte_carlo(options, |run| {
        let data = run_scene(scene, Seed::new(options.seed).of_run(run), &readings)?;
        jobs.iter()
            .map(|job| {
                let at = readings.iter().position(|r| *r == job.reading).unwrap_or(0);
                Ok(Scored::new(&data.truth, &estimates(job, &data.centroids[at], &data.truth)?))
            })
            .collect::<Result<Vec<_>>>()
    })?;
    Ok((0..jobs.len()).map(|j| Outcome::gather(runs.iter().map(|r| &r[j]))).collect())
}

/// Does `one` for each run on all cores; results come in the order of the runs.
/// # Errors
/// The first run that fails.
pub fn monte_carlo<T: Send>(options: &Options<'_>, one: impl Fn(u64) -> Result<T> + Sync) -> Result<Vec<T>> {
    (0..options.runs)
        .into_par_iter()
        .map(|run| {
            let out = one(run);
            (options.progress)(1);
            out
        })
        .collect()
}
