//! Many bright spots in coded video: what a codec makes of noise lasts for many frames and is no target.

use boresight::io::video::{Mp4Options, Mp4Writer};
use boresight::sim::{SceneConfig, Seed};
use boresight::{Config, FrameSource as _, Image, Pixels, Scan, TrackStatus, auto};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::collections::BTreeMap;
use std::fmt::Write as _;

const SIZE: (usize, usize) = (640, 480);
const N_FRAMES: usize = 60;
const RATE_HZ: f64 = 25.0;

/// A place (px) and its velocity (px/s).
type Course = [f64; 4];

/// What is filmed.
struct Film {
    n_spots: usize,
    /// Range of their peaks, counts.
    peaks: [f64; 2],
    /// Of the ground, counts.
    noise: f64,
    quantiser: u8,
}

/// Spots on white noise, coded, and their courses.
fn film(path: &std::path::Path, film: &Film) -> Vec<Course> {
    let mut rng = ChaCha8Rng::seed_from_u64(11);
    let mut even = |from: f64, to: f64| from + (to - from) * rng.random::<f64>();
    let courses: Vec<Course> = (0..film.n_spots)
        .map(|_| {
            let (x, y) = (even(60.0, SIZE.0 as f64 - 60.0), even(60.0, SIZE.1 as f64 - 60.0));
            [x, y, even(-20.0, 20.0), even(-20.0, 20.0)]
        })
        .collect();
    let mut scene = format!(
        "width-px = {}\nheight-px = {}\nn-frames = {N_FRAMES}\nrate-hz = {RATE_HZ:.1}\nbits = 8\n\
         [background.white]\nmean = 40.0\nstd = {:.1}\n",
        SIZE.0, SIZE.1, film.noise
    );
    for [x, y, vx, vy] in &courses {
        // A spot of 2400 counts in all has a peak of 100.
        let total =
            24.0 * if film.peaks[0] < film.peaks[1] { even(film.peaks[0], film.peaks[1]) } else { film.peaks[0] };
        let _ = writeln!(
            scene,
            "[[targets]]\nstart-px = [{x}, {y}]\nvelocity-px-per-s = [{vx}, {vy}]\n\
             shape.spot = {{ sigma-px = 0.5, psf-sigma-px = 1.9, total = {total:.1} }}"
        );
    }
    let mut source = SceneConfig::from_toml(&scene).unwrap().build(Seed { seed: 12, run: 0 }).unwrap();
    let options = Mp4Options { quantiser: film.quantiser, ..Mp4Options::default() };
    let mut writer = Mp4Writer::create(path, SIZE.0, SIZE.1, options).unwrap();
    while let Some(frame) = source.next_frame().unwrap() {
        let Pixels::Gray8(image) = &frame.pixels else { panic!("grey frames") };
        let rgb = Image::from_vec(SIZE.0, SIZE.1, image.as_slice().iter().map(|v| [*v; 3]).collect()).unwrap();
        writer.write(rgb, frame.time).unwrap();
    }
    writer.finish().unwrap();
    courses
}

/// How many tracks a run without options reports of it, how many of them hold no spot, and in what share of the frames spots are held.
fn reported(film_of: &Film) -> (usize, usize, f64) {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("spots.mp4");
    let courses = film(&path, film_of);
    let mut run = auto::open(&path, &Config::default()).unwrap();
    let mut scan = Scan::default();
    // Reported states of each track, and those of them near a spot: two that are seen as one lie up to 5 px from the middle between them.
    let mut states: BTreeMap<u64, [usize; 2]> = BTreeMap::new();
    let mut n_held = 0;
    while let Some(frame) = run.frames.next_frame().unwrap() {
        run.detector.detect(&frame, &mut scan).unwrap();
        let t = frame.index.0 as f64 / RATE_HZ;
        let mut held = vec![false; courses.len()];
        for s in run.tracker.step(&scan).unwrap().iter().filter(|s| s.status != TrackStatus::Tentative) {
            let counts = states.entry(s.id.0).or_default();
            let mut is_near = false;
            for (c, held) in courses.iter().zip(&mut held) {
                let near = (c[0] + c[2] * t - s.position().x).hypot(c[1] + c[3] * t - s.position().y) < 6.0;
                (*held, is_near) = (*held || near, is_near || near);
            }
            *counts = [counts[0] + 1, counts[1] + usize::from(is_near)];
        }
        n_held += held.iter().filter(|h| **h).count();
    }
    let n_false = states.values().filter(|[n, near]| 2 * near < *n).count();
    let held = n_held as f64 / (courses.len() * N_FRAMES) as f64;
    println!("{} tracks, {n_false} of noise, spots held {held:.2}; {:?}", states.len(), run.config.detector.threshold);
    (states.len(), n_false, held)
}

#[test]
fn of_many_bright_spots_in_coded_video_few_tracks_are_noise() {
    let n = 300;
    let (n_tracks, n_false, _) = reported(&Film { n_spots: n, peaks: [100.0, 100.0], noise: 4.0, quantiser: 30 });
    // Spots closer than their own width are one for a while.
    assert!((n * 9 / 10..n * 5 / 4).contains(&n_tracks), "{n_tracks} tracks");
    // 271 of 603 with the threshold that lets a false detection through for ten spots; 16 since it lies in the valley, what the codec left behind spots for some frames; 0 since what is copied is no evidence.
    assert!(n_false <= n / 10, "{n_false} of {n_tracks} tracks hold no spot");
}

#[test]
fn where_the_codec_flattens_the_ground_spots_are_found_and_what_it_leaves_is_not() {
    let n = 80;
    let (n_tracks, n_false, held) = reported(&Film { n_spots: n, peaks: [30.0, 150.0], noise: 5.0, quantiser: 36 });
    // Before, the threshold lay at 744372 deviations of next to nothing, and 161 tracks were reported; since 82, of which 5 hold no spot, and spots are held in 85 % of their frames.
    assert!(held > 0.8, "{held}");
    assert!(n_false <= n / 10, "{n_false} of {n_tracks} tracks hold no spot");
}
