//! The same frames for this fit, trackpy, Picasso and SciPy: written to a folder, the peers run by `scripts/fit_peers.py`.

use super::scenes::random;
use super::spot_frames::{SIGMA, frame_of, noise_and_height};
use anyhow::{Result, ensure};
use boresight::Image;
use boresight::vision::fit::{SensorNoise, Spot, SpotModel, Stamp, Width, fit_spots};
use nalgebra::Vector2;
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use std::fmt::Write as _;
use std::path::Path;
use std::process::Command;
use std::time::Instant;

const SIDE: usize = 400;
const SPACING: usize = 20;
const FRAMES: usize = 12;

/// Frames of whole numbers with a spot in each square of 20 px, and their places.
struct Case {
    name: &'static str,
    noise: SensorNoise,
    frames: Vec<Image<u16>>,
    truth: Vec<Vec<Vector2<f64>>>,
    /// Standard deviation of an axis at the bound without a slope of the ground, px.
    bound: f64,
}

fn case(light: bool, snr: f64, name: &'static str, rng: &mut ChaCha8Rng) -> Result<Case> {
    let (mut noise, height) = noise_and_height(light, snr);
    let (mut frames, mut truth, mut bound, mut n) = (Vec::new(), Vec::new(), 0.0, 0.0);
    if !light {
        noise.read_variance += 1.0 / 12.0;
    }
    for _ in 0..FRAMES {
        let places: Vec<Vector2<f64>> = (0..(SIDE / SPACING).pow(2))
            .map(|k| {
                let square =
                    Vector2::new((k % (SIDE / SPACING)) as f64, (k / (SIDE / SPACING)) as f64) * SPACING as f64;
                square + Vector2::new(9.5 + rng.random::<f64>(), 9.5 + rng.random::<f64>())
            })
            .collect();
        let mean = frame_of([SIDE; 2], &places, height, 120.0);
        let image = super::spot_frames::image_of([SIDE; 2], &mean, &noise, rng)?;
        let clean = Image::from_vec(SIDE, SIDE, mean.iter().map(|v| *v as f32).collect()).unwrap_or_default();
        for p in &places {
            let flat = SpotModel { width: Width::Round, slope: false };
            let stamp = Stamp::cut(&clean, *p, 4, &noise, None);
            if let Some(Ok(fit)) = stamp.map(|s| fit_spots(&s, &[Spot::round(*p, 1.0, SIGMA)], flat)) {
                bound += 0.5 * fit.spots()[0].bound.trace();
                n += 1.0;
            }
        }
        let values = image.as_slice().iter().map(|v| v.round().max(0.0) as u16).collect();
        frames.push(Image::from_vec(SIDE, SIDE, values).unwrap_or_default());
        truth.push(places);
    }
    Ok(Case { name, noise, frames, truth, bound: (bound / f64::max(n, 1.0)).sqrt() })
}

/// rms error of an axis, px; largest mean error in a quarter of a pixel, px; share found; fits a second.
fn ours(case: &Case, model: SpotModel) -> [f64; 4] {
    let (mut square, mut n, mut tried, mut time) = (0.0, 0.0, 0.0, 0.0);
    let mut quarters = [[0.0f64; 2]; 4];
    for (image, places) in case.frames.iter().zip(&case.truth) {
        let start = Instant::now();
        let found: Vec<Option<Vector2<f64>>> = places
            .iter()
            .map(|p| {
                let pixel = p.map(f64::round);
                let stamp = Stamp::cut(image, pixel, 4, &case.noise, None)?;
                let fit = fit_spots(&stamp, &[Spot::round(pixel, 1.0, SIGMA)], model).ok()?;
                Some(fit.spots()[0].spot.position)
            })
            .collect();
        time += start.elapsed().as_secs_f64();
        for (found, p) in found.iter().zip(places) {
            tried += 1.0;
            let Some(e) = found.map(|f| f - p).filter(|e| e.norm() < 2.0) else { continue };
            square += 0.5 * e.norm_squared();
            n += 1.0;
            let quarter = &mut quarters[((p.x + 0.5).rem_euclid(1.0) * 4.0) as usize % 4];
            quarter[0] += e.x;
            quarter[1] += 1.0;
        }
    }
    let bias = quarters.iter().map(|q| (q[0] / q[1].max(1.0)).abs()).fold(0.0, f64::max);
    [(square / n).sqrt(), bias, n / tried, tried / time]
}

/// An array of NumPy's format of whole numbers.
fn npy(path: &Path, frames: &[Image<u16>]) -> Result<()> {
    let mut head = format!("{{'descr': '<u2', 'fortran_order': False, 'shape': ({}, {SIDE}, {SIDE}), }}", frames.len());
    while (head.len() + 11) % 64 != 0 {
        head.push(' ');
    }
    head.push('\n');
    let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
    bytes.extend((head.len() as u16).to_le_bytes());
    bytes.extend(head.as_bytes());
    frames.iter().flat_map(|f| f.as_slice()).for_each(|v| bytes.extend(v.to_le_bytes()));
    Ok(std::fs::write(path, bytes)?)
}

pub fn table(python: Option<&Path>, page: &mut String) -> Result<()> {
    let mut rng = random(19);
    let cases = [
        case(false, 10.0, "constant, SNR 10", &mut rng)?,
        case(true, 7.0, "light, SNR 7", &mut rng)?,
        case(true, 20.0, "light, SNR 20", &mut rng)?,
    ];
    writeln!(
        page,
        "\n{} spots, {SPACING} px apart, whole numbers, even ground; the same frames for all, one thread. Bound: unknown height, width and ground. Bias: the largest mean error along x in a quarter of a pixel. SciPy and `refine_leastsq` fit the first 400 only: their rms is known to 2.5 %.\n",
        FRAMES * (SIDE / SPACING).pow(2)
    )?;
    writeln!(
        page,
        "| frames | method | rms px an axis | of the bound | bias px | found | fits a second |\n| --- | --- | --- | --- | --- | --- | --- |"
    )?;
    let folder = std::env::temp_dir().join(format!("boresight-fit-peers-{}", std::process::id()));
    std::fs::create_dir_all(&folder)?;
    for c in &cases {
        for (name, model) in [
            ("`fit`, even ground", SpotModel { width: Width::Round, slope: false }),
            ("`fit`, inclined ground", SpotModel::default()),
        ] {
            let [rms, bias, found, rate] = ours(c, model);
            let of_bound = rms / c.bound;
            writeln!(
                page,
                "| {} | {name} | {rms:.4} | {of_bound:.3} | {bias:.4} | {:.1} % | {rate:.2e} |",
                c.name,
                100.0 * found
            )?;
        }
        let Some(python) = python else { continue };
        npy(&folder.join("frames.npy"), &c.frames)?;
        let rows =
            c.truth.iter().enumerate().flat_map(|(k, t)| t.iter().map(move |p| format!("{k},{},{}\n", p.x, p.y)));
        std::fs::write(folder.join("truth.csv"), rows.collect::<String>())?;
        let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("../scripts/fit_peers.py");
        let n = &c.noise;
        let numbers = [n.read_variance, n.gain, n.offset, SIGMA, c.bound].map(|v| v.to_string());
        let out = Command::new(python).arg(script).arg(&folder).arg(c.name).args(numbers).output()?;
        ensure!(out.status.success(), "{}", String::from_utf8_lossy(&out.stderr));
        writeln!(page, "{}", String::from_utf8_lossy(&out.stdout).trim())?;
    }
    std::fs::remove_dir_all(&folder)?;
    if python.is_none() {
        writeln!(
            page,
            "\ntrackpy, Picasso and SciPy were not measured: `cargo xtask limit positions --python PATH` does."
        )?;
    }
    Ok(())
}
