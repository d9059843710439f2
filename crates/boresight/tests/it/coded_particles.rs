//! Many bright spots in coded video: what a codec makes of noise lasts for many frames and is no target.

use boresight::io::video::{Mp4Options, Mp4Writer};
use boresight::sim::{SceneConfig, Seed};
use boresight::{Config, FrameSource as _, Image, Pixels, Scan, TrackStatus, auto};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::collections::BTreeMap;
use std::fmt::Write as _;

const SIZE: (usize, usize) = (640, 480);
const N_SPOTS: usize = 300;
const N_FRAMES: usize = 60;
const RATE_HZ: f64 = 25.0;

/// A place (px) and its velocity (px/s).
type Course = [f64; 4];

/// Spots of 100 counts on noise of 4, coded, and their courses.
fn film(path: &std::path::Path) -> Vec<Course> {
    let mut rng = ChaCha8Rng::seed_from_u64(11);
    let mut even = |from: f64, to: f64| from + (to - from) * rng.random::<f64>();
    let courses: Vec<Course> = (0..N_SPOTS)
        .map(|_| {
            let (x, y) = (even(60.0, SIZE.0 as f64 - 60.0), even(60.0, SIZE.1 as f64 - 60.0));
            [x, y, even(-20.0, 20.0), even(-20.0, 20.0)]
        })
        .collect();
    let mut scene = format!(
        "width-px = {}\nheight-px = {}\nn-frames = {N_FRAMES}\nrate-hz = {RATE_HZ:.1}\nbits = 8\n\
         [background.white]\nmean = 40.0\nstd = 4.0\n",
        SIZE.0, SIZE.1
    );
    for [x, y, vx, vy] in &courses {
        let _ = writeln!(
            scene,
            "[[targets]]\nstart-px = [{x}, {y}]\nvelocity-px-per-s = [{vx}, {vy}]\n\
             shape.spot = {{ sigma-px = 0.5, psf-sigma-px = 1.9, total = 2400.0 }}"
        );
    }
    let mut source = SceneConfig::from_toml(&scene).unwrap().build(Seed { seed: 12, run: 0 }).unwrap();
    let options = Mp4Options { quantiser: 30, ..Mp4Options::default() };
    let mut writer = Mp4Writer::create(path, SIZE.0, SIZE.1, options).unwrap();
    while let Some(frame) = source.next_frame().unwrap() {
        let Pixels::Gray8(image) = &frame.pixels else { panic!("grey frames") };
        let rgb = Image::from_vec(SIZE.0, SIZE.1, image.as_slice().iter().map(|v| [*v; 3]).collect()).unwrap();
        writer.write(rgb, frame.time).unwrap();
    }
    writer.finish().unwrap();
    courses
}

#[test]
fn of_many_bright_spots_in_coded_video_few_tracks_are_noise() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("spots.mp4");
    let courses = film(&path);
    let mut run = auto::open(&path, &Config::default()).unwrap();
    let mut scan = Scan::default();
    // Reported states of each track, and those of them near a spot: two that are seen as one lie up to 5 px from the middle between them.
    let mut states: BTreeMap<u64, [usize; 2]> = BTreeMap::new();
    while let Some(frame) = run.frames.next_frame().unwrap() {
        run.detector.detect(&frame, &mut scan).unwrap();
        let t = frame.index.0 as f64 / RATE_HZ;
        for s in run.tracker.step(&scan).unwrap().iter().filter(|s| s.status != TrackStatus::Tentative) {
            let is_near = |c: &Course| (c[0] + c[2] * t - s.position().x).hypot(c[1] + c[3] * t - s.position().y) < 6.0;
            let counts = states.entry(s.id.0).or_default();
            counts[0] += 1;
            counts[1] += usize::from(courses.iter().any(is_near));
        }
    }
    let n_false = states.values().filter(|[n, near]| 2 * near < *n).count();
    println!("{} tracks, {n_false} of noise; {:?}", states.len(), run.config.detector.threshold);
    // Spots closer than their own width are one for a while.
    assert!((N_SPOTS * 9 / 10..N_SPOTS * 5 / 4).contains(&states.len()), "{} tracks", states.len());
    // 271 of 603 with the threshold that lets a false detection through for ten spots; 16 since it lies in the valley: what the codec left behind spots for some frames.
    assert!(n_false <= N_SPOTS / 10, "{n_false} of {} tracks hold no spot", states.len());
}
