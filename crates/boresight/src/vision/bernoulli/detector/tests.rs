//! Spots in noise: found, given up, crossing, after a gap; noise alone; what is refused.

use crate::vision::bernoulli::{BernoulliConfig, TargetShape};
use crate::vision::integrate::StillBackground;
use crate::vision::threshold::{Polarity, ThresholdConfig};
use crate::vision::{Detector, DetectorConfig, build};
use crate::{Frame, FrameIndex, Image, PixelKind, Pixels, Scan, SourceInfo, Timestamp};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;

const SIZE: [usize; 2] = [120, 96];
const SIGMA: f64 = 1.3;

/// Few velocities: turns in every few frames.
fn config() -> BernoulliConfig {
    BernoulliConfig { max_speed_px_per_s: 40.0, acceleration_density_px2_per_s3: 1000.0, ..Default::default() }
}

fn detector(config: BernoulliConfig) -> Box<dyn Detector> {
    let info = SourceInfo {
        label: String::new(),
        reader: String::new(),
        width: SIZE[0],
        height: SIZE[1],
        kind: PixelKind::Gray16,
        n_frames: None,
        rate_hz: Some(25.0),
        true_times: true,
    };
    build(&DetectorConfig { threshold: ThresholdConfig::Bernoulli(config), ..Default::default() }, &info).unwrap()
}

/// Noise of 40 counts with spots of a height in deviations.
fn frame(k: u64, time_s: f64, spots: &[([f64; 2], f64)], rng: &mut ChaCha8Rng) -> Frame {
    let value = |i: usize, noise: f64| {
        let (x, y) = ((i % SIZE[0]) as f64, (i / SIZE[0]) as f64);
        let light = |([sx, sy], height): &([f64; 2], f64)| {
            height * (-((x - sx).powi(2) + (y - sy).powi(2)) / (2.0 * SIGMA * SIGMA)).exp()
        };
        (5000.0 + 40.0 * (noise + spots.iter().map(light).sum::<f64>())).round() as u16
    };
    let pixels = (0..SIZE[0] * SIZE[1]).map(|i| value(i, rng.sample(StandardNormal))).collect();
    let image = Image::from_vec(SIZE[0], SIZE[1], pixels).unwrap();
    Frame { index: FrameIndex(k), time: Timestamp::from_secs_f64(time_s), pixels: Pixels::Gray16(image) }
}

/// Distance of the nearest detection, px.
fn nearest(scan: &Scan, [x, y]: [f64; 2]) -> f64 {
    scan.detections.iter().map(|d| (d.position.x - x).hypot(d.position.y - y)).fold(f64::INFINITY, f64::min)
}

#[test]
fn a_spot_that_no_frame_shows_is_found_while_it_turns_and_given_up_when_it_is_gone() {
    for side in [1.0, -1.0] {
        let polarity = if side > 0.0 { Polarity::Bright } else { Polarity::Dark };
        let mut detector = detector(BernoulliConfig { polarity, ..config() });
        let (mut rng, mut scan) = (ChaCha8Rng::seed_from_u64(11), Scan::default());
        let (mut held, mut others, mut last) = (0, 0, 0);
        for k in 0..140u64 {
            // A circle of 12 px in 80 frames: 0.94 px a frame, turning by 4.5 degrees in each.
            let angle = std::f64::consts::TAU * k as f64 / 80.0;
            let place = [36.0 + 12.0 * angle.cos(), 32.0 + 12.0 * angle.sin()];
            // 1.1 deviations at its peak: 2.5 in the matched frame, of 11 520 places.
            let is_there = (20..110).contains(&k);
            let spots = [(place, 1.1 * side)];
            let spots = if is_there { &spots[..] } else { &[] };
            // Uneven times.
            let time_s = 0.04 * k as f64 + if k % 2 == 1 { 0.01 } else { 0.0 };
            detector.detect(&frame(k, time_s, spots, &mut rng), &mut scan).unwrap();
            assert_eq!(scan.blind, k < 5, "a background is needed first");
            let near = nearest(&scan, place) < 3.0;
            held += usize::from((50..110).contains(&k) && near);
            others += scan.detections.len() - usize::from(near && is_there);
            last = if scan.detections.is_empty() { last } else { k };
        }
        assert!(held >= 57, "held in {held} of 60 frames");
        // What is left is that it is reported somewhat after it went.
        assert!(others <= 20 && (110..125).contains(&last), "{others} others, last at {last}");
    }
}

#[test]
fn frames_too_far_apart_are_refused_and_say_why() {
    let (mut rng, mut scan) = (ChaCha8Rng::seed_from_u64(16), Scan::default());
    // An hour: mixing velocities step by step for so long would never end.
    let mut detector = detector(config());
    let said = (0..4u64).map(|k| detector.detect(&frame(k, 3600.0 * k as f64, &[], &mut rng), &mut scan));
    let e = said.filter_map(Result::err).next().unwrap().to_string();
    assert!(e.contains("3600.000 s apart") && e.contains("acceleration-density-px2-per-s3"), "{e}");
    // One that was well before goes on after any number of gaps.
    let mut detector = self::detector(config());
    for k in 0..20u64 {
        let gaps = k.saturating_sub(10);
        detector.detect(&frame(k, 0.04 * k as f64 + 5.0 * gaps as f64, &[], &mut rng), &mut scan).unwrap();
    }
}

#[test]
fn light_that_rises_all_over_begins_no_target() {
    let mut detector = detector(config());
    let (mut rng, mut scan) = (ChaCha8Rng::seed_from_u64(17), Scan::default());
    for k in 0..80u64 {
        let mut frame = frame(k, 0.04 * k as f64, &[], &mut rng);
        if let (Pixels::Gray16(image), 40..) = (&mut frame.pixels, k) {
            (0..SIZE[1]).for_each(|y| image.row_mut(y).iter_mut().for_each(|v| *v += 100));
        }
        detector.detect(&frame, &mut scan).unwrap();
        assert!(scan.detections.len() <= 1, "frame {k}: {}", scan.detections.len());
    }
}

#[test]
fn times_are_seconds_and_not_frames() {
    let slow = BernoulliConfig { max_speed_px_per_s: 0.8, acceleration_density_px2_per_s3: 0.01, ..config() };
    let mut detector = detector(BernoulliConfig { mean_life_s: 500.0, ..slow });
    let (mut rng, mut scan) = (ChaCha8Rng::seed_from_u64(15), Scan::default());
    let place = |k: u64| [20.0 + 1.2 * k as f64, 30.0 + 0.6 * k as f64];
    for k in 0..50u64 {
        detector.detect(&frame(k, 2.0 * k as f64, &[(place(k), 1.5)], &mut rng), &mut scan).unwrap();
    }
    assert!(nearest(&scan, place(49)) < 3.0, "{:?}", scan.detections);
}

#[test]
fn noise_alone_has_no_more_false_targets_than_are_asked_for() {
    let rate = 0.02;
    let mut detector = detector(BernoulliConfig { false_alarms_per_frame: rate, ..config() });
    let (mut rng, mut scan) = (ChaCha8Rng::seed_from_u64(12), Scan::default());
    let (mut begun, mut before) = (0usize, 0usize);
    let n = 400u64;
    for k in 0..n {
        detector.detect(&frame(k, 0.04 * k as f64, &[], &mut rng), &mut scan).unwrap();
        begun += scan.detections.len().saturating_sub(before);
        before = scan.detections.len();
    }
    // 8 are expected at most; 15 or more of 8 are a chance of 2 %.
    assert!(begun < 15, "{begun} begun");
}

#[test]
fn noise_alone_has_about_as_many_false_targets_as_are_asked_for() {
    let rate = 0.3;
    let mut detector = detector(BernoulliConfig { false_alarms_per_frame: rate, ..config() });
    let (mut rng, mut scan) = (ChaCha8Rng::seed_from_u64(18), Scan::default());
    let (mut begun, mut before) = (0usize, Vec::<[f64; 2]>::new());
    for k in 0..500u64 {
        detector.detect(&frame(k, 0.04 * k as f64, &[], &mut rng), &mut scan).unwrap();
        let now: Vec<[f64; 2]> = scan.detections.iter().map(|d| [d.position.x, d.position.y]).collect();
        let is_new = |d: &&[f64; 2]| !before.iter().any(|b| (b[0] - d[0]).hypot(b[1] - d[1]) < 6.0);
        begun += usize::from(k >= 100) * now.iter().filter(is_new).count();
        before = now;
    }
    // 120 are asked for: a factor of three either way.
    assert!((40..360).contains(&begun), "{begun} begun");
}

#[test]
fn a_square_is_found_by_its_edges_and_said_to_be_as_large_and_bright_as_it_is() {
    const SIDE: f64 = 9.0;
    let config = BernoulliConfig { shape: TargetShape::Square, side_px: SIDE, ..config() };
    let mut detector = detector(config);
    let (mut rng, mut scan) = (ChaCha8Rng::seed_from_u64(19), Scan::default());
    let (mut held, mut peaks) = (0, 0.0);
    for k in 0..90u64 {
        let place = [15.0 + 0.8 * k as f64, 70.0 - 0.5 * k as f64];
        let mut frame = frame(k, 0.04 * k as f64, &[], &mut rng);
        if let Pixels::Gray16(image) = &mut frame.pixels {
            for y in 0..SIZE[1] {
                for (x, v) in image.row_mut(y).iter_mut().enumerate() {
                    // What of the pixel is within; 0.3 deviations, 2.7 in the matched frame.
                    let within = |c: usize, at: f64| (0.5 * SIDE + 0.5 - (c as f64 - at).abs()).clamp(0.0, 1.0);
                    *v += (0.3 * 40.0 * within(x, place[0]) * within(y, place[1])).round() as u16;
                }
            }
        }
        detector.detect(&frame, &mut scan).unwrap();
        let near = |d: &&crate::Detection| (d.position.x - place[0]).hypot(d.position.y - place[1]) < 3.0;
        if let (Some(d), 40..) = (scan.detections.iter().find(near), k) {
            (held, peaks) = (held + 1, peaks + f64::from(d.peak));
            assert_eq!((d.extent.width_px, d.area_px), (SIDE, 81));
        }
    }
    assert!(held >= 47, "held in {held} of 50 frames");
    // 12 counts; its strength is a mean over a straight time at places rounded to whole pixels, up to 0.5 px beside it.
    let mean = peaks / f64::from(held);
    assert!((9.0..14.0).contains(&mean), "{mean} counts");
}

#[test]
fn two_that_cross_stay_two() {
    let mut detector = detector(config());
    let (mut rng, mut scan) = (ChaCha8Rng::seed_from_u64(13), Scan::default());
    let mut both = 0;
    for k in 0..90u64 {
        let along = 8.0 + 0.6 * k as f64;
        let places = [[along, 12.0 + 0.45 * k as f64], [along, 52.0 - 0.45 * k as f64]];
        let spots = places.map(|p| (p, 2.0));
        detector.detect(&frame(k, 0.04 * k as f64, &spots, &mut rng), &mut scan).unwrap();
        assert!(scan.detections.len() <= 3, "frame {k}: {}", scan.detections.len());
        // They meet in frame 44.
        both += usize::from(k >= 60 && places.iter().all(|p| nearest(&scan, *p) < 2.5));
    }
    assert!(both >= 28, "both in {both} of 30 frames");
}

#[test]
fn after_a_gap_it_begins_anew_and_what_does_not_fit_memory_is_refused() {
    let mut detector = detector(config());
    let (mut rng, mut scan) = (ChaCha8Rng::seed_from_u64(14), Scan::default());
    for k in 0..60u64 {
        let gap = if k < 30 { 0.0 } else { 60.0 };
        let place = [20.0 + 0.5 * k as f64, 30.0];
        detector.detect(&frame(k, 0.04 * k as f64 + gap, &[(place, 2.5)], &mut rng), &mut scan).unwrap();
        if k == 29 {
            assert!(nearest(&scan, place) < 2.0);
        }
        if k == 30 {
            assert!(scan.detections.is_empty(), "what was a minute ago says nothing");
        }
    }
    assert!(nearest(&scan, [49.5, 30.0]) < 2.0, "{:?}", scan.detections);
    let fast = BernoulliConfig { max_speed_px_per_s: 1e5, background: StillBackground::Spatial, ..config() };
    let e = self::detector(fast).detect(&frame(0, 0.0, &[], &mut rng), &mut scan).unwrap_err().to_string();
    assert!(e.contains("512 MB") && e.contains("hint") && e.contains("max-speed-px-per-s"), "{e}");
}
