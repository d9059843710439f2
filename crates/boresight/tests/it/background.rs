//! How the background of a fixed camera behaves: targets, light, shadows, standing and departed targets, shake, odd input.

use boresight::Image;
use boresight::vision::background::{Background, BackgroundConfig, BackgroundPixel, ShadowConfig};

/// Textured ground 40..160 with noise of about a count, seen in a light.
fn ground(w: usize, h: usize, t: usize, gain: f32, offset: f32) -> Image<f32> {
    let mut f = Image::filled(w, h, 0.0);
    for y in 0..h {
        for (x, v) in f.row_mut(y).iter_mut().enumerate() {
            let texture = 40.0 + (x * 29 + y * 53) as f32 % 7.0 * 3.0 + (x / 20 * 20) as f32 % 100.0;
            let noise = ((x * 7919 + y * 104_729 + t * 1_299_709) % 1009) as f32 / 1009.0 * 4.0 - 2.0;
            *v = gain * texture + offset + noise;
        }
    }
    f
}

fn put(f: &mut Image<f32>, x0: usize, y0: usize, size: usize, v: f32) {
    for y in y0..y0 + size {
        f.row_mut(y)[x0..x0 + size].fill(v);
    }
}

fn as_type<T: BackgroundPixel>(f: &Image<f32>) -> Image<T> {
    let pixels = f.as_slice().iter().map(|&v| T::from_f64(f64::from(v))).collect();
    Image::from_vec(f.width(), f.height(), pixels).unwrap()
}

fn learned<T: BackgroundPixel>(config: BackgroundConfig) -> Background<T> {
    let mut b = Background::<T>::new(config).unwrap();
    for t in 0..100 {
        b.update(&as_type(&ground(150, 60, t, 1.0, 0.0)), 0.05).unwrap();
    }
    assert!(!b.is_starting());
    b
}

fn a_square_is_found<T: BackgroundPixel>() {
    let mut b = learned::<T>(BackgroundConfig::default());
    assert_eq!(b.moving().count(), 0);
    for t in 0..20 {
        let mut f = ground(150, 60, 100 + t, 1.0, 0.0);
        put(&mut f, 10 + 5 * t, 20, 10, 230.0);
        b.update(&as_type(&f), 0.05).unwrap();
        // The majority takes the corners of the square.
        assert!((92..=100).contains(&b.moving().count()), "{} at {t}", b.moving().count());
        assert!(b.moving().get(15 + 5 * t, 25) && !b.moving().get(15 + 5 * t, 35));
    }
}

#[test]
fn a_moving_square_is_found_whole_and_nothing_else_in_every_pixel_type() {
    a_square_is_found::<u8>();
    a_square_is_found::<u16>();
    a_square_is_found::<f32>();
}

#[test]
fn a_passing_target_of_the_start_leaves_no_ghost() {
    let mut b = Background::<u8>::new(BackgroundConfig::default()).unwrap();
    for t in 0..80 {
        let mut f = ground(150, 60, t, 1.0, 0.0);
        put(&mut f, 10 + t, 20, 10, 230.0);
        b.update(&as_type(&f), 0.05).unwrap();
    }
    assert!((92..=100).contains(&b.moving().count()), "{}", b.moving().count());
}

#[test]
fn a_sudden_change_of_the_whole_light_moves_nothing() {
    let mut b = learned::<u8>(BackgroundConfig::default());
    for t in 0..30 {
        b.update(&as_type(&ground(150, 60, 200 + t, 1.25, 10.0)), 0.05).unwrap();
        assert!(b.moving().count() < 9, "{} at {t}", b.moving().count());
    }
    let blind = BackgroundConfig {
        follow_light: false,
        shadow: ShadowConfig { enabled: false, ..ShadowConfig::default() },
        ..BackgroundConfig::default()
    };
    let mut b = learned::<u8>(blind);
    b.update(&as_type(&ground(150, 60, 200, 1.25, 10.0)), 0.05).unwrap();
    assert!(b.moving().count() > 8000, "the test's light must be a change");
}

#[test]
fn a_shadow_is_ground_and_a_dark_target_is_not() {
    let scene = |dark: f32| {
        let mut f = ground(150, 60, 300, 1.0, 0.0);
        for y in 20..40 {
            f.row_mut(y)[85..100].iter_mut().for_each(|v| *v *= 0.7);
        }
        put(&mut f, 30, 20, 12, dark);
        as_type::<u8>(&f)
    };
    let mut b = learned::<u8>(BackgroundConfig::default());
    b.update(&scene(5.0), 0.05).unwrap();
    let n = b.moving().count();
    assert!((130..=150).contains(&n), "{n}: the target's 144 px alone");
    let mut b = learned::<u8>(BackgroundConfig {
        shadow: ShadowConfig { enabled: false, ..ShadowConfig::default() },
        ..BackgroundConfig::default()
    });
    b.update(&scene(5.0), 0.05).unwrap();
    assert!(b.moving().count() > 400, "without shadows the 300 px of shadow move too");
}

#[test]
fn a_standing_target_stays_for_its_time_and_a_departed_one_fades() {
    let config = BackgroundConfig { standing_time_s: 40.0, ghost_time_s: 1.0, ..BackgroundConfig::default() };
    let mut b = learned::<u8>(config);
    let stand = |t: usize| {
        let mut f = ground(150, 60, t, 1.0, 0.0);
        put(&mut f, 30, 20, 12, 240.0);
        as_type::<u8>(&f)
    };
    for t in 0..100 {
        b.update(&stand(t), 0.2).unwrap();
    }
    assert!(b.moving().count() > 120, "{} after 20 s", b.moving().count());
    for t in 0..2000 {
        b.update(&stand(t), 0.2).unwrap();
    }
    assert_eq!(b.moving().count(), 0, "after 420 s it is background");
    let mut n = Vec::new();
    for t in 0..150 {
        b.update(&as_type(&ground(150, 60, t, 1.0, 0.0)), 0.2).unwrap();
        n.push(b.moving().count());
    }
    assert!(n[0] > 100 && n[149] < 10, "its hole of {} px has {} left after 30 s", n[0], n[149]);
}

#[test]
fn a_shake_of_one_pixel_moves_little_if_allowed() {
    let shaken = |shake: bool| {
        let mut b = learned::<u8>(BackgroundConfig {
            shake,
            shadow: ShadowConfig { enabled: false, ..ShadowConfig::default() },
            ..BackgroundConfig::default()
        });
        let f = ground(151, 60, 400, 1.0, 0.0);
        let mut moved = Image::filled(150, 60, 0.0);
        for y in 0..60 {
            moved.row_mut(y).copy_from_slice(&f.row(y)[1..]);
        }
        b.update(&as_type(&moved), 0.05).unwrap();
        b.moving().count()
    };
    assert!(shaken(true) < 10 && shaken(false) > 100, "{} {}", shaken(true), shaken(false));
}

#[test]
fn frames_that_do_not_fit_are_refused_and_odd_sizes_and_nan_are_not() {
    let mut b = Background::<u8>::new(BackgroundConfig::default()).unwrap();
    b.update(&Image::filled(8, 8, 1), 0.0).unwrap();
    assert!(b.update(&Image::filled(8, 9, 1), 0.1).is_err());
    for dt_s in [-1.0, f64::NAN, f64::INFINITY] {
        assert!(b.update(&Image::filled(8, 8, 1), dt_s).is_err());
    }
    assert!(b.prime(&[]).is_err());
    let (a, c) = (Image::filled(2, 2, 0u8), Image::filled(3, 2, 0u8));
    assert!(b.prime(&[&a, &c]).is_err());
    for (w, h) in [(0, 0), (0, 3), (3, 0), (1, 1), (1, 70), (70, 1), (64, 2), (65, 2)] {
        let config = BackgroundConfig { shake: true, ..BackgroundConfig::default() };
        let mut b = Background::<f32>::new(config).unwrap();
        for t in 0..50 {
            let v = [f32::NAN, 3.0, f32::INFINITY, 50.0][t % 4];
            b.update(&Image::filled(w, h, v), 10f64.powi(t as i32 % 9 - 4)).unwrap();
        }
    }
    let wrong = BackgroundConfig { ghost_time_s: 0.0, ..BackgroundConfig::default() };
    let e = wrong.validate("detector.background").unwrap_err().to_string();
    assert!(e.starts_with("detector.background.ghost-time-s = 0: expected a time above 0 s"), "{e}");
}
