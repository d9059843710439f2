//! What is drawn on simulated frames is found, scenery, targets that a camera follows and lines along its pan are not.

use super::super::{MendedSource, SensorConfig, if_defective};
use super::*;
use crate::sensor::Calibration;
use crate::{Frame, FrameIndex, FrameSource, PixelKind, Pixels, Result, SourceInfo, Timestamp};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;

const W: usize = 160;
const H: usize = 120;
const N: usize = 48;

/// Hard-edged squares on an even ground, displaced by `at(k)` pixels in frame `k`, in noise of two counts; `draw` changes a frame.
fn frames(at: impl Fn(usize) -> [usize; 2], draw: impl Fn(usize, &mut Image<u8>)) -> Vec<Image<u8>> {
    let mut rng = ChaCha8Rng::seed_from_u64(5);
    let squares: Vec<[usize; 3]> = (0..120)
        .map(|_| [rng.random_range(0..W + 60), rng.random_range(0..H + 60), rng.random_range(40..170)])
        .collect();
    (0..N)
        .map(|k| {
            let mut image = Image::filled(W, H, 60u8);
            let [dx, dy] = at(k);
            for [x, y, v] in &squares {
                for yy in (y.wrapping_sub(dy)..y.wrapping_sub(dy).wrapping_add(9)).filter(|y| *y < H) {
                    for xx in (x.wrapping_sub(dx)..x.wrapping_sub(dx).wrapping_add(7)).filter(|x| *x < W) {
                        image.row_mut(yy)[xx] = *v as u8;
                    }
                }
            }
            let noisy = |v: &mut u8| *v = (f64::from(*v) + 2.0 * rng.sample::<f64, _>(StandardNormal)).round() as u8;
            image.as_mut_slice().iter_mut().for_each(noisy);
            draw(k, &mut image);
            image
        })
        .collect()
}

fn found(frames: &[Image<u8>]) -> Vec<[u32; 2]> {
    find_overlay(&frames.iter().collect::<Vec<_>>())
}

fn still(_: usize) -> [usize; 2] {
    [0, 0]
}

fn panning(k: usize) -> [usize; 2] {
    [k, k / 3]
}

fn along_rows(k: usize) -> [usize; 2] {
    [k, 0]
}

/// A cross in the middle and a square frame.
fn marks() -> Vec<[usize; 2]> {
    let cross = (4..12).flat_map(|k| [[80 + k, 60], [80 - k, 60], [80, 60 + k], [80, 60 - k]]);
    let frame = (0..20).flat_map(|k| [[20 + k, 20], [20 + k, 39], [20, 20 + k], [39, 20 + k]]);
    cross.chain(frame).collect()
}

/// Letters that stay beside digits.
fn letters() -> Vec<[usize; 2]> {
    let letter =
        |x: usize| (0..8).flat_map(move |k| [[x, 100 + k], [x + k / 2, 100], [x + k / 2, 104], [x + k / 2, 107]]);
    [88, 94].into_iter().flat_map(letter).collect()
}

/// Bars of two digits' width of which some are lit, others in every frame.
fn digits(k: usize) -> Vec<[usize; 2]> {
    let mut rng = ChaCha8Rng::seed_from_u64(k as u64);
    let lit: Vec<bool> = (0..8).map(|_| rng.random()).collect();
    let bar = |b: usize| (0..8).flat_map(move |y| [[100 + 4 * b, 100 + y], [101 + 4 * b, 100 + y]]);
    (0..8).filter(|b| lit[*b]).flat_map(bar).collect()
}

/// A spot of that height and deviation, px, as a lens draws it.
fn add_spot(image: &mut Image<u8>, [at_x, at_y]: [f64; 2], height: f64, deviation_px: f64) {
    for y in 0..H {
        for (x, v) in image.row_mut(y).iter_mut().enumerate() {
            let r2 = ((x as f64 - at_x).powi(2) + (y as f64 - at_y).powi(2)) / deviation_px.powi(2);
            *v = (f64::from(*v) + height * (-0.5 * r2).exp()).min(255.0) as u8;
        }
    }
}

fn put(places: &[[usize; 2]], image: &mut Image<u8>) {
    places.iter().for_each(|[x, y]| image.row_mut(*y)[*x] = 255);
}

/// How many of some places were found, and how many of what was found lie farther than three pixels from them.
fn compared(found: &[[u32; 2]], of: &[[usize; 2]]) -> (usize, usize) {
    let is_near =
        |[x, y]: &[u32; 2]| of.iter().any(|p| p[0].abs_diff(*x as usize).max(p[1].abs_diff(*y as usize)) <= 3);
    let hits = of.iter().filter(|[x, y]| found.contains(&[*x as u32, *y as u32])).count();
    (hits, found.iter().filter(|p| !is_near(p)).count())
}

#[test]
fn marks_are_found_where_the_scene_moves_and_none_in_the_scene() {
    let of = marks();
    for at in [panning, along_rows] {
        assert!(found(&frames(at, |_, _| {})).is_empty(), "the scene alone");
        let (hits, others) = compared(&found(&frames(at, |_, image| put(&of, image))), &of);
        assert_eq!(hits, of.len());
        assert!(others < 20, "{others} px of scenery");
    }
    assert!(found(&frames(still, |_, image| put(&of, image))).is_empty(), "they stand as the scene does");
}

#[test]
fn digits_are_found_whether_the_scene_moves_or_not() {
    let all: Vec<[usize; 2]> = (0..N).flat_map(digits).chain(letters()).collect();
    let draw = |k: usize, image: &mut Image<u8>| put(&[digits(k), letters()].concat(), image);
    for (name, at) in [("still", still as fn(usize) -> [usize; 2]), ("panning", panning)] {
        let (hits, others) = compared(&found(&frames(at, draw)), &all);
        assert!(hits as f64 > 0.85 * all.len() as f64, "{name}: {hits} of {}", all.len());
        assert!(others < 60, "{name}: {others} px of scenery");
    }
}

#[test]
fn a_target_that_the_camera_follows_is_none() {
    // A spot of deviation 1 px stands in the same place to the last digit; another of 4 px side wanders by a pixel at times.
    assert!(found(&frames(panning, |_, image| add_spot(image, [80.3, 60.2], 190.0, 1.0))).is_empty());
    let wandering = |k: usize, image: &mut Image<u8>| {
        let x = 40 + usize::from(k % 5 == 2);
        put(&(0..16).map(|i| [x + i % 4, 80 + i / 4]).collect::<Vec<_>>(), image);
    };
    assert!(found(&frames(panning, wandering)).is_empty());
}

#[test]
fn spots_that_come_to_the_same_places_again_are_no_digits() {
    // In two of six frames a crowd of alike spots stands where it stood six frames before; none stands there in the others.
    let mut rng = ChaCha8Rng::seed_from_u64(9);
    let spots: Vec<[f64; 2]> = (0..40).map(|_| [rng.random_range(8.0..152.0), rng.random_range(8.0..112.0)]).collect();
    let frame = |k: usize| {
        let mut image = Image::filled(W, H, 30u8);
        spots.iter().filter(|_| k % 6 < 2).for_each(|at| add_spot(&mut image, *at, 180.0, 2.0));
        image
    };
    assert!(found(&(0..N).map(frame).collect::<Vec<_>>()).is_empty());
}

#[test]
fn lines_along_a_pan_and_what_comes_by_are_none() {
    // A horizon that the pan runs along, and a square that crosses a scene that stands.
    let horizon = |_: usize, image: &mut Image<u8>| (0..3).for_each(|y| image.row_mut(70 + y).fill(250));
    assert!(found(&frames(along_rows, horizon)).is_empty());
    let passing =
        |k: usize, image: &mut Image<u8>| put(&(0..81).map(|i| [3 * k + i % 9, 50 + i / 9]).collect::<Vec<_>>(), image);
    assert!(found(&frames(still, passing)).is_empty());
}

#[test]
fn frames_too_few_too_small_or_of_several_sizes_have_none() {
    assert!(find_overlay(&[]).is_empty());
    let mut some = frames(panning, |_, image| put(&marks(), image));
    some.truncate(20);
    assert!(found(&some).is_empty(), "fewer than are compared");
    let small: Vec<Image<u8>> = (0..N).map(|_| Image::filled(20, 20, 0)).collect();
    assert!(found(&small).is_empty());
    let mut some = frames(panning, |_, image| put(&marks(), image));
    some[7] = Image::filled(W, H - 1, 0);
    assert!(found(&some).is_empty());
}

/// Frames of coded video.
struct Shown(SourceInfo, Vec<Image<u8>>, u64);

impl Shown {
    fn of(frames: &[Image<u8>]) -> Box<dyn FrameSource> {
        let info = SourceInfo {
            label: String::new(),
            reader: String::new(),
            width: W,
            height: H,
            kind: PixelKind::Gray8,
            n_frames: Some(frames.len() as u64),
            rate_hz: Some(25.0),
            true_times: true,
        };
        Box::new(Self(info, frames.to_vec(), 0))
    }
}

impl FrameSource for Shown {
    fn info(&self) -> &SourceInfo {
        &self.0
    }

    fn is_coded(&self) -> bool {
        true
    }

    fn next_frame(&mut self) -> Result<Option<Frame>> {
        let k = self.2;
        self.2 += 1;
        let (index, time) = (FrameIndex(k), Timestamp::from_secs_f64(k as f64 / 25.0));
        Ok(self.1.get(k as usize).map(|image| Frame { index, time, pixels: Pixels::Gray8(image.clone()) }))
    }
}

fn all(mut source: Box<dyn FrameSource>) -> Vec<Pixels> {
    std::iter::from_fn(|| source.next_frame().unwrap().map(|f| f.pixels)).collect()
}

#[test]
fn marks_are_filled_unasked_and_as_the_written_configuration_says() {
    let with = frames(panning, |_, image| put(&marks(), image));
    let (source, found) = if_defective(Shown::of(&with), N, &SensorConfig::default()).unwrap();
    assert!(found.drawn.len() >= marks().len());
    let mended = all(source);
    assert_eq!(mended.len(), N);
    for pixels in &mended {
        let Pixels::Gray8(image) = pixels else { panic!() };
        assert!(marks().iter().all(|[x, y]| image.row(*y)[*x] < 190), "the scene is no brighter than 170 and noise");
    }
    let config = SensorConfig { overlay: Some(true), ..SensorConfig::default() };
    let again = MendedSource::new(Shown::of(&with), &config, &Calibration::default(), None).unwrap();
    assert!(again.info().reader.contains("pixels of what is drawn"), "{}", again.info().reader);
    assert_eq!(all(Box::new(again)), mended);
    // Frames in colour are filled by what was found in grey ones.
    let mut colour = Pixels::Rgb8(Image::filled(W, H, [10, 20, 30]));
    if let Pixels::Rgb8(image) = &mut colour {
        marks().iter().for_each(|[x, y]| image.row_mut(*y)[*x] = [255; 3]);
    }
    found.overlay(W, H).unwrap().apply(&mut colour);
    assert_eq!(colour, Pixels::Rgb8(Image::filled(W, H, [10, 20, 30])));
    let left = SensorConfig { overlay: Some(false), ..SensorConfig::default() };
    let (source, found) = if_defective(Shown::of(&with), N, &left).unwrap();
    assert!(found.drawn.is_empty() && found.overlay(W, H).is_none());
    assert!(all(source).iter().zip(&with).all(|(a, b)| *a == Pixels::Gray8(b.clone())));
}

#[test]
fn marks_of_the_digits_level_are_found_where_the_scene_stands() {
    let draw = |k: usize, image: &mut Image<u8>| put(&[digits(k), marks()].concat(), image);
    let all: Vec<[usize; 2]> = (0..N).flat_map(digits).chain(marks()).collect();
    let found = found(&frames(still, draw));
    let (hits, _) = compared(&found, &marks());
    assert_eq!(hits, marks().len());
    let (_, others) = compared(&found, &all);
    assert!(others < 60, "{others} px of scenery");
}
