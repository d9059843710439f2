//! Tests of the detector at a stated false-alarm rate.

use super::*;
use crate::vision::noise::gaussian_seeded;
use crate::vision::polarity::Polarity;
use proptest::prelude::*;

fn noise(w: usize, h: usize, seed: u64) -> Image<f32> {
    let flat = Image::filled(w, h, 100.0f32);
    let noisy = gaussian_seeded(&flat, 4.0, seed).unwrap();
    Image::from_vec(w, h, noisy.as_slice().iter().map(|v| *v as f32).collect()).unwrap()
}

fn draw(image: &mut Image<f32>, x0: f64, y0: f64, height: f64, sigma: f64) {
    for y in 0..image.height() {
        for (x, v) in image.row_mut(y).iter_mut().enumerate() {
            let d2 = (x as f64 - x0).powi(2) + (y as f64 - y0).powi(2);
            *v += (height * (-d2 / (2.0 * sigma * sigma)).exp()) as f32;
        }
    }
}

fn run<T: Pixel>(config: &CfarConfig, image: &Image<T>) -> Vec<Detection> {
    let mut out = Vec::new();
    CfarDetector::new(config).detect(image, &mut out);
    out
}

#[test]
fn white_noise_gives_about_as_many_detections_as_were_asked_for() {
    let config = CfarConfig { false_alarms_per_frame: 3.0, polarity: Polarity::Both, ..Default::default() };
    let mut detector = CfarDetector::new(&config);
    let (mut found, frames) = (Vec::new(), 30);
    for seed in 0..frames {
        detector.detect(&noise(200, 160, seed), &mut found);
    }
    let mean = found.len() as f64 / frames as f64;
    // Poisson: standard deviation 0.32; the factor asked of the detector is 1.5.
    assert!((2.0..4.5).contains(&mean), "{mean}");
}

#[test]
fn spots_from_one_pixel_to_a_third_of_the_frame_are_found_once_and_in_their_place() {
    for sigma in [0.3, 0.8, 1.3, 2.5, 5.0, 10.0, 20.0] {
        for (x0, y0) in [(120.3, 80.6), (3.0, 90.2)] {
            let mut image = noise(240, 200, 5);
            // So narrow a spot may fall between the pixels.
            draw(&mut image, x0, y0, if sigma < 0.5 { 400.0 } else { 80.0 }, sigma);
            let found = run(&CfarConfig { false_alarms_per_frame: 0.03, ..Default::default() }, &image);
            assert_eq!(found.len(), 1, "sigma {sigma} at {x0}, {y0}: {found:?}");
            let d = found[0].position - Vector2::new(x0, y0);
            let allowed = if x0 < 10.0 && sigma > 2.0 { 1.2 * sigma } else { 0.2 + 0.15 * sigma };
            assert!(d.norm() < allowed, "sigma {sigma}: {d}");
        }
    }
}

#[test]
fn a_dark_spot_is_found_where_dark_ones_are_looked_for_and_whole_numbers_do_as_well() {
    let mut image = noise(160, 120, 9);
    draw(&mut image, 50.2, 60.7, -60.0, 1.5);
    let words =
        Image::from_vec(160, 120, image.as_slice().iter().map(|v| (v * 20.0).round() as u16).collect()).unwrap();
    let bytes = Image::from_vec(160, 120, image.as_slice().iter().map(|v| v.round() as u8).collect()).unwrap();
    let config = |polarity| CfarConfig { polarity, false_alarms_per_frame: 1e-3, ..Default::default() };
    for polarity in [Polarity::Dark, Polarity::Both] {
        for found in [run(&config(polarity), &image), run(&config(polarity), &words), run(&config(polarity), &bytes)] {
            assert_eq!(found.len(), 1, "{found:?}");
            assert!((found[0].position - Vector2::new(50.2, 60.7)).norm() < 0.3);
        }
    }
    assert!(run(&config(Polarity::Bright), &image).is_empty());
}

#[test]
fn frames_without_content_have_no_detections() {
    let config = CfarConfig { false_alarms_per_frame: 10.0, polarity: Polarity::Both, ..Default::default() };
    for (w, h) in [(0, 0), (1, 1), (6, 300), (64, 64), (7, 7)] {
        assert!(run(&config, &Image::filled(w, h, 7u8)).is_empty());
        assert!(run(&config, &Image::filled(w, h, 0.1f32)).is_empty());
        assert!(run(&config, &Image::filled(w, h, f32::NAN)).is_empty());
    }
}

#[test]
fn a_frame_seen_twice_gives_the_same_and_what_was_seen_before_does_not_matter() {
    let mut image = noise(150, 130, 3);
    draw(&mut image, 70.0, 60.0, 50.0, 2.0);
    let mut detector = CfarDetector::new(&CfarConfig::default());
    let (mut first, mut again) = (Vec::new(), Vec::new());
    detector.detect(&image, &mut first);
    detector.detect(&noise(90, 77, 4), &mut again);
    again.clear();
    detector.detect(&image, &mut again);
    assert_eq!(first, again);
    assert!(!first.is_empty());
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]
    #[test]
    fn any_frame_gives_finite_detections_inside_it(
        w in 1usize..70, h in 1usize..70, seed in 0u64..1000, rate in 0.01f64..100.0, cut in 0usize..3,
    ) {
        inside(w, h, seed, rate, cut);
    }
}

/// Looks at noise, as it is, with pixels that are not finite, or cut to two values.
fn inside(w: usize, h: usize, seed: u64, rate: f64, cut: usize) {
    let mut image = noise(w, h, seed);
    for (i, v) in image.as_mut_slice().iter_mut().enumerate() {
        match cut {
            1 if i % 17 == 0 => *v = f32::INFINITY,
            2 => *v = if *v > 104.0 { 255.0 } else { 0.0 },
            _ => {}
        }
    }
    let config = CfarConfig { false_alarms_per_frame: rate, polarity: Polarity::Both, ..Default::default() };
    for d in run(&config, &image) {
        assert!(d.position.x > -3.0 && d.position.x < w as f64 + 2.0, "{d:?}");
        assert!(d.position.y > -3.0 && d.position.y < h as f64 + 2.0, "{d:?}");
        assert!(d.cov[(0, 0)] > 0.0 && d.cov.determinant() > 0.0, "{d:?}");
        assert!(f64::from(d.score) >= -rate.log10() - 1e-3 && d.area_px > 0, "{d:?}");
    }
}

#[test]
fn a_spot_is_not_placed_far_beyond_the_border() {
    inside(69, 45, 681, 72.458_273_984_143_81, 1);
}
