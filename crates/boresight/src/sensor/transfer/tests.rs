//! Gains, offsets and read noise put into simulated frames come back, whatever moves.

use super::*;
use crate::Image;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, Poisson, StandardNormal};

const W: usize = 160;
const H: usize = 120;

struct Scene {
    gain: f64,
    offset: f64,
    read: f64,
    /// Light at a pixel in a frame, electrons.
    light: fn(f64, f64, f64) -> f64,
    full: f64,
    /// Response of a pixel differs by this share.
    unequal: f64,
}

impl Scene {
    fn frames(&self, n: usize, seed: u64) -> Vec<Pixels> {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let response: Vec<f64> =
            (0..W * H).map(|_| 1.0 + self.unequal * rng.sample::<f64, _>(StandardNormal)).collect();
        (0..n)
            .map(|k| {
                let values = (0..W * H)
                    .map(|i| {
                        let light = (self.light)((i % W) as f64, (i / W) as f64, k as f64) * response[i];
                        let electrons: f64 =
                            if light > 0.0 { Poisson::new(light).unwrap().sample(&mut rng) } else { 0.0 };
                        let read: f64 = rng.sample(StandardNormal);
                        (self.offset + self.gain * electrons + self.read * read).round().clamp(0.0, self.full) as u16
                    })
                    .collect();
                Pixels::Gray16(Image::from_vec(W, H, values).unwrap())
            })
            .collect()
    }
}

fn gather(frames: &[Pixels]) -> PhotonTransfer {
    let mut transfer = PhotonTransfer::default();
    for f in frames {
        transfer.push(f);
    }
    transfer
}

/// Shading from 20 to 300 electrons.
fn shading(x: f64, y: f64, _: f64) -> f64 {
    20.0 + 1.5 * x + 0.3 * y
}

/// The same with squares of 400 electrons that cross it, bars that pan, and a lamp that flickers.
fn busy(x: f64, y: f64, k: f64) -> f64 {
    let flicker = 1.0 + 0.02 * (1.7 * k).sin();
    let square = |x0: f64, y0: f64, s: f64| (x - x0).abs() < s && (y - y0).abs() < s;
    let squares =
        square(10.0 + 4.0 * k, 30.0, 9.0) || square(150.0 - 3.0 * k, 90.0, 12.0) || square(80.0, 3.0 * k, 8.0);
    let bars = if y < 25.0 { 40.0 * ((x + 1.5 * k) / 4.0).sin() } else { 0.0 };
    flicker * (if squares { 400.0 } else { shading(x, y, k) } + bars).max(0.0)
}

const PLAIN: Scene = Scene { gain: 2.3, offset: 100.0, read: 6.0, light: shading, full: 65535.0, unequal: 0.0 };

#[test]
fn gain_and_read_noise_come_back_within_their_errors() {
    let curve = gather(&PLAIN.frames(40, 1)).curve().unwrap();
    let line = curve.line.unwrap();
    assert!((line.slope - 2.3).abs() < 4.0 * line.slope_sd && line.slope_sd < 0.05, "{line:?}");
    // 36 + 1/12 - 2.3 x 100.
    assert!((line.intercept + 193.9).abs() < 4.0 * line.intercept_sd && line.intercept_sd < 8.0, "{line:?}");
    assert!(curve.has_gain());
    let [read, gain, offset] = curve.noise(None);
    // Without dark frames the line alone: variance 36 + 2.3 (m - 100) at any m.
    let variance = |m: f64| read * read + gain * (m - offset);
    assert!((variance(400.0) / 726.0 - 1.0).abs() < 0.03, "{read} {gain} {offset}");
}

#[test]
fn dark_frames_tell_offset_and_read_noise_apart() {
    let dark = Scene { light: |_, _, _| 0.0, ..PLAIN };
    let dark = gather(&dark.frames(20, 2)).single_level().unwrap();
    let [read, gain, offset] = gather(&PLAIN.frames(40, 3)).curve().unwrap().noise(Some(dark));
    assert!(
        (read - 6.0).abs() < 0.1 && (gain - 2.3).abs() < 0.05 && (offset - 100.0).abs() < 0.1,
        "{read} {gain} {offset}"
    );
}

#[test]
fn motion_flicker_and_unequal_pixels_change_little() {
    for (unequal, seed) in [(0.0, 4), (0.03, 5)] {
        let scene = Scene { light: busy, unequal, ..PLAIN };
        let curve = gather(&scene.frames(40, seed)).curve().unwrap();
        let line = curve.line.unwrap();
        assert!((line.slope / 2.3 - 1.0).abs() < 0.06, "{line:?} {:?}", curve.levels);
        // At 400 counts: 36 + 690.
        assert!(((line.intercept + 400.0 * line.slope) / 726.0 - 1.0).abs() < 0.06, "{line:?}");
    }
}

#[test]
fn noise_without_light_has_no_gain_and_small_noise_in_whole_counts_is_measured() {
    for read in [0.6, 1.5, 8.0] {
        let scene = Scene { gain: 1e-9, read, light: |x, y, k| 1e9 * shading(x, y, k), ..PLAIN };
        // The light's own noise is 1e-9 √(3e11): nothing.
        let curve = gather(&scene.frames(30, 6)).curve().unwrap();
        let [found, gain, _] = curve.noise(None);
        assert!((found / read - 1.0).abs() < 0.05, "{read}: {found}");
        assert!(!curve.has_gain() && gain == 0.0, "{:?}", curve.line);
    }
}

#[test]
fn full_pixels_do_not_count() {
    let scene = Scene { full: 500.0, ..PLAIN };
    let frames: Vec<Pixels> = scene
        .frames(40, 7)
        .into_iter()
        .map(|p| match p {
            Pixels::Gray16(i) => {
                let values = i.as_slice().iter().map(|v| (v / 2).min(250) as u8 + u8::from(*v >= 500) * 5).collect();
                Pixels::Gray8(Image::from_vec(W, H, values).unwrap())
            }
            other => other,
        })
        .collect();
    let line = gather(&frames).curve().unwrap().line.unwrap();
    // Halved counts: gain 1.15 (halving to whole counts adds a little noise).
    assert!((line.slope / 1.15 - 1.0).abs() < 0.06, "{line:?}");
}

#[test]
fn nothing_comes_of_nothing() {
    let mut transfer = PhotonTransfer::default();
    assert!(transfer.curve().is_none() && transfer.single_level().is_none());
    for image in [Image::filled(0, 0, 0.0f32), Image::filled(3, 3, f32::NAN), Image::filled(64, 64, f32::NAN)] {
        for _ in 0..4 {
            assert!(transfer.push(&Pixels::GrayF32(image.clone())));
        }
    }
    assert!(transfer.push(&Pixels::Rgb8(Image::filled(9, 9, [1; 3]))));
    assert!(transfer.curve().is_none());
    for _ in 0..4 {
        transfer.push(&Pixels::GrayF32(Image::filled(64, 64, 7.0)));
    }
    let curve = transfer.curve().unwrap();
    assert!(curve.variance == 0.0 && !curve.has_gain() && curve.noise(None) == [0.0; 3], "{curve:?}");
}
