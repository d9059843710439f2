//! Fitted positions beside the Cramér-Rao bound: errors, covariances, place in the pixel, fits a second, peers.

use super::scenes::random;
use super::spot_frames::{SIGMA, frame_of, image_of, noise_and_height};
use anyhow::Result;
use boresight::vision::fit::{Spot, SpotModel, Stamp, Width, fit_spots};
use nalgebra::Vector2;
use rand::RngExt;
use std::fmt::Write as _;
use std::path::Path;
use std::time::Instant;

const SIDE: usize = 9;
/// Cells of a pixel along each axis.
const CELLS: usize = 4;
const GROUND: f64 = 120.0;

/// Sums over the fits of one cell.
#[derive(Clone, Copy, Default)]
struct Sums {
    n: f64,
    square: f64,
    bound: f64,
    nees: f64,
    bias: [f64; 2],
    tried: f64,
}

fn errors(light: bool, snr: f64, per_cell: usize) -> Result<[Sums; CELLS * CELLS]> {
    let (noise, height) = noise_and_height(light, snr);
    let mut rng = random(17);
    let mut cells = [Sums::default(); CELLS * CELLS];
    let centre = Vector2::new(4.0, 4.0);
    for (k, cell) in cells.iter_mut().enumerate() {
        let corner = Vector2::new((k % CELLS) as f64, (k / CELLS) as f64) / CELLS as f64 + Vector2::repeat(3.5);
        for _ in 0..per_cell {
            let truth = corner + Vector2::new(rng.random::<f64>(), rng.random::<f64>()) / CELLS as f64;
            let mean = frame_of([SIDE; 2], &[truth], height, GROUND);
            let image = image_of([SIDE; 2], &mean, &noise, &mut rng)?;
            let start = truth + 0.4 * (Vector2::new(rng.random::<f64>(), rng.random::<f64>()) - Vector2::repeat(0.5));
            cell.tried += 1.0;
            let fit = |image| {
                let stamp = Stamp::cut(image, centre, 4, &noise, None)?;
                fit_spots(&stamp, &[Spot::round(start, 1.0, SIGMA)], SpotModel::default()).ok().map(|f| f.spots()[0])
            };
            let clean =
                boresight::Image::from_vec(SIDE, SIDE, mean.iter().map(|v| *v as f32).collect()).unwrap_or_default();
            let (Some(found), Some(at_truth)) = (fit(&image), fit(&clean)) else { continue };
            let e = found.spot.position - truth;
            cell.n += 1.0;
            cell.square += e.norm_squared();
            cell.bound += at_truth.bound.trace();
            cell.nees += found.cov.cholesky().map_or(f64::NAN, |c| e.dot(&c.solve(&e)));
            cell.bias[0] += e.x;
            cell.bias[1] += e.y;
        }
    }
    Ok(cells)
}

fn table_of_errors(n_fits: usize, page: &mut String) -> Result<()> {
    writeln!(
        page,
        "| noise | SNR | fits | bound px an axis | rms / bound | in the worst cell | eᵀ C⁻¹ e (95 % bounds) | largest bias of a cell, in deviations of its mean | no fit |"
    )?;
    writeln!(page, "| --- | --- | --- | --- | --- | --- | --- | --- | --- |")?;
    for light in [false, true] {
        for snr in [5.0, 7.0, 10.0, 20.0, 50.0] {
            let cells = errors(light, snr, (n_fits / (CELLS * CELLS)).max(10))?;
            let sum = |of: fn(&Sums) -> f64| cells.iter().map(of).sum::<f64>();
            let n = sum(|c| c.n);
            let ratio = (sum(|c| c.square) / sum(|c| c.bound)).sqrt();
            let worst = cells.iter().map(|c| (c.square / c.bound).sqrt()).fold(0.0, f64::max);
            let half = 1.96 * 2.0 / n.sqrt();
            let bias = |c: &Sums| {
                let sd = (0.5 * c.bound / c.n / c.n).sqrt();
                (c.bias[0] / c.n / sd).abs().max((c.bias[1] / c.n / sd).abs())
            };
            writeln!(
                page,
                "| {} | {snr} | {n} | {:.4} | {ratio:.3} | {worst:.3} | {:.3} ({:.3} to {:.3}) | {:.1} | {:.2} % |",
                if light { "light and read noise" } else { "constant" },
                (0.5 * sum(|c| c.bound) / n).sqrt(),
                sum(|c| c.nees) / n,
                2.0 - half,
                2.0 + half,
                cells.iter().map(bias).fold(0.0, f64::max),
                100.0 * (1.0 - n / sum(|c| c.tried))
            )?;
        }
    }
    writeln!(
        page,
        "\nThe rms of a cell is known to {:.1} %; of 32 biases (two axes of 16 cells) the largest of none is 2.9 in one table of twenty.",
        100.0 / (4.0 * n_fits as f64 / (CELLS * CELLS) as f64).sqrt()
    )?;
    Ok(())
}

fn table_of_speed(page: &mut String) -> Result<()> {
    writeln!(page, "\n| fit of 9 x 9 px, with cutting the window | µs, median of 9 runs | fits a second and core |")?;
    writeln!(page, "| --- | --- | --- |")?;
    let model = |width| SpotModel { width, slope: true };
    let still = Vector2::zeros();
    let cases = [
        ("round, constant noise", false, 1, still, model(Width::Round)),
        ("round, light and read noise", true, 1, still, model(Width::Round)),
        ("known width, constant noise", false, 1, still, model(Width::Known)),
        ("elliptic, constant noise", false, 1, still, model(Width::Elliptic)),
        ("round, smeared by 2 px, constant noise", false, 1, Vector2::new(1.6, 1.2), model(Width::Round)),
        ("two of one width, constant noise", false, 2, still, model(Width::Alike)),
    ];
    for (name, light, n_spots, motion, model) in cases {
        let (noise, height) = noise_and_height(light, 20.0);
        let mut rng = random(18);
        let scenes = (0..2000)
            .map(|_| {
                let shift = Vector2::new(rng.random::<f64>() - 0.5, rng.random::<f64>() - 0.5);
                let first = if n_spots == 2 { Vector2::new(2.5, 3.5) } else { Vector2::new(4.0, 4.0) };
                let truth = [first + shift, first + shift + Vector2::new(3.2, 1.0)];
                let mean = frame_of([SIDE; 2], &truth[..n_spots], height, GROUND);
                Ok((image_of([SIDE; 2], &mean, &noise, &mut rng)?, truth.map(|t| t + 0.1 * shift)))
            })
            .collect::<Result<Vec<_>>>()?;
        let once = || {
            let start = Instant::now();
            for (image, guess) in &scenes {
                let guesses = guess.map(|g| Spot { motion, ..Spot::round(g, 1.0, SIGMA) });
                let stamp = Stamp::cut(image, Vector2::new(4.0, 4.0), 4, &noise, None);
                std::hint::black_box(stamp.map(|s| fit_spots(&s, &guesses[..n_spots], model)));
            }
            start.elapsed().as_secs_f64() / scenes.len() as f64
        };
        let mut times: Vec<f64> = (0..9).map(|_| once()).collect();
        times.sort_by(f64::total_cmp);
        writeln!(page, "| {name} | {:.2} | {:.2e} |", 1e6 * times[4], 1.0 / times[4])?;
    }
    Ok(())
}

pub fn table(n_fits: usize, data: &Path, python: Option<&Path>, page: &mut String) -> Result<()> {
    table_of_errors(n_fits, page)?;
    table_of_speed(page)?;
    super::locking::table(data, page)?;
    super::peers::table(python, page)
}
