//! Tests of scenes as frames: statistics of every effect, truth, determinism.

use super::super::motion::MotionConfig;
use super::super::scene::{Clock, Correlated, Gradient, Occluder, Rectangle, Spot, Textured, White};
use super::*;

fn frames(c: &SceneConfig, seed: u64) -> Vec<(Frame, Vec<TrackState>)> {
    let mut source = c.build(Seed::new(seed)).unwrap();
    std::iter::from_fn(|| source.next_frame().unwrap().map(|f| (f, source.truth().to_vec()))).collect()
}

fn floats(f: &Frame) -> Vec<f64> {
    match &f.pixels {
        Pixels::Gray8(i) => i.as_slice().iter().map(|v| f64::from(*v)).collect(),
        Pixels::Gray16(i) => i.as_slice().iter().map(|v| f64::from(*v)).collect(),
        _ => panic!("grey frames"),
    }
}

fn mean_std(v: &[f64]) -> (f64, f64) {
    let m = v.iter().sum::<f64>() / v.len() as f64;
    (m, (v.iter().map(|x| (x - m).powi(2)).sum::<f64>() / v.len() as f64).sqrt())
}

/// A scene in which everything is on.
fn busy() -> SceneConfig {
    let target = |shape| Target { shape, motion: MotionConfig::Singer(Default::default()), ..Target::default() };
    let mut c = SceneConfig {
        bits: 12,
        n_frames: 12,
        background: Background::Correlated(Correlated { coherence: 0.8, ..Default::default() }),
        targets: vec![
            target(Shape::Spot(Spot::default())),
            target(Shape::Textured(Textured::default())),
            target(Shape::Rectangle(Rectangle::default())),
        ],
        occluders: vec![Occluder::default()],
        ..Default::default()
    };
    c.sensor = Sensor {
        blur_sigma_px: 0.7,
        electrons_per_count: Some(5.0),
        read_noise: 1.0,
        offset_std: 1.0,
        gain_std: 0.01,
        dead_share: 0.001,
        salt_pepper_share: 0.001,
        saturation: Some(3000.0),
        jitter_px: 0.3,
    };
    c.clock.dropped_share = 0.2;
    c.clock.jitter_s = 0.05;
    c
}

#[test]
fn the_same_seed_gives_the_same_bits_and_another_seed_others() {
    for c in [SceneConfig::default(), busy()] {
        assert_eq!(frames(&c, 3), frames(&c, 3));
        assert_ne!(frames(&c, 3)[0].0, frames(&c, 4)[0].0);
    }
}

#[test]
fn a_recycled_frame_changes_nothing() {
    for c in [SceneConfig::default(), busy()] {
        let fresh = frames(&c, 1);
        let mut source = c.build(Seed::new(1)).unwrap();
        for (f, _) in &fresh {
            let again = source.next_frame().unwrap().unwrap();
            assert_eq!(&again, f);
            source.recycle(again);
        }
    }
}

#[test]
fn dropped_frames_keep_numbers_and_times_of_the_others() {
    let mut c = SceneConfig { n_frames: 400, width_px: 16, height_px: 16, ..SceneConfig::default() };
    let whole = frames(&c, 1);
    c.clock.dropped_share = 0.25;
    let some = frames(&c, 1);
    assert!((some.len() as f64 / 400.0 - 0.75).abs() < 0.08, "{} of 400", some.len());
    for (f, _) in &some {
        assert_eq!(&whole[f.index.0 as usize].0, f);
    }
    c.clock = Clock { jitter_s: 10.0, ..Clock::default() };
    let jittered = frames(&c, 1);
    assert!(jittered.windows(2).all(|w| w[0].0.time < w[1].0.time), "order stays");
}

#[test]
fn a_spot_holds_its_light_and_its_centroid_is_the_truth() {
    let spot = Spot { sigma_px: 0.8, psf_sigma_px: 1.2, total: 40_000.0 };
    let target = Target {
        start_px: [30.3, 21.8],
        velocity_px_per_s: [0.27, -0.1],
        shape: Shape::Spot(spot),
        ..Target::default()
    };
    let c = SceneConfig {
        bits: 16,
        n_frames: 5,
        background: Background::White(White { mean: 0.0, std: 0.0 }),
        targets: vec![target],
        ..Default::default()
    };
    for (f, truth) in frames(&c, 1) {
        let v = floats(&f);
        let sum: f64 = v.iter().sum();
        let x: f64 = v.iter().enumerate().map(|(i, v)| v * (i % 64) as f64).sum::<f64>() / sum;
        let y: f64 = v.iter().enumerate().map(|(i, v)| v * (i / 64) as f64).sum::<f64>() / sum;
        assert!((sum - 40_000.0).abs() < 40.0, "{sum}");
        assert!(
            (x - truth[0].kinematics.mean[0]).abs() < 2e-3 && (y - truth[0].kinematics.mean[2]).abs() < 2e-3,
            "{x} {y}"
        );
    }
}

#[test]
fn a_textured_target_moves_by_parts_of_a_pixel() {
    let x = Textured { size_px: [11.5, 7.0], mean: 200.0, contrast: 0.0, grain_px: 2.0 };
    let target = Target {
        start_px: [20.25, 30.4],
        velocity_px_per_s: [0.3, 0.1],
        shape: Shape::Textured(x),
        ..Target::default()
    };
    let c = SceneConfig {
        bits: 16,
        n_frames: 8,
        background: Background::White(White { mean: 0.0, std: 0.0 }),
        targets: vec![target],
        ..Default::default()
    };
    for (f, truth) in frames(&c, 1) {
        let v = floats(&f);
        let sum: f64 = v.iter().sum();
        let cx: f64 = v.iter().enumerate().map(|(i, v)| v * (i % 64) as f64).sum::<f64>() / sum;
        assert!((sum / (200.0 * 11.5 * 7.0) - 1.0).abs() < 2e-3, "{sum}");
        // Light at a sharp edge is seen at its pixel's centre: at most 1/8 px² of first moment a side.
        assert!((cx - truth[0].kinematics.mean[0]).abs() < 0.125 / 11.5 + 1e-3, "{cx} {}", truth[0].kinematics.mean[0]);
    }
}

#[test]
fn sensor_noises_have_the_spread_asked_for() {
    let flat = |sensor: Sensor| SceneConfig {
        bits: 16,
        n_frames: 2,
        width_px: 128,
        height_px: 128,
        targets: vec![],
        background: Background::White(White { mean: 1000.0, std: 0.0 }),
        sensor,
        ..Default::default()
    };
    let of = |s: Sensor| frames(&flat(s), 2).iter().map(|(f, _)| floats(f)).collect::<Vec<_>>();
    let (_, read) = mean_std(&of(Sensor { read_noise: 20.0, ..Default::default() })[0]);
    assert!((read - 20.0).abs() < 0.6, "{read}");
    let (_, shot) = mean_std(&of(Sensor { electrons_per_count: Some(2.0), ..Default::default() })[0]);
    assert!((shot - 500f64.sqrt()).abs() < 0.7, "{shot}");
    let fixed = of(Sensor { offset_std: 15.0, ..Default::default() });
    assert_eq!(fixed[0], fixed[1], "a fixed pattern stays");
    assert!((mean_std(&fixed[0]).1 - 15.0).abs() < 0.5);
    let dead = of(Sensor { dead_share: 0.05, ..Default::default() });
    let share = dead[0].iter().filter(|v| **v == 0.0).count() as f64 / dead[0].len() as f64;
    assert!((share - 0.05).abs() < 0.007 && dead[0] == dead[1], "{share}");
    let salt = of(Sensor { salt_pepper_share: 0.1, ..Default::default() });
    let (low, high) =
        (salt[0].iter().filter(|v| **v == 0.0).count(), salt[0].iter().filter(|v| **v == 65535.0).count());
    assert!(low.abs_diff(819) < 110 && high.abs_diff(819) < 110 && salt[0] != salt[1], "{low} {high}");
    let full = of(Sensor { saturation: Some(900.0), ..Default::default() });
    assert!(full[0].iter().all(|v| *v == 900.0));
}

#[test]
fn correlated_clutter_has_its_spread_its_length_and_its_coherence() {
    let b = Correlated { mean: 5000.0, std: 300.0, length_px: 2.0, coherence: 0.7 };
    let c = SceneConfig {
        bits: 16,
        n_frames: 40,
        width_px: 96,
        height_px: 96,
        targets: vec![],
        background: Background::Correlated(b),
        ..Default::default()
    };
    let all: Vec<_> =
        frames(&c, 5).iter().map(|(f, _)| floats(f).iter().map(|v| (v - 5000.0) / 300.0).collect::<Vec<_>>()).collect();
    let n = (all.len() * 96 * 96) as f64;
    let var: f64 = all.iter().flatten().map(|v| v * v).sum::<f64>() / n;
    // A Gaussian kernel of width s gives the correlation exp(-d²/(4 s²)): at d = 4, e⁻¹.
    let along: f64 = all.iter().flat_map(|f| f.chunks(96).flat_map(|r| (0..92).map(|i| r[i] * r[i + 4]))).sum::<f64>()
        / (n * 92.0 / 96.0);
    let next: f64 =
        all.windows(2).flat_map(|w| w[0].iter().zip(&w[1]).map(|(a, b)| a * b)).sum::<f64>() / (n * 39.0 / 40.0);
    assert!((var - 1.0).abs() < 0.08, "{var}");
    assert!((along - (-1f64).exp()).abs() < 0.06, "{along}");
    assert!((next - 0.7).abs() < 0.07, "{next}");
}

#[test]
fn an_occluder_hides_the_target_and_the_truth_says_how_much() {
    let occluder = Occluder { corner_px: [20, 0], size_px: [10, 64], mean: 10.0, std: 0.0 };
    let target = Target { start_px: [5.0, 32.0], velocity_px_per_s: [1.0, 0.0], ..Target::default() };
    let c = SceneConfig {
        background: Background::Gradient(Gradient { level: 10.0, slope_per_px: [0.0; 2], std: 0.0 }),
        targets: vec![target],
        occluders: vec![occluder],
        ..Default::default()
    };
    for (f, truth) in frames(&c, 1) {
        let seen = floats(&f).iter().filter(|v| **v != 10.0).count() as f64 / 81.0;
        assert!((seen - f64::from(truth[0].score)).abs() < 0.05, "frame {}: {seen} {}", f.index.0, truth[0].score);
    }
}

#[test]
fn targets_come_go_and_grow() {
    let target = Target {
        start_px: [32.0, 32.0],
        velocity_px_per_s: [0.0; 2],
        appears_s: 10.0,
        vanishes_s: Some(20.0),
        growth_per_s: 0.1,
        ..Target::default()
    };
    let c = SceneConfig {
        background: Background::White(White { mean: 0.0, std: 0.0 }),
        targets: vec![target],
        ..Default::default()
    };
    for (f, truth) in frames(&c, 1) {
        let n = floats(&f).iter().filter(|v| **v > 0.0).count();
        match f.index.0 {
            10 => assert_eq!((n, truth.len()), (81, 1)),
            19 => assert_eq!((n, truth[0].extent.width_px), (17 * 17, 17.0)),
            k if (10..20).contains(&k) => assert_eq!(truth.len(), 1),
            _ => assert_eq!((n, truth.len()), (0, 0)),
        }
    }
}

#[test]
fn both_ways_of_drawing_give_the_same_statistics() {
    // An occluder outside the picture forces the way of floats.
    let fast = SceneConfig { n_frames: 60, ..SceneConfig::default() };
    let outside = Occluder { corner_px: [-10, 0], size_px: [1, 1], ..Occluder::default() };
    let slow = SceneConfig { occluders: vec![outside], ..fast.clone() };
    let stats = |c| {
        let all: Vec<_> = frames(c, 1).iter().flat_map(|(f, _)| floats(f)).collect();
        let (m, s) = mean_std(&all);
        let in_band = all.iter().filter(|v| (90.0..=110.0).contains(*v)).count() as f64 / all.len() as f64;
        (m, s, in_band)
    };
    let (a, b) = (stats(&fast), stats(&slow));
    assert!((a.0 - b.0).abs() < 0.5 && (a.1 - b.1).abs() < 0.5 && (a.2 - b.2).abs() < 0.003, "{a:?} {b:?}");
}
