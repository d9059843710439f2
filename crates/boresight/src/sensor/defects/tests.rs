//! Defects put into simulated frames are found, scenery and stars are not.

use super::*;
use crate::Pixels;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;

const W: usize = 120;
const H: usize = 90;

/// 32 frames of a shaded scene with an upright edge, a square that moves and standing Gaussian spots; `change` makes the sensor bad.
fn frames(seed: u64, change: impl Fn(usize, usize, f32, &mut ChaCha8Rng) -> f32) -> MeanMap {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut map = MeanMap::default();
    let spots = [(20.3, 20.7), (60.0, 60.0), (90.5, 30.5)];
    for k in 0..32usize {
        let values = (0..W * H).map(|i| {
            let (x, y) = (i % W, i / W);
            let mut v = 300.0 + 0.5 * x as f32 + if x > 70 && y > 50 { 150.0 } else { 0.0 };
            if (10 + 2 * k..20 + 2 * k).contains(&x) && (70..80).contains(&y) {
                v += 200.0;
            }
            for (sx, sy) in spots {
                // A pixel-integrated spot of deviation 0.5 px, the sharpest there is: 1000 counts in all.
                let share = |c: f64, x: usize| {
                    let e = |edge: f64| libm::erf((edge - c) / (0.5 * std::f64::consts::SQRT_2));
                    0.5 * (e(x as f64 + 0.5) - e(x as f64 - 0.5))
                };
                v += (1000.0 * share(sx, x) * share(sy, y)) as f32;
            }
            let v = change(x, y, v, &mut rng) + 5.0 * rng.sample::<f32, _>(StandardNormal);
            v.round() as u16
        });
        map.push(&Pixels::Gray16(Image::from_vec(W, H, values.collect()).unwrap())).unwrap();
    }
    map
}

#[test]
fn scenery_stars_and_noise_are_no_defects() {
    for seed in 0..4 {
        let found = find_defects(&frames(seed, |_, _, v, _| v));
        assert_eq!(found, Defects::default(), "{seed}");
    }
}

#[test]
fn hot_dead_stuck_and_blinking_pixels_are_found_and_no_others() {
    let found = find_defects(&frames(9, |x, y, v, rng| match (x, y) {
        (30, 40) | (31, 40) => v + 90.0,
        (50, 10) => 0.0,
        // Stuck at its neighbours' value, but for the noise that is added: a minus of the same noise is not at hand, so it is noisy instead.
        (100, 80) => v + if rng.random::<f32>() < 0.5 { 80.0 } else { -80.0 },
        (0, 0) => v + 200.0,
        _ => v,
    }));
    assert_eq!(found.pixels, [[0, 0], [50, 10], [30, 40], [31, 40], [100, 80]]);
    assert!(found.columns.is_empty());
}

#[test]
fn a_pixel_that_never_changes_is_found_where_its_neighbours_do() {
    let mut rng = ChaCha8Rng::seed_from_u64(3);
    let mut map = MeanMap::default();
    for _ in 0..32 {
        let mut image = Image::filled(20, 20, 0u8);
        image
            .as_mut_slice()
            .iter_mut()
            .for_each(|v| *v = (100.0 + 3.0 * rng.sample::<f32, _>(StandardNormal)).round() as u8);
        image.row_mut(7)[5] = 100;
        map.push(&Pixels::Gray8(image)).unwrap();
    }
    assert_eq!(find_defects(&map).pixels, [[5, 7]]);
}

#[test]
fn offsets_of_columns_are_found_to_a_fraction_of_the_noise() {
    let mut rng = ChaCha8Rng::seed_from_u64(4);
    let offsets: Vec<f32> = (0..W).map(|_| 4.0 * rng.sample::<f32, _>(StandardNormal)).collect();
    let found = find_defects(&frames(5, |x, _, v, _| v + offsets[x]));
    assert_eq!(found.columns.len(), W);
    // Offsets are told up to a line through 31 of them, known to 1.25 x 4 / √31 = 0.9 in its middle and twice that at its ends, where the frame's 30 outermost
    // columns are: 1.0 rms of all.
    let left: Vec<f32> = offsets.iter().zip(&found.columns).map(|(o, f)| o - f).collect();
    let mean = left.iter().sum::<f32>() / W as f32;
    let rms = (left.iter().map(|v| (v - mean).powi(2)).sum::<f32>() / W as f32).sqrt();
    assert!(rms < 1.3, "{rms} of 4");
    assert!(found.pixels.is_empty(), "{:?}", found.pixels);
    assert!((found.column_rms() - 4.0).abs() < 0.8, "{}", found.column_rms());
}

#[test]
fn frames_without_noise_and_light_that_comes_rarely_have_no_defects() {
    let mut rng = ChaCha8Rng::seed_from_u64(6);
    let mut scene = Image::filled(W, H, 0u8);
    // Whole numbers of a codec's still picture: patches of a few counts.
    for (i, v) in scene.as_mut_slice().iter_mut().enumerate() {
        let (x, y) = ((i % W) as f64, (i / W) as f64);
        *v = (60.0
            + 3.0 * (0.11 * x).sin() * (0.07 * y).cos()
            + 20.0 * f64::from(u8::from(x > 2.0 * y))
            + rng.random::<f64>()) as u8;
    }
    let (mut still, mut rare) = (MeanMap::default(), MeanMap::default());
    for _ in 0..32 {
        still.push(&Pixels::Gray8(scene.clone())).unwrap();
        let values = (0..W * H).map(|_| if rng.random::<f64>() < 0.04 { rng.random_range(3..30) } else { 0 }).collect();
        rare.push(&Pixels::Gray8(Image::from_vec(W, H, values).unwrap())).unwrap();
    }
    assert_eq!(find_defects(&still), Defects::default());
    assert_eq!(find_defects(&rare), Defects::default());
}

#[test]
fn frames_too_small_or_too_few_have_no_defects() {
    assert_eq!(find_defects(&MeanMap::default()), Defects::default());
    let mut map = MeanMap::default();
    map.push(&Pixels::GrayF32(Image::filled(2, 9, 1.0))).unwrap();
    assert_eq!(find_defects(&map), Defects::default());
    let mut map = MeanMap::default();
    let mut image = Image::filled(9, 9, 1.0f32);
    image.row_mut(4)[4] = f32::NAN;
    map.push(&Pixels::GrayF32(image)).unwrap();
    assert_eq!(find_defects(&map).pixels, [[4, 4]]);
}
