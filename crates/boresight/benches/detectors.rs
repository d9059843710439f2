//! Whole detectors, a frame: `isolated`, `cfar`, `spot` and movers before a fixed camera, on the frames that their aims name; `bernoulli` on noise.
//!
//! Run: `cargo bench -p boresight --bench detectors`. Fixed seeds; one thread; eight frames in turn. Scenes: the sample clip (320 x 256), 50 and 600 round spots in white noise, and ten textured things before
//! a textured ground with even noise of 2 counts either way; 256 x 256 px of even noise.

use boresight::sim::{SceneConfig, Seed};
use boresight::vision::background::BackgroundConfig;
use boresight::vision::bernoulli::BernoulliConfig;
use boresight::vision::cfar::CfarConfig;
use boresight::vision::threshold::{SpotConfig, ThresholdConfig};
use boresight::vision::{ClusterConfig, DetectorConfig, IsolatedConfig, build};
use boresight::{Frame, FrameIndex, FrameSource, Image, Pixels, Scan, Timestamp};
use divan::Bencher;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::fmt::Write as _;

/// Frames of a scene.
const N: usize = 8;

fn main() {
    divan::main();
}

/// The detector over the frames, in turn.
fn run(bencher: Bencher, frames: &[Frame], config: &DetectorConfig) {
    let Pixels::Gray8(first) = &frames[0].pixels else { panic!("grey frames") };
    let info = boresight::SourceInfo {
        label: "bench".into(),
        reader: "bench".into(),
        width: first.width(),
        height: first.height(),
        kind: boresight::PixelKind::Gray8,
        n_frames: None,
        rate_hz: Some(25.0),
        true_times: true,
    };
    let mut detector = build(config, &info).expect("a valid configuration");
    let (mut scan, mut k) = (Scan::default(), 0);
    let mut next = || {
        let pixels = frames[k % frames.len()].pixels.clone();
        let frame = Frame { index: FrameIndex(k as u64), time: Timestamp::from_ns(k as i64 * 40_000_000), pixels };
        k += 1;
        frame
    };
    // A background is learnt from the first frames.
    for _ in 0..60 {
        detector.detect(&next(), &mut scan).expect("frames of one size");
    }
    bencher.with_inputs(next).bench_local_refs(|frame| detector.detect(frame, &mut scan));
}

fn isolated(min_score: f64, max_side_px: u32) -> DetectorConfig {
    let isolated = IsolatedConfig { min_score, max_side_px, ..Default::default() };
    DetectorConfig {
        threshold: ThresholdConfig::Isolated(isolated),
        cluster: ClusterConfig { min_area_px: Some(3), ..Default::default() },
        ..Default::default()
    }
}

/// Round spots of 2.2 px that stand 180 counts above noise of 4 counts, as in the comparison of whole runs.
fn spots((width, height): (usize, usize), n: usize) -> Vec<Frame> {
    let mut text = format!(
        "width-px = {width}\nheight-px = {height}\nn-frames = 100\nrate-hz = 25.0\nbits = 8\n[background.white]\nmean = 30.0\nstd = 4.0\n"
    );
    let mut rng = ChaCha8Rng::seed_from_u64(4);
    for _ in 0..n {
        let mut within = |side: usize| 12.0 + (side as f64 - 24.0) * rng.random::<f64>();
        let (x, y) = (within(width), within(height));
        let _ = writeln!(
            text,
            "[[targets]]\nstart-px = [{x:.2}, {y:.2}]\nvelocity-px-per-s = [0.0, 0.0]\nshape.spot = {{ sigma-px = 0.5, psf-sigma-px = 2.15, total = 5472.0 }}"
        );
    }
    let config = SceneConfig::from_toml(&text).expect("a valid scene");
    let mut source = config.build(Seed { seed: 5, run: 0 }).expect("a scene that can be built");
    std::iter::from_fn(|| source.next_frame().expect("a frame")).take(N).collect()
}

fn sample() -> Vec<Frame> {
    let clip = concat!(env!("CARGO_MANIFEST_DIR"), "/../../samples/ir_drone/IR_DRONE_046.mp4");
    let mut source = boresight::io::open(clip, &boresight::io::OpenOptions::default()).expect("the sample clip");
    std::iter::from_fn(|| source.next_frame().expect("a frame")).step_by(30).take(N).collect()
}

#[divan::bench(args = [2.5, 7.3])]
fn isolated_sample_320x256(bencher: Bencher, min_score: f64) {
    run(bencher, &sample(), &isolated(min_score, 102));
}

#[divan::bench(args = [2.5, 7.3])]
fn isolated_50_spots_1080p(bencher: Bencher, min_score: f64) {
    run(bencher, &spots((1920, 1080), 50), &isolated(min_score, 432));
}

fn cfar() -> DetectorConfig {
    DetectorConfig { threshold: ThresholdConfig::Cfar(CfarConfig::default()), ..Default::default() }
}

#[divan::bench]
fn cfar_sample_320x256(bencher: Bencher) {
    run(bencher, &sample(), &cfar());
}

#[divan::bench]
fn cfar_50_spots_1080p(bencher: Bencher) {
    run(bencher, &spots((1920, 1080), 50), &cfar());
}

#[divan::bench]
fn spot_600_particles_640x424(bencher: Bencher) {
    let config = DetectorConfig { threshold: ThresholdConfig::Spot(SpotConfig::default()), ..Default::default() };
    run(bencher, &spots((640, 424), 600), &config);
}

#[divan::bench]
fn moving_768x576(bencher: Bencher) {
    const SIZE: (usize, usize) = (768, 576);
    let mut rng = ChaCha8Rng::seed_from_u64(6);
    let mut texture = |n: usize| -> Vec<f32> { (0..n).map(|_| 60.0 + 120.0 * rng.random::<f32>()).collect() };
    let (ground, thing) = (texture(SIZE.0 * SIZE.1), texture(24 * 48));
    let frame = |k: usize| {
        let mut image: Vec<f32> = ground.clone();
        for i in 0..10 {
            let (left, top) = (40 + 70 * i + 3 * k, 60 + 40 * i);
            for y in 0..48 {
                let at = (top + y) * SIZE.0 + left;
                image[at..at + 24].copy_from_slice(&thing[24 * y..24 * (y + 1)]);
            }
        }
        let pixels = image.iter().map(|v| (v + 4.0 * (rng.random::<f32>() - 0.5)) as u8).collect();
        let pixels = Pixels::Gray8(Image::from_vec(SIZE.0, SIZE.1, pixels).expect("as many pixels as the size says"));
        Frame { index: FrameIndex(k as u64), time: Timestamp::default(), pixels }
    };
    let frames: Vec<Frame> = (0..N).map(frame).collect();
    let config = DetectorConfig {
        threshold: ThresholdConfig::Moving(BackgroundConfig::default()),
        cluster: ClusterConfig { distance_px: 7.0, min_area_px: Some(60), ..Default::default() },
        ..Default::default()
    };
    run(bencher, &frames, &config);
}

/// Velocities of up to 50 px/s at 25 frames/s: 11 x 11 of them; as many frames as fade a background away, before they come again.
#[divan::bench]
fn bernoulli_noise_256x256(bencher: Bencher) {
    let mut rng = ChaCha8Rng::seed_from_u64(7);
    let mut frame = |k: usize| {
        let pixels = (0..256 * 256).map(|_| 80 + rng.random_range(0..40u8)).collect();
        let pixels = Pixels::Gray8(Image::from_vec(256, 256, pixels).expect("as many pixels as the size says"));
        Frame { index: FrameIndex(k as u64), time: Timestamp::default(), pixels }
    };
    let frames: Vec<Frame> = (0..100).map(&mut frame).collect();
    let config =
        DetectorConfig { threshold: ThresholdConfig::Bernoulli(BernoulliConfig::default()), ..Default::default() };
    run(bencher, &frames, &config);
}
