//! Scenes at the limit: spots of σ = 1.3 px in white noise of 40 counts, 16 bit, 25 frames/s, and what a detector reports of them.

use anyhow::Result;
use boresight::vision::integrate::IntegrateConfig;
use boresight::vision::threshold::ThresholdConfig;
use boresight::vision::{Detector, DetectorConfig, build};
use boresight::{Frame, FrameIndex, Image, PixelKind, Pixels, Scan, SourceInfo, Timestamp};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;

pub const SIGMA: f64 = 1.3;
pub const RATE_HZ: f64 = 25.0;
const NOISE: f32 = 40.0;

/// A spot of constant velocity: its place in frame `at`, px, and its velocity, px a frame.
#[derive(Clone, Copy, Debug)]
pub struct Spot {
    pub place: [f64; 2],
    pub velocity: [f64; 2],
    pub at: f64,
}

impl Spot {
    /// Its place in frame `k`.
    pub fn place(&self, k: f64) -> [f64; 2] {
        [0, 1].map(|a| self.place[a] + self.velocity[a] * (k - self.at))
    }

    /// A spot of a random velocity of at most `speed` px a frame that stays within a square frame over frames `from..to`.
    pub fn random(side: usize, speed: f64, from: u64, to: u64, rng: &mut ChaCha8Rng) -> Self {
        loop {
            let place = [0, 1].map(|_| rng.random::<f64>() * (side as f64 - 1.0));
            let velocity = [0, 1].map(|_| speed * (2.0 * rng.random::<f64>() - 1.0));
            let spot = Self { place, velocity, at: to as f64 };
            let inside = |k: u64| spot.place(k as f64).iter().all(|c| (4.0..side as f64 - 5.0).contains(c));
            if velocity[0].hypot(velocity[1]) <= speed && inside(from) && inside(to) {
                return spot;
            }
        }
    }
}

/// Frame `k` of noise with spots whose peaks are `snr` deviations of it.
pub fn frame(size: [usize; 2], spots: &[Spot], snr: f64, k: u64, rng: &mut ChaCha8Rng) -> Frame {
    let mut values: Vec<f32> = (0..size[0] * size[1]).map(|_| rng.sample::<f32, _>(StandardNormal)).collect();
    for spot in spots {
        let [x0, y0] = spot.place(k as f64);
        let near = |c: f64, n: usize| ((c - 7.0).max(0.0) as usize).min(n)..((c + 8.0).max(0.0) as usize).min(n);
        for y in near(y0, size[1]) {
            for x in near(x0, size[0]) {
                let d2 = (x as f64 - x0).powi(2) + (y as f64 - y0).powi(2);
                values[y * size[0] + x] += (snr * (-d2 / (2.0 * SIGMA * SIGMA)).exp()) as f32;
            }
        }
    }
    let pixels = values.iter().map(|v| (5000.0 + NOISE * v).round() as u16).collect();
    let image = Image::from_vec(size[0], size[1], pixels).unwrap_or_default();
    let time = Timestamp::from_secs_f64(k as f64 / RATE_HZ);
    Frame { index: FrameIndex(k), time, pixels: Pixels::Gray16(image) }
}

/// Random numbers of a seed.
pub fn random(seed: u64) -> ChaCha8Rng {
    ChaCha8Rng::seed_from_u64(seed)
}

/// What a source of such frames says of itself.
pub fn info(size: [usize; 2], kind: PixelKind) -> SourceInfo {
    SourceInfo {
        label: "simulated".into(),
        reader: String::new(),
        width: size[0],
        height: size[1],
        kind,
        n_frames: None,
        rate_hz: Some(RATE_HZ),
        true_times: true,
    }
}

/// The detector that sums, for these scenes.
pub fn detector(size: [usize; 2], config: IntegrateConfig) -> Result<Box<dyn Detector>> {
    detector_of(size, ThresholdConfig::Integrate(config))
}

/// A detector for these scenes.
pub fn detector_of(size: [usize; 2], threshold: ThresholdConfig) -> Result<Box<dyn Detector>> {
    let info = info(size, PixelKind::Gray16);
    let config = DetectorConfig { threshold, ..DetectorConfig::default() };
    Ok(build(&config, &info)?)
}

/// Score Σψ / √Σφ of a detection made of `n` even frames: what its covariance was made from.
pub fn deviations(d: &boresight::Detection, n: u32) -> f64 {
    let n = f64::from(n);
    // Variance of a fitted line's end, for n even points of variance 1 / n.
    let end = 2.0 * (2.0 * n - 1.0) / (n + 1.0);
    SIGMA * (2.0 * end / d.cov[(0, 0)]).sqrt()
}

/// Runs frames through a detector; `seen` gets each report.
pub fn run(
    detector: &mut dyn Detector,
    frames: impl Iterator<Item = Frame>,
    mut seen: impl FnMut(&Scan),
) -> Result<()> {
    let mut scan = Scan::default();
    for frame in frames {
        detector.detect(&frame, &mut scan)?;
        if !scan.blind {
            seen(&scan);
        }
    }
    Ok(())
}
