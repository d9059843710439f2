//! Fitted positions through the detectors, whatever finds the targets: beside the centroid, as exact as stated, and said where they are not used.

use crate::vision_conformance::source;
use boresight::vision::cfar::CfarConfig;
use boresight::vision::fit::FitConfig;
use boresight::vision::threshold::{LevelConfig, LocalConfig, Polarity, Side, SpotConfig, ThresholdConfig};
use boresight::vision::{ClusterConfig, DetectorConfig, GivenNoise, NoiseConfig, build};
use boresight::{Detection, Frame, FrameIndex, Image, PixelKind, Pixels, PositionFit, Scan, Timestamp};
use nalgebra::Vector2;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;

const SIDE: usize = 160;
const NOISE: f64 = 4.0;

/// A frame of whole numbers with pixel-integrated spots (place, height, deviation) on an inclined ground.
fn frame(spots: &[(Vector2<f64>, f64, f64)], rng: &mut ChaCha8Rng) -> Image<u16> {
    let share = |v: f64, c: f64, s: f64| {
        let e = |edge: f64| libm::erf((edge - c) / (s * std::f64::consts::SQRT_2));
        0.5 * (e(v + 0.5) - e(v - 0.5))
    };
    let value = |i: usize| {
        let (x, y) = ((i % SIDE) as f64, (i / SIDE) as f64);
        let light: f64 = spots
            .iter()
            .filter(|(p, _, s)| (p - Vector2::new(x, y)).amax() < 6.0 * s)
            .map(|(p, h, s)| h * std::f64::consts::TAU * s * s * share(x, p.x, *s) * share(y, p.y, *s))
            .sum();
        let z: f64 = rng.sample(StandardNormal);
        (500.0 + 0.2 * x - 0.1 * y + light + NOISE * z).round().max(0.0) as u16
    };
    Image::from_vec(SIDE, SIDE, (0..SIDE * SIDE).map(value).collect()).unwrap()
}

fn detect(image: &Image<u16>, threshold: &ThresholdConfig, fit: Option<FitConfig>) -> Vec<Detection> {
    let mut config = DetectorConfig { threshold: threshold.clone(), ..Default::default() };
    config.cluster = ClusterConfig { min_area_px: Some(3), ..Default::default() };
    config.noise = NoiseConfig::Given(GivenNoise { read_counts: NOISE, ..Default::default() });
    config.centroid.fit = fit;
    let mut detector = build(&config, &source(SIDE, SIDE, PixelKind::Gray16)).unwrap();
    let mut scan = Scan::default();
    let (index, time) = (FrameIndex(0), Timestamp::default());
    detector.detect(&Frame { index, time, pixels: Pixels::Gray16(image.clone()) }, &mut scan).unwrap();
    scan.detections
}

fn thresholds() -> Vec<ThresholdConfig> {
    let polarity = Polarity::Bright;
    vec![
        ThresholdConfig::Level(LevelConfig { level: 565.0, side: Side::Bright, exclusive: false }),
        ThresholdConfig::Local(LocalConfig { k: 5.0, polarity, cell_px: 32, min_contrast: 0.0 }),
        ThresholdConfig::Spot(SpotConfig { size_px: 7.0, k: 8.0, polarity, ..Default::default() }),
        ThresholdConfig::Isolated(Default::default()),
        ThresholdConfig::Cfar(CfarConfig::default()),
    ]
}

/// Spots on a grid 20 px apart, each at its own place between the pixels.
fn grid(height: f64, sigma: f64, rng: &mut ChaCha8Rng) -> Vec<(Vector2<f64>, f64, f64)> {
    let place = |k: usize| 10.0 + 20.0 * k as f64;
    (0..49)
        .map(|k| {
            let shift = Vector2::new(rng.random::<f64>() - 0.5, rng.random::<f64>() - 0.5);
            (Vector2::new(place(k % 7) + 5.0, place(k / 7) + 5.0) + shift, height, sigma)
        })
        .collect()
}

/// Mean of e² and of eᵀ C⁻¹ e of the detections near the spots, their number, and the share of fitted ones.
fn errors(found: &[Detection], spots: &[(Vector2<f64>, f64, f64)]) -> [f64; 4] {
    let mut sums = [0.0; 4];
    for (at, _, _) in spots {
        let Some(d) = found.iter().find(|d| (d.position - at).norm() < 2.0) else { continue };
        let e = d.position - at;
        sums[0] += e.norm_squared();
        sums[1] += e.dot(&(d.cov.try_inverse().unwrap() * e));
        sums[2] += 1.0;
        sums[3] += f64::from(u8::from(matches!(d.fit, Some(PositionFit::Spot { .. }))));
    }
    sums
}

#[test]
fn every_detector_gives_positions_at_the_bound_with_honest_covariances() {
    for threshold in thresholds() {
        let mut rng = ChaCha8Rng::seed_from_u64(11);
        let (mut plain, mut fitted) = ([0.0; 4], [0.0; 4]);
        for _ in 0..12 {
            let spots = grid(100.0, 1.4, &mut rng);
            let image = frame(&spots, &mut rng);
            let add = |sums: &mut [f64; 4], fit| {
                let found = errors(&detect(&image, &threshold, fit), &spots);
                sums.iter_mut().zip(found).for_each(|(s, v)| *s += v);
            };
            add(&mut plain, None);
            add(&mut fitted, Some(FitConfig::default()));
        }
        let n = fitted[2];
        let sd = |s: &[f64; 4]| (s[0] / (2.0 * s[2])).sqrt();
        // White noise and an unknown slope: 1.07 √(2/π) noise / height.
        let bound = 1.075 * (2.0 / std::f64::consts::PI).sqrt() * NOISE / 100.0;
        println!(
            "{threshold:?}: {n}, sd {:.4} and {:.4} px, bound {bound:.4}, NEES {:.3}",
            sd(&plain),
            sd(&fitted),
            fitted[1] / n
        );
        assert!(n > 570.0 && fitted[3] / n > 0.99, "{threshold:?}: {fitted:?}");
        // 588 spots: the rms to 2 %, the NEES to 4 %, each at 3 deviations; the bound is that of unlimited windows.
        assert!(sd(&fitted) < 1.1 * bound, "{threshold:?}: {} {bound}", sd(&fitted));
        match threshold {
            // Its own positions come from a fit with a sloping ground: they are at the bound themselves, and as honest.
            ThresholdConfig::Cfar(_) => {
                assert!(sd(&plain) < 1.03 * bound, "{} {bound}", sd(&plain));
                assert!((plain[1] / plain[2] - 2.0).abs() < 0.25, "{}", plain[1] / plain[2]);
            }
            _ => assert!(sd(&fitted) < sd(&plain), "{threshold:?}: {} {}", sd(&fitted), sd(&plain)),
        }
        assert!((fitted[1] / n - 2.0).abs() < 0.25, "{threshold:?}: {}", fitted[1] / n);
    }
}

#[test]
fn what_is_no_spot_keeps_its_centroid_and_says_so() {
    let mut rng = ChaCha8Rng::seed_from_u64(12);
    let mut image = frame(&[], &mut rng);
    // A square, a bar, and a thing too large for a window.
    for (left, top, width, height) in [(20, 20, 6, 6), (60, 20, 12, 3), (80, 80, 40, 40)] {
        for y in top..top + height {
            image.row_mut(y)[left..left + width].iter_mut().for_each(|v| *v += 400);
        }
    }
    let threshold = ThresholdConfig::Level(LevelConfig { level: 700.0, side: Side::Bright, exclusive: false });
    let (plain, fitted) = (detect(&image, &threshold, None), detect(&image, &threshold, Some(FitConfig::default())));
    assert_eq!((plain.len(), fitted.len()), (3, 3));
    for (a, b) in plain.iter().zip(&fitted) {
        assert_eq!(b.fit, Some(PositionFit::Centroid), "{b:?}");
        assert_eq!((a.position, a.cov, a.fit), (b.position, b.cov, None));
    }
}

#[test]
fn spots_that_overlap_are_fitted_together() {
    let mut rng = ChaCha8Rng::seed_from_u64(13);
    let threshold = ThresholdConfig::Spot(SpotConfig { size_px: 4.0, k: 8.0, ..Default::default() });
    let (mut plain, mut fitted, mut of_fits) = ([0.0; 4], [0.0; 4], [0.0; 4]);
    for _ in 0..10 {
        let mut spots = grid(150.0, 1.3, &mut rng);
        for k in 0..spots.len() {
            let (at, h, s) = spots[k];
            spots.push((at + Vector2::new(4.2, 1.5), 0.8 * h, s));
        }
        let image = frame(&spots, &mut rng);
        let add = |sums: &mut [f64; 4], fit| {
            let found = errors(&detect(&image, &threshold, fit), &spots);
            sums.iter_mut().zip(found).for_each(|(s, v)| *s += v);
        };
        add(&mut plain, None);
        add(&mut fitted, Some(FitConfig::default()));
        let mut found = detect(&image, &threshold, Some(FitConfig::default()));
        found.retain(|d| matches!(d.fit, Some(PositionFit::Spot { .. })));
        of_fits.iter_mut().zip(errors(&found, &spots)).for_each(|(s, v)| *s += v);
    }
    // Where the detector missed one of a pair, the other is no spot, and its centroid stays.
    println!("{plain:?} {fitted:?} {of_fits:?}");
    assert!(fitted[2] > 930.0 && of_fits[2] > 0.94 * fitted[2], "{fitted:?}");
    assert!(fitted[0] / fitted[2] < 0.2 * plain[0] / plain[2], "{plain:?} {fitted:?}");
    // Some 900 fits: 2 ± 0.07.
    assert!((of_fits[1] / of_fits[2] - 2.0).abs() < 0.25, "{}", of_fits[1] / of_fits[2]);
}
