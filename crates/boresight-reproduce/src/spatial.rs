//! Thesis Figure 4.2: mean and median filters on salt and pepper (density 0.03) and on Gaussian noise (σ = 1.4, 10,
//! 25).
//!
//! Source: `docs/theory/image.md`: 64 x 64 frame with a 9 x 9 target of 100 on 50, window 3 x 3, border replicated,
//! noise not clamped. Numbers are the root mean square error against the clean frame, counts; the paper prints pictures
//! only. The "paper" column is therefore empty.

use super::item::{Figure, Output, Row, Section};
use super::score::spread;
use super::study::{Options, monte_carlo};
use boresight::sim::Purpose;
use boresight::sim::Seed;
use boresight::vision::spatial::{Border, mean_exact, median_exact};
use boresight::{Image, Result};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

fn clean() -> Image<f64> {
    let mut image = Image::filled(64, 64, 50.0);
    for y in 28..37 {
        image.row_mut(y)[28..37].fill(100.0);
    }
    image
}

fn rmse(a: &Image<f64>, b: &Image<f64>) -> f64 {
    let sum: f64 = a.as_slice().iter().zip(b.as_slice()).map(|(a, b)| (a - b).powi(2)).sum();
    (sum / a.as_slice().len() as f64).sqrt()
}

/// The noises, and how each is made from a random source.
const NOISES: [(&str, Option<f64>); 4] = [
    ("salt & pepper 0.03", None),
    ("Gaussian 1.4", Some(1.4)),
    ("Gaussian 10", Some(10.0)),
    ("Gaussian 25", Some(25.0)),
];

/// The frame with noise, its mean and its median.
fn filtered(clean: &Image<f64>, sigma: Option<f64>, rng: &mut ChaCha8Rng) -> Result<[Image<f64>; 3]> {
    let mut noisy = clean.clone();
    for v in noisy.as_mut_slice() {
        match sigma {
            Some(s) => {
                let z: f64 = StandardNormal.sample(rng);
                *v += s * z;
            }
            None => {
                let u: f64 = rng.random();
                if u < 0.03 {
                    *v = if u < 0.015 { 0.0 } else { 255.0 };
                }
            }
        }
    }
    // The filters take the pixel types of files; 24 bits are far below the errors of interest.
    let single = noisy.as_slice().iter().map(|v| *v as f32).collect();
    let single = Image::from_vec(noisy.width(), noisy.height(), single).unwrap_or_default();
    let (mean, median) = (mean_exact(&single, 3, Border::Replicate)?, median_exact(&single, 3, Border::Replicate)?);
    Ok([noisy, mean, median])
}

fn pictures(clean: &Image<f64>, seed: Seed) -> Result<Vec<Figure>> {
    let mut rng = seed.stream(Purpose::Sensor, 42);
    let mut out = Vec::new();
    for (name, sigma) in &NOISES[..2] {
        for (what, image) in ["noisy", "mean", "median"].iter().zip(filtered(clean, *sigma, &mut rng)?) {
            let levels = image.as_slice().iter().map(|v| boresight::sim::quantise(*v)).collect();
            out.push(Figure {
                item: "filters-4.2",
                caption: format!("Thesis Figure 4.2: {name}, {what}"),
                axes: ["x, px".into(), "y, px".into()],
                lines: Vec::new(),
                picture: Some((image.width(), image.height(), levels)),
                sentence: format!("RMSE {:.2} counts.", rmse(clean, &image)),
            });
        }
    }
    Ok(out)
}

/// Makes the table and the pictures of Figure 4.2.
pub fn figure_42(options: &Options<'_>) -> Result<Output> {
    let clean = clean();
    let runs = monte_carlo(options, |run| {
        let mut rng = Seed::new(options.seed).of_run(run).stream(Purpose::Sensor, 42);
        NOISES
            .iter()
            .map(|(_, sigma)| Ok(filtered(&clean, *sigma, &mut rng)?.each_ref().map(|i| rmse(&clean, i))))
            .collect::<Result<Vec<_>>>()
    })?;
    let mut rows = Vec::new();
    for (i, (name, _)) in NOISES.iter().enumerate() {
        for (j, what) in ["RMSE noisy", "RMSE mean", "RMSE median"].into_iter().enumerate() {
            let values: Vec<f64> = runs.iter().map(|r| r[i][j]).collect();
            rows.push(Row {
                case: (*name).into(),
                measure: what.into(),
                paper: None,
                ours: spread(&values, None),
                reference: None,
                lost: 0,
            });
        }
    }
    let m = |i: usize| rows[i].ours.mean;
    let sentence = format!(
        "Median beats mean on salt and pepper ({:.1} → {:.1} against {:.1}): reproduced. \"Mean suits Gaussian noise\" is not reproduced at σ = 1.4, where both \
         make a frame with edges worse ({:.2} → {:.2} mean, {:.2} median); it holds for strong noise (σ = 10: {:.2} against {:.2}).",
        m(0),
        m(2),
        m(1),
        m(3),
        m(4),
        m(5),
        m(7),
        m(8)
    );
    Ok(Output {
        sections: vec![Section {
            item: "filters-4.2",
            title: "Thesis Figure 4.2: mean and median filters, 3 x 3".into(),
            reading: "9 x 9 target of 100 on 50, borders replicated; RMSE in counts".into(),
            rows,
            sentence,
        }],
        figures: pictures(&clean, Seed::new(options.seed))?,
    })
}
