//! Fits of spots in windows of 9 x 9 px, with cutting the window; 512 spots a run.
//!
//! Run: `cargo bench -p boresight --bench fit`. Fixed seed; one thread. Peak 20 deviations of the noise, σ = 1.3 px.

use boresight::Image;
use boresight::vision::fit::{SensorNoise, Spot, SpotModel, Stamp, Width, fit_spots};
use divan::{Bencher, black_box, counter::ItemsCount};
use nalgebra::Vector2;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, Normal};

const N: usize = 512;

fn main() {
    divan::main();
}

/// Windows with one spot each, and where the fit starts.
fn windows() -> Vec<(Image<f32>, Vector2<f64>)> {
    let mut rng = ChaCha8Rng::seed_from_u64(5);
    let noise = Normal::new(0.0, 4.0).unwrap();
    (0..N)
        .map(|_| {
            let place = Vector2::new(3.5 + rng.random::<f64>(), 3.5 + rng.random::<f64>());
            let value = |i: usize| {
                let d2 = (Vector2::new((i % 9) as f64, (i / 9) as f64) - place).norm_squared();
                120.0 + 80.0 * (-d2 / 3.38).exp()
            };
            let values = (0..81).map(|i| (value(i) + noise.sample(&mut rng)) as f32).collect();
            (Image::from_vec(9, 9, values).unwrap(), place + Vector2::new(0.1, -0.1))
        })
        .collect()
}

fn run(bencher: Bencher<'_, '_>, noise: SensorNoise, width: Width, motion: Vector2<f64>) {
    let windows = windows();
    bencher.counter(ItemsCount::new(N)).bench_local(|| {
        for (image, place) in &windows {
            let stamp = Stamp::cut(image, Vector2::new(4.0, 4.0), 4, &noise, None).unwrap();
            let guess = Spot { motion, ..Spot::round(*place, 1.0, 1.3) };
            black_box(fit_spots(&stamp, &[guess], SpotModel { width, slope: true })).ok();
        }
    });
}

const STILL: Vector2<f64> = Vector2::new(0.0, 0.0);

#[divan::bench]
fn round_constant_noise(bencher: Bencher<'_, '_>) {
    run(bencher, SensorNoise::constant(16.0), Width::Round, STILL);
}

#[divan::bench]
fn round_light(bencher: Bencher<'_, '_>) {
    run(bencher, SensorNoise { read_variance: 4.0, gain: 0.6, offset: 100.0 }, Width::Round, STILL);
}

#[divan::bench]
fn elliptic_constant_noise(bencher: Bencher<'_, '_>) {
    run(bencher, SensorNoise::constant(16.0), Width::Elliptic, STILL);
}

#[divan::bench]
fn smeared_constant_noise(bencher: Bencher<'_, '_>) {
    run(bencher, SensorNoise::constant(16.0), Width::Round, Vector2::new(1.6, 1.2));
}
