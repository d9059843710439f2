//! What moves before a moving camera: a 1920x1080 frame of a ground of waves that moves by (3, 2) px a frame, with three squares of 24 px.
//!
//! Run: `cargo bench -p boresight --bench steadied`. Fixed seed; one thread. The camera goes there and back, so that no frame is a cut.

use boresight::vision::steadied::SteadiedConfig;
use boresight::vision::threshold::ThresholdConfig;
use boresight::vision::{ClusterConfig, DetectorConfig, build};
use boresight::{Frame, FrameIndex, Image, PixelKind, Pixels, Scan, SourceInfo, Timestamp};
use divan::Bencher;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

const W: usize = 1920;
const H: usize = 1080;
/// Frames from one end of the way to the other.
const N: usize = 30;

fn main() {
    divan::main();
}

fn images() -> Vec<Image<u8>> {
    let mut rng = ChaCha8Rng::seed_from_u64(7);
    let waves: Vec<[f32; 4]> = (0..12)
        .map(|_| {
            let (length, angle) = (6.0 + 40.0 * rng.random::<f32>(), std::f32::consts::TAU * rng.random::<f32>());
            let k = std::f32::consts::TAU / length;
            [k * angle.cos(), k * angle.sin(), std::f32::consts::TAU * rng.random::<f32>(), 12.0]
        })
        .collect();
    let (w, h) = (W + 3 * N, H + 2 * N);
    let value = |i: usize| {
        let (x, y) = ((i % w) as f32, (i / w) as f32);
        120.0 + waves.iter().map(|[kx, ky, phase, a]| a * (kx * x + ky * y + phase).sin()).sum::<f32>()
    };
    let ground: Vec<f32> = (0..w * h).map(value).collect();
    (0..N)
        .map(|k| {
            let mut image = Image::filled(W, H, 0u8);
            for y in 0..H {
                let from = (y + 2 * k) * w + 3 * k;
                let row = image.row_mut(y);
                row.iter_mut().zip(&ground[from..]).for_each(|(p, g)| *p = (g + 4.0 * rng.random::<f32>()) as u8);
                for i in 0..3 {
                    let (left, top) = (300 + 400 * i + 5 * k, 300 + 150 * i);
                    if (top..top + 24).contains(&y) {
                        row[left..left + 24].fill(230 - 100 * i as u8);
                    }
                }
            }
            image
        })
        .collect()
}

/// One frame of [`N`] that go there and back.
#[divan::bench(sample_count = 60, sample_size = 1)]
fn steadied_1080p_3_squares(bencher: Bencher) {
    let images = images();
    let info = SourceInfo {
        label: String::new(),
        reader: String::new(),
        width: W,
        height: H,
        kind: PixelKind::Gray8,
        n_frames: None,
        rate_hz: Some(25.0),
        true_times: true,
    };
    let config = DetectorConfig {
        threshold: ThresholdConfig::Steadied(SteadiedConfig::default()),
        cluster: ClusterConfig { distance_px: 7.0, min_area_px: Some(60), ..Default::default() },
        ..Default::default()
    };
    let mut detector = build(&config, &info).expect("a valid configuration");
    let (mut scan, mut k) = (Scan::default(), 0usize);
    let mut next = move || {
        let place = k % (2 * N - 2);
        let image = images[if place < N { place } else { 2 * N - 2 - place }].clone();
        let (index, time) = (FrameIndex(k as u64), Timestamp::from_secs_f64(0.04 * k as f64));
        k += 1;
        Frame { index, time, pixels: Pixels::Gray8(image) }
    };
    // Warm: two frames to compare with.
    for _ in 0..N {
        detector.detect(&next(), &mut scan).expect("a frame of the announced size");
    }
    bencher
        .with_inputs(next)
        .bench_local_values(|frame| detector.detect(&frame, &mut scan).expect("a frame of the announced size"));
}
