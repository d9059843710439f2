//! Thesis Figures 4.3 and 4.16-4.21: a gate among centroids; each fusion sensor's states and the fused trajectory.
//!
//! Source: captions of the thesis; reading F1 (unbiased independent sensors, `docs/theory/papers.md`) unless said. One
//! seeded run.
//! Units: px, px/scan, scans from 1; positions in the papers' world (from 1).

use super::follow::{GATE_99, StartAt, Tuning};
use super::item::{Figure, Line};
use super::scene_study::{READING_A, run_scene};
use super::sensor_fusion::{F1, F2, run, truth};
use boresight::Result;
use boresight::sim::Seed;
use boresight::sim::{PAPER_START, paper_scene};
use boresight_filters::model::ConstantVelocity;
use boresight_filters::{GaussianFilter, Kf, Measurement, Start};
use nalgebra::{Matrix2, Vector2, Vector4};

fn figure(caption: String, axes: [&str; 2], lines: Vec<Line>, sentence: &str) -> Figure {
    Figure { item: "figures", caption, axes: axes.map(String::from), lines, picture: None, sentence: sentence.into() }
}

fn over_scans(name: &str, states: &[Vector4<f64>], i: usize) -> Line {
    let points = states.iter().enumerate().map(|(k, s)| [k as f64 + 1.0, s[i]]).collect();
    Line { name: name.into(), points, marks: false }
}

/// Thesis Figure 4.3: the gate of one track among all centroids of a scan.
pub fn gate(seed: Seed) -> Result<Figure> {
    let scene = paper_scene(&[PAPER_START], (100.0, 10.0), (50.0, 50.0));
    let data = run_scene(&scene, seed, &[READING_A])?;
    let tuning = Tuning { r: 0.5, q: 1e-5, start: StartAt::KNOWN };
    let (belief, _) = tuning.belief(&[], &data.truth);
    let mut filter: Kf<_, 4> = Kf::start(ConstantVelocity::discrete(tuning.q.sqrt())?, belief)?;
    let r = Matrix2::identity() * tuning.r;
    let scans = data.centroids.first().map_or(&[][..], |s| s);
    for scan in scans.iter().take(9) {
        filter.predict(1.0)?;
        if let Some(i) = super::follow::nearest_gated(&filter.predicted(), &r, scan) {
            filter.correct(&Measurement { position: scan[i], cov: r })?;
        }
    }
    filter.predict(1.0)?;
    let p = filter.predicted();
    let root = (p.cov + r).cholesky().map_or(Matrix2::identity(), |c| c.l());
    let edge = (0..=60)
        .map(|i| {
            let a = std::f64::consts::TAU * f64::from(i) / 60.0;
            let q = p.mean + root * Vector2::new(a.cos(), a.sin()) * GATE_99.sqrt();
            [q.x, q.y]
        })
        .collect();
    let near = |z: &&Vector2<f64>| (*z - p.mean).amax() < 12.0;
    let marks = scans.get(9).into_iter().flatten().filter(near).map(|z| [z.x, z.y]).collect();
    let lines = vec![
        Line { name: "gate (99 %)".into(), points: edge, marks: false },
        Line { name: "centroids".into(), points: marks, marks: true },
        Line { name: "predicted".into(), points: vec![[p.mean.x, p.mean.y]], marks: true },
    ];
    Ok(figure(
        "Thesis Figure 4.3: gating, data set II, scan 10".into(),
        ["x, px", "y, px"],
        lines,
        "Of some 260 centroids in the frame hardly more than the target's own lies in the gate.",
    ))
}

/// Thesis Figures 4.16-4.21.
pub fn fusion_of_d1(seed: Seed) -> Result<Vec<Figure>> {
    let truth = truth();
    let mut out = Vec::new();
    for (loss, numbers) in [(false, ["4.16", "4.17", "4.18"]), (true, ["4.19", "4.20", "4.21"])] {
        let all = run(&F1, loss, seed, &truth)?;
        for (i, name) in ["imaging sensor", "ground radar"].into_iter().enumerate() {
            let lost = match (loss, i) {
                (false, _) => "",
                (true, 0) => ", no data in scans 15-25",
                (true, _) => ", no data in scans 30-45",
            };
            for (what, unit, at) in [("positions", "px", 0), ("velocities", "px/scan", 1)] {
                let lines = vec![
                    over_scans("true x = y", &truth, at),
                    over_scans("x", &all[i], at),
                    over_scans("y", &all[i], at + 2),
                ];
                let sentence = if loss { "Where there are no data the track is predicted on." } else { "Reading F1." };
                out.push(figure(
                    format!("Thesis Figure {}: {what} from the {name}{lost}", numbers[i]),
                    ["scan", unit],
                    lines,
                    sentence,
                ));
            }
        }
        let path = |name: &str, s: &[Vector4<f64>], marks| Line {
            name: name.into(),
            points: s.iter().map(|v| [v[0], v[2]]).collect(),
            marks,
        };
        let lines = vec![
            path("true", &truth, false),
            path("imaging", &all[0], true),
            path("radar", &all[1], true),
            path("fused", &all[2], true),
        ];
        let with = if loss { "with" } else { "without" };
        out.push(figure(
            format!("Thesis Figure {}: fused trajectory {with} measurement loss", numbers[2]),
            ["x, px", "y, px"],
            lines,
            "The fused track lies nearer the truth than either sensor's.",
        ));
    }
    for (name, sensors) in [("F1, unbiased", F1), ("F2, opposite biases", F2)] {
        for loss in [false, true] {
            let all = run(&sensors, loss, seed, &truth)?;
            let lines = ["imaging", "radar", "fused"]
                .iter()
                .zip(&all)
                .map(|(n, s)| {
                    let error = |(k, (t, e)): (usize, (&Vector4<f64>, &Vector4<f64>))| {
                        [k as f64 + 1.0, (t[0] - e[0]).hypot(t[2] - e[2])]
                    };
                    Line {
                        name: (*n).into(),
                        points: truth.iter().zip(s).enumerate().map(error).collect(),
                        marks: false,
                    }
                })
                .collect();
            let table = if loss { "4.4, with loss" } else { "4.3" };
            out.push(figure(
                format!("Position errors behind Thesis Table {table}, reading {name}"),
                ["scan", "px"],
                lines,
                "One run.",
            ));
        }
    }
    Ok(out)
}
