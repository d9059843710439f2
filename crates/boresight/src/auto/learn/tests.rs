//! Tests of the first pass, on drawn frames.

use super::super::in_memory::InMemory;
use super::*;
use crate::track::ConfirmationConfig;
use crate::vision::DetectorConfig;
use crate::vision::isolated::IsolatedConfig;
use crate::vision::threshold::BandConfig;
use crate::{Frame, FrameIndex, Image, PixelKind, Pixels, SourceInfo, Timestamp};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

const SIZE: [usize; 2] = [160, 120];

/// 100 frames on which `draw` has drawn, and what describes them.
fn filmed(draw: impl Fn(u64, &mut Image<u8>)) -> (Vec<Frame>, SourceInfo) {
    let mut rng = ChaCha8Rng::seed_from_u64(3);
    let frames = (0..100u64)
        .map(|k| {
            let noise = (0..SIZE[0] * SIZE[1]).map(|_| 60 + rng.random_range(0..6u8)).collect();
            let mut image = Image::from_vec(SIZE[0], SIZE[1], noise).unwrap();
            draw(k, &mut image);
            Frame {
                index: FrameIndex(k),
                time: Timestamp::from_secs_f64(0.04 * k as f64),
                pixels: Pixels::Gray8(image),
            }
        })
        .collect();
    let info = SourceInfo {
        label: String::new(),
        reader: String::new(),
        width: SIZE[0],
        height: SIZE[1],
        kind: PixelKind::Gray8,
        n_frames: Some(100),
        rate_hz: Some(25.0),
        true_times: true,
    };
    (frames, info)
}

/// Draws a bright square of 4 px.
fn square(image: &mut Image<u8>, [x, y]: [f64; 2], value: u8) {
    (0..4).for_each(|dy| image.row_mut(y as usize + dy)[x as usize..x as usize + 4].fill(value));
}

/// The choice that is learnt from, for isolated blobs of at least this score.
fn assumed(min_score: f64, report: Report) -> Choice {
    let mut config = Config::default();
    config.detector = DetectorConfig {
        threshold: ThresholdConfig::Isolated(IsolatedConfig { min_score, ..IsolatedConfig::default() }),
        ..DetectorConfig::default()
    };
    config.tracker.report = report;
    Choice::alone(config, Vec::new())
}

/// What is reported of noise with bright squares at these places and speeds, px a frame.
fn reported(squares: &[([f64; 2], f64)]) -> (Report, Vec<String>) {
    let (frames, info) = filmed(|k, image| {
        squares.iter().for_each(|([x, y], speed)| square(image, [x + speed * k as f64, *y], 200));
    });
    let mut choice = assumed(IsolatedConfig::default().min_score, Report::Moving);
    let mut frames = Replay::new(Box::new(InMemory(frames.into_iter(), info)), 100);
    learn(&mut frames, &mut choice, &Request::default(), Ok::<_, Error>).unwrap();
    (choice.config.tracker.report, choice.reasons)
}

#[test]
fn where_specks_are_left_out_the_scans_made_ahead_are_those_of_the_configuration_that_is_written() {
    // Twelve bright squares, or so many that the frames of the choice tell what they reach, and forty faint specks that stay for eight frames each.
    for columns in [4, 8] {
        specks_are_left_out(columns);
    }
}

fn specks_are_left_out(columns: u32) {
    let (frames, info) = filmed(|k, image| {
        (0..3 * columns).for_each(|i| {
            let (column, row) = (f64::from(i % columns), f64::from(i / columns));
            square(image, [8.0 + 144.0 / f64::from(columns) * column + 0.2 * k as f64, 10.0 + 40.0 * row], 200);
        });
        let mut specks = ChaCha8Rng::seed_from_u64(100 + k / 8);
        for _ in 0..40 {
            let place = [specks.random_range(4.0..150.0), specks.random_range(4.0..110.0)];
            if place[1] as usize % 40 > 20 {
                square(image, place, 75 + specks.random_range(0..10));
            }
        }
    });
    let mut choice = assumed(2.5, Report::All);
    choice.config.detector.camera = crate::camera::CameraConfig::Moving;
    choice.config.tracker.min_initiation_score = 4.0;
    let mut replay = Replay::new(Box::new(InMemory(frames.clone().into_iter(), info.clone())), 48).up_to(60);
    let mut learnt = learn(&mut replay, &mut choice, &Request::default(), Ok::<_, Error>).unwrap();
    let ThresholdConfig::Isolated(isolated) = &choice.config.detector.threshold else { panic!("another detector") };
    assert!(isolated.min_score > 2.5, "{:?}", choice.reasons);
    let mut anew = crate::vision::build(&choice.config.detector, &info).unwrap();
    for frame in &frames {
        let [mut a, mut b] = [Scan::default(), Scan::default()];
        learnt.detect(frame, &mut a).unwrap();
        anew.detect(frame, &mut b).unwrap();
        assert_eq!(format!("{a:?}"), format!("{b:?}"));
    }
}

#[test]
fn of_a_band_that_was_set_things_are_confirmed_by_probability_and_pieces_by_their_hits() {
    for in_two in [false, true] {
        let (frames, info) = filmed(|k, image| {
            (0..6).for_each(|i| {
                let (x, y) = (20.0 + 40.0 * f64::from(i % 3) + 0.2 * k as f64, 30.0 + 50.0 * f64::from(i / 3));
                square(image, [x, y], 200);
                square(image, [x + 4.0, y], 200);
                if in_two {
                    square(image, [x, y + 8.0], 200);
                    square(image, [x + 4.0, y + 8.0], 200);
                }
            });
        });
        let mut choice = assumed(2.5, Report::All);
        choice.config.detector.threshold = ThresholdConfig::Band(BandConfig { low: 150.0, high: 255.0 });
        let mut replay = Replay::new(Box::new(InMemory(frames.into_iter(), info)), 48).up_to(60);
        learn(&mut replay, &mut choice, &Request::default(), Ok::<_, Error>).unwrap();
        let by_probability = matches!(choice.config.tracker.confirmation, ConfirmationConfig::Existence(_));
        assert_eq!(by_probability, !in_two, "{:?}", choice.reasons);
    }
}

#[test]
fn the_camera_has_come_as_far_as_its_farthest_place() {
    let shift = |x: f64| Some(crate::CameraMotion::exact_shift(nalgebra::Vector2::new(x, 0.0)));
    let after = |steps: &[f64]| {
        let scan =
            |(k, x): (usize, &f64)| Scan::at(FrameIndex(k as u64), Timestamp::default()).with_camera_motion(shift(*x));
        farthest_px(&steps.iter().enumerate().map(scan).collect::<Vec<_>>())
    };
    assert_eq!(after(&[[2.0; 60], [-2.0; 60]].concat()), 120.0, "there and back is as far as there");
    assert_eq!(after(&[1.0, -1.0].repeat(100)), 1.0, "a shake goes nowhere");
    assert_eq!(after(&[]), 0.0);
}

#[test]
fn what_stands_is_reported_where_nothing_moves_and_only_there() {
    let still = ([40.0, 40.0], 0.0);
    let (report, reasons) = reported(&[still]);
    assert_eq!(report, Report::All, "{reasons:?}");
    assert!(reasons.iter().any(|r| r.contains("Nothing moves by itself")));
    assert_eq!(reported(&[still, ([20.0, 80.0], 1.0)]).0, Report::Moving);
    let many: Vec<([f64; 2], f64)> =
        (0..8).map(|i| ([20.0 + 30.0 * f64::from(i % 4), 30.0 + 40.0 * f64::from(i / 4)], 0.0)).collect();
    assert_eq!(reported(&many).0, Report::Moving, "eight things are a landscape");
}

#[test]
fn regions_left_out_of_scans_made_ahead_are_those_that_the_configuration_leaves_out() {
    // A large thing and small ones that move before a fixed camera.
    let (frames, info) = filmed(|k, image| {
        let x = 10.0 + k as f64;
        [[x, 20.0], [x + 4.0, 20.0], [x, 24.0], [x + 4.0, 24.0], [140.0 - x, 60.0], [x, 90.0]]
            .into_iter()
            .for_each(|at| square(image, at, 200));
    });
    let mut config = assumed(2.5, Report::All).config;
    config.detector.threshold = ThresholdConfig::Moving(crate::vision::background::BackgroundConfig::default());
    let replay = || Replay::new(Box::new(InMemory(frames.clone().into_iter(), info.clone())), 48).up_to(60);
    let of = |min_area_px: u32| {
        let mut config = config.clone();
        config.detector.cluster.min_area_px = Some(min_area_px);
        let mut replay = replay();
        let (mut pass, mut at_once) = first_pass(&mut replay, &config, &Request::default()).unwrap();
        pass.take_on(&mut replay, &mut at_once, 60);
        pass
    };
    let (mut left_out, mut anew) = (of(9), of(40));
    assert!(!left_out.leave_out_below(40, Some(1)), "of a full scan nobody knows what it left out");
    assert!(left_out.scans().iter().any(|s| s.detections.len() == 3));
    assert!(left_out.leave_out_below(40, Some(100)));
    for frame in &frames {
        let [mut a, mut b] = [Scan::default(), Scan::default()];
        left_out.detect(frame, &mut a).unwrap();
        anew.detect(frame, &mut b).unwrap();
        assert_eq!(format!("{a:?}"), format!("{b:?}"));
        assert!(frame.index.0 < 30 || a.detections.len() == 1, "{}", a.detections.len());
    }
}
