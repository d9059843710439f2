//! The spot detector against its kernel written out, hand-made responses, and trials with noise.

use super::*;
use crate::vision::threshold::Polarity;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;

const GROUND: f64 = 50.0;
const LARGE: Disc = Disc { radius: 3, noise_gain: 1.0, share: 1.0 };

/// A frame of 64 x 48 with Gaussian spots (x, y, height) of sigma 1.5 px.
fn frame(spots: &[(f64, f64, f64)]) -> Image<f32> {
    let mut image = Image::filled(64, 48, GROUND as f32);
    for y in 0..48 {
        for x in 0..64 {
            let light = |s: &(f64, f64, f64)| {
                let d2 = (x as f64 - s.0).powi(2) + (y as f64 - s.1).powi(2);
                s.2 * (-d2 / (2.0 * 1.5 * 1.5)).exp()
            };
            image.row_mut(y)[x] += spots.iter().map(light).sum::<f64>() as f32;
        }
    }
    image
}

fn detect(image: &Image<f32>, config: &SpotConfig, noise: (f64, f64)) -> Vec<Detection> {
    let mut found = Vec::new();
    SpotDetector::new(config).detect(image, noise, &mut found);
    found
}

/// A box applied twice less a wider box, at (dx, dy), written out.
fn kernel(smooth: usize, surround: usize, dx: i64, dy: i64) -> f64 {
    let twice = |k: i64| (smooth as f64 - k.abs() as f64).max(0.0) / (smooth * smooth) as f64;
    let wide = |k: i64| if 2 * k.abs() < surround as i64 { 1.0 / surround as f64 } else { 0.0 };
    twice(dx) * twice(dy) - wide(dx) * wide(dy)
}

#[test]
fn the_response_to_one_pixel_is_the_kernel_and_a_missing_value_takes_its_left_neighbours() {
    let mut detector = SpotDetector::new(&SpotConfig::default());
    let mut image = Image::filled(41, 41, 0.0f32);
    image.row_mut(20)[20] = 1000.0;
    detector.fill_response(&image);
    for (dx, dy) in [(0, 0), (1, 0), (0, -2), (2, 2), (-3, 1), (5, -5), (6, 0), (9, 9)] {
        let ours = f64::from(detector.response.row((20 + dy) as usize)[(20 + dx) as usize]);
        assert!((ours - 1000.0 * kernel(3, 11, dx, dy)).abs() < 1e-3, "{dx} {dy}: {ours}");
    }
    let holes = Image::from_vec(4, 1, vec![f32::NAN, 3.0, f32::NAN, f32::INFINITY]).unwrap();
    detector.fill_response(&holes);
    assert_eq!(detector.whole.as_slice(), [0.0, 3.0, 3.0, 3.0]);
}

#[test]
fn sizes_follow_from_the_targets_size() {
    let sizes = |config: SpotConfig| {
        let d = SpotDetector::new(&config);
        let discs: Vec<usize> = d.discs.iter().map(|d| d.radius).collect();
        (d.smooth, d.surround, d.radius, d.peak_offsets.len(), discs)
    };
    // A peak is the largest of the whole-pixel offsets nearer than radius + 2; discs have 0.3 to 0.5 of the size, two pixels at least.
    let inside = |r: i32| (-r..=r).flat_map(|y| (-r..=r).map(move |x| x * x + y * y)).filter(|d2| *d2 < r * r).count();
    assert_eq!(sizes(SpotConfig::default()), (3, 11, 3, inside(5), vec![2, 3]));
    assert_eq!(sizes(SpotConfig { size_px: 20.0, ..Default::default() }), (5, 31, 10, inside(12), vec![6, 8, 10]));
    let narrow = SpotConfig { size_px: 4.0, surround: 1.0, smooth_px: Some(9.0), ..Default::default() };
    assert_eq!(sizes(narrow), (9, 11, 2, inside(4), vec![2]), "the surroundings are wider than the smoothing");
    assert_eq!(sizes(SpotConfig { size_px: 1.9, ..Default::default() }), (1, 3, 1, inside(3), vec![2]));
    assert_eq!([0.2, 1.0, 2.0, 2.6, 4.0, 4.6].map(odd), [1, 1, 3, 3, 5, 5]);
}

#[test]
fn the_gain_from_noise_to_position_is_that_of_the_kernel_written_out() {
    for config in
        [SpotConfig::default(), SpotConfig { size_px: 11.0, surround: 1.0, smooth_px: Some(5.0), ..Default::default() }]
    {
        let d = SpotDetector::new(&config);
        for disc in &d.discs {
            let r = disc.radius as i64 + 1;
            let mut sum = 0.0;
            for (x, y) in (-30..=30).flat_map(|y| (-30..=30).map(move |x| (x, y))) {
                let weighted = |(px, py): (i64, i64)| {
                    let window = (disc.radius as f64 + 0.5 - (px as f64).hypot(py as f64)).clamp(0.0, 1.0);
                    px as f64 * window * kernel(d.smooth, d.surround, px - x, py - y)
                };
                let seen: f64 = (-r..=r).flat_map(|py| (-r..=r).map(move |px| (px, py))).map(weighted).sum();
                sum += seen * seen;
            }
            assert!((disc.noise_gain / sum - 1.0).abs() < 1e-4, "{} {sum}", disc.noise_gain);
        }
    }
}

#[test]
fn a_spot_is_found_at_its_sub_pixel_position_bright_or_dark() {
    for (amplitude, polarity) in [(80.0, Polarity::Bright), (-40.0, Polarity::Dark), (-40.0, Polarity::Both)] {
        let config = SpotConfig { size_px: 7.0, polarity, ..Default::default() };
        let found = detect(&frame(&[(30.3, 20.6, amplitude)]), &config, (1.0, 0.0));
        assert_eq!(found.len(), 1, "{amplitude}");
        let d = found[0].position - Vector2::new(30.3, 20.6);
        assert!(d.norm() < 0.05, "{d}");
        let peak = f64::from(frame(&[(30.3, 20.6, amplitude)]).row(21)[30]);
        assert!((f64::from(found[0].peak) - peak).abs() < 1e-4, "{} {peak}", found[0].peak);
    }
    let dark = SpotConfig { polarity: Polarity::Dark, ..Default::default() };
    let opposite = detect(&frame(&[(30.3, 20.6, 80.0)]), &dark, (1.0, 0.0));
    assert!(opposite.iter().all(|d| (d.position - Vector2::new(30.3, 20.6)).norm() > 3.0), "only its rim is dark");
}

#[test]
fn spots_of_both_signs_come_in_raster_order_without_each_others_rims() {
    let both = SpotConfig { polarity: Polarity::Both, ..Default::default() };
    let found = detect(&frame(&[(14.0, 30.0, -60.0), (45.0, 12.0, 80.0), (50.0, 35.0, -80.0)]), &both, (1.0, 0.0));
    let places: Vec<_> = found.iter().map(|d| (d.position.x.round(), d.position.y.round())).collect();
    assert_eq!(places, [(45.0, 12.0), (14.0, 30.0), (50.0, 35.0)]);
    // A neighbour half as strong, and of the other sign, is a target of its own; a third as strong it may be a rim.
    let pair = |height: f64| detect(&frame(&[(25.0, 24.0, 80.0), (33.0, 24.0, height)]), &both, (1.0, 0.0)).len();
    assert_eq!((pair(-70.0), pair(-1.0)), (2, 1));
}

#[test]
fn neighbours_nearer_than_half_the_size_are_one_and_the_stronger_stays() {
    let mut detector = SpotDetector::new(&SpotConfig { size_px: 8.0, ..Default::default() });
    let mut kept = |spots: &[(f64, f64, f64)]| -> Vec<f64> {
        detector.spots = spots
            .iter()
            .map(|&(x, y, mass)| Spot {
                position: Vector2::new(x, y),
                mass,
                pull: Vector2::zeros(),
                score: 1.0,
                peak: (x as usize, y as usize),
                disc: LARGE,
                nearest2: usize::MAX,
                doubt: Matrix2::zeros(),
            })
            .collect();
        detector.drop_doubles();
        detector.spots.iter().map(|s| s.mass).collect()
    };
    assert_eq!(kept(&[(10.0, 10.0, 1.0), (13.9, 10.0, 2.0)]), [2.0]);
    assert_eq!(kept(&[(10.0, 10.0, 2.0), (10.0, 13.9, 1.0)]), [2.0]);
    assert_eq!(kept(&[(10.0, 10.0, 2.0), (12.0, 12.0, 2.0)]).len(), 1);
    assert_eq!(kept(&[(10.0, 10.0, 1.0), (14.0, 10.0, 2.0)]), [1.0, 2.0], "exactly half the size apart");
    assert_eq!(kept(&[(10.0, 0.0, 1.0), (10.0, 3.0, 2.0)]), [2.0], "the first in the first row");
    assert_eq!(kept(&[(10.0, 10.0, 3.0), (40.0, 10.0, 1.0), (13.0, 11.0, 2.0), (40.0, 60.0, 4.0)]), [3.0, 1.0, 4.0]);
}

#[test]
fn two_equal_pixels_are_one_spot_between_them() {
    let mut image = Image::filled(40, 40, 10.0f32);
    image.row_mut(20)[20..22].fill(100.0);
    let found = detect(&image, &SpotConfig::default(), (1.0, 0.0));
    assert_eq!(found.len(), 1);
    assert!((found[0].position - Vector2::new(20.5, 20.0)).norm() < 0.02, "{}", found[0].position);
}

#[test]
fn neighbours_hardly_draw_each_other_where_spots_are_looked_for_at_their_width() {
    // Spots of 3.5 px at half height, 5 px apart.
    let image = frame(&[(30.2, 20.0, 100.0), (35.2, 20.4, 90.0)]);
    let config = SpotConfig { size_px: 3.5, surround: 1.0, smooth_px: Some(3.0), ..Default::default() };
    let two = detect(&image, &config, (1.0, 0.0));
    assert_eq!(two.len(), 2);
    for (d, x) in two.iter().zip([30.2, 35.2]) {
        assert!((d.position.x - x).abs() < 0.3, "{}", d.position);
    }
}

#[test]
fn the_disc_has_half_of_the_size_and_less_where_another_peak_is_near() {
    let detector = SpotDetector::new(&SpotConfig { size_px: 20.0, surround: 1.0, ..Default::default() });
    let radius = |nearest2: usize| {
        detector.disc_for(&Summit { x: 32, y: 24, v: 9.0, median: 0.0, deviation: 1.0, nearest2 }).radius
    };
    // None, and others at 20, 19, 16, 15, 12, 11 and 3 px.
    let nearest = [usize::MAX, 400, 361, 256, 225, 144, 121, 9];
    assert_eq!(nearest.map(radius), [10, 10, 8, 8, 6, 6, 6, 6]);
}

#[test]
fn a_centroid_in_noise_is_near_the_bound_and_its_covariance_is_right() {
    // Light of deviation 1.5 px, 30 deviations of the noise high, looked for at 2.45 widths and at one.
    let bound = {
        let slope = |x: f64, y: f64| x / 2.25 * (-(x * x + y * y) / 4.5).exp();
        let cells = (-12..=12).flat_map(|y| (-12..=12).map(move |x| (f64::from(x), f64::from(y))));
        1.0 / (30.0 * cells.map(|(x, y)| slope(x, y).powi(2)).sum::<f64>().sqrt())
    };
    // Error an axis in units of the bound, and e² over the stated variance.
    let errors = |size_px: f64, only_largest: bool| {
        let mut rng = ChaCha8Rng::seed_from_u64(13);
        let config = SpotConfig { size_px, surround: 1.0, smooth_px: Some(3.0), ..Default::default() };
        let mut detector = SpotDetector::new(&config);
        if only_largest {
            detector.discs.retain(|d| d.radius == 4);
        }
        let (mut sum2, mut nees) = (0.0, 0.0);
        for _ in 0..500 {
            let truth = Vector2::new(30.0 + rng.random::<f64>(), 20.0 + rng.random::<f64>());
            let mut image = frame(&[(truth.x, truth.y, 120.0)]);
            image.as_mut_slice().iter_mut().for_each(|p| *p += 4.0 * rng.sample::<f32, _>(StandardNormal));
            let mut found = Vec::new();
            detector.detect(&image, (16.0, 0.0), &mut found);
            let near = found.iter().find(|d| (d.position - truth).norm() < 1.0).unwrap();
            let e2 = (near.position - truth).norm_squared();
            (sum2, nees) = (sum2 + e2, nees + e2 / near.cov[(0, 0)]);
        }
        println!("{size_px} {only_largest}: {} {}", (sum2 / 1000.0).sqrt() / bound, nees / 1000.0);
        ((sum2 / 1000.0).sqrt() / bound, nees / 1000.0)
    };
    // The first is known to 2.2 %, the second to 4.5 %.
    // A filter no wider than half of the height sees less of the light: 1.33 by the same trial in numpy.
    for (size_px, most) in [(8.65, 1.2), (3.53, 1.4)] {
        let (error, nees) = errors(size_px, false);
        assert!(error < most && (nees - 1.0).abs() < 0.2, "{size_px}: {error} {nees}");
    }
    // By that disc alone it is stated half as sure as it is.
    assert!(errors(8.65, true).1 < 0.6);
}

#[test]
fn what_a_disc_holds_is_counted_as_the_whole_spot() {
    let config = SpotConfig { size_px: 8.6, surround: 1.0, smooth_px: Some(3.0), ..Default::default() };
    let mut detector = SpotDetector::new(&config);
    let mut of = |spots: &[(f64, f64, f64)]| {
        let mut found = Vec::new();
        detector.detect(&frame(spots), (1.0, 0.0), &mut found);
        (found[0].sum, detector.spots[0].disc)
    };
    let ((alone, disc), (beside, smaller)) =
        (of(&[(30.0, 20.0, 100.0)]), of(&[(30.0, 20.0, 100.0), (37.0, 20.0, 90.0)]));
    assert!((disc.radius, disc.share, smaller.radius) == (4, 1.0, 3) && smaller.share < 0.98);
    // The surroundings of the other take some of it; by its disc alone it would be less by that share too.
    assert!((beside / alone - 1.0).abs() < 0.1 && beside * smaller.share / alone < 0.9, "{beside} {alone}");
}

#[test]
fn a_response_below_the_least_contrast_is_none() {
    let response = |height: f64| {
        let mut d = SpotDetector::new(&SpotConfig::default());
        d.fill_response(&frame(&[(30.0, 20.0, height)]));
        f64::from(d.response.row(20)[30])
    };
    let least = response(10.0);
    for (height, n) in [(10.1, 1), (9.9, 0)] {
        let config = SpotConfig { min_contrast: least, ..Default::default() };
        assert_eq!(detect(&frame(&[(30.0, 20.0, height)]), &config, (1.0, 0.0)).len(), n, "{height}");
    }
    // A frame without spread scores by the least contrast, which is k deviations, and without one by the least deviation there is, 1e-6.
    let score = |height: f64, min_contrast: f64| {
        let config = SpotConfig { min_contrast, ..Default::default() };
        f64::from(detect(&frame(&[(30.0, 20.0, height)]), &config, (1.0, 0.0))[0].score)
    };
    assert!((score(10.0, 0.5) / (6.0 * least / 0.5) - 1.0).abs() < 1e-3, "{least}");
    assert!((score(10.0, 0.0) * 1e-6 / least - 1.0).abs() < 1e-3, "{least}");
    assert_eq!(score(1e6, 0.0), 1e9);
}

#[test]
fn size_peak_and_variance_are_read_from_the_response() {
    let mut d = SpotDetector::new(&SpotConfig::default());
    d.response = Image::filled(60, 60, 0.0);
    let mut frame = Image::filled(60, 60, 7.0f32);
    for (x, y, r, v) in
        [(29, 29, 10.0, 20.0), (30, 29, 6.0, 26.0), (31, 29, 5.0, 12.0), (29, 30, 5.0, 3.0), (28, 29, 4.9, 90.0)]
    {
        d.response.row_mut(y)[x] = r;
        frame.row_mut(y)[x] = v;
    }
    let disc = Disc { radius: 3, noise_gain: 2.0, share: 1.0 };
    d.discs = vec![disc];
    let (position, doubt) = (Vector2::new(29.4, 29.2), Matrix2::zeros());
    let spot = |pull| Spot {
        position,
        mass: 10.0,
        pull: Vector2::repeat(pull),
        score: 4.0,
        peak: (29, 29),
        disc,
        nearest2: usize::MAX,
        doubt,
    };
    let bright = d.detection(&frame, &spot(0.5), (3.0, 0.1), 1.0);
    // Half the peak or more: (29, 29), (30, 29), (31, 29), (29, 30).
    assert_eq!(bright.extent, Extent { left_px: 28.5, top_px: 28.5, width_px: 3.0, height_px: 2.0 });
    assert_eq!((bright.area_px, bright.peak, bright.sum, bright.score), (4, 26.0, 10.0, 4.0));
    assert_eq!(bright.position, Vector2::new(29.4, 29.2));
    assert_eq!(d.detection(&frame, &spot(0.5), (3.0, 0.1), -1.0).peak, 3.0);
    // (3 + 0.1 x 20) x 2 / (10 x 0.5)² + 1e-4.
    let variance = |spot: &Spot, noise| d.detection(&frame, spot, noise, 1.0).cov[(0, 0)];
    assert!((variance(&spot(0.5), (3.0, 0.1)) - 0.4001).abs() < 1e-12);
    assert!((variance(&spot(0.0), (3.0, 0.0)) - 0.0601).abs() < 1e-12);
    assert!((variance(&spot(0.95), (9.0, 0.0)) - 2.0001).abs() < 1e-12, "a disc is pulled by 0.7 at most");
    assert_eq!(bright.cov, Matrix2::identity() * bright.cov[(0, 0)]);
    frame.row_mut(29)[29] = -20.0;
    assert!(
        (d.detection(&frame, &spot(0.0), (3.0, 0.1), 1.0).cov[(0, 0)] - 0.0601).abs() < 1e-12,
        "no shot noise below 0"
    );
}

#[test]
fn the_pull_of_the_disc_is_how_far_its_centroid_follows_it() {
    // An even response pulls a disc all the way: the centroid of what is inside is its middle wherever it stands. By parts: a unit step of the
    // disc moves the centroid by Σ_edge D r / (2 Σ D), the edge's half towards the step; here Σ over the soft ring, counted by hand.
    let mut d = SpotDetector::new(&SpotConfig::default());
    d.response = Image::filled(40, 40, 2.0);
    d.grid.refresh(&d.response);
    d.discs = vec![LARGE];
    let summit = Summit { x: 20, y: 20, v: 2.0, median: 0.0, deviation: 1.0, nearest2: usize::MAX };
    let spot = d.spot(&summit);
    let (mut mass, mut edge) = (0.0, 0.0);
    for y in -5..=5 {
        for x in -5..=5 {
            let r = f64::from(x).hypot(f64::from(y));
            let window = (3.5 - r).clamp(0.0, 1.0);
            mass += 2.0 * window;
            edge += if window > 0.0 && window < 1.0 { r } else { 0.0 };
        }
    }
    assert_eq!(spot.position, Vector2::new(20.0, 20.0));
    assert!((spot.mass - mass).abs() < 1e-9 && spot.pull.iter().all(|p| (p - edge / mass).abs() < 1e-9), "{spot:?}");
}

#[test]
fn a_flat_frame_or_one_without_values_has_no_spots() {
    for image in [Image::filled(40, 40, 7.0f32), Image::filled(40, 40, f32::NAN), Image::filled(1, 1, 3.0)] {
        assert!(detect(&image, &SpotConfig::default(), (1.0, 0.0)).is_empty());
    }
    let mut found = Vec::new();
    SpotDetector::new(&SpotConfig::default()).detect(&Image::<u8>::filled(0, 0, 0), (1.0, 0.0), &mut found);
    assert!(found.is_empty());
}

#[test]
fn errors_in_noise_are_as_large_as_their_covariance_says() {
    let mut rng = ChaCha8Rng::seed_from_u64(11);
    let (mut z, mut sum2) = (Vec::new(), 0.0);
    for _ in 0..400 {
        let truth = Vector2::new(30.0 + rng.random::<f64>(), 20.0 + rng.random::<f64>());
        let mut image = frame(&[(truth.x, truth.y, 120.0)]);
        image.as_mut_slice().iter_mut().for_each(|p| *p += 4.0 * rng.sample::<f32, _>(StandardNormal));
        let found = detect(&image, &SpotConfig::default(), (16.0, 0.0));
        let Some(d) = found.iter().find(|d| (d.position - truth).norm() < 2.0) else { continue };
        let e = (d.position - truth) / d.cov[(0, 0)].sqrt();
        sum2 += e.norm_squared();
        z.extend([e.x, e.y]);
    }
    let (n, mean) = (z.len() as f64, z.iter().sum::<f64>() / z.len() as f64);
    let within = z.iter().filter(|z| z.abs() < 1.96).count() as f64 / n;
    println!("{n} {mean} {} {within}", sum2 / n);
    assert!(n >= 780.0, "{n}");
    // Deviations of the mean, of the mean square and of the share inside: 0.035, 0.05, 0.008.
    assert!(
        mean.abs() < 0.12 && (sum2 / n - 1.0).abs() < 0.2 && (within - 0.95).abs() < 0.03,
        "{mean} {} {within}",
        sum2 / n
    );
}

#[test]
fn a_frame_is_searched_as_by_a_new_detector_whatever_came_before() {
    let config = DetectorConfig::default();
    let mut old = SpotDetector::new(&SpotConfig::default());
    let found_by = |finder: &mut SpotDetector, spots: &[(f64, f64, f64)]| {
        let image = frame(spots);
        let mut found = Vec::new();
        finder.find(&TypedFrame { image: &image, raw: &image, colours: None, dt_s: 0.0 }, &config, &mut found).unwrap();
        found
    };
    found_by(&mut old, &[(40.0, 30.0, 200.0), (12.0, 9.0, 90.0)]);
    let spots = [(20.3, 15.6, 80.0), (50.0, 40.0, 60.0)];
    let new = found_by(&mut SpotDetector::new(&SpotConfig::default()), &spots);
    assert_eq!(new.len(), 2);
    assert_eq!(found_by(&mut old, &spots), new);
    // So frames may be searched out of order, side by side.
    assert!(!TargetFinder::<f32>::remembers(&old));
}
