//! What moves before a moving camera: patches of texture over a textured ground, drawn here, whose places are known exactly.

use boresight::boresight_filters::nalgebra::{Matrix3, Vector2, Vector3};
use boresight::vision::steadied::SteadiedConfig;
use boresight::vision::threshold::ThresholdConfig;
use boresight::vision::{ClusterConfig, DetectorConfig, build};
use boresight::{Config, Frame, FrameIndex, Image, PixelKind, Pixels, Scan, SourceInfo, Timestamp, auto};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

const SIZE: [usize; 2] = [320, 240];
const N_FRAMES: usize = 60;
/// Deviation of a pixel's noise, counts.
const NOISE: f64 = 2.0;
/// Side of a mover, px.
const SIDE: f64 = 10.0;

/// Values on a lattice, several of them of different spacing, smooth between.
struct Texture(Vec<(f64, f64, Vec<f64>)>);

const LATTICE: usize = 256;

impl Texture {
    fn new(seed: u64) -> Self {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut lattice = || (0..LATTICE * LATTICE).map(|_| rng.random::<f64>() - 0.5).collect();
        Self([(3.0, 30.0), (7.0, 50.0), (19.0, 70.0), (60.0, 50.0)].map(|(px, height)| (px, height, lattice())).into())
    }

    fn at(&self, p: Vector2<f64>) -> f64 {
        let one = |(px, height, values): &(f64, f64, Vec<f64>)| {
            let (x, y) = (p.x / px + 50.0, p.y / px + 50.0);
            let (i, j) = (x.floor(), y.floor());
            // Smooth steps between the lattice's points.
            let (u, v) = ((x - i) * (x - i) * (3.0 - 2.0 * (x - i)), (y - j) * (y - j) * (3.0 - 2.0 * (y - j)));
            let at = |i: f64, j: f64| values[(j as usize % LATTICE) * LATTICE + i as usize % LATTICE];
            let (above, below) =
                ((1.0 - u) * at(i, j) + u * at(i + 1.0, j), (1.0 - u) * at(i, j + 1.0) + u * at(i + 1.0, j + 1.0));
            height * ((1.0 - v) * above + v * below)
        };
        120.0 + self.0.iter().map(one).sum::<f64>()
    }
}

/// What the camera does in each frame: px, rad, 1, and the change of perspective, 1/px.
#[derive(Clone, Copy)]
struct Camera {
    pan: [f64; 2],
    shake: f64,
    turn: f64,
    zoom: f64,
    tilt: f64,
}

/// The frames, and where each mover lies in each.
fn scene(seed: u64, camera: Camera, speeds: &[f64]) -> (Vec<Frame>, Vec<Vec<Vector2<f64>>>) {
    let (ground, paint) = (Texture::new(seed), Texture::new(seed + 1000));
    let mut rng = ChaCha8Rng::seed_from_u64(seed + 2000);
    let middle = Vector2::new(0.5 * SIZE[0] as f64, 0.5 * SIZE[1] as f64);
    let movers: Vec<(Vector2<f64>, Vector2<f64>)> = speeds
        .iter()
        .enumerate()
        .map(|(i, speed)| {
            let angle = std::f64::consts::TAU * rng.random::<f64>();
            let at = Vector2::new(60.0 + 200.0 * i as f64 / speeds.len() as f64, 60.0 + 120.0 * rng.random::<f64>());
            let velocity = *speed * Vector2::new(angle.cos(), angle.sin());
            // In the middle of its way in the middle of the time.
            (at - 0.5 * N_FRAMES as f64 * velocity, velocity)
        })
        .collect();
    let (mut frames, mut truth) = (Vec::new(), Vec::new());
    for k in 0..N_FRAMES {
        let t = k as f64 - 0.5 * N_FRAMES as f64;
        let [sx, sy]: [f64; 2] =
            std::array::from_fn(|_| camera.shake * Distribution::<f64>::sample(&StandardNormal, &mut rng));
        let (turn, zoom) = (camera.turn * t, (camera.zoom * t).exp());
        let (c, s) = (zoom * turn.cos(), zoom * turn.sin());
        let about = |x: f64, y: f64| Matrix3::new(1.0, 0.0, x, 0.0, 1.0, y, 0.0, 0.0, 1.0);
        let linear = Matrix3::new(c, -s, 0.0, s, c, 0.0, camera.tilt * t, -0.5 * camera.tilt * t, 1.0);
        let image_from_ground = about(middle.x + camera.pan[0] * t + sx, middle.y + camera.pan[1] * t + sy)
            * linear
            * about(-middle.x, -middle.y);
        let ground_from_image = image_from_ground.try_inverse().unwrap();
        let map = |m: &Matrix3<f64>, p: Vector2<f64>| {
            let q = m * Vector3::new(p.x, p.y, 1.0);
            Vector2::new(q.x / q.z, q.y / q.z)
        };
        let mut image = Image::filled(SIZE[0], SIZE[1], 0u8);
        for y in 0..SIZE[1] {
            for (x, v) in image.row_mut(y).iter_mut().enumerate() {
                let g = map(&ground_from_image, Vector2::new(x as f64, y as f64));
                let mut value = ground.at(g);
                for (start, velocity) in &movers {
                    let q = g - (start + velocity * k as f64);
                    if q.amax() <= 0.5 * SIDE {
                        value = paint.at(q + 40.0 * velocity);
                    }
                }
                let noise: f64 = StandardNormal.sample(&mut rng);
                *v = (value + NOISE * noise).round().clamp(0.0, 255.0) as u8;
            }
        }
        let time = Timestamp::from_secs_f64(0.04 * k as f64);
        frames.push(Frame { index: FrameIndex(k as u64), time, pixels: Pixels::Gray8(image) });
        truth.push(movers.iter().map(|(start, v)| map(&image_from_ground, start + v * k as f64)).collect());
    }
    (frames, truth)
}

fn info() -> SourceInfo {
    SourceInfo {
        label: String::new(),
        reader: String::new(),
        width: SIZE[0],
        height: SIZE[1],
        kind: PixelKind::Gray8,
        n_frames: Some(N_FRAMES as u64),
        rate_hz: Some(25.0),
        true_times: true,
    }
}

fn inside(p: &Vector2<f64>) -> bool {
    p.x > 8.0 && p.y > 8.0 && p.x < SIZE[0] as f64 - 8.0 && p.y < SIZE[1] as f64 - 8.0
}

/// Share of the movers' places in which a region lies, and regions elsewhere, a frame; from the first frame on, with the first second shown beforehand.
fn measured(frames: &[Frame], truth: &[Vec<Vector2<f64>>]) -> (f64, f64) {
    let config = DetectorConfig {
        threshold: ThresholdConfig::Steadied(SteadiedConfig::default()),
        cluster: ClusterConfig { distance_px: 3.0, min_area_px: Some(4), ..Default::default() },
        ..Default::default()
    };
    let mut detector = build(&config, &info()).unwrap();
    let first = frames.iter().take_while(|f| f.time.as_secs_f64() <= detector.prime_s()).count();
    detector.prime(&frames[..first]).unwrap();
    let (mut scan, mut seen, mut all, mut n_false) = (Scan::default(), 0, 0, 0);
    for (frame, truth) in frames.iter().zip(truth) {
        detector.detect(frame, &mut scan).unwrap();
        assert!(!scan.blind, "{:?}", frame.index);
        let near = |t: &Vector2<f64>, p: &Vector2<f64>| (t - p).amax() <= 0.5 * SIDE + 4.0;
        for t in truth.iter().filter(|t| inside(t)) {
            all += 1;
            seen += usize::from(scan.detections.iter().any(|d| near(t, &d.position)));
        }
        n_false += scan.detections.iter().filter(|d| !truth.iter().any(|t| near(t, &d.position))).count();
    }
    (f64::from(seen as u32) / f64::from(all.max(1)), n_false as f64 / frames.len() as f64)
}

const CAMERAS: [(&str, Camera); 4] = [
    ("pan", Camera { pan: [2.0, -1.0], shake: 0.0, turn: 0.0, zoom: 0.0, tilt: 0.0 }),
    ("shake", Camera { pan: [0.5, 0.3], shake: 2.5, turn: 0.0, zoom: 0.0, tilt: 0.0 }),
    ("turn and zoom", Camera { pan: [0.5, 0.3], shake: 0.0, turn: 0.005, zoom: 0.004, tilt: 0.0 }),
    ("tilt", Camera { pan: [0.5, 0.3], shake: 0.3, turn: 0.0, zoom: 0.001, tilt: 2e-5 }),
];

#[test]
fn patches_of_texture_are_found_over_texture_whatever_the_camera_does() {
    for (name, camera) in CAMERAS {
        for seed in 1..6 {
            let (frames, truth) = scene(seed, camera, &[0.5, 1.0, 1.5, 2.5]);
            let (seen, n_false) = measured(&frames, &truth);
            println!("{name}, seed {seed}: {:.1} % seen, {n_false:.2} false regions a frame", 100.0 * seen);
            assert!(seen >= 0.9 && n_false <= 0.5, "{name}, seed {seed}: {seen} {n_false}");
        }
    }
}

#[test]
fn a_ground_on_which_nothing_moves_is_quiet() {
    for (name, camera) in CAMERAS {
        let (frames, truth) = scene(7, camera, &[]);
        let (_, n_false) = measured(&frames, &truth);
        println!("{name}: {n_false:.3} false regions a frame");
        assert!(n_false <= 0.2, "{name}: {n_false}");
    }
}

#[test]
fn the_choice_without_options_takes_it_where_it_is_needed_and_nowhere_else() {
    for (name, camera) in CAMERAS {
        let (frames, _) = scene(3, camera, &[0.6, 1.0, 1.5, 2.0]);
        let choice = auto::choose(&frames[..48], &info(), &Config::default()).unwrap();
        assert_eq!(choice.config.detector.threshold.name(), "steadied", "{name}: {:?}", choice.reasons);
        let (frames, _) = scene(3, camera, &[]);
        let choice = auto::choose(&frames[..48], &info(), &Config::default()).unwrap();
        assert_ne!(choice.config.detector.threshold.name(), "steadied", "{name}: {:?}", choice.reasons);
    }
}

#[test]
fn a_cut_is_blind_until_a_frame_is_three_lags_old() {
    let (mut frames, _) = scene(1, CAMERAS[0].1, &[]);
    let (other, _) = scene(50, CAMERAS[0].1, &[]);
    frames[30..].clone_from_slice(&other[30..]);
    let config =
        DetectorConfig { threshold: ThresholdConfig::Steadied(SteadiedConfig::default()), ..Default::default() };
    let mut detector = build(&config, &info()).unwrap();
    let mut blind = Vec::new();
    for frame in &frames {
        let mut scan = Scan::default();
        detector.detect(frame, &mut scan).unwrap();
        assert!(!scan.blind || scan.detections.is_empty());
        blind.push(scan.blind);
    }
    // Frames are kept every 0.08 s, and half of that is no matter: the first is 0.92 s old, three lags less 0.04 s, after 23 frames; nothing was shown beforehand.
    assert!(blind[..23].iter().all(|b| *b) && blind[23..30].iter().all(|b| !b), "{blind:?}");
    assert!(blind[30..53].iter().all(|b| *b) && blind[53..].iter().all(|b| !b), "{blind:?}");
}
