//! Segmentation of a 1920x1080 frame, from pixels to weighted centroids, beside a plain read of the same bytes.
//!
//! Run: `cargo bench -p boresight --bench segment`. Fixed seeds; one thread. The scenes have the numbers of those that peers are compared on:
//! `sparse` 50 targets of 9x9, `particles` 5 000 spots of sigma 3, `noisy` N(50, 50²) with every tenth pixel set.

use boresight::vision::Clusterer;
use boresight::vision::threshold::BackgroundGrid;
use boresight::vision::threshold::{BandConfig, LocalConfig, SpotConfig, ThresholdConfig};
use boresight::vision::threshold::{band_bits, words};
use boresight::vision::{CentroidMethod, ClusterConfig, DetectorConfig};
use boresight::vision::{build, threshold::otsu_level};
use boresight::{Frame, FrameIndex, Image, PixelKind, Pixels, Scan, SourceInfo, Timestamp};
use divan::{Bencher, black_box, counter::BytesCount};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, Normal};

const W: usize = 1920;
const H: usize = 1080;

fn main() {
    divan::main();
}

#[derive(Clone, Copy, Debug)]
enum Scene {
    Sparse,
    Particles,
    Noisy,
}

const SCENES: [Scene; 3] = [Scene::Sparse, Scene::Particles, Scene::Noisy];

impl Scene {
    fn low(self) -> u8 {
        if matches!(self, Self::Noisy) { 114 } else { 100 }
    }

    fn image(self) -> Image<u8> {
        let mut rng = ChaCha8Rng::seed_from_u64(7);
        let (mean, sd) = match self {
            Self::Sparse => (20.0, 3.0),
            Self::Particles => (15.0, 3.0),
            Self::Noisy => (50.0, 50.0),
        };
        let noise = Normal::new(mean, sd).unwrap();
        let mut f: Vec<f64> = (0..W * H).map(|_| noise.sample(&mut rng)).collect();
        match self {
            Self::Sparse => {
                let target = Normal::new(180.0, 10.0).unwrap();
                for i in 0..50 {
                    let (left, top) = (16 + (i % 10) * 190, 16 + (i / 10) * 200);
                    for y in top..top + 9 {
                        (left..left + 9).for_each(|x| f[y * W + x] = target.sample(&mut rng));
                    }
                }
            }
            Self::Particles => {
                let step = ((W * H) as f64 / 5000.0).sqrt();
                let centres =
                    |n: usize| (0..).map(|i| (f64::from(i) + 0.5) * step).take_while(move |v| *v < n as f64 - 9.0);
                for cy in centres(H) {
                    for cx in centres(W) {
                        let (cx, cy) = (cx + rng.random_range(-3.0..3.0), cy + rng.random_range(-3.0..3.0));
                        for y in (cy as usize).saturating_sub(12)..(cy as usize + 12).min(H) {
                            for x in (cx as usize).saturating_sub(12)..(cx as usize + 12).min(W) {
                                let d2 = (x as f64 - cx).powi(2) + (y as f64 - cy).powi(2);
                                f[y * W + x] += 180.0 * (-d2 / 18.0).exp();
                            }
                        }
                    }
                }
            }
            Self::Noisy => {}
        }
        Image::from_vec(W, H, f.into_iter().map(|v| v.round().clamp(0.0, 255.0) as u8).collect()).unwrap()
    }
}

#[divan::bench]
fn read(bencher: Bencher) {
    let image = Scene::Noisy.image();
    bencher.counter(BytesCount::new(W * H)).bench_local(|| {
        let (words, _) = black_box(&image).as_slice().as_chunks::<8>();
        words.iter().fold(0u64, |all, w| all ^ u64::from_le_bytes(*w))
    });
}

#[divan::bench]
fn band_to_bits(bencher: Bencher) {
    let (image, mut bits) = (Scene::Noisy.image(), vec![0; words(W)]);
    bencher.counter(BytesCount::new(W * H)).bench_local(|| {
        (0..H).for_each(|y| {
            band_bits(black_box(&image).row(y), 114, 255, &mut bits);
            black_box(&bits);
        });
    });
}

#[divan::bench(args = SCENES)]
fn to_weighted_centroids(bencher: Bencher, scene: Scene) {
    let (image, mut bits) = (scene.image(), vec![0; words(W)]);
    let mut clusters = Clusterer::new(&ClusterConfig::default());
    let mut centroids: Vec<[f64; 4]> = Vec::new();
    let mut run = || {
        clusters.begin(W);
        for y in 0..H {
            band_bits(image.row(y), scene.low(), 255, &mut bits);
            clusters.row(y, &bits, image.row(y));
        }
        centroids.clear();
        centroids.extend(clusters.regions().map(|r| [r.sum_x / r.sum, r.sum_y / r.sum, f64::from(r.area), r.sum]));
        centroids.len()
    };
    run();
    bencher.counter(BytesCount::new(W * H)).bench_local(run);
}

fn detector(bencher: Bencher, scene: Scene, config: &DetectorConfig) {
    let source = SourceInfo {
        label: "bench".into(),
        reader: "bench".into(),
        width: W,
        height: H,
        kind: PixelKind::Gray8,
        n_frames: None,
        rate_hz: None,
        true_times: true,
    };
    let mut detector = build(config, &source).unwrap();
    let frame = Frame { index: FrameIndex(0), time: Timestamp::default(), pixels: Pixels::Gray8(scene.image()) };
    let mut scan = Scan::default();
    detector.detect(&frame, &mut scan).unwrap();
    bencher.counter(BytesCount::new(W * H)).bench_local(|| detector.detect(&frame, &mut scan));
}

/// With covariances, as the pipeline runs it.
#[divan::bench(args = SCENES)]
fn detections_by_band(bencher: Bencher, scene: Scene) {
    let threshold = ThresholdConfig::Band(BandConfig { low: f64::from(scene.low()), high: 255.0 });
    detector(bencher, scene, &DetectorConfig { threshold, ..Default::default() });
}

#[divan::bench]
fn detections_by_band_bbox(bencher: Bencher) {
    let threshold = ThresholdConfig::Band(BandConfig { low: 100.0, high: 255.0 });
    let mut config = DetectorConfig { threshold, ..Default::default() };
    config.centroid.method = CentroidMethod::Bbox;
    detector(bencher, Scene::Particles, &config);
}

#[divan::bench]
fn detections_by_local_threshold(bencher: Bencher) {
    let threshold = ThresholdConfig::Local(LocalConfig::default());
    detector(bencher, Scene::Sparse, &DetectorConfig { threshold, ..Default::default() });
}

#[divan::bench]
fn detections_by_spot(bencher: Bencher) {
    let threshold = ThresholdConfig::Spot(SpotConfig::default());
    detector(bencher, Scene::Particles, &DetectorConfig { threshold, ..Default::default() });
}

#[divan::bench]
fn background_grid_refresh(bencher: Bencher) {
    let (image, mut grid) = (Scene::Sparse.image(), BackgroundGrid::new(32));
    bencher.counter(BytesCount::new(W * H)).bench_local(|| grid.refresh(black_box(&image)));
}

#[divan::bench]
fn otsu(bencher: Bencher) {
    let image = Scene::Particles.image();
    bencher.counter(BytesCount::new(W * H)).bench_local(|| otsu_level(black_box(&image)));
}
