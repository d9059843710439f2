//! Scenes that are drawn for it.

use super::*;

#[test]
fn the_size_is_that_of_what_holds_half_of_the_area_however_many_flickers_there_are() {
    let region = |side: f64| Moved { left: 0.0, top: 0.0, right: side, bottom: 2.0 * side, area: side * side };
    let info = SourceInfo {
        label: String::new(),
        reader: String::new(),
        width: 320,
        height: 240,
        kind: PixelKind::Gray8,
        n_frames: None,
        rate_hz: None,
        true_times: true,
    };
    let size = |frames: &[Vec<Moved>]| {
        let mut scene = Scene::default();
        measure(&mut scene, frames, &info);
        scene.size_px
    };
    let among = |n_flickers: usize| {
        let frame = [vec![region(40.0); 2], vec![region(3.0); n_flickers]].concat();
        size(&[frame.clone(), Vec::new(), frame])
    };
    assert_eq!((among(0), among(100)), ([40.0, 80.0], [40.0, 80.0]));
    // 400 of 9 px² are more than two of 1600 px².
    assert_eq!((among(400), size(&[])), ([3.0, 6.0], [0.0; 2]));
}

#[test]
fn the_edges_of_a_camera_that_moves_are_seen_to_move_though_their_pixels_vary_as_much() {
    // A roof's edge of 120 counts in noise of two, slanted, that comes by so many pixels a frame.
    use rand::{RngExt, SeedableRng};
    let share = |px_a_frame: f64| {
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(1);
        let grids: Vec<Image<f32>> = (0..48)
            .map(|k| {
                let mut grid = Image::filled(120, 90, 0f32);
                for y in 0..90 {
                    let edge = 0.2 * y as f64 + 30.0 + px_a_frame * f64::from(k);
                    for (x, p) in grid.row_mut(y).iter_mut().enumerate() {
                        let z: f64 = rng.sample(rand_distr::StandardNormal);
                        *p = (80.0 + 120.0 * (x as f64 - edge).clamp(0.0, 1.0) + 2.0 * z) as f32;
                    }
                }
                grid
            })
            .collect();
        let config = BackgroundConfig { start_s: 0.0, min_difference: Some(MIN_COUNTS), ..BackgroundConfig::default() };
        let mut background = Background::<f32>::new(config).unwrap();
        background.prime(&grids.iter().collect::<Vec<_>>()).unwrap();
        let edges = edges(&background, 120, 90, true);
        assert!(edges.len() > 50);
        let moved = grids.iter().map(|g| edges.iter().filter(|e| e.has_moved(g)).count()).sum::<usize>();
        moved as f64 / (edges.len() * grids.len()) as f64
    };
    assert!(share(0.0) < 0.03, "{}", share(0.0));
    assert!(share(0.4) > 0.2, "{}", share(0.4));
}

#[test]
fn what_moves_before_a_fixed_camera_is_told_in_a_light_that_falls_by_half() {
    use crate::{FrameIndex, Timestamp};
    use rand::{RngExt, SeedableRng};
    let (w, h) = (200usize, 150usize);
    let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(3);
    let ground: Vec<f32> = (0..w * h).map(|i| 40.0 + 130.0 * f32::from((i % w / 9 + i / w / 7) % 2 == 0)).collect();
    let mut frames = |falls_by: f32, pan: usize| -> Vec<Frame> {
        (0..30)
            .map(|k| {
                let light = 1.0 - falls_by * k as f32 / 30.0;
                let mut image = Image::filled(w, h, 0u8);
                for y in 0..h {
                    for (x, p) in image.row_mut(y).iter_mut().enumerate() {
                        let thing = (20 + 4 * k..44 + 4 * k).contains(&x) && (60..90).contains(&y);
                        let value = if thing { 100.0 } else { ground[y * w + (x + pan * k) % w] };
                        *p = (light * value + 3.0 * rng.random::<f32>()) as u8;
                    }
                }
                let time = Timestamp::from_secs_f64(0.04 * k as f64);
                Frame { index: FrameIndex(k as u64), time, pixels: Pixels::Gray8(image) }
            })
            .collect()
    };
    let info = SourceInfo {
        label: String::new(),
        reader: String::new(),
        width: w,
        height: h,
        kind: PixelKind::Gray8,
        n_frames: None,
        rate_hz: None,
        true_times: true,
    };
    for falls_by in [0.0, 0.5] {
        let scene = look(&frames(falls_by, 0), &info).unwrap();
        assert_eq!(scene.camera, Camera::Fixed);
        let told = scene.in_one_light.as_deref().unwrap_or(&scene);
        assert!(told.n_moving == 30 && told.regions < 1.5 && told.share < 0.05, "{falls_by}: {told:?}");
    }
    assert_ne!(look(&frames(0.5, 2), &info).unwrap().camera, Camera::Fixed, "the ground goes by");
}

/// What is seen of 30 frames of 200 x 150 px in which things of 100 x 0.6 counts and 24 x 12 px cross a ground of 100 counts, each with a caster of so many px of 30 counts at its upper side.
fn darkened(caster_rows: usize) -> Scene {
    use crate::{FrameIndex, Timestamp};
    use rand::{RngExt, SeedableRng};
    let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(2);
    let frame = |k: usize| {
        let mut image = Image::filled(200, 150, 0u8);
        for y in 0..150 {
            for (x, p) in image.row_mut(y).iter_mut().enumerate() {
                let inside = (10 + 5 * k..34 + 5 * k).contains(&x);
                let value = match y {
                    60..72 if inside => 60.0,
                    y if inside && (60 - caster_rows..60).contains(&y) => 30.0,
                    _ => 100.0,
                };
                *p = (value + 3.0 * rng.random::<f32>()) as u8;
            }
        }
        let time = Timestamp::from_secs_f64(0.04 * k as f64);
        Frame { index: FrameIndex(k as u64), time, pixels: Pixels::Gray8(image) }
    };
    let frames: Vec<Frame> = (0..30).map(frame).collect();
    let info = SourceInfo {
        label: String::new(),
        reader: String::new(),
        width: 200,
        height: 150,
        kind: PixelKind::Gray8,
        n_frames: None,
        rate_hz: None,
        true_times: true,
    };
    look(&frames, &info).unwrap()
}

#[test]
fn what_is_darker_by_a_factor_is_shadow_where_something_casts_it_and_else_a_dark_thing() {
    let (cast, alone) = (darkened(12), darkened(0));
    let height_px = |s: &Scene| s.size_px[1];
    assert!(!cast.has_dark_things() && (0.3..0.6).contains(&cast.shadow), "{}", cast.shadow);
    assert!((10.0..14.0).contains(&height_px(&cast)), "the caster alone: {}", height_px(&cast));
    assert!(alone.has_dark_things() && alone.n_moving == 30, "{} {}", alone.shadow, alone.n_moving);
    assert!((10.0..14.0).contains(&height_px(&alone)), "{}", height_px(&alone));
}
