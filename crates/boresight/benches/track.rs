//! Time of association and tracking: a scan of the tracker, gating and pairing by itself, assignment, k best.
//!
//! Targets lie in a square whose side grows with their number (60 √N px), 90 % are detected, clutter is 10 % of N, fixed
//! seed. The long table with memory and quality is `cargo run --release -p xtask -- bench-track`.

use boresight::associate::JpdaConfig;
use boresight::associate::assignment::{Dense, k_best};
use boresight::associate::{AssociatorConfig, Gates, Pair, Prior};
use boresight::track::{self, MhtConfig, TrackerConfig};
use boresight::{Detection, Extent, FrameIndex, Scan, Timestamp};
use nalgebra::{Matrix2, Vector2};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

fn main() {
    divan::main();
}

const SCANS: usize = 40;

fn scans(n: usize) -> Vec<Scan> {
    let mut rng = ChaCha8Rng::seed_from_u64(4);
    let side = (60.0 * (n as f64).sqrt()).max(400.0);
    let mut targets: Vec<(Vector2<f64>, Vector2<f64>)> = (0..n)
        .map(|_| {
            let mut pair = |low: f64, high: f64| Vector2::new(rng.random_range(low..high), rng.random_range(low..high));
            (pair(0.0, side), pair(-2.5, 2.5))
        })
        .collect();
    (0..SCANS)
        .map(|k| {
            let mut points: Vec<Vector2<f64>> = Vec::new();
            for (p, v) in &mut targets {
                if rng.random::<f64>() < 0.9 {
                    points.push(*p + Vector2::new(rng.random_range(-1.7..1.7), rng.random_range(-1.7..1.7)));
                }
                *p += *v;
            }
            points.extend((0..n / 10).map(|_| Vector2::new(rng.random_range(0.0..side), rng.random_range(0.0..side))));
            let detection = |p: &Vector2<f64>| {
                Detection::at(*p, Matrix2::identity())
                    .with_extent(Extent { left_px: p.x - 5.0, top_px: p.y - 5.0, width_px: 10.0, height_px: 10.0 })
                    .with_area_px(100)
            };
            Scan::at(FrameIndex(k as u64), Timestamp::from_secs_f64(k as f64))
                .with_detections(points.iter().map(detection).collect())
        })
        .collect()
}

fn config(associator: AssociatorConfig) -> TrackerConfig {
    TrackerConfig {
        acceleration_std_px_per_s2: Some(0.1),
        extra_noise_px: 0.0,
        max_speed_px_per_s: 8.0,
        clutter_density_per_px2: 3e-5,
        coast_s: 6.0,
        associator,
        ..TrackerConfig::default()
    }
}

fn run(b: divan::Bencher<'_, '_>, n: usize, config: &TrackerConfig) {
    let scans = scans(n);
    b.counter(divan::counter::ItemsCount::new(SCANS)).bench_local(|| {
        let mut tracker = track::build(config).expect("a sound configuration");
        scans.iter().map(|s| tracker.step(s).expect("a sound scan").len()).sum::<usize>()
    });
}

#[divan::bench(args = [100, 1000, 10_000], sample_count = 20)]
fn scan_of_n_targets_global_nearest(b: divan::Bencher<'_, '_>, n: usize) {
    run(b, n, &config(AssociatorConfig::default()));
}

#[divan::bench(args = [100, 1000], sample_count = 20)]
fn scan_of_n_targets_jpda(b: divan::Bencher<'_, '_>, n: usize) {
    run(b, n, &config(AssociatorConfig::Jpda(JpdaConfig::default())));
}

#[divan::bench(args = [100], sample_count = 10)]
fn scan_of_n_targets_mht(b: divan::Bencher<'_, '_>, n: usize) {
    run(b, n, &TrackerConfig { mht: Some(MhtConfig::default()), ..config(AssociatorConfig::default()) });
}

#[divan::bench(args = [100, 500])]
fn dense_assignment_of_n(b: divan::Bencher<'_, '_>, n: usize) {
    let mut rng = ChaCha8Rng::seed_from_u64(7);
    let cost: Vec<f64> = (0..n * n).map(|_| rng.random::<f64>()).collect();
    let mut solver = Dense::default();
    b.bench_local(|| solver.solve(n, &cost).map(|c| c[0]).expect("finite costs"));
}

#[divan::bench(args = [10, 100])]
fn k_best_of_20_tracks(b: divan::Bencher<'_, '_>, k: usize) {
    let mut rng = ChaCha8Rng::seed_from_u64(8);
    let mut gates = Gates::new();
    gates.reset(25, 1.0);
    for i in 0..20u32 {
        for detection in i..i + 5 {
            gates.push(Pair { detection, cost: rng.random_range(0.0..9.0), log_likelihood: 0.0 });
        }
        gates.end_row(Prior { p_detection: 0.9, p_gate: 0.99, existence: 1.0, miss_cost: 9.0 });
    }
    b.bench_local(|| k_best(&gates, k).len());
}
