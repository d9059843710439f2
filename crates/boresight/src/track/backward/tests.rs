//! Backward continuation in simulation: NEES, where it begins, under a panning camera.

use super::*;
use crate::{CameraMotion, FrameIndex, Timestamp};
use nalgebra::{Matrix2, Vector4};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;

const DT_S: f64 = 0.04;

fn config() -> TrackerConfig {
    TrackerConfig {
        retrospective_s: 10.0,
        confirmation: ConfirmationConfig::Existence(ExistenceConfig::default()),
        clutter_density_per_px2: 1e-5,
        extra_noise_px: 0.0,
        detection_probability: 0.8,
        gate_probability: 0.999,
        ..crate::Config::default().tracker
    }
}

struct Scene {
    scans: Vec<Scan>,
    grounds: Vec<SteadyGround>,
    grids: Vec<UniformGrid>,
    taken: Vec<Vec<bool>>,
    truth: Vec<Vector4<f64>>,
}

impl Scene {
    fn of(scans: Vec<Scan>, truth: Vec<Vector4<f64>>) -> Self {
        let mut ground = SteadyGround::default();
        let grounds = scans.iter().map(|s| {
            ground = ground.after(s);
            ground
        });
        let grounds = grounds.collect();
        let grid = |s: &Scan| {
            let mut grid = UniformGrid::new();
            grid.build(s.detections.iter().map(|d| (d.position.x, d.position.y)));
            grid
        };
        let (grids, taken) = (scans.iter().map(grid).collect(), vec![Vec::new(); scans.len()]);
        Self { scans, grounds, grids, taken, truth }
    }

    fn past(&self, k: usize) -> Past<'_> {
        Past { scan: &self.scans[k], ground: self.grounds[k], grid: &self.grids[k], taken: &self.taken[k] }
    }

    /// The states before `first` of a track that has taken the first detection of every scan from there on.
    fn back(&self, config: &TrackerConfig, first: usize) -> Vec<TrackState> {
        let own =
            (first..self.scans.len()).map(|k| Own { scan: &self.scans[k], ground: self.grounds[k], detection: 0 });
        let before = (0..first).rev().map(|k| self.past(k));
        Backward::of(config).unwrap().continue_back(TrackId(7), own, before)
    }
}

/// A target of 0.3 px noise driven by 25 px²/s³, seen with the probability `p` from scan `from` on, in `n_false` false detections a scan of 200 x 200 px; the
/// camera pans by `pan` px a scan.
fn scene(seed: u64, from: usize, p: f64, n_false: usize, pan: f64) -> Scene {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut x = Vector4::new(100.0, 0.0, 100.0, 0.0);
    for v in [1, 3] {
        x[v] = 20.0 * rng.sample::<f64, _>(StandardNormal);
    }
    let (mut scans, mut truth) = (Vec::new(), Vec::new());
    for k in 0..60 {
        // White acceleration: its integral, and what of it is position.
        for v in [0, 2] {
            let [a, b]: [f64; 2] = [rng.sample(StandardNormal), rng.sample(StandardNormal)];
            let speed = (25.0 * DT_S).sqrt() * a;
            x[v] += DT_S * x[v + 1] + 0.5 * DT_S * speed + (25.0 * DT_S.powi(3) / 12.0).sqrt() * b;
            x[v + 1] += speed;
        }
        truth.push(x);
        let shift = Vector2::new(pan * k as f64, 0.0);
        let at = |place: Vector2<f64>| Detection::at(place + shift, Matrix2::identity() * 0.09);
        let noise = Vector2::new(rng.sample(StandardNormal), rng.sample(StandardNormal)) * 0.3;
        let mut detections = Vec::new();
        if k >= from && (k >= 40 || rng.random::<f64>() < p) {
            detections.push(at(Vector2::new(x[0], x[2]) + noise));
        }
        for _ in 0..n_false {
            detections.push(at(Vector2::new(rng.random_range(0.0..200.0), rng.random_range(0.0..200.0))));
        }
        let mut scan = Scan::at(FrameIndex(k as u64), Timestamp::from_secs_f64(k as f64 * DT_S));
        scan.detections = detections;
        if pan != 0.0 {
            let step = if k == 0 { 0.0 } else { pan };
            scan.camera_motion = Some(CameraMotion::exact_shift(Vector2::new(step, 0.0)));
        }
        scans.push(scan);
    }
    Scene::of(scans, truth)
}

#[test]
fn a_target_is_followed_to_where_it_came_from_with_honest_covariances() {
    let (mut n, mut nees, mut error) = (0.0, 0.0, 0.0f64);
    for seed in 0..60 {
        let scene = scene(seed, 0, 0.9, 0, 0.0);
        let states = scene.back(&config(), 40);
        assert!(states.len() >= 30, "seed {seed}: {}", states.len());
        for (k, s) in (0..40).rev().zip(&states).skip(3) {
            let off = s.kinematics.mean - scene.truth[k];
            nees += off.dot(&s.kinematics.cov.cholesky().unwrap().solve(&off));
            error = error.max((off[0]).hypot(off[2]));
            n += 1.0;
        }
    }
    // Four degrees of freedom; states of one run are not independent: some 60 of them are.
    let mean = nees / n;
    assert!((mean - 4.0).abs() < 0.8, "{mean}");
    assert!(error < 6.0, "{error}");
}

#[test]
fn a_target_that_was_not_there_before_is_not_followed_into_false_detections() {
    let mut beyond = 0;
    for seed in 0..100 {
        let config = TrackerConfig { clutter_density_per_px2: 5.0 / 4e4, ..config() };
        let states = scene(seed, 40, 0.9, 5, 0.0).back(&config, 40);
        beyond += usize::from(!states.is_empty());
    }
    // Confirmed with 0.95: at most as many as that allows, and four standard deviations.
    assert!(beyond <= 14, "{beyond} of 100");
}

#[test]
fn it_begins_where_the_target_came() {
    let mut off = Vec::new();
    for seed in 0..40 {
        let states = scene(seed, 20, 0.9, 2, 0.0).back(&config(), 40);
        off.push((20 - states.len() as i64).abs());
    }
    off.sort_unstable();
    assert!(off[20] <= 1 && off[36] <= 4, "{off:?}");
}

#[test]
fn under_a_panning_camera_it_is_the_same_on_the_ground() {
    for seed in 0..5 {
        let (still, pans) = (scene(seed, 0, 0.9, 0, 0.0), scene(seed, 0, 0.9, 0, 3.0));
        let (a, b) = (still.back(&config(), 40), pans.back(&config(), 40));
        assert_eq!(a.len(), b.len());
        for (k, (a, b)) in (0..40).rev().zip(a.iter().zip(&b)) {
            assert!((b.kinematics.mean[0] - a.kinematics.mean[0] - 3.0 * k as f64).abs() < 1e-6);
            let pan_px_per_s = if k == 0 { 0.0 } else { 3.0 / DT_S };
            assert!((b.kinematics.mean[1] - a.kinematics.mean[1] - pan_px_per_s).abs() < 1e-6);
            assert!((b.kinematics.cov - a.kinematics.cov).norm() < 1e-6);
        }
    }
}

#[test]
fn what_another_track_has_is_left_to_it() {
    let mut scene = scene(1, 0, 1.0, 0, 0.0);
    assert_eq!((scene.back(&config(), 40).len(), scene.back(&config(), 59).len()), (40, 59));
    scene.taken[..40].iter_mut().for_each(|t| *t = vec![true]);
    assert!(scene.back(&config(), 40).is_empty());
    assert!(Backward::of(&TrackerConfig { retrospective_s: 0.0, ..config() }).is_none());
}

#[test]
fn a_crowd_of_detections_tells_nothing_and_ends_the_search() {
    let mut scene = scene(2, 0, 1.0, 0, 0.0);
    for (k, scan) in scene.scans[..40].iter_mut().enumerate() {
        let x = scene.truth[k];
        let here = Detection::at(Vector2::new(x[0], x[2]), Matrix2::identity() * 0.09);
        scan.detections = vec![here; 100_000];
    }
    let scene = Scene::of(scene.scans, scene.truth);
    assert!(scene.back(&config(), 40).is_empty());
}

#[test]
fn a_jerk_of_the_camera_that_nobody_measured_does_not_end_it() {
    let mut followed = 0;
    for seed in 0..20 {
        let mut scene = scene(seed, 0, 0.95, 1, 0.0);
        // From scan 20 back the image runs by 2.5 px a scan more than the target.
        for (k, scan) in scene.scans[..20].iter_mut().enumerate() {
            let off = Vector2::new(2.5, -2.5) * (20 - k) as f64;
            scan.detections.iter_mut().for_each(|d| d.position += off);
        }
        let scene = Scene::of(scene.scans, scene.truth);
        followed += usize::from(scene.back(&config(), 40).len() >= 36);
    }
    assert!(followed >= 18, "{followed} of 20");
}

#[test]
fn a_gate_larger_than_the_square_of_false_detections_is_searched_whole() {
    // Metres in place of pixels, a hundred of them: a radar's.
    let scale = 100.0;
    let mut scene = scene(4, 0, 1.0, 0, 0.0);
    for d in scene.scans.iter_mut().flat_map(|s| &mut s.detections) {
        (d.position, d.cov) = (d.position * scale, d.cov * scale * scale);
    }
    let scene = Scene::of(scene.scans, scene.truth);
    let config = TrackerConfig {
        acceleration_density_px2_per_s3: 25.0 * scale * scale,
        max_speed_px_per_s: config().max_speed_px_per_s * scale,
        clutter_density_per_px2: config().clutter_density_per_px2 / (scale * scale),
        ..config()
    };
    assert_eq!(scene.back(&config, 40).len(), 40);
}

/// Three scans `DT_S` apart with a detection of 0.3 px noise and 8 x 4 px that moves by 4 px to the right; the last one is 12 x 2 px.
fn passing() -> Scene {
    let scan = |k: u32| {
        let at = Vector2::new(100.0 + 4.0 * f64::from(k), 50.0);
        let (w, h) = if k == 2 { (12.0, 2.0) } else { (8.0, 4.0) };
        let d = Detection::at(at, Matrix2::identity() * 0.09).with_extent(Extent::around(at, w, h));
        Scan::at(FrameIndex(u64::from(k)), Timestamp::from_secs_f64(f64::from(k) * DT_S)).with_detections(vec![d])
    };
    Scene::of((0..3).map(scan).collect(), vec![Vector4::zeros(); 3])
}

/// The walk after the passing target's own three detections, the last first.
fn walk_of<'a>(back: &'a Backward, scene: &Scene) -> Walk<'a> {
    let own = (0..3).map(|k| Own { scan: &scene.scans[k], ground: scene.grounds[k], detection: 0 });
    back.begin(own).unwrap()
}

#[test]
fn the_walk_begins_with_the_velocity_and_the_size_of_its_own_detections() {
    let back = Backward::of(&TrackerConfig { appearance_gain: 0.25, ..config() }).unwrap();
    let scene = passing();
    let walk = walk_of(&back, &scene);
    let belief = walk.filter.belief();
    // 100 px/s, reversed; three places of 0.3 px tell it to 0.3 / (√2 · 0.04) = 5.3 px/s, a prior of 87 px/s pulls by 0.4 %.
    assert!((belief.mean[0] - 100.0).abs() < 0.3 && (belief.mean[1] + 100.0).abs() < 2.0, "{}", belief.mean);
    assert!((belief.cov[(1, 1)].sqrt() - 5.3).abs() < 0.2, "{}", belief.cov);
    // From 12 x 2 px two quarters of the way to 8 x 4 px.
    assert_eq!(walk.side_px, [12.0 - 1.0 - 0.75, 2.0 + 0.5 + 0.375]);
}

#[test]
fn a_detection_within_the_gate_is_looked_at_and_one_beyond_is_not() {
    let back = Backward::of(&config()).unwrap();
    let belief = Gaussian { mean: Vector4::new(50.0, 0.0, 60.0, 0.0), cov: nalgebra::Matrix4::identity() * 0.4 };
    // S = 0.4 + 0.09 px²; the gate of 99.9 % is 13.8: 2.60 px.
    for (off, within) in [(0.0, true), (2.2, true), (2.59, true), (2.61, false)] {
        let mut past = passing();
        past.scans[0].detections[0].position = Vector2::new(50.0 + off, 60.0);
        let past = Scene::of(past.scans, past.truth);
        let scene = passing();
        let (likely, _) = walk_of(&back, &scene).look(&past.past(0), Vector2::new(50.0, 60.0), &belief);
        assert_eq!(likely.is_some(), within, "{off} px");
        assert!(likely.is_none_or(|l| (l.innovation.nis - off * off / 0.49).abs() < 1e-9));
    }
}

#[test]
fn the_likelier_of_two_is_taken_whatever_their_order() {
    let back = Backward::of(&config()).unwrap();
    let belief = Gaussian { mean: Vector4::new(50.0, 0.0, 60.0, 0.0), cov: nalgebra::Matrix4::identity() * 0.4 };
    for (near, far) in [([50.1, 60.0], [51.2, 61.2]), ([50.1, 60.0], [48.8, 58.8])] {
        for order in [[near, far], [far, near]] {
            let mut past = passing();
            past.scans[0].detections =
                order.map(|at| Detection::at(Vector2::from(at), Matrix2::identity() * 0.09)).to_vec();
            let past = Scene::of(past.scans, past.truth);
            let scene = passing();
            let (likely, _) = walk_of(&back, &scene).look(&past.past(0), Vector2::new(50.0, 60.0), &belief);
            assert_eq!(order[likely.unwrap().detection as usize], near);
        }
    }
}

/// Half a second of (4, -2) px/s in reversed time lies behind what was seen earlier; its variance comes on top.
#[test]
fn what_was_seen_before_its_scan_is_carried_there_with_the_velocitys_variance() {
    let mut belief = Gaussian { mean: Vector4::new(0.0, 4.0, 0.0, -2.0), cov: nalgebra::Matrix4::zeros() };
    (belief.cov[(1, 1)], belief.cov[(3, 3)]) = (8.0, 12.0);
    (belief.cov[(1, 3)], belief.cov[(3, 1)]) = (2.0, 2.0);
    let m = Measurement::isotropic(10.0, 20.0, 1.0);
    let c = carried(m, 500_000_000, &belief);
    assert_eq!(c.position, Vector2::new(8.0, 21.0));
    assert_eq!(c.cov, Matrix2::new(3.0, 0.5, 0.5, 4.0));
    assert_eq!(carried(m, 0, &belief), m);
}
