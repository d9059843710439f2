//! The captioned figures of Roopa et al., the thesis chapter, and Parimala and Raol, from one seeded run each.
//!
//! Source: captions of the thesis' Figures 4.5-4.14 (synthetic images, trajectories, states and errors, RSSPE and
//! RSSVE, errors and innovations with their bounds), Roopa et al., Figures 1 and 3, Parimala and Raol, Figure 1. Bounds
//! are two standard deviations of the filter's own covariance. Units: px, px/scan, scans from 1; positions in the
//! papers' world (from 1).

use super::follow::{StartAt, Tuning, nearest_gated};
use super::item::{Figure, Line, Output};
use super::scene_study::{READING_A, READING_B, READING_C, SceneRun, run_scene};
use super::study::{FilterKind, Job, Options, estimates};
use boresight::sim::Seed;
use boresight::sim::{PAPER_START, paper_scene};
use boresight::{FrameSource, Pixels, Result};
use boresight_filters::model::ConstantVelocity;
use boresight_filters::{GaussianFilter, Kf, Measurement, Start};
use nalgebra::{Matrix2, Vector4};

fn line(name: &str, values: impl Iterator<Item = f64>) -> Line {
    Line { name: name.into(), points: values.enumerate().map(|(k, v)| [k as f64 + 1.0, v]).collect(), marks: false }
}

fn over_scans(caption: String, unit: &str, lines: Vec<Line>, sentence: &str) -> Figure {
    Figure {
        item: "figures",
        caption,
        axes: ["scan".into(), unit.into()],
        lines,
        picture: None,
        sentence: sentence.into(),
    }
}

/// A run with everything the figures need.
struct Detail {
    run: SceneRun,
    estimates: Vec<Vector4<f64>>,
    /// Two standard deviations of the state.
    bounds: Vec<Vector4<f64>>,
    /// Innovation and two standard deviations, per axis; none in a scan without a measurement.
    innovations: Vec<[Option<[f64; 2]>; 2]>,
}

fn detail(target_std: f64, background_std: f64, seed: Seed) -> Result<Detail> {
    let scene = paper_scene(&[PAPER_START], (100.0, target_std), (50.0, background_std));
    let run = run_scene(&scene, seed, &[READING_A])?;
    let tuning = Tuning { r: 0.5, q: 1e-5, start: StartAt::KNOWN };
    let (belief, _) = tuning.belief(&[], &run.truth);
    let mut filter: Kf<_, 4> = Kf::start(ConstantVelocity::discrete(tuning.q.sqrt())?, belief)?;
    let cov = Matrix2::identity() * tuning.r;
    let (mut estimates, mut bounds, mut innovations) = (Vec::new(), Vec::new(), Vec::new());
    for scan in &run.centroids[0] {
        filter.predict(1.0)?;
        let predicted = filter.predicted();
        let taken = nearest_gated(&predicted, &cov, scan).map(|i| scan[i]);
        innovations.push(
            [0, 1].map(|i| taken.map(|z| [z[i] - predicted.mean[i], 2.0 * (predicted.cov[(i, i)] + tuning.r).sqrt()])),
        );
        if let Some(position) = taken {
            filter.correct(&Measurement { position, cov })?;
        }
        let b = filter.belief();
        estimates.push(b.mean);
        bounds.push(b.cov.diagonal().map(|v| 2.0 * v.max(0.0).sqrt()));
    }
    Ok(Detail { run, estimates, bounds, innovations })
}

fn picture(number: &str, what: &str, target_std: f64, background_std: f64, seed: Seed) -> Result<Figure> {
    let mut source = paper_scene(&[PAPER_START], (100.0, target_std), (50.0, background_std)).build(seed)?;
    let mut last = None;
    for _ in 0..25 {
        last = source.next_frame()?.or(last);
    }
    let picture = match last.map(|f| f.pixels) {
        Some(Pixels::Gray8(i)) => Some((i.width(), i.height(), i.into_vec())),
        _ => None,
    };
    Ok(Figure {
        item: "figures",
        caption: format!("Thesis Figure {number}: synthetic image of {what}, scan 25"),
        axes: ["x, px".into(), "y, px".into()],
        lines: Vec::new(),
        picture,
        sentence: "Target pixels replace the background; N(m, s) are standard deviations.".into(),
    })
}

fn trajectory(caption: String, truth: &[Vector4<f64>], others: &[(&str, &[Vector4<f64>])], sentence: &str) -> Figure {
    let path = |name: &str, s: &[Vector4<f64>], marks| Line {
        name: name.into(),
        points: s.iter().map(|v| [v[0], v[2]]).collect(),
        marks,
    };
    let mut lines = vec![path("true", truth, false)];
    lines.extend(others.iter().map(|(name, s)| path(name, s, true)));
    Figure {
        item: "figures",
        caption,
        axes: ["x, px".into(), "y, px".into()],
        lines,
        picture: None,
        sentence: sentence.into(),
    }
}

fn pair(d: &Detail, first: usize, numbers: &str, what: &str, unit: &str) -> Vec<Figure> {
    [(first, "x"), (first + 2, "y")]
        .into_iter()
        .map(|(i, axis)| {
            let error = |sign: f64| line(if sign > 0.0 { "+2σ" } else { "−2σ" }, d.bounds.iter().map(move |b| sign * b[i]));
            let lines = vec![line("error", d.run.truth.iter().zip(&d.estimates).map(|(t, e)| t[i] - e[i])), error(1.0), error(-1.0)];
            over_scans(format!("Thesis Figure {numbers}: error of the {axis}-{what} with its theoretical bounds"), unit, lines, "The errors stay well inside the bounds: R = 0.5 px² is larger than the centroids' true variance of 0.1 px².")
        })
        .collect()
}

fn states(d: &Detail, i: usize, number: &str, what: &str, unit: &str) -> Figure {
    let of = |name: &str, s: &[Vector4<f64>], i: usize| line(name, s.iter().map(|v| v[i]));
    let lines = vec![
        of("true x = y", &d.run.truth, i),
        of("estimated x", &d.estimates, i),
        of("estimated y", &d.estimates, i + 2),
    ];
    over_scans(
        format!("Thesis Figure {number}: true and estimated {what}, data set II"),
        unit,
        lines,
        "The start is known.",
    )
}

/// Makes all figures.
pub fn figures(options: &Options<'_>) -> Result<Output> {
    let seed = Seed::new(options.seed);
    let (one, two) = (detail(0.0, 0.0, seed)?, detail(10.0, 50.0, seed)?);
    let mut figures = vec![
        super::figures_fusion::gate(seed)?,
        picture("4.5", "data set I", 0.0, 0.0, seed)?,
        trajectory(
            "Thesis Figure 4.6: trajectory, data set I".into(),
            &one.run.truth,
            &[("estimated", &one.estimates)],
            "Estimates lie on the truth.",
        ),
        over_scans(
            "Thesis Figure 4.7: errors of position, data set I".into(),
            "px",
            vec![
                line("x", one.run.truth.iter().zip(&one.estimates).map(|(t, e)| t[0] - e[0])),
                line("y", one.run.truth.iter().zip(&one.estimates).map(|(t, e)| t[2] - e[2])),
            ],
            "All errors are exactly zero.",
        ),
        picture("4.8", "data set II", 10.0, 50.0, seed)?,
        trajectory(
            "Thesis Figure 4.9: trajectory, data set II".into(),
            &two.run.truth,
            &[("estimated", &two.estimates)],
            "The target is held in every scan.",
        ),
    ];
    figures.push(states(&two, 0, "4.10", "positions", "px"));
    figures.extend(pair(&two, 0, "4.10, 4.13", "position", "px"));
    figures.push(states(&two, 1, "4.11", "velocities", "px/scan"));
    figures.extend(pair(&two, 1, "4.11, 4.13", "velocity", "px/scan"));
    let root =
        |i: usize| two.run.truth.iter().zip(&two.estimates).map(move |(t, e)| (t[i] - e[i]).hypot(t[i + 2] - e[i + 2]));
    figures.push(over_scans(
        "Thesis Figure 4.12: root sum square errors of position and velocity, data set II".into(),
        "px, px/scan",
        vec![line("RSSPE", root(0)), line("RSSVE", root(1))],
        "Below 1 px and 0.4 px/scan throughout, as the text says; with tunings that match Table 4.2 this holds in at most 5 % of runs.",
    ));
    for (i, axis) in ["x", "y"].into_iter().enumerate() {
        let of = |f: &dyn Fn([f64; 2]) -> f64| -> Vec<[f64; 2]> {
            two.innovations.iter().enumerate().filter_map(|(k, v)| v[i].map(|v| [k as f64 + 1.0, f(v)])).collect()
        };
        let line = |name: &str, points| Line { name: name.into(), points, marks: false };
        figures.push(over_scans(
            format!("Thesis Figure 4.14: innovations of {axis} with their bounds, data set II"),
            "px",
            vec![line("innovation", of(&|v| v[0])), line("+2σ", of(&|v| v[1])), line("−2σ", of(&|v| -v[1]))],
            "Far fewer than 5 % lie outside: the filter is cautious.",
        ));
    }
    figures.extend(tracking_of_d0(seed)?);
    figures.extend(super::figures_fusion::fusion_of_d1(seed)?);
    figures.push(fusion_of_d3(seed)?);
    Ok(Output { figures, ..Output::default() })
}

fn tracking_of_d0(seed: Seed) -> Result<Vec<Figure>> {
    let scene = paper_scene(&[PAPER_START], (100.0, 1.0), (50.0, 50.0));
    let run = run_scene(&scene, seed, &[READING_B])?;
    let tuning = Tuning { r: 0.5, q: 5e-4, start: StartAt::TwoPoints };
    let job = Job { reading: READING_B, tuning, filter: FilterKind::Ud };
    let e = estimates(&job, &run.centroids[0], &run.truth)?;
    let root = |i: usize| run.truth.iter().zip(&e).map(move |(t, e)| (t[i] - e[i]).hypot(t[i + 2] - e[i + 2]));
    let errors = vec![line("position", root(0)), line("velocity", root(1))];
    Ok(vec![
        trajectory(
            "Roopa et al. 2016, Figure 1: tracking of the centroid, CTUDF, Vn = 1".into(),
            &run.truth,
            &[("estimated", &e)],
            "One run of reading B.",
        ),
        over_scans(
            "Roopa et al. 2016, Figure 3: errors of position and velocity, CTUDF, Vn = 1".into(),
            "px, px/scan",
            errors,
            "The velocity settles after the two-point start.",
        ),
    ])
}

fn fusion_of_d3(seed: Seed) -> Result<Figure> {
    let tuning = Tuning { r: 0.5, q: 1e-5, start: StartAt::KNOWN };
    let scene = |std| paper_scene(&[PAPER_START], (100.0, std), (50.0, 100.0));
    let a = run_scene(&scene(1.0), seed, &[READING_C])?;
    let b = run_scene(&scene(5.0), seed.of_run(1), &[READING_C])?;
    let root = |e: &[Vector4<f64>]| -> Vec<f64> {
        a.truth.iter().zip(e).map(|(t, e)| (t[0] - e[0]).hypot(t[2] - e[2])).collect()
    };
    let mut lines = Vec::new();
    for (name, data, filter) in [
        ("sensor 1, CTSRIF", &a, FilterKind::Srif),
        ("sensor 1, CTFSRIF", &a, FilterKind::FuzzySrif),
        ("sensor 2, CTSRIF", &b, FilterKind::Srif),
    ] {
        let job = Job { reading: READING_C, tuning, filter };
        lines.push(line(name, root(&estimates(&job, &data.centroids[0], &data.truth)?).into_iter()));
    }
    lines.push(line("fused, CTSRIF", root(&super::srif::follow_both(&a, &b)?).into_iter()));
    Ok(over_scans(
        "Parimala and Raol, Figure 1: measurement-level fusion, position errors".into(),
        "px",
        lines,
        "One run of reading C, independent sensors.",
    ))
}
