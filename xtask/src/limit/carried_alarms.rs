//! New false targets of the carried density in noise alone, against what is asked for: white, coloured, and of a few counts.

use super::scenes::{RATE_HZ, SIGMA, info, random};
use anyhow::Result;
use boresight::vision::bernoulli::BernoulliConfig;
use boresight::vision::threshold::ThresholdConfig;
use boresight::vision::{DetectorConfig, build};
use boresight::{Frame, FrameIndex, Image, PixelKind, Pixels, Scan, Timestamp};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;
use std::collections::VecDeque;
use std::fmt::Write as _;

/// Frames of a second, for which the tracker of these scenes coasts.
const SECOND: usize = 25;

/// Noise of a deviation of 1 before it becomes counts.
#[derive(Clone, Copy)]
enum Noise {
    White,
    /// Blurred by a Gaussian of a pixel.
    Coloured,
    /// The same, correlated by a half with the frame before: what the density takes for independent is not.
    ColouredInTime,
    /// Of 0.7 counts, 8 bits.
    FewCounts,
    /// Laplace's: tails of exp(-|z|).
    HeavyTailed,
}

/// One source of noise, with what it remembers.
struct Source {
    noise: Noise,
    side: usize,
    rng: ChaCha8Rng,
    last: Vec<f32>,
}

impl Source {
    fn frame(&mut self, k: u64) -> Frame {
        let (side, rng) = (self.side, &mut self.rng);
        let heavy = matches!(self.noise, Noise::HeavyTailed);
        let mut z: Vec<f32> = (0..side * side)
            .map(|_| {
                if heavy {
                    let u = rng.random::<f32>() - 0.5;
                    -u.signum() * (1.0 - 2.0 * u.abs()).max(1e-7).ln() / 2f32.sqrt()
                } else {
                    rng.sample::<f32, _>(StandardNormal)
                }
            })
            .collect();
        if matches!(self.noise, Noise::Coloured | Noise::ColouredInTime) {
            blur(&mut z, side);
        }
        if matches!(self.noise, Noise::ColouredInTime) {
            // Correlated with the frame before by a half, of the same deviation.
            let old = 0.75f32.sqrt();
            z.iter_mut().zip(&self.last).for_each(|(z, last)| *z = old * *z + 0.5 * last);
            self.last.clone_from(&z);
        }
        let (ground, counts) = if matches!(self.noise, Noise::FewCounts) { (100.0, 0.7) } else { (5000.0, 40.0) };
        let value = |z: f32| (ground + counts * z).round().max(0.0);
        let pixels = if matches!(self.noise, Noise::FewCounts) {
            let v = z.iter().map(|z| value(*z) as u8).collect();
            Pixels::Gray8(Image::from_vec(side, side, v).unwrap_or_default())
        } else {
            let v = z.iter().map(|z| value(*z) as u16).collect();
            Pixels::Gray16(Image::from_vec(side, side, v).unwrap_or_default())
        };
        Frame { index: FrameIndex(k), time: Timestamp::from_secs_f64(k as f64 / RATE_HZ), pixels }
    }
}

/// By a Gaussian of a pixel around the edges, back to a deviation of 1.
fn blur(z: &mut Vec<f32>, side: usize) {
    let weights: Vec<f32> = (-3i32..=3).map(|i| (-0.5 * (i * i) as f32).exp()).collect();
    let energy: f32 = weights.iter().map(|w| w * w).sum();
    for stride in [1, side] {
        *z = (0..z.len())
            .map(|i| {
                let (along, rest) = (i / stride % side, i - i / stride % side * stride);
                let at = |k: usize| rest + (along + side + k - 3) % side * stride;
                weights.iter().enumerate().map(|(k, w)| w * z[at(k)]).sum::<f32>() / energy.sqrt()
            })
            .collect();
    }
}

/// Each row has frames of its own; a report is new where none was within 6 px in the frame before, apart where none was in the second before.
pub fn table(n_frames: u64, page: &mut String) -> Result<()> {
    writeln!(
        page,
        "| noise | frames of px | new false targets a frame asked | frames seen | expected | found | a second apart |\n| --- | --- | --- | --- | --- | --- | --- |"
    )?;
    let all = [
        ("white", Noise::White, 256, n_frames),
        ("white", Noise::White, 128, 4 * n_frames),
        ("coloured", Noise::Coloured, 128, 4 * n_frames),
        ("coloured in time", Noise::ColouredInTime, 128, 4 * n_frames),
        ("0.7 counts, 8 bit", Noise::FewCounts, 128, 4 * n_frames),
        ("heavy tails", Noise::HeavyTailed, 128, 4 * n_frames),
    ];
    for (i, (name, noise, side, n_frames)) in all.into_iter().enumerate() {
        for rate in [0.1, 0.01, 1e-3] {
            let carried =
                BernoulliConfig { false_alarms_per_frame: rate, sigma_px: SIGMA, ..BernoulliConfig::default() };
            let config = DetectorConfig { threshold: ThresholdConfig::Bernoulli(carried), ..DetectorConfig::default() };
            let kind = if matches!(noise, Noise::FewCounts) { PixelKind::Gray8 } else { PixelKind::Gray16 };
            let mut detector = build(&config, &info([side; 2], kind))?;
            let mut source = Source { noise, side, rng: random(7 + i as u64), last: vec![0.0; side * side] };
            let (mut begun, mut before, mut scan) = ([0usize; 2], VecDeque::<Vec<[f64; 2]>>::new(), Scan::default());
            for k in 0..n_frames {
                detector.detect(&source.frame(k), &mut scan)?;
                let now: Vec<[f64; 2]> = scan.detections.iter().map(|d| [d.position.x, d.position.y]).collect();
                let near = |d: &[f64; 2], b: &[f64; 2]| (b[0] - d[0]).hypot(b[1] - d[1]) < 6.0;
                for (begun, frames) in begun.iter_mut().zip([1, SECOND]) {
                    let is_new = |d: &&[f64; 2]| !before.iter().take(frames).flatten().any(|b| near(d, b));
                    *begun += now.iter().filter(is_new).count();
                }
                before.push_front(now);
                before.truncate(SECOND);
            }
            let expected = rate * n_frames as f64;
            writeln!(
                page,
                "| {name} | {side} x {side} | {rate} | {n_frames} | {expected:.1} | {} | {} |",
                begun[0], begun[1]
            )?;
        }
    }
    Ok(())
}
