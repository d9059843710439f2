//! Why square roots: the same f32 arithmetic, P0 = 1e6, R = 1e-6, 200 steps; each form against f64
//! (docs/theory/filters.md).
//!
//! Writes the plot `f32_roots.svg` to the folder given (default: the current one).
//! Run: `cargo run -p boresight-filters --example f32_roots -- docs/images`

use boresight_filters::model::{ConstantVelocity, Dense};
use boresight_filters::{
    CovarianceForm, FilterError, Gaussian, GaussianFilter, Information, Kf, Measurement, SquareRoot, Srif, Start, Ud,
};
use nalgebra::{Matrix4, Vector4};
use std::fmt::Write as _;

const STEPS: usize = 200;
type Cv = Dense<ConstantVelocity<f32>>;

/// Relative error of the worst variance at each step, and whether a covariance was not positive definite.
fn errors<F: GaussianFilter<4, Real = f32>>(mut filter: F, truth: &[[f64; 4]]) -> (Vec<f64>, bool) {
    let mut broken = false;
    let z = Measurement::isotropic(0.0, 0.0, 1e-3);
    let errors = truth
        .iter()
        .map(|truth| {
            // A refused step leaves the filter as it was: it counts as broken, and the error is shown as it stands.
            broken |= filter.predict(1.0).is_err() || filter.correct(&z).is_err();
            let cov = filter.belief().cov.cast::<f64>();
            broken |= cov.cholesky().is_none();
            (0..4).map(|i| (cov[(i, i)] - truth[i]).abs() / truth[i]).fold(0.0, f64::max)
        })
        .collect();
    (errors, broken)
}

fn start() -> Gaussian<4> {
    Gaussian { mean: Vector4::zeros(), cov: Matrix4::identity() * 1e6 }
}

fn main() -> Result<(), FilterError> {
    let model64 = ConstantVelocity::discrete(0.0_f64)?;
    let mut reference = Ud::start(model64, start())?;
    let mut truth = Vec::new();
    for _ in 0..STEPS {
        reference.predict(1.0)?;
        reference.correct(&Measurement::isotropic(0.0, 0.0, 1e-3))?;
        truth.push(std::array::from_fn(|i| reference.belief().cov[(i, i)]));
    }
    let (model, b) = (Dense(ConstantVelocity::<f32>::discrete(0.0)?), start().cast::<f32>());
    let kf = Kf::<Cv, 4, f32>::start(model, b)?;
    let runs = [
        ("short form", "#c0392b", errors(kf.with_form(CovarianceForm::Short), &truth)),
        ("Joseph", "#e67e22", errors(kf, &truth)),
        ("information", "#8e44ad", errors(Information::<Cv, 4, f32>::start(model, b)?, &truth)),
        ("square root", "#16a085", errors(SquareRoot::<Cv, 4, f32>::start(model, b)?, &truth)),
        ("U-D", "#2980b9", errors(Ud::<Cv, 4, f32>::start(model, b)?, &truth)),
        ("SRIF", "#2c3e50", errors(Srif::<Cv, 4, f32>::start(model, b)?, &truth)),
    ];
    println!("| form (f32) | worst relative error of a variance | at step 200 | always positive definite |");
    println!("| --- | --- | --- | --- |");
    for (name, _, (e, broken)) in &runs {
        let worst = e.iter().copied().fold(0.0, f64::max);
        println!("| {name} | {worst:.1e} | {:.1e} | {} |", e[STEPS - 1], if *broken { "no" } else { "yes" });
    }
    let folder = std::env::args().nth(1).unwrap_or_else(|| ".".into());
    let path = std::path::Path::new(&folder).join("f32_roots.svg");
    match std::fs::write(&path, plot(&runs)) {
        Ok(()) => println!("\nwrote {}", path.display()),
        Err(e) => println!("\ncannot write {}: {e}", path.display()),
    }
    Ok(())
}

/// A line of the plot: name, colour, errors and whether the filter broke.
type Line = (&'static str, &'static str, (Vec<f64>, bool));

/// Draws log10 of the error over the steps.
fn plot(runs: &[Line]) -> String {
    let (w, h, left, top) = (720.0, 400.0, 64.0, 34.0);
    let (right, bottom) = (w - 130.0, h - 46.0);
    let x = |k: usize| left + (right - left) * k as f64 / (STEPS - 1) as f64;
    // Decades from 1e-9 to 1e3; what leaves the frame is drawn on its edge.
    let y = |e: f64| bottom - (bottom - top) * (e.max(1e-9).log10().min(3.0) + 9.0) / 12.0;
    let mut s = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {w} {h}\" font-family=\"sans-serif\" font-size=\"12\">\
         <rect width=\"{w}\" height=\"{h}\" fill=\"white\"/>\
         <text x=\"{left}\" y=\"20\" font-size=\"14\">Relative error of the variances in f32 (P0 = 1e6, R = 1e-6)</text>"
    );
    for decade in (-9..=3).step_by(3) {
        let at = y(10f64.powi(decade));
        let _ = write!(
            s,
            "<line x1=\"{left}\" x2=\"{right}\" y1=\"{at:.1}\" y2=\"{at:.1}\" stroke=\"#ddd\"/>\
             <text x=\"{:.0}\" y=\"{:.1}\" text-anchor=\"end\">1e{decade}</text>",
            left - 6.0,
            at + 4.0
        );
    }
    for k in [0, 50, 100, 150, 199] {
        let _ = write!(s, "<text x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"middle\">{}</text>", x(k), bottom + 18.0, k + 1);
    }
    let _ =
        write!(s, "<text x=\"{:.0}\" y=\"{:.0}\" text-anchor=\"middle\">step</text>", (left + right) / 2.0, h - 10.0);
    let mut labels: Vec<(f64, &str, &str)> = Vec::new();
    for (name, colour, (e, _)) in runs {
        let mut points = String::new();
        for (k, e) in e.iter().enumerate() {
            let _ = write!(points, "{:.1},{:.1} ", x(k), y(*e));
        }
        let _ = write!(s, "<polyline points=\"{points}\" fill=\"none\" stroke=\"{colour}\" stroke-width=\"1.6\"/>");
        labels.push((y(e[STEPS - 1]), name, colour));
    }
    // Labels at the ends of their lines, moved apart.
    labels.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut free = top;
    for (at, name, colour) in labels {
        let at = at.max(free);
        let _ = write!(s, "<text x=\"{:.0}\" y=\"{:.1}\" fill=\"{colour}\">{name}</text>", right + 8.0, at + 4.0);
        free = at + 15.0;
    }
    s + "</svg>\n"
}
