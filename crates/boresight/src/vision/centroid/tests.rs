//! The terms of a centroid's covariance, each against an independent value: a derivative by differences, an integral, a series, or trials.

use super::*;
use crate::vision::cluster::segment;
use crate::vision::config::ClusterConfig;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

pub(super) fn close(a: f64, b: f64, tolerance: f64) -> bool {
    (a - b).abs() <= tolerance * b.abs().max(1e-12)
}

/// Values in an L with a bump: no symmetry, so that every sum and cross term counts. Values of 0 are outside.
const LETTER: [[f32; 5]; 4] =
    [[0.0, 30.0, 0.0, 0.0, 0.0], [0.0, 45.0, 80.0, 0.0, 0.0], [0.0, 60.0, 20.0, 35.0, 0.0], [0.0, 0.0, 0.0, 25.0, 0.0]];

/// The letter at columns 3.., rows 2.. of a frame whose other pixels are `ground`.
fn letter(ground: f32, scale: f32) -> (Image<f32>, Region) {
    let mut image = Image::filled(12, 9, ground);
    let mut region: Option<Region> = None;
    for (y, row) in LETTER.iter().enumerate() {
        for (x, v) in row.iter().enumerate().filter(|(_, v)| **v > 0.0) {
            let (x, y) = (x + 3, y + 2);
            image.row_mut(y)[x] = scale * v;
            let one = Region::of_run(0, y as u32, x as u32, x as u32, image.row(y));
            match &mut region {
                Some(r) => r.absorb(&one),
                None => region = Some(one),
            }
        }
    }
    (image, region.unwrap())
}

/// The pixels of a region of the letter, or of its box: (x, y, value).
fn pixels(image: &Image<f32>, region: &Region, whole_box: bool) -> Vec<(f64, f64, f64)> {
    let mut out = Vec::new();
    for y in region.top..=region.bottom {
        for x in region.left..=region.right {
            if whole_box || LETTER[y as usize - 2][x as usize - 3] > 0.0 {
                out.push((f64::from(x), f64::from(y), f64::from(image.row(y as usize)[x as usize])));
            }
        }
    }
    out
}

/// Σ σ² (∂c/∂I)(∂c/∂I)ᵀ by differences, each pixel's light spread evenly over its square.
fn propagated(pixels: &[(f64, f64, f64)], around: &Surroundings, variance: f64) -> Matrix2<f64> {
    let weight = |v: f64| around.sign * (v - around.background);
    let place = |changed: Option<(usize, f64, Vector2<f64>)>| {
        let (mut sum, mut moment) = (0.0, Vector2::zeros());
        for (i, &(x, y, v)) in pixels.iter().enumerate() {
            sum += weight(v);
            moment += Vector2::new(x, y) * weight(v);
            if let Some((k, h, at)) = changed
                && k == i
            {
                sum += around.sign * h;
                moment += (Vector2::new(x, y) + at) * (around.sign * h);
            }
        }
        moment / sum
    };
    let mut cov = Matrix2::zeros();
    const PARTS: usize = 20;
    for i in 0..pixels.len() {
        for part in 0..PARTS * PARTS {
            let at = |k: usize| (k as f64 + 0.5) / PARTS as f64 - 0.5;
            let at = Vector2::new(at(part % PARTS), at(part / PARTS));
            let d = (place(Some((i, 1e-5, at))) - place(Some((i, -1e-5, at)))) / 2e-5;
            cov += d * d.transpose() * (variance / (PARTS * PARTS) as f64);
        }
    }
    cov
}

fn same(a: &Matrix2<f64>, b: &Matrix2<f64>, tolerance: f64) -> bool {
    (a - b).norm() <= tolerance * b.norm()
}

#[test]
fn the_noise_of_the_pixels_goes_into_position_and_covariance_as_the_derivatives_say() {
    let grounds = [(0.0, 1.0, 1.0), (7.0, 1.0, 1.0), (100.0, -1.0, 1.0)];
    for (background, sign, variance) in grounds.into_iter().chain([(7.0, 1.0, 9.0)]) {
        let (image, region) = letter(7.0, 1.0);
        let around = Surroundings { background, sign, variance, ..Surroundings::plain() };
        let inside = pixels(&image, &region, false);
        let c = centroid(&region, &image, CentroidMethod::Mask, &around);
        let weights: f64 = inside.iter().map(|p| sign * (p.2 - background)).sum();
        let x: f64 = inside.iter().map(|p| sign * (p.2 - background) * p.0).sum::<f64>() / weights;
        let y: f64 = inside.iter().map(|p| sign * (p.2 - background) * p.1).sum::<f64>() / weights;
        assert!((c.position - Vector2::new(x, y)).norm() < 1e-9 && close(c.sum, weights, 1e-12));
        let want = propagated(&inside, &around, variance) + floor();
        assert!(same(&c.cov, &want, 2e-3), "{background} {sign}: {} {want}", c.cov);
        assert!(want[(0, 1)].abs() > 0.05 * want[(0, 0)], "the cross term must count: {want}");
    }
}

#[test]
fn the_least_variance_keeps_a_noiseless_covariance_invertible() {
    let (image, region) = letter(0.0, 1.0);
    let around = Surroundings { variance: 0.0, ..Surroundings::plain() };
    let c = centroid(&region, &image, CentroidMethod::Mask, &around);
    assert_eq!(c.cov, Matrix2::identity() * 1e-6);
}

#[test]
fn noise_grows_with_the_mean_intensity_and_never_shrinks_below_the_dark() {
    let (image, region) = letter(0.0, 1.0);
    let noisy = |variance, gain, scale: f32| {
        let (image, region) = if scale == 1.0 { (image.clone(), region.clone()) } else { letter(0.0, scale) };
        let background = if scale < 0.0 { -200.0 } else { 0.0 };
        let around = Surroundings { variance, gain, background, ..Surroundings::plain() };
        centroid(&region, &image, CentroidMethod::Mask, &around).cov - floor()
    };
    let mean = region.sum / f64::from(region.area);
    assert!(same(&noisy(2.0, 0.5, 1.0), &(noisy(1.0, 0.0, 1.0) * (2.0 + 0.5 * mean)), 1e-12));
    assert!(same(&noisy(2.0, 0.5, -1.0), &noisy(2.0, 0.0, -1.0), 1e-12), "intensities below 0 have no shot noise");
}

#[test]
fn the_edge_adds_to_the_noise_of_a_pixel_and_takes_half_of_it_at_most() {
    let (image, region) = letter(0.0, 1.0);
    // The mean is 42.1: pixels over the level 30 add, those under the level 50 (a dark region weighed as a bright one) take away.
    for (level, takes) in [(30.0, false), (50.0, true)] {
        let around = Surroundings { background: 20.0, variance: 400.0, level: Some(level), ..Surroundings::plain() };
        let with = centroid(&region, &image, CentroidMethod::Mask, &around).cov - floor();
        let without = Surroundings { level: None, ..around };
        let without = centroid(&region, &image, CentroidMethod::Mask, &without).cov - floor();
        let edge = Edge::of(&region, &around).weighted();
        assert_eq!(edge < -200.0, takes, "{edge}");
        let want = if takes { 0.5 } else { 1.0 + edge / 400.0 };
        assert!(same(&with, &(without * want), 1e-9), "{level}: {with} {without} {want}");
    }
}

#[test]
fn the_sides_of_a_box_carry_the_light_that_lies_on_them() {
    let (image, region) = letter(4.0, 1.0);
    let around = Surroundings { background: 2.0, variance: 0.0, ..Surroundings::plain() };
    let c = centroid(&region, &image, CentroidMethod::Bbox, &around);
    let weight = |x: u32, y: u32| f64::from(image.row(y as usize)[x as usize]) - 2.0;
    let (l, r, t, b) = (region.left, region.right, region.top, region.bottom);
    let inside = pixels(&image, &region, true);
    let total: f64 = inside.iter().map(|p| p.2 - 2.0).sum();
    let want: Vector2<f64> = inside.iter().map(|p| Vector2::new(p.0, p.1) * (p.2 - 2.0)).sum::<Vector2<f64>>() / total;
    assert!((c.position - want).norm() < 1e-12 && close(c.sum, total, 1e-12));
    // A side that moves out by h takes in a strip at the side with the light of the column outside, one that moves in gives up that of the inside.
    let moved = |light: f64, at: Vector2<f64>, h: f64| (want * total + at * (h * light)) / (total + h * light);
    let h = 1e-6;
    let lever = |inner: f64, outer: f64, at: Vector2<f64>| {
        let slope = |light: f64| (moved(light, at, h) - moved(light, at, -h)) / (2.0 * h);
        0.5 * (slope(inner) + slope(outer))
    };
    let column = |x: u32| (t..=b).map(|y| weight(x, y)).sum::<f64>();
    let row = |y: u32| (l..=r).map(|x| weight(x, y)).sum::<f64>();
    let side_x = |inner: u32, outer: u32, at: f64| lever(column(inner), column(outer), Vector2::new(at, want.y)).x;
    let side_y = |inner: u32, outer: u32, at: f64| lever(row(inner), row(outer), Vector2::new(want.x, at)).y;
    let x2 = side_x(l, l - 1, f64::from(l) - 0.5).powi(2) + side_x(r, r + 1, f64::from(r) + 0.5).powi(2);
    let y2 = side_y(t, t - 1, f64::from(t) - 0.5).powi(2) + side_y(b, b + 1, f64::from(b) + 0.5).powi(2);
    let cov = c.cov - floor();
    assert!(close(cov[(0, 0)], x2 / 12.0, 1e-6) && close(cov[(1, 1)], y2 / 12.0, 1e-6), "{cov} {x2} {y2}");
    assert_eq!(cov[(0, 1)], 0.0);
}

#[test]
fn the_noise_in_a_box_is_that_of_all_its_pixels() {
    let (image, region) = letter(4.0, 1.0);
    let around = Surroundings { background: 2.0, variance: 3.0, gain: 0.1, ..Surroundings::plain() };
    let quiet = Surroundings { variance: 0.0, gain: 0.0, ..around };
    let cov = |a: &Surroundings| centroid(&region, &image, CentroidMethod::Bbox, a).cov;
    let inside = pixels(&image, &region, true);
    let mean = inside.iter().map(|p| p.2).sum::<f64>() / inside.len() as f64;
    let want = propagated(&inside, &around, 3.0 + 0.1 * mean);
    assert!(same(&(cov(&around) - cov(&quiet)), &want, 2e-3), "{} {want}", cov(&around) - cov(&quiet));
}

#[test]
fn at_the_frames_edge_the_side_inside_counts_for_the_one_outside_and_no_value_weighs_nothing() {
    let image = Image::from_vec(3, 2, vec![9.0f32, 5.0, 2.0, 4.0, f32::NAN, 1.0]).unwrap();
    let mut region = Region::of_run(0, 0, 0, 2, image.row(0));
    region.absorb(&Region::of_run(0, 1, 0, 2, image.row(0)));
    let around = Surroundings { background: 1.0, ..Surroundings::plain() };
    let sums = Sums::of_rectangle(&region, &image, &around);
    assert_eq!(sums.sides, [8.0 + 3.0, 1.0, 8.0 + 4.0 + 1.0, 3.0], "left, right, top, bottom less the background of 1");
    assert_eq!((sums.n, sums.w, sums.wx, sums.wy), (6.0, 16.0, 6.0, 3.0));
    assert_eq!((sums.intensity, sums.x, sums.y, sums.xx, sums.xy, sums.yy), (22.0, 6.0, 3.0, 10.0, 3.0, 3.0));
}

#[test]
fn sharp_discs_lie_where_their_binary_centroids_say() {
    // No noise: only the grid moves the centroid. z² of both axes over 4000 discs, mean 2, deviation of the mean 0.03.
    let mut rng = ChaCha8Rng::seed_from_u64(7);
    let (mut sum, n) = (0.0, 4000);
    for _ in 0..n {
        let truth = Vector2::new(15.0 + rng.random::<f64>(), 15.0 + rng.random::<f64>());
        let radius = 4.0 + 4.0 * rng.random::<f64>();
        let mut image = Image::filled(31, 31, 0u8);
        for y in 0..31 {
            for x in 0..31 {
                image.row_mut(y)[x] = 200 * u8::from((Vector2::new(x as f64, y as f64) - truth).norm() <= radius);
            }
        }
        let region = segment(&image, 100, 255, &ClusterConfig::default()).remove(0);
        let around = Surroundings { variance: 0.0, ..Surroundings::plain() };
        let c = centroid(&region, &image, CentroidMethod::Binary, &around);
        let e = c.position - truth;
        sum += (e.transpose() * c.cov.cholesky().unwrap().solve(&e))[(0, 0)];
        // The same weights by another way: every pixel of 200 joins with all its weight at the level 200.
        let sharp = Surroundings { variance: 0.0, level: Some(200.0), ..Surroundings::plain() };
        let mask = centroid(&region, &image, CentroidMethod::Mask, &sharp);
        assert!((mask.position - c.position).norm() < 1e-9 && same(&mask.cov, &c.cov, 1e-6), "{} {}", mask.cov, c.cov);
        assert_eq!((c.sum, mask.sum), (f64::from(region.area), 200.0 * f64::from(region.area)));
    }
    let mean = sum / f64::from(n);
    assert!((mean - 2.0).abs() < 0.1, "{mean}");
}

#[test]
fn the_middle_of_a_sharp_box_is_off_by_its_sides_roundings() {
    // Each side is rounded to a pixel: variance 1/12, so the middle has 1/24.
    let (image, region) = letter(0.0, 1.0);
    let c = centroid(&region, &image, CentroidMethod::BoxCentre, &Surroundings::plain());
    let middle = Vector2::new(f64::from(region.left + region.right), f64::from(region.top + region.bottom)) * 0.5;
    assert_eq!((c.position, c.sum), (middle, f64::from(region.area)));
    assert!(same(&c.cov, &(Matrix2::identity() / 24.0), 1e-12));
    // 0.75 δ² a side is what simulated spots gave.
    let undecided = Surroundings { variance: 1e6, level: Some(30.0), ..Surroundings::plain() };
    let c = centroid(&region, &image, CentroidMethod::BoxCentre, &undecided);
    assert!(same(&c.cov, &(Matrix2::identity() * (0.5 * (1.0 / 12.0 + 0.75))), 1e-12), "{}", c.cov);
}

#[test]
fn weights_that_say_nothing_fall_back_to_the_pixels_alone() {
    let image = Image::from_vec(3, 1, vec![10u8, 20, 10]).unwrap();
    let region = Region::of_run(0, 0, 0, 2, image.row(0));
    // All weights below 0; a sum of 0; and weights of both signs that throw the centroid out of its box on either side.
    for background in [20.0, 40.0 / 3.0] {
        let around = Surroundings { background, ..Surroundings::plain() };
        let c = centroid(&region, &image, CentroidMethod::Mask, &around);
        assert_eq!((c.position, c.sum), (Vector2::new(1.0, 0.0), 3.0), "{background}");
        assert!(c.cov.cholesky().is_some());
    }
    for values in [vec![0u8, 10, 30], vec![30u8, 10, 0]] {
        for column in [false, true] {
            let (w, h) = if column { (1, 3) } else { (3, 1) };
            let image = Image::from_vec(w, h, values.clone()).unwrap();
            let mut region = Region::of_run(0, 0, 0, w as u32 - 1, image.row(0));
            (1..h).for_each(|y| region.absorb(&Region::of_run(0, y as u32, 0, 0, image.row(y))));
            let c = centroid(
                &region,
                &image,
                CentroidMethod::Mask,
                &Surroundings { background: 11.0, ..Surroundings::plain() },
            );
            let middle = if column { Vector2::new(0.0, 1.0) } else { Vector2::new(1.0, 0.0) };
            assert_eq!((c.position, c.sum), (middle, 3.0), "{values:?}");
        }
    }
}

#[test]
fn nothing_is_known_of_plain_surroundings() {
    let plain = Surroundings { background: 0.0, sign: 1.0, variance: 1.0, gain: 0.0, level: None, ground: None };
    assert_eq!(Surroundings::plain(), plain);
}
