//! Every detector, whatever its threshold: odd sizes, empty and full frames, NaN, the whole range of u16; finite positions
//! inside the frame, covariances that can be inverted, the same answer twice.

use boresight::vision::FollowConfig;
use boresight::vision::bernoulli::{BernoulliConfig, TargetShape};
use boresight::vision::cfar::CfarConfig;
use boresight::vision::colour::ColourMatchConfig;
use boresight::vision::fit::{FitConfig, FitWidth};
use boresight::vision::integrate::{IntegrateConfig, StillBackground};
use boresight::vision::spatial::{SpatialConfig, WindowConfig};
use boresight::vision::threshold::{
    BandConfig, LevelConfig, LocalConfig, OtsuConfig, Polarity, Side, SpotConfig, ThresholdConfig,
};
use boresight::vision::{
    CentroidConfig, CentroidMethod, ClusterConfig, DetectorConfig, GivenNoise, NoiseConfig, Weight,
};
use boresight::vision::{Detector, build};
use boresight::{Frame, FrameIndex, Image, PixelKind, Pixels, Scan, SourceInfo, Timestamp};

/// Every threshold; the match makes a new one fail to compile until it is here.
pub fn thresholds() -> Vec<ThresholdConfig> {
    let local = |polarity| ThresholdConfig::Local(LocalConfig { k: 2.0, polarity, cell_px: 8, min_contrast: 0.0 });
    let spot = |polarity| ThresholdConfig::Spot(SpotConfig { size_px: 5.0, k: 2.0, polarity, ..Default::default() });
    let cfar =
        |polarity| ThresholdConfig::Cfar(CfarConfig { false_alarms_per_frame: 10.0, polarity, ..Default::default() });
    let integrate = |polarity, background| {
        let (false_alarms_per_frame, frames) = (10.0, 4);
        ThresholdConfig::Integrate(IntegrateConfig {
            false_alarms_per_frame,
            frames,
            polarity,
            background,
            ..Default::default()
        })
    };
    // Few velocities.
    let bernoulli = |polarity, background| {
        ThresholdConfig::Bernoulli(BernoulliConfig {
            max_speed_px_per_s: 30.0,
            acceleration_density_px2_per_s3: 1000.0,
            polarity,
            background,
            ..Default::default()
        })
    };
    let all = vec![
        ThresholdConfig::Band(BandConfig { low: 100.0, high: 60_000.0 }),
        ThresholdConfig::Level(LevelConfig { level: 99.5, side: Side::Bright, exclusive: false }),
        ThresholdConfig::Level(LevelConfig { level: 100.0, side: Side::Dark, exclusive: true }),
        ThresholdConfig::Otsu(OtsuConfig { side: Side::Bright }),
        ThresholdConfig::Otsu(OtsuConfig { side: Side::Dark }),
        local(Polarity::Bright),
        local(Polarity::Dark),
        local(Polarity::Both),
        spot(Polarity::Bright),
        spot(Polarity::Both),
        ThresholdConfig::Isolated(Default::default()),
        cfar(Polarity::Bright),
        cfar(Polarity::Both),
        integrate(Polarity::Bright, StillBackground::Temporal),
        integrate(Polarity::Both, StillBackground::Both),
        integrate(Polarity::Dark, StillBackground::Spatial),
        bernoulli(Polarity::Bright, StillBackground::Temporal),
        bernoulli(Polarity::Both, StillBackground::Spatial),
        bernoulli(Polarity::Dark, StillBackground::Both),
        ThresholdConfig::Bernoulli(BernoulliConfig {
            shape: TargetShape::Square,
            side_px: 6.0,
            max_speed_px_per_s: 30.0,
            acceleration_density_px2_per_s3: 1000.0,
            ..Default::default()
        }),
        ThresholdConfig::Moving(Default::default()),
        ThresholdConfig::Difference(Default::default()),
        ThresholdConfig::Steadied(Default::default()),
        ThresholdConfig::Colour(ColourMatchConfig { reference: [200, 100, 55], ..Default::default() }),
    ];
    for t in &all {
        match t {
            ThresholdConfig::Band(_)
            | ThresholdConfig::Level(_)
            | ThresholdConfig::Otsu(_)
            | ThresholdConfig::Local(_)
            | ThresholdConfig::Spot(_)
            | ThresholdConfig::Isolated(_)
            | ThresholdConfig::Cfar(_)
            | ThresholdConfig::Integrate(_)
            | ThresholdConfig::Bernoulli(_)
            | ThresholdConfig::Moving(_)
            | ThresholdConfig::Difference(_)
            | ThresholdConfig::Steadied(_)
            | ThresholdConfig::Colour(_) => {}
        }
    }
    all
}

pub fn source(width: usize, height: usize, kind: PixelKind) -> SourceInfo {
    SourceInfo {
        label: "test".into(),
        reader: "test".into(),
        width,
        height,
        kind,
        n_frames: None,
        rate_hz: None,
        true_times: true,
    }
}

/// Frame `k`: all 0, all at the top of the range, noise over the whole range, a bright square that moves.
fn frame(width: usize, height: usize, kind: PixelKind, k: u64) -> Frame {
    let mut state = k.wrapping_mul(0x9e37_79b9_7f4a_7c15) | 1;
    let mut level = |i: usize| -> u16 {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        let (x, y) = (i % width.max(1), i / width.max(1));
        let at = 3 + k as usize;
        match k % 4 {
            0 => 0,
            1 => u16::MAX,
            2 => state as u16,
            _ if (at..at + 4).contains(&x) && (2..6).contains(&y) => 50_000,
            _ => 5000 + (state % 512) as u16,
        }
    };
    let n = width * height;
    let pixels = match kind {
        PixelKind::Gray8 => {
            Pixels::Gray8(Image::from_vec(width, height, (0..n).map(|i| (level(i) >> 8) as u8).collect()).unwrap())
        }
        PixelKind::Gray16 => Pixels::Gray16(Image::from_vec(width, height, (0..n).map(&mut level).collect()).unwrap()),
        PixelKind::GrayF32 => {
            let value = |i: usize| match i % 7 {
                3 if k.is_multiple_of(2) => f32::NAN,
                5 if k % 8 == 2 => f32::INFINITY,
                _ => f32::from(level(i)) - 1000.0,
            };
            Pixels::GrayF32(Image::from_vec(width, height, (0..n).map(value).collect()).unwrap())
        }
        PixelKind::Rgb8 => {
            let value = |i: usize| {
                let v = (level(i) >> 8) as u8;
                [v, v / 2, 255 - v]
            };
            Pixels::Rgb8(Image::from_vec(width, height, (0..n).map(value).collect()).unwrap())
        }
    };
    Frame { index: FrameIndex(k), time: Timestamp::from_ns(k as i64 * 40_000_000), pixels }
}

fn run(detector: &mut dyn Detector, width: usize, height: usize, kind: PixelKind) -> Vec<Scan> {
    (0..9)
        .map(|k| {
            let mut scan = Scan::default();
            detector.detect(&frame(width, height, kind, k), &mut scan).unwrap();
            assert_eq!((scan.index, scan.time.ns), (FrameIndex(k), k as i64 * 40_000_000));
            scan
        })
        .collect()
}

/// As [`run`], but what a twin may find is found by two in turn, the last frame first.
fn run_with_twins(detector: &mut dyn Detector, width: usize, height: usize, kind: PixelKind) -> Vec<Scan> {
    let mut twins = [detector.twin(), detector.twin()];
    let frames: Vec<Frame> = (0..9).map(|k| frame(width, height, kind, k)).collect();
    let begin = |frame| {
        let mut scan = Scan::default();
        let done = detector.begin(frame, &mut scan).unwrap();
        (scan, done)
    };
    let mut scans: Vec<(Scan, bool)> = frames.iter().map(begin).collect();
    for (i, (scan, done)) in scans.iter_mut().enumerate().rev() {
        match &mut twins[i % 2] {
            Some(twin) => assert!(!*done && twin.finish(&frames[i], scan).is_ok()),
            None => assert!(*done, "nobody is left to finish it"),
        }
    }
    scans.into_iter().map(|(scan, _)| scan).collect()
}

const KINDS: [PixelKind; 4] = [PixelKind::Gray8, PixelKind::Gray16, PixelKind::GrayF32, PixelKind::Rgb8];

fn check(config: &DetectorConfig, what: &str) -> usize {
    let mut n = 0;
    // Colour is looked for in colour frames; a source without it is refused when the detector is built.
    let colour = matches!(config.threshold, ThresholdConfig::Colour(_));
    for kind in KINDS {
        if colour && kind != PixelKind::Rgb8 {
            let e = build(config, &source(9, 9, kind)).err().unwrap().to_string();
            assert!(e.contains("colour frames") && e.contains("input.colour=rgb"), "{e}");
            continue;
        }
        for (width, height) in [(0, 0), (1, 1), (1, 9), (9, 1), (63, 5), (64, 12), (65, 12), (130, 20)] {
            let what = format!("{what}, {kind:?} {width} x {height}");
            let build = || build(config, &source(width, height, kind)).unwrap();
            let scans = run(build().as_mut(), width, height, kind);
            assert_eq!(scans, run(build().as_mut(), width, height, kind), "{what}: not the same twice");
            assert_eq!(scans, run_with_twins(build().as_mut(), width, height, kind), "{what}: not the same by twins");
            for d in scans.iter().flat_map(|s| &s.detections) {
                n += 1;
                let (x, y) = (d.position.x, d.position.y);
                assert!(
                    (-0.5..width as f64 - 0.5).contains(&x) && (-0.5..height as f64 - 0.5).contains(&y),
                    "{what}: {x} {y}"
                );
                assert!(d.cov.cholesky().is_some() && d.cov.iter().all(|v| v.is_finite()), "{what}: {}", d.cov);
                assert!(d.area_px > 0 && d.extent.width_px >= 1.0 && d.extent.height_px >= 1.0, "{what}: {d:?}");
                assert!(!d.score.is_nan(), "{what}: {d:?}");
            }
            let mut scan = Scan::default();
            let wrong = build().detect(&frame(width + 1, height, kind, 0), &mut scan).unwrap_err().to_string();
            assert!(wrong.contains("expected") && wrong.contains("hint"), "{wrong}");
        }
    }
    n
}

#[test]
fn every_threshold_takes_every_frame() {
    for threshold in thresholds() {
        let what = format!("{threshold:?}");
        // Frames that jump over the whole range are noise to a mean of each pixel: it must find a spot that moves.
        let of_noise = matches!(&threshold, ThresholdConfig::Integrate(c) if c.background == StillBackground::Temporal);
        let config = DetectorConfig { threshold, ..Default::default() };
        let found = check(&config, &what);
        // Nine frames are shorter than three lags, and none of them covers the one before.
        let of_ground = matches!(config.threshold, ThresholdConfig::Steadied(_));
        let finds = if of_noise {
            finds_a_moving_spot(&config, 0, 100.0)
        } else if let ThresholdConfig::Bernoulli(c) = &config.threshold {
            // No frame alone decides. It is for what is near the noise: 20 counts over 2.3.
            finds_a_moving_spot(&config, 12, if c.polarity == Polarity::Dark { -20.0 } else { 20.0 })
        } else if of_ground {
            finds_a_patch_over_moving_ground(&config)
        } else {
            found > 0
        };
        assert!(finds, "{what} found nothing at all");
    }
}

/// Whether every report on frames of a spot that moves 1 px a frame, from a frame on, has a detection there.
fn finds_a_moving_spot(config: &DetectorConfig, from: u64, height: f64) -> bool {
    let mut detector = build(config, &source(96, 64, PixelKind::Gray8)).unwrap();
    let (mut scan, mut reports) = (Scan::default(), 0);
    for k in 0..24u64 {
        let (x0, y0) = (20.0 + k as f64, 30.0);
        let value = |i: usize| {
            let (x, y) = ((i % 96) as f64, (i / 96) as f64);
            let noise = (i as u64 + 31 * k).wrapping_mul(0x9E37_79B9_7F4A_7C15) >> 61;
            let spot = height * (-((x - x0).powi(2) + (y - y0).powi(2)) / 3.4).exp();
            (120.0 + noise as f64 + spot) as u8
        };
        let image = Image::from_vec(96, 64, (0..96 * 64).map(value).collect()).unwrap();
        let time = Timestamp::from_ns(k as i64 * 40_000_000);
        detector.detect(&Frame { index: FrameIndex(k), time, pixels: Pixels::Gray8(image) }, &mut scan).unwrap();
        if scan.blind || k < from {
            continue;
        }
        reports += 1;
        if !scan.detections.iter().any(|d| (d.position.x - x0).hypot(d.position.y - y0) < 2.0) {
            return false;
        }
    }
    reports > 5
}

/// Whether every report on frames of a ground of waves that moves by 1 px a frame has a detection at a bright patch that moves by 1 px a frame the other way.
fn finds_a_patch_over_moving_ground(config: &DetectorConfig) -> bool {
    let mut detector = build(config, &source(160, 120, PixelKind::Gray8)).unwrap();
    let (mut scan, mut reports) = (Scan::default(), 0);
    for k in 0..40u64 {
        let (x0, y0) = (40.0 + k as f64, 60.0);
        let value = |i: usize| {
            let (x, y) = ((i % 160) as f64, (i / 160) as f64);
            if (x - x0).abs() <= 3.0 && (y - y0).abs() <= 3.0 {
                return 240;
            }
            let g = x + k as f64;
            let waves =
                30.0 * (0.31 * g + 0.20 * y).sin() + 30.0 * (0.17 * g - 0.41 * y).sin() + 20.0 * (0.6 * g).cos();
            (110.0 + waves) as u8
        };
        let image = Image::from_vec(160, 120, (0..160 * 120).map(value).collect()).unwrap();
        let time = Timestamp::from_ns(k as i64 * 40_000_000);
        detector.detect(&Frame { index: FrameIndex(k), time, pixels: Pixels::Gray8(image) }, &mut scan).unwrap();
        if scan.blind {
            continue;
        }
        reports += 1;
        if !scan.detections.iter().any(|d| (d.position.x - x0).hypot(d.position.y - y0) < 6.0) {
            return false;
        }
    }
    reports > 5
}

#[test]
fn every_centroid_weight_filter_and_distance_takes_every_frame() {
    for method in [CentroidMethod::Mask, CentroidMethod::Binary, CentroidMethod::Bbox, CentroidMethod::BoxCentre] {
        for weight in [Weight::Auto, Weight::Intensity, Weight::AboveBackground] {
            let config = DetectorConfig {
                threshold: ThresholdConfig::Otsu(OtsuConfig { side: Side::Bright }),
                centroid: CentroidConfig { method, weight, extra_sd_px: 0.1, fit: None },
                ..Default::default()
            };
            check(&config, &format!("{method:?} {weight:?}"));
        }
    }
    for (distance_px, inclusive) in [(0.5, false), (1.0, true), (2.0, false), (7.3, true)] {
        let config = DetectorConfig {
            filter: SpatialConfig::Median(WindowConfig::default()),
            cluster: ClusterConfig { distance_px, inclusive, ..Default::default() },
            max_detections: Some(5),
            follow: Some(FollowConfig::default()),
            ..Default::default()
        };
        check(&config, &format!("d_p {distance_px}"));
    }
    let config = DetectorConfig {
        cluster: ClusterConfig { neck: Some(0.7), min_area_px: Some(3), ..Default::default() },
        ..Default::default()
    };
    check(&config, "cut at necks");
}

#[test]
fn things_that_touch_are_two_detections_where_they_are_cut_at_their_neck() {
    // Two discs of radius 15 whose middles lie 28 px apart: half the neck is √(15² - 14²) = 5.4 px.
    let set = |i: usize| (i % 80, i / 80);
    let is_disc = |i: usize, x: f64| (set(i).0 as f64 - x).hypot(set(i).1 as f64 - 30.0) <= 15.0;
    let pixels = (0..80 * 60).map(|i| if is_disc(i, 26.0) || is_disc(i, 54.0) { 100u8 } else { 20 }).collect();
    let image = Image::from_vec(80, 60, pixels).unwrap();
    let frame = Frame { index: FrameIndex(0), time: Timestamp::default(), pixels: Pixels::Gray8(image) };
    let found = |neck: Option<f64>| {
        let config = DetectorConfig {
            threshold: ThresholdConfig::Otsu(OtsuConfig { side: Side::Bright }),
            cluster: ClusterConfig { neck, ..Default::default() },
            ..Default::default()
        };
        let mut scan = Scan::default();
        build(&config, &source(80, 60, PixelKind::Gray8)).unwrap().detect(&frame, &mut scan).unwrap();
        scan.detections.iter().map(|d| (d.position.x, d.position.y, d.area_px)).collect::<Vec<_>>()
    };
    let [whole] = found(None)[..] else { panic!("they touch") };
    let [left, right] = found(Some(0.5))[..] else { panic!("they are two") };
    assert!((whole.0 - 40.0).abs() < 1e-9 && whole.2 == left.2 + right.2);
    for ((x, y, area), at) in [(left, 26.0), (right, 54.0)] {
        // The cut takes off what lies beyond the middle, 1 % of a disc, and the pixels on the middle are one disc's.
        assert!((x - at).abs() < 0.3 && (y - 30.0).abs() < 0.01 && (690..=715).contains(&area), "{x} {y} {area}");
    }
    assert_eq!(found(Some(0.3)).len(), 1, "0.36 is not narrower than 0.3");
}

#[test]
fn every_fit_takes_what_every_threshold_finds() {
    let fits = [
        FitConfig::default(),
        FitConfig { width: FitWidth::Elliptic, motion_px: [3.0, -2.0], max_misfit: 1e3, ..Default::default() },
        FitConfig { width: FitWidth::Known, sigma_px: Some(1.0), slope: false, max_misfit: 1e3, ..Default::default() },
    ];
    let given = NoiseConfig::Given(GivenNoise { read_counts: 2.0, gain: 0.5, offset_counts: 40.0 });
    for threshold in thresholds() {
        for (fit, noise) in fits.iter().zip([&NoiseConfig::Estimated, &given, &given]) {
            let what = format!("{threshold:?} {fit:?} {noise:?}");
            let centroid = CentroidConfig { fit: Some(fit.clone()), ..Default::default() };
            let config =
                DetectorConfig { threshold: threshold.clone(), centroid, noise: noise.clone(), ..Default::default() };
            check(&config, &what);
        }
    }
}

#[test]
fn a_single_dark_target_is_followed_past_a_larger_dark_thing() {
    let config = DetectorConfig {
        threshold: ThresholdConfig::Level(LevelConfig { level: 150.0, side: Side::Dark, exclusive: false }),
        follow: Some(FollowConfig { margin_px: 3.0, max_missed: 3 }),
        ..Default::default()
    };
    let mut detector = build(&config, &source(80, 40, PixelKind::Gray8)).unwrap();
    let mut scan = Scan::default();
    for k in 0..20usize {
        let mut image = Image::filled(80, 40, 200u8);
        let mut square = |left: usize, top: usize, side: usize| {
            (top..top + side).for_each(|y| image.row_mut(y)[left..left + side].fill(50));
        };
        square(5 + 2 * k, 10, 4);
        // From frame 3 on something larger is dark elsewhere, and in frame 8 the target is hidden.
        if k >= 3 {
            square(60, 28, 9);
        }
        if k == 8 {
            image.row_mut(10)[5 + 2 * k..].fill(200);
            (10..14).for_each(|y| image.row_mut(y).fill(200));
        }
        let frame = Frame { index: FrameIndex(k as u64), time: Timestamp::default(), pixels: Pixels::Gray8(image) };
        detector.detect(&frame, &mut scan).unwrap();
        if k == 8 {
            assert!(scan.detections.is_empty());
            continue;
        }
        assert_eq!(scan.detections.len(), 1, "frame {k}");
        assert_eq!(scan.detections[0].position, nalgebra::Vector2::new(6.5 + 2.0 * k as f64, 11.5), "frame {k}");
    }
}
