//! Tests of the camera's motion on simulated grounds.

use super::*;
use crate::Similarity;
use crate::sim::ground::{CameraPathConfig, Ground};
use crate::sim::scene::Background;
use crate::sim::{SceneConfig, SceneSource, Seed};
use crate::{Frame, FrameSource};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// A ground of knots every `length_px` under a camera; per-frame rates.
fn scene(size: (usize, usize), length_px: f64, pan: [f64; 2], turn_deg: f64, zoom: f64, n_frames: u64) -> SceneSource {
    let mut scene =
        SceneConfig { width_px: size.0, height_px: size.1, rate_hz: 25.0, n_frames, ..SceneConfig::default() };
    scene.targets.clear();
    scene.background = Background::Ground(Ground { length_px, noise_std: 1.0, ..Ground::default() });
    scene.camera = CameraPathConfig {
        pan_px_per_s: pan.map(|v| 25.0 * v),
        rotation_deg_per_s: 25.0 * turn_deg,
        zoom_per_s: 25.0 * zoom,
    };
    scene.build(Seed::new(7)).unwrap()
}

fn frames(source: &mut SceneSource) -> Vec<Frame> {
    std::iter::from_fn(|| source.next_frame().unwrap()).collect()
}

/// Motion of frame `k` as it is.
fn truth(source: &SceneSource, k: u64) -> Similarity {
    source.image_from_ground(k - 1).inverse().then(&source.image_from_ground(k))
}

#[test]
fn a_pan_of_2_to_5_px_a_frame_over_any_texture_is_never_unknown() {
    // At 28 px the patches are hardly above the noise.
    for (length, pan) in [(6.0, 2.0), (16.0, 3.5), (16.0, 5.0), (28.0, 3.0)] {
        let mut source = scene((320, 240), length, [pan, 0.3 * pan], 0.0, 0.0, 60);
        let frames = frames(&mut source);
        let mut camera = CameraMotionEstimator::default();
        let mut ground = Homography::identity();
        for (k, frame) in frames.iter().enumerate() {
            let motion = camera.step(&frame.pixels);
            let Some(motion) = motion else {
                assert_eq!(k, 0, "length {length}, pan {pan}: unknown in frame {k}");
                continue;
            };
            assert_eq!(motion.basis, MotionBasis::Measured, "length {length}, pan {pan}, frame {k}");
            for corner in [[0.0, 0.0], [319.0, 0.0], [0.0, 239.0], [319.0, 239.0]].map(Vector2::from) {
                let off = motion.now_from_before.apply(corner) - corner - Vector2::new(pan, 0.3 * pan);
                assert!(off.norm() < 0.5, "a pan shifts the corners alike: frame {k}, {off}");
            }
            ground = ground.then(&motion.now_from_before);
            let error = ground.shift_at(motion.centre_px) - Vector2::new(pan, 0.3 * pan) * k as f64;
            assert!(error.norm() < 0.4, "length {length}, pan {pan}, frame {k}: off by {error}");
        }
    }
}

#[test]
fn light_that_is_switched_is_no_motion() {
    for pan in [0.0, 3.0] {
        let mut camera = CameraMotionEstimator::default();
        for (k, mut frame) in
            frames(&mut scene((320, 240), 16.0, [pan, 0.3 * pan], 0.0, 0.0, 60)).into_iter().enumerate()
        {
            let Pixels::Gray8(image) = &mut frame.pixels else { panic!("eight bits") };
            if k / 15 % 2 == 1 {
                image.as_mut_slice().iter_mut().for_each(|p| *p = (0.7 * f64::from(*p)) as u8);
            }
            let motion = camera.step(&frame.pixels);
            if k < 3 {
                continue;
            }
            let motion = motion.unwrap_or_else(|| panic!("pan {pan}: unknown in frame {k}"));
            let error = motion.shift_px() - pan * Vector2::new(1.0, 0.3);
            assert!(motion.basis == MotionBasis::Measured && error.norm() < 0.3, "pan {pan}, frame {k}: {error}");
        }
    }
}

#[test]
fn turn_and_zoom_are_measured_to_a_twentieth_of_a_degree_and_of_a_percent() {
    for (turn, zoom) in [(1.0, 0.0), (-0.5, 0.01)] {
        let mut source = scene((320, 240), 16.0, [1.0, 0.0], turn, zoom, 60);
        let frames = frames(&mut source);
        let mut camera = CameraMotionEstimator::default();
        let mut squares = [0.0f64; 2];
        for (k, frame) in frames.iter().enumerate() {
            let motion = camera.step(&frame.pixels);
            if k < 3 {
                continue; // the first frames learn the course
            }
            let motion = motion.unwrap_or_else(|| panic!("turn {turn}, zoom {zoom}: unknown in frame {k}"));
            assert_eq!(motion.basis, MotionBasis::Measured, "turn {turn}, zoom {zoom}, frame {k}");
            let (now, truth) = (motion.now_from_before, truth(&source, k as u64));
            squares[0] += (now.angle_rad_at(motion.centre_px) - truth.angle_rad()).to_degrees().powi(2);
            squares[1] += (100.0 * (now.zoom_at(motion.centre_px) / truth.zoom() - 1.0)).powi(2);
            let error = now.shift_at(motion.centre_px) - truth.shift_at(motion.centre_px);
            assert!(error.norm() < 0.3, "turn {turn}, zoom {zoom}, frame {k}: off by {error}");
        }
        let rms = squares.map(|s| (s / 57.0).sqrt());
        assert!(rms[0] < 0.05 && rms[1] < 0.05, "turn {turn}, zoom {zoom}: {rms:?}");
    }
}

#[test]
fn a_fixed_camera_under_noise_has_exactly_no_motion() {
    for even in [false, true] {
        let mut source = scene((320, 240), 16.0, [0.0, 0.0], 0.0, 0.0, 60);
        let mut camera = CameraMotionEstimator::default();
        let mut n = 0;
        while let Some(frame) = source.next_frame().unwrap() {
            let Pixels::Gray8(mut image) = frame.pixels else { unreachable!() };
            if !even {
                // A quiet sky: the ground below it stands out.
                (0..100).for_each(|y| image.row_mut(y).fill(150));
            }
            if let Some(motion) = camera.step(&Pixels::Gray8(image)) {
                assert!(motion.now_from_before.is_identity() && motion.cov == MotionCov::zeros());
                n += 1;
            }
        }
        assert!(even || n == 59, "{n}: an even texture that never moved may be the sensor's own, another not");
    }
}

#[test]
fn what_is_not_seen_is_held_and_less_and_less_sure() {
    let mut source = scene((320, 240), 16.0, [4.0, 1.0], 0.0, 0.0, 60);
    let frames = frames(&mut source);
    let blind = Pixels::Gray8(Image::filled(320, 240, 90u8));
    let mut camera = CameraMotionEstimator::default();
    frames[..30].iter().for_each(|f| {
        camera.step(&f.pixels);
    });
    let mut spread = 0.0;
    for k in 0..4 {
        let motion = camera.step(&blind).expect("held");
        assert_eq!(motion.basis, MotionBasis::Held);
        assert!((motion.shift_px() - Vector2::new(4.0, 1.0)).norm() < 0.3, "{k}: {}", motion.shift_px());
        let now = motion.cov_at(motion.centre_px)[(0, 0)];
        assert!(now > 1.2 * spread && now > 1e-6, "{k}: {now} after {spread}");
        spread = now;
    }
    // The key frame is found again: the way over the blind frames is right, too.
    let motion = camera.step(&frames[34].pixels).expect("seen again");
    assert_eq!(motion.basis, MotionBasis::Measured);
    assert!((motion.shift_px() - Vector2::new(4.0, 1.0)).norm() < 1.0);
    assert!(motion.cov_at(motion.centre_px)[(0, 0)] >= spread, "what was uncertain stays so for some frames");
    let unknown = (0..40).map(|_| camera.step(&blind)).filter(Option::is_none).count();
    assert!(unknown >= 40 - MOST_HELD as usize, "in the end it is unknown: {unknown}");
}

#[test]
fn a_cut_is_said_and_the_other_view_is_followed() {
    // The first camera stands, the second moves on.
    let (mut one, mut other) =
        (scene((320, 240), 16.0, [0.0, 0.0], 0.0, 0.0, 30), scene((320, 240), 12.0, [3.0, 1.0], 0.0, 0.0, 60));
    let (one, other) = (frames(&mut one), frames(&mut other));
    let mut camera = CameraMotionEstimator::default();
    for f in &one {
        assert!(camera.step(&f.pixels).is_none_or(|m| !m.is_cut()));
    }
    let cut = camera.step(&other[40].pixels).expect("said");
    assert!(cut.is_cut() && cut.measured_shift_px().is_none() && cut.now_from_before.is_identity());
    for frame in &other[42..] {
        camera.step(&frame.pixels);
    }
    let motion = camera.step(&other[59].pixels).expect("the other view");
    assert_eq!(motion.basis, MotionBasis::Measured);
}

#[test]
fn another_view_that_is_no_cut_is_followed_once_the_key_frame_is_given_up() {
    // Both pan: every frame is another one, so that a cut does not stand out.
    let (mut one, mut other) =
        (scene((320, 240), 16.0, [3.0, 0.0], 0.0, 0.0, 30), scene((320, 240), 12.0, [3.0, 1.0], 0.0, 0.0, 60));
    let (one, other) = (frames(&mut one), frames(&mut other));
    let mut camera = CameraMotionEstimator::default();
    one.iter().for_each(|f| {
        camera.step(&f.pixels);
    });
    for (k, frame) in (0..).zip(&other[40..]) {
        let motion = camera.step(&frame.pixels).expect("the other view moves on");
        if k < WAIT_FRAMES {
            assert_eq!(motion.basis, MotionBasis::Held, "{k}: the key frame may come back");
            continue;
        }
        assert_eq!(motion.basis, if k == WAIT_FRAMES { MotionBasis::Resumed } else { MotionBasis::Measured }, "{k}");
        assert!((motion.shift_px() - Vector2::new(3.0, 1.0)).norm() < 0.3);
    }
}

#[test]
fn an_even_sky_and_tiny_frames_say_nothing() {
    for (w, h) in [(320, 256), (1, 1), (5, 300), (0, 0)] {
        let mut camera = CameraMotionEstimator::default();
        for _ in 0..3 {
            assert_eq!(camera.step(&Pixels::Gray8(Image::filled(w, h, 7))), None);
            assert_eq!(camera.clone().step(&Pixels::GrayF32(Image::filled(w, h, f32::NAN))), None);
        }
    }
}

#[test]
fn a_frame_reduced_by_three_moves_by_its_own_pixels() {
    let mut source = scene((800, 600), 40.0, [6.0, -3.0], 0.4, 0.0, 12);
    let frames = frames(&mut source);
    let mut camera = CameraMotionEstimator::default();
    for (k, frame) in frames.iter().enumerate() {
        let motion = camera.step(&frame.pixels);
        if k < 3 {
            continue;
        }
        let (motion, truth) = (motion.expect("textured"), truth(&source, k as u64));
        assert!((motion.centre_px - Vector2::new(399.5, 299.5)).norm() < 2.0, "{}", motion.centre_px);
        for corner in [Vector2::new(0.0, 0.0), Vector2::new(799.0, 599.0)] {
            let error = motion.now_from_before.apply(corner) - truth.apply(corner);
            assert!(error.norm() < 0.6, "frame {k}: off by {error}");
        }
    }
}

/// A textured ground seen from (x, y), with one bright thing that moves on its own.
fn view(ground: &Image<u8>, x: usize, y: usize, thing: usize) -> Pixels {
    let mut frame = Image::filled(160, 120, 0u8);
    for r in 0..120 {
        frame.row_mut(r).copy_from_slice(&ground.row(y + r)[x..x + 160]);
    }
    for r in 50..60 {
        frame.row_mut(r)[thing..thing + 10].fill(250);
    }
    Pixels::Gray8(frame)
}

fn ground() -> Image<u8> {
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let coarse: Vec<f64> = (0..60 * 60).map(|_| 200.0 * rng.random::<f64>()).collect();
    let mut image = Image::filled(400, 400, 0u8);
    for y in 0..400 {
        for x in 0..400 {
            // Smooth between the knots, so that half pixels exist.
            let (fx, fy) = (x as f64 / 7.0, y as f64 / 7.0);
            let (i, j) = (fx as usize, fy as usize);
            let (a, b) = (fx - i as f64, fy - j as f64);
            let at = |i: usize, j: usize| coarse[j * 60 + i];
            let v = at(i, j) * (1.0 - a) * (1.0 - b)
                + at(i + 1, j) * a * (1.0 - b)
                + at(i, j + 1) * (1.0 - a) * b
                + at(i + 1, j + 1) * a * b;
            image.row_mut(y)[x] = v as u8;
        }
    }
    image
}

#[test]
fn a_pan_is_followed_whatever_a_target_does() {
    let ground = ground();
    let mut camera = CameraMotionEstimator::default();
    assert_eq!(camera.step(&view(&ground, 100, 100, 10)), None, "the first frame has no shift");
    let mut sum = Vector2::zeros();
    for k in 1..30 {
        let shift = camera.step(&view(&ground, 100 + 4 * k, 100 + k, 10 + 2 * k)).expect("a textured ground");
        sum += shift.shift_px();
        assert!((sum - Vector2::new(-4.0 * k as f64, -(k as f64))).norm() < 0.5, "frame {k}: {sum}");
    }
}

#[test]
fn a_fixed_camera_is_exactly_fixed_under_a_sensor_s_noise() {
    let ground = ground();
    let mut rng = ChaCha8Rng::seed_from_u64(2);
    let mut camera = CameraMotionEstimator::default();
    for k in 0..20 {
        let Pixels::Gray8(mut frame) = view(&ground, 50, 50, 10 + k) else { unreachable!() };
        frame.as_mut_slice().iter_mut().for_each(|p| *p = p.saturating_add(rng.random_range(0..6)));
        let shift = camera.step(&Pixels::Gray8(frame));
        assert!(k == 0 || shift.is_some_and(|m| m.now_from_before.is_identity()), "frame {k}: {shift:?}");
    }
}

#[test]
fn a_car_before_an_even_road_with_a_few_marks_is_not_the_camera() {
    // A textured thing over a sixth of the view goes up; the road is noise, with marks near the border that stand.
    let texture = ground();
    let mut rng = ChaCha8Rng::seed_from_u64(3);
    let mut camera = CameraMotionEstimator::default();
    for k in 0..20usize {
        let mut frame = Image::filled(320, 240, 0u8);
        frame.as_mut_slice().iter_mut().for_each(|p| *p = 100 + rng.random_range(0..4));
        for (x, y) in [(30, 20), (150, 15), (290, 25), (20, 200), (285, 195)] {
            (0..14).for_each(|r| frame.row_mut(y + r)[x..x + 14].copy_from_slice(&texture.row(y + r)[x..x + 14]));
        }
        let top = 100 - 3 * k;
        (0..130).for_each(|r| frame.row_mut(top + r)[115..205].copy_from_slice(&texture.row(200 + r)[200..290]));
        let motion = camera.step(&Pixels::Gray8(frame));
        assert!(motion.is_none_or(|m| m.shift_px().norm() < 1.0), "frame {k}: {motion:?}");
    }
}

#[test]
fn spots_that_move_by_themselves_before_an_even_ground_are_no_motion_of_the_camera() {
    // As particles, birds or stars: a hundred patches of texture, each with a velocity of its own, and noise that a codec repeats. The camera stands.
    let (w, h) = (960usize, 540usize);
    for seed in 0..3 {
        let mut rng = ChaCha8Rng::seed_from_u64(300 + seed);
        let mut normal = |std: f64| std * rng.sample::<f64, _>(rand_distr::StandardNormal);
        let grounds: Vec<Vec<u8>> = (0..6).map(|_| (0..w * h).map(|_| (30.0 + normal(4.0)) as u8).collect()).collect();
        let mut spots: Vec<[Vector2<f64>; 2]> = (0..50)
            .map(|_| {
                [Vector2::new(480.0 + normal(200.0), 270.0 + normal(110.0)), Vector2::new(normal(1.0), normal(1.0))]
            })
            .collect();
        let mut camera = CameraMotionEstimator::default();
        for k in 0..200 {
            let mut pixels = grounds[k % 6].clone();
            for [at, velocity] in &mut spots {
                *at += *velocity;
                for (axis, most) in [(0, w as f64), (1, h as f64)] {
                    if at[axis] < 20.0 || at[axis] > most - 20.0 {
                        velocity[axis] = velocity[axis].abs().copysign(0.5 * most - at[axis]);
                    }
                }
                let (cx, cy) = (at.x.round() as i64, at.y.round() as i64);
                for y in (cy - 6).max(0)..(cy + 7).min(h as i64) {
                    for x in (cx - 6).max(0)..(cx + 7).min(w as i64) {
                        let r2 = (x as f64 - at.x).powi(2) + (y as f64 - at.y).powi(2);
                        let p = &mut pixels[y as usize * w + x as usize];
                        *p = p.saturating_add((180.0 * (-0.5 * r2 / 4.84).exp()) as u8);
                    }
                }
            }
            if let Some(motion) = camera.step(&Pixels::Gray8(Image::from_vec(w, h, pixels).unwrap())) {
                let shift = motion.shift_px();
                assert!(shift.norm() < 1e-6, "seed {seed}, frame {k}: {shift}, {:?}", motion.basis);
            }
        }
    }
}

#[test]
fn a_few_bright_things_before_an_even_ground_are_no_motion_of_the_camera() {
    // Three to eight saturated spots in noise, each with a velocity of its own that it keeps: a shift, turn and zoom explains any two of them. The camera stands.
    // By chance they may agree with one: of 60 such scenes two do. Without the rule seven of these nine.
    let (w, h) = (320usize, 240usize);
    let mut invented = std::collections::BTreeSet::new();
    for (seed, n) in [3, 5, 8].into_iter().cycle().take(9).enumerate() {
        let mut rng = ChaCha8Rng::seed_from_u64(900 + seed as u64);
        let spots: Vec<[Vector2<f64>; 2]> = (0..n)
            .map(|_| {
                let mut even = |low: f64, high: f64| low + (high - low) * rng.random::<f64>();
                [Vector2::new(even(40.0, 280.0), even(40.0, 200.0)), Vector2::new(even(-1.2, 1.2), even(-1.0, 1.0))]
            })
            .collect();
        let mut camera = CameraMotionEstimator::default();
        for k in 0..60 {
            let mut image = Image::filled(w, h, 0u8);
            for y in 0..h {
                for (x, p) in image.row_mut(y).iter_mut().enumerate() {
                    let light = |[at, v]: &[Vector2<f64>; 2]| {
                        let d = Vector2::new(x as f64, y as f64) - at - v * f64::from(k);
                        if d.norm() < 14.0 { 1500.0 * (-0.5 * d.norm_squared() / 4.0).exp() } else { 0.0 }
                    };
                    let noise: f64 = 2.0 * rng.sample::<f64, _>(rand_distr::StandardNormal);
                    *p = (30.0 + noise + spots.iter().map(light).sum::<f64>()) as u8;
                }
            }
            if let Some(motion) = camera.step(&Pixels::Gray8(image)) {
                let shift = motion.shift_px();
                let zoom = motion.now_from_before.zoom_at(Vector2::new(160.0, 120.0));
                if shift.norm() > 1e-6 || (zoom - 1.0).abs() > 1e-9 {
                    invented.insert(seed);
                }
            }
        }
    }
    assert!(invented.len() <= 1, "{invented:?}");
}

/// Two views of 320 x 240 px with a little noise: what lies at p in the first lies at `way` of it in the second, of the ground's texture where `is_textured` says so.
fn two_views(way: &Similarity, is_textured: impl Fn(Vector2<f64>) -> bool) -> [Pixels; 2] {
    let (texture, mut rng) = (ground(), ChaCha8Rng::seed_from_u64(6));
    let at = |p: Vector2<f64>| {
        let (x, y) = (p.x as usize, p.y as usize);
        let (u, v) = (p.x - x as f64, p.y - y as f64);
        let [a, b] = [y, y + 1].map(|y| [x, x + 1].map(|x| f64::from(texture.row(y)[x])));
        (a[0] * (1.0 - u) + a[1] * u) * (1.0 - v) + (b[0] * (1.0 - u) + b[1] * u) * v
    };
    [false, true].map(|moved| {
        let mut view = Image::filled(320, 240, 0u8);
        for y in 0..240 {
            for (x, v) in view.row_mut(y).iter_mut().enumerate() {
                let q = Vector2::new(x as f64, y as f64);
                let p = if moved { way.inverse().apply(q) } else { q };
                let value = if is_textured(p) { at(p + Vector2::repeat(40.0)) } else { 100.0 };
                *v = (value + 2.0 * rng.random::<f64>()) as u8;
            }
        }
        Pixels::Gray8(view)
    })
}

#[test]
fn a_ground_of_two_pieces_that_covers_most_of_the_view_is_no_chance() {
    // A turn and a zoom explain any two things; here they explain two thirds of the area.
    let truth = Similarity::about(Vector2::new(159.5, 119.5), Vector2::new(6.0, -4.0), 0.03, 1.01);
    let views = two_views(&truth, |p| (10.0..120.0).contains(&p.x) || (200.0..310.0).contains(&p.x));
    let mut camera = CameraMotionEstimator::default();
    assert_eq!(camera.step(&views[0]), None);
    let motion = camera.step(&views[1]).expect("most of the view");
    for corner in [Vector2::new(0.0, 0.0), Vector2::new(319.0, 239.0)] {
        let error = motion.now_from_before.apply(corner) - truth.apply(corner);
        assert!(error.norm() < 0.2, "{error}");
    }
}

#[cfg(feature = "video")]
#[test]
fn of_a_view_that_moved_few_patches_lie_where_they_lay() {
    let clip = concat!(env!("CARGO_MANIFEST_DIR"), "/../../samples/ir_drone/IR_DRONE_046.mp4");
    let frame = crate::io::open(clip, &crate::io::OpenOptions::default()).unwrap().next_frame().unwrap().unwrap();
    let (mut image, mut sums) = (Image::default(), Vec::new());
    reduce(&frame.pixels, &mut image, &mut sums);
    let (w, h) = (image.width() - 32, image.height() - 16);
    let view = |left: usize, top: usize| {
        let rows = (top..top + h).flat_map(|y| image.row(y)[left..left + w].iter().copied());
        Image::from_vec(w, h, rows.collect()).unwrap()
    };
    let mut key = KeyFrame::default();
    key.take(&mut view(0, 0));
    let share = |left, top| {
        let now = view(left, top);
        let found = |p: &&crate::camera::key_frame::Patch| {
            let to = find_near(&key.image, &now, **p, p.middle(), &Similarity::identity());
            to.is_some_and(|to| (to - p.middle()).norm() <= STILL)
        };
        key.patches.iter().filter(found).count() as f64 / key.patches.len() as f64
    };
    assert!(share(0, 0) > AT_REST, "some reach the border");
    for moved in [(2, 0), (0, 2), (3, 0), (0, 4), (7, 2), (5, 9), (12, 0), (15, 15), (31, 8)] {
        assert!(share(moved.0, moved.1) < 0.75 * AT_REST, "{moved:?}: {}", share(moved.0, moved.1));
    }
}
