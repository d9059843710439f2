//! The fit beside the Cramér-Rao bound (its Fisher matrix by differences of a mean by the C library's error function), on seeded noise.

use super::*;
use crate::Image;
use nalgebra::{DMatrix, DVector};
use proptest::prelude::*;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, Poisson, StandardNormal};

const SIDE_PX: usize = 9;

/// Mean of a pixel by the plain formula: [b, bx, by (counts/px), then x, y, F, sx, sy a spot], smeared by 2000 steps of `motion`.
fn mean(x: f64, y: f64, p: &[f64], motion: Vector2<f64>) -> f64 {
    let share = |v: f64, c: f64, s: f64| {
        let e = |edge: f64| libm::erf((edge - c) / (s * std::f64::consts::SQRT_2));
        0.5 * (e(v + 0.5) - e(v - 0.5))
    };
    let n = if motion.norm() > 0.0 { 2000 } else { 1 };
    let spots: f64 = p[3..]
        .chunks_exact(5)
        .map(|q| {
            let at = |k: usize| motion * ((k as f64 + 0.5) / n as f64 - 0.5);
            (0..n).map(|k| q[2] * share(x, q[0] + at(k).x, q[3]) * share(y, q[1] + at(k).y, q[4])).sum::<f64>()
                / n as f64
        })
        .sum();
    let middle = 0.5 * (SIDE_PX - 1) as f64;
    p[0] + p[1] * (x - middle) + p[2] * (y - middle) + spots
}

fn means(p: &[f64], motion: Vector2<f64>) -> Vec<f64> {
    (0..SIDE_PX * SIDE_PX).map(|i| mean((i % SIDE_PX) as f64, (i / SIDE_PX) as f64, p, motion)).collect()
}

/// The bound by brute force: central differences of the mean, a general inverse. `free` lists groups of parameters that move together.
fn bound(p: &[f64], free: &[&[usize]], noise: &SensorNoise) -> DMatrix<f64> {
    let mean = means(p, Vector2::zeros());
    let slopes: Vec<DVector<f64>> = free
        .iter()
        .map(|group| {
            let h = 1e-5 * p[group[0]].abs().max(1.0);
            let moved = |h: f64| {
                let mut q = p.to_vec();
                group.iter().for_each(|&i| q[i] += h);
                DVector::from_vec(means(&q, Vector2::zeros()))
            };
            (moved(h) - moved(-h)) / (2.0 * h)
        })
        .collect();
    let weight = |i: usize| 1.0 / (noise.read_variance + noise.gain * (mean[i] - noise.offset));
    let n = free.len();
    let fisher = DMatrix::from_fn(n, n, |a, b| (0..mean.len()).map(|i| slopes[a][i] * slopes[b][i] * weight(i)).sum());
    fisher.try_inverse().unwrap()
}

/// A frame of these means with the noise.
fn draw(mean: &[f64], noise: &SensorNoise, rng: &mut ChaCha8Rng) -> Image<f32> {
    let values = mean.iter().map(|&m| {
        let light = if noise.gain > 0.0 {
            noise.offset + noise.gain * Poisson::new((m - noise.offset) / noise.gain).unwrap().sample(rng)
        } else {
            m
        };
        (light + noise.read_variance.sqrt() * rng.sample::<f64, _>(StandardNormal)) as f32
    });
    Image::from_vec(SIDE_PX, SIDE_PX, values.collect()).unwrap()
}

fn stamp(image: &Image<f32>, noise: &SensorNoise) -> Stamp {
    Stamp::cut(image, Vector2::new(4.0, 4.0), 4, noise, None).unwrap()
}

fn clean(p: &[f64], motion: Vector2<f64>) -> Image<f32> {
    Image::from_vec(SIDE_PX, SIDE_PX, means(p, motion).iter().map(|v| *v as f32).collect()).unwrap()
}

#[test]
fn clean_spots_are_found_whatever_their_form() {
    let still = Vector2::zeros();
    let noise = [SensorNoise::constant(1e-4), SensorNoise { read_variance: 2.0, gain: 0.5, offset: 90.0 }];
    let round = SpotModel::default();
    let elliptic = SpotModel { width: Width::Elliptic, slope: true };
    for noise in &noise {
        for (p, motion, model) in [
            ([100.0, 0.5, -0.3, 4.3, 3.8, 300.0, 1.3, 1.3], still, round),
            ([200.0, 0.0, 0.0, 3.6, 4.45, -250.0, 0.9, 0.9], still, round),
            ([100.0, 0.5, -0.3, 4.1, 3.7, 500.0, 0.8, 1.6], still, elliptic),
            ([100.0, 0.2, 0.1, 4.2, 3.9, 500.0, 1.1, 1.1], Vector2::new(2.5, -1.5), round),
            ([100.0, 0.2, 0.1, 4.2, 3.9, 500.0, 0.9, 1.2], Vector2::new(0.6, 0.4), elliptic),
        ] {
            let image = clean(&p, motion);
            let mut guess = Spot::round(Vector2::new(4.0, 4.0), p[5].signum(), 1.1);
            guess.motion = motion;
            let fit = fit_spots(&stamp(&image, noise), &[guess], model).unwrap();
            let found = fit.spots()[0].spot;
            // Values are f32: 1e-5 counts of 300.
            assert!((found.position - Vector2::new(p[3], p[4])).norm() < 1e-4, "{p:?} {noise:?}: {found:?}");
            assert!((found.flux - p[5]).abs() < 0.05 && (found.sigma - Vector2::new(p[6], p[7])).norm() < 1e-3);
            assert!((fit.ground - p[0]).abs() < 0.01 && (fit.slope - Vector2::new(p[1], p[2])).norm() < 1e-3);
        }
    }
}

#[test]
fn the_stated_covariance_is_the_inverse_of_fishers_matrix_by_differences() {
    // Little noise: the fit then ends at the truth.
    for noise in [SensorNoise::constant(1e-4), SensorNoise { read_variance: 2e-3, gain: 5e-4, offset: 90.0 }] {
        let p = [100.0, 0.5, -0.3, 4.3, 3.8, 300.0, 1.3, 1.3];
        let image = clean(&p, Vector2::zeros());
        let guess = Spot::round(Vector2::new(4.0, 4.0), 1.0, 1.3);
        let cases: [(SpotModel, &[&[usize]]); 4] = [
            (SpotModel::default(), &[&[3], &[4], &[5], &[6, 7], &[0], &[1], &[2]]),
            (SpotModel { width: Width::Elliptic, slope: true }, &[&[3], &[4], &[5], &[6], &[0], &[1], &[2], &[7]]),
            (SpotModel { width: Width::Round, slope: false }, &[&[3], &[4], &[5], &[6, 7], &[0]]),
            (SpotModel { width: Width::Known, slope: true }, &[&[3], &[4], &[5], &[0], &[1], &[2]]),
        ];
        for (model, free) in cases {
            let flat = [100.0, 0.0, 0.0, 4.3, 3.8, 300.0, 1.3, 1.3];
            let (p, image) = if model.slope { (&p, &image) } else { (&flat, &clean(&flat, Vector2::zeros())) };
            let bound = bound(p, free, &noise);
            let found = fit_spots(&stamp(image, &noise), &[guess], model).unwrap().spots()[0];
            let close = |a: f64, b: f64| (a - b).abs() < 1e-3 * bound[(0, 0)].max(b.abs());
            assert!(
                close(found.bound[(0, 0)], bound[(0, 0)]) && close(found.bound[(1, 1)], bound[(1, 1)]),
                "{model:?}"
            );
            assert!(close(found.bound[(0, 1)], bound[(0, 1)]), "{model:?}: {} {bound}", found.bound);
            assert!((found.flux_variance / bound[(2, 2)] - 1.0).abs() < 1e-3);
            if model.width != Width::Known {
                assert!((found.sigma_variance.x / bound[(3, 3)] - 1.0).abs() < 1e-3);
            }
        }
    }
}

#[test]
fn the_two_ways_to_the_sums_agree() {
    let p = [100.0, 0.5, -0.3, 4.3, 3.8, 300.0, 1.3, 0.9];
    let mut rng = ChaCha8Rng::seed_from_u64(5);
    for noise in [SensorNoise::constant(9.0), SensorNoise { read_variance: 2.0, gain: 0.5, offset: 90.0 }] {
        let stamp = stamp(&draw(&means(&p, Vector2::zeros()), &noise, &mut rng), &noise);
        let one = Single::new(&stamp).sums(&[100.0, 1.0, -2.0, 4.1, 3.9, 280.0, 0.2, -0.1]);
        let mut q = [0.0; several::PARAMETERS];
        q[..8].copy_from_slice(&[100.0, 1.0, -2.0, 4.1, 3.9, 280.0, 0.2, -0.1]);
        let mut to = [HELD; several::PARAMETERS];
        (0..8).for_each(|i| to[i] = i);
        let two = Several::new(&stamp, 1, [Vector2::zeros(); MOST_SPOTS], to).sums(&q);
        assert!((one.cost - two.cost).abs() < 1e-8 * one.cost.abs() && (one.chi2 / two.chi2 - 1.0).abs() < 1e-12);
        for i in 0..8 {
            assert!((one.vector[i] - two.vector[i]).abs() < 1e-9 * one.matrix[i][i].sqrt().max(1.0) * 10.0);
            for j in 0..=i {
                let unit = (one.matrix[i][i] * one.matrix[j][j]).sqrt();
                assert!((one.matrix[i][j] - two.matrix[i][j]).abs() < 1e-12 * unit, "{i} {j}");
            }
        }
    }
}

/// Errors over many frames: mean of the two axes in standard deviations, rms over the bound, NEES, share of fits, mean p.
struct Errors {
    bias: Vector2<f64>,
    over_bound: f64,
    nees: f64,
    fitted: f64,
    mean_p: f64,
}

fn errors(p: &[f64; 8], model: SpotModel, free: &[&[usize]], noise: &SensorNoise, n: usize, seed: u64) -> Errors {
    let bound = bound(p, free, noise);
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mean = means(p, Vector2::zeros());
    let (mut sum, mut square, mut nees, mut fitted, mut mean_p) = (Vector2::zeros(), 0.0, 0.0, 0.0, 0.0);
    for _ in 0..n {
        let image = draw(&mean, noise, &mut rng);
        let start = Vector2::new(p[3] + 0.4 * rng.random::<f64>() - 0.2, p[4] + 0.4 * rng.random::<f64>() - 0.2);
        let Ok(fit) = fit_spots(&stamp(&image, noise), &[Spot::round(start, 1.0, 1.3)], model) else { continue };
        let found = fit.spots()[0];
        let e = found.spot.position - Vector2::new(p[3], p[4]);
        sum += e;
        square += e.norm_squared();
        nees += e.dot(&(found.cov.try_inverse().unwrap() * e));
        mean_p += fit.goodness.p;
        fitted += 1.0;
    }
    let trace = bound[(0, 0)] + bound[(1, 1)];
    let sd = |v: f64| (v / fitted).sqrt();
    Errors {
        bias: Vector2::new(sum.x / fitted / sd(bound[(0, 0)]), sum.y / fitted / sd(bound[(1, 1)])),
        over_bound: (square / fitted / trace).sqrt(),
        nees: nees / fitted,
        fitted: fitted / n as f64,
        mean_p: mean_p / fitted,
    }
}

#[test]
fn errors_reach_the_bound_at_every_phase_without_bias_and_as_stated() {
    let free: [&[usize]; 7] = [&[3], &[4], &[5], &[6, 7], &[0], &[1], &[2]];
    let n = 600;
    let (mut nees, mut cells) = (0.0, 0.0);
    for (k, (dx, dy)) in [(0.0, 0.0), (0.25, 0.0), (0.5, 0.5), (-0.3, 0.4)].into_iter().enumerate() {
        for (l, (snr, noise)) in [
            (5.0, SensorNoise::constant(16.0)),
            (20.0, SensorNoise::constant(16.0)),
            // Light: 35 and 400 electrons at the peak over a ground of 10, the first 5 deviations high.
            (35.0, SensorNoise { read_variance: 4.0, gain: 2.0, offset: 100.0 }),
            (400.0, SensorNoise { read_variance: 4.0, gain: 2.0, offset: 100.0 }),
        ]
        .into_iter()
        .enumerate()
        {
            let height = if noise.gain > 0.0 { snr * noise.gain } else { snr * 4.0 };
            let p = [120.0, 0.0, 0.0, 4.0 + dx, 4.0 + dy, height * std::f64::consts::TAU * 1.69, 1.3, 1.3];
            let e = errors(&p, SpotModel::default(), &free, &noise, n, (10 * k + l) as u64);
            // A mean of n errors has the deviation 1 in these units, the rms 1 / √(4n) = 2 %, the NEES 2 / √n = 8 %.
            assert!(e.bias.amax() < 3.7, "{p:?} {noise:?}: bias {}", e.bias);
            assert!(e.over_bound < 1.05 + 0.06 && e.over_bound > 0.94, "{p:?} {noise:?}: {}", e.over_bound);
            assert!((e.nees - 2.0).abs() < 0.3 && e.fitted > 0.995, "{p:?} {noise:?}: {} {}", e.nees, e.fitted);
            assert!((e.mean_p - 0.5).abs() < 0.05, "{p:?} {noise:?}: mean p {}", e.mean_p);
            nees += e.nees;
            cells += 1.0;
        }
    }
    // 9600 fits: 2 ± 0.02.
    println!("NEES {}", nees / cells);
    assert!((nees / cells - 2.0).abs() < 0.06, "{}", nees / cells);
}

#[test]
fn two_that_overlap_are_told_apart_with_an_honest_covariance() {
    let noise = SensorNoise::constant(16.0);
    let p = [120.0, 0.0, 0.0, 2.9, 3.6, 600.0, 1.2, 1.2, 5.4, 4.2, 450.0, 1.2, 1.2];
    let mean = means(&p, Vector2::zeros());
    let mut rng = ChaCha8Rng::seed_from_u64(8);
    let (mut nees, mut alone, n) = (0.0, 0.0, 500);
    for _ in 0..n {
        let stamp = stamp(&draw(&mean, &noise, &mut rng), &noise);
        let guesses = [Spot::round(Vector2::new(3.1, 3.8), 1.0, 1.2), Spot::round(Vector2::new(5.2, 4.0), 1.0, 1.2)];
        let fit = fit_spots(&stamp, &guesses, SpotModel { width: Width::Alike, slope: true }).unwrap();
        for (k, f) in fit.spots().iter().enumerate() {
            let e = f.spot.position - Vector2::new(p[3 + 5 * k], p[4 + 5 * k]);
            nees += e.dot(&(f.cov.try_inverse().unwrap() * e)) / f64::from(2 * n);
        }
        if let Ok(one) = fit_spots(&stamp, &guesses[..1], SpotModel::default()) {
            alone += one.goodness.p / f64::from(n);
        }
    }
    // 1000 fits: 2 ± 0.06. Alone the first cannot explain the pixels.
    assert!((nees - 2.0).abs() < 0.25, "{nees}");
    assert!(alone < 0.01, "{alone}");
}

#[test]
fn a_map_of_variances_weighs_the_noisy_pixels_less() {
    let p = [120.0, 0.0, 0.0, 4.2, 3.8, 300.0, 1.3, 1.3];
    let mean = means(&p, Vector2::zeros());
    let variance = |i: usize| if i % 5 == 2 { 900.0f32 } else { 4.0 };
    let map = Image::from_vec(SIDE_PX, SIDE_PX, (0..81).map(variance).collect()).unwrap();
    let noise = SensorNoise { read_variance: 4.0, gain: 1.0, offset: 100.0 };
    let mut rng = ChaCha8Rng::seed_from_u64(9);
    let (mut nees, mut with, mut without, n) = (0.0, 0.0, 0.0, 500);
    for _ in 0..n {
        let mut image = draw(&mean, &SensorNoise { read_variance: 0.0, ..noise }, &mut rng);
        for (i, v) in image.as_mut_slice().iter_mut().enumerate() {
            *v += variance(i).sqrt() * rng.sample::<f32, _>(StandardNormal);
        }
        let guess = [Spot::round(Vector2::new(4.0, 4.0), 1.0, 1.3)];
        let model = SpotModel { width: Width::Known, slope: false };
        let error = |map| {
            let stamp = Stamp::cut(&image, Vector2::new(4.0, 4.0), 4, &noise, map).unwrap();
            let found = fit_spots(&stamp, &guess, model).map(|f| f.spots()[0]).ok()?;
            Some((found.spot.position - Vector2::new(4.2, 3.8), found.cov))
        };
        let (e, cov) = error(Some(&map)).unwrap();
        nees += e.dot(&(cov.try_inverse().unwrap() * e)) / f64::from(n);
        with += e.norm_squared() / f64::from(n);
        without += error(None).map_or(1.0, |(e, _)| e.norm_squared()) / f64::from(n);
    }
    assert!((nees - 2.0).abs() < 0.36 && with < 0.6 * without, "{nees} {with} {without}");
}

#[test]
fn what_is_no_spot_is_told_by_the_chance_of_its_residuals() {
    let mut rng = ChaCha8Rng::seed_from_u64(4);
    let noise = SensorNoise::constant(4.0);
    // A square of 5 x 5 px, 25 deviations high.
    let mean: Vec<f64> =
        (0..81).map(|i| if (2..7).contains(&(i % 9)) && (2..7).contains(&(i / 9)) { 150.0 } else { 100.0 }).collect();
    let image = draw(&mean, &noise, &mut rng);
    let fit = fit_spots(&stamp(&image, &noise), &[Spot::round(Vector2::new(4.0, 4.0), 1.0, 1.5)], SpotModel::default());
    let fit = fit.unwrap();
    assert!(fit.goodness.p < 1e-6 && fit.unexplained > 3.0, "{:?}", fit.goodness);
    // Even ground has no spot to be found.
    let flat = stamp(&Image::filled(9, 9, 5.0f32), &noise);
    let guess = Spot::round(Vector2::new(4.0, 4.0), 1.0, 1.5);
    assert!(fit_spots(&flat, &[guess], SpotModel::default()).is_err());
    assert_eq!(fit_spots(&flat, &[], SpotModel::default()), Err(Unfit::TooLittle));
    assert_eq!(fit_spots(&flat, &[guess; 5], SpotModel::default()), Err(Unfit::TooLittle));
}

proptest! {
    #[test]
    fn any_frame_any_guess_and_any_noise_give_a_fit_or_a_reason(
        values in prop::collection::vec(prop_oneof![4 => -50.0f32..300.0, 1 => any::<f32>()], 130),
        guesses in prop::collection::vec((-3.0f64..16.0, -3.0f64..13.0, -500.0f64..500.0, 0.1f64..5.0, any::<bool>()), 1..5),
        half in 0usize..12,
        noise in (prop_oneof![Just(0.0), 1e-9f64..100.0, any::<f64>()], prop_oneof![Just(0.0), 1e-9f64..10.0, any::<f64>()], -100.0f64..200.0),
        width in prop_oneof![Just(Width::Known), Just(Width::Round), Just(Width::Elliptic)],
        slope: bool,
    ) {
        let image = Image::from_vec(13, 10, values).unwrap();
        let noise = SensorNoise { read_variance: noise.0, gain: noise.1, offset: noise.2 };
        let guesses: Vec<Spot> = guesses
            .iter()
            .map(|&(x, y, flux, sigma, moves)| Spot {
                motion: if moves { Vector2::new(x, -y) } else { Vector2::zeros() },
                ..Spot::round(Vector2::new(x, y), flux, sigma)
            })
            .collect();
        if let Some(stamp) = Stamp::cut(&image, guesses[0].position, half, &noise, None)
            && let Ok(fit) = fit_spots(&stamp, &guesses, SpotModel { width, slope })
        {
            for f in fit.spots() {
                prop_assert!((-0.5..12.5).contains(&f.spot.position.x) && (-0.5..9.5).contains(&f.spot.position.y));
                prop_assert!(f.cov.cholesky().is_some(), "{:?}", f);
            }
            prop_assert!((0.0..=1.0).contains(&fit.goodness.p));
        }
    }
}
