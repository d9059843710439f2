//! The covariance of a centroid is honest: the normalised error over 10 000 rendered targets has mean square 2.

use boresight::Image;
use boresight::vision::segment;
use boresight::vision::{CentroidMethod, ClusterConfig};
use boresight::vision::{Surroundings, centroid};
use nalgebra::Vector2;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

const N: usize = 10_000;
const SIDE: usize = 31;
const GROUND: f64 = 50.0;

/// Spots of random size, height and sub-pixel place; returns the mean of eᵀ C⁻¹ e for each (method, weigh above ground).
fn mean_squares(noise: f64, k: f64, sigma: (f64, f64), methods: &[(CentroidMethod, bool)]) -> Vec<f64> {
    let mut rng = ChaCha8Rng::seed_from_u64(20_261_121);
    let level = (GROUND + k * noise).ceil();
    let config = ClusterConfig::default();
    let (mut total, mut n) = (vec![0.0; methods.len()], 0usize);
    for _ in 0..N {
        let s = rng.random_range(sigma.0..sigma.1);
        let height = rng.random_range(60.0..140.0);
        let truth = Vector2::new(15.0 + rng.random_range(-0.5..0.5), 15.0 + rng.random_range(-0.5..0.5));
        let pixels = (0..SIDE * SIDE)
            .map(|i| {
                let d2 = (Vector2::new((i % SIDE) as f64, (i / SIDE) as f64) - truth).norm_squared();
                let z: f64 = StandardNormal.sample(&mut rng);
                (GROUND + height * (-d2 / (2.0 * s * s)).exp() + noise * z).round().clamp(0.0, 255.0) as u8
            })
            .collect();
        let image = Image::from_vec(SIDE, SIDE, pixels).unwrap();
        let regions = segment(&image, level as u8, 255, &config);
        let target = regions.iter().max_by_key(|r| r.area).unwrap();
        for (sum, (method, above)) in total.iter_mut().zip(methods) {
            let around = Surroundings {
                background: if *above { GROUND } else { 0.0 },
                sign: 1.0,
                variance: noise * noise + 1.0 / 12.0,
                gain: 0.0,
                level: Some(level - 0.5),
                ground: Some(GROUND),
            };
            let c = centroid(target, &image, *method, &around);
            let e = c.position - truth;
            *sum += (e.transpose() * c.cov.cholesky().unwrap().solve(&e))[(0, 0)];
        }
        n += 1;
    }
    total.iter().map(|t| t / n as f64).collect()
}

#[test]
fn the_normalised_error_of_every_centroid_has_mean_square_two() {
    use CentroidMethod::{Bbox, Binary, BoxCentre, Mask};
    let methods = [(Mask, true), (Mask, false), (Binary, false), (Bbox, false), (Bbox, true), (BoxCentre, false)];
    // Noise 4 counts, threshold at 5 times the noise: peaks of 15 to 35 times the noise.
    let ms = mean_squares(4.0, 5.0, (1.5, 2.5), &methods);
    println!("{ms:?}");
    // The mean of 10 000 squares has the deviation 0.02.
    for (m, method) in ms.iter().zip(&methods) {
        // Weighed above the background, a whole rectangle is on the safe side: its covariance is up to 25 % too large.
        let safe = *method == (Bbox, true);
        let low = if safe { 0.75 } else { 0.95 };
        assert!((low..1.05).contains(&(m / 2.0)), "{method:?}: {m}");
    }
}
