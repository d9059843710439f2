//! A scene as a stream of frames with their truth.
//!
//! Each frame is drawn anew from the seed; nothing is held but the frame, the targets' states and (where asked for) one image
//! each of clutter and fixed pattern. Scenes of rectangles on white noise with 8 bits and an ideal sensor (the papers' scenes)
//! go straight to 8-bit levels ([`super::random`]); all others are drawn as floats ([`super::draw`]).
//! The truth of a frame: one [`TrackState`] a target that is in the picture, with its exact kinematics (zero covariance),
//! its box and, as score, the share of its box that is inside the frame and not occluded.

use super::draw::Painter;
use super::motion::Mover;
use super::random::{LevelNoise, LevelTable, Purpose, Seed};
use super::render::{clip, first_pixel};
use super::scene::{Background, SceneConfig, Sensor, Shape, Target};
use crate::{
    Error, ErrorKind, Extent, Frame, FrameIndex, FrameSource, Image, PixelKind, Pixels, Result, SourceInfo, Timestamp,
    TrackId, TrackState, TrackStatus,
};
use boresight_filters::Gaussian;
use nalgebra::{Matrix4, Vector2, Vector4};
use rand::RngExt;
use rand_distr::{Distribution, StandardNormal};

/// A scene that hands out its frames.
pub struct SceneSource {
    config: SceneConfig,
    seed: Seed,
    target_seed: Seed,
    info: SourceInfo,
    next: u64,
    movers: Vec<Option<Mover>>,
    truth: Vec<TrackState>,
    spare: Option<Frame>,
    way: Way,
}

/// How the frames are drawn.
enum Way {
    /// Straight to 8-bit levels: one table for the background, one a target.
    Levels { background: Box<LevelTable>, targets: Vec<LevelTable> },
    /// As floats, through the sensor.
    Floats(Box<Painter>),
}

impl std::fmt::Debug for SceneSource {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("SceneSource")
            .field("config", &self.config)
            .field("seed", &self.seed)
            .field("next", &self.next)
            .finish_non_exhaustive()
    }
}

impl SceneSource {
    pub(super) fn new(config: &SceneConfig, seed: Seed, background: Option<Box<dyn FrameSource>>) -> Result<Self> {
        config.validate("scene")?;
        let mut config = config.clone();
        if let Some(b) = &background {
            config.width_px = b.info().width;
            config.height_px = b.info().height;
            config.validate("scene (size of the background)")?;
        } else if let Background::File(path) = &config.background {
            return Err(Error::new(ErrorKind::Config, "this background needs its file opened first")
                .at(format!("scene.background.file = {path}")));
        }
        let way = match level_tables(&config) {
            Some((background, targets)) => Way::Levels { background: Box::new(background), targets },
            None => Way::Floats(Box::new(Painter::new(&config, seed, background))),
        };
        let info = SourceInfo {
            label: "simulation".into(),
            reader: "simulation".into(),
            width: config.width_px,
            height: config.height_px,
            kind: if config.bits == 8 { PixelKind::Gray8 } else { PixelKind::Gray16 },
            n_frames: (config.clock.dropped_share == 0.0).then_some(config.n_frames),
            rate_hz: Some(config.rate_hz),
            true_times: true,
        };
        let movers = vec![None; config.targets.len()];
        Ok(Self { config, seed, target_seed: seed, info, next: 0, movers, truth: Vec::new(), spare: None, way })
    }

    /// Draws the pixels of rectangular targets from another seed: a second sensor that sees the same background noise.
    ///
    /// For the papers' scenes (rectangles on white noise, 8 bits, ideal sensor); others are drawn from the one seed.
    #[must_use]
    pub fn with_target_seed(mut self, seed: Seed) -> Self {
        self.target_seed = seed;
        self
    }

    /// The truth of the frame handed out last: every target in the picture, in the scene's order.
    pub fn truth(&self) -> &[TrackState] {
        &self.truth
    }

    /// The scene.
    pub fn config(&self) -> &SceneConfig {
        &self.config
    }

    /// Time of frame `k` and whether it is dropped, and the camera's offset in it.
    fn clock(&self, k: u64) -> (Timestamp, bool, Vector2<f64>) {
        let c = &self.config;
        let nominal_s = k as f64 / c.rate_hz;
        if c.clock.dropped_share == 0.0 && c.clock.jitter_s == 0.0 && c.sensor.jitter_px == 0.0 {
            return (Timestamp::from_secs_f64(nominal_s), false, Vector2::zeros());
        }
        // Always the same draws in the same order: switching one effect off leaves the others as they were.
        let mut rng = self.seed.stream(Purpose::Timing, k);
        let u: f64 = rng.random();
        let [zt, zx, zy]: [f64; 3] = std::array::from_fn(|_| StandardNormal.sample(&mut rng));
        let limit = 0.45 / c.rate_hz;
        let t = (nominal_s + (c.clock.jitter_s * zt).clamp(-limit, limit)).max(0.0);
        (Timestamp::from_secs_f64(t), u < c.clock.dropped_share, c.sensor.jitter_px * Vector2::new(zx, zy))
    }

    /// Moves all targets to `time` and writes the truth; returns each target's state in the picture and its growth.
    fn advance(&mut self, time: Timestamp, camera: Vector2<f64>, present: &mut Vec<(usize, Vector4<f64>, f64)>) {
        let t = time.as_secs_f64();
        present.clear();
        self.truth.clear();
        for (i, target) in self.config.targets.iter().enumerate() {
            if t < target.appears_s || target.vanishes_s.is_some_and(|v| t >= v) {
                continue;
            }
            let start = || {
                let ([x, y], [vx, vy]) = (target.start_px, target.velocity_px_per_s);
                Mover::new(&target.motion, Vector4::new(x, vx, y, vy), target.appears_s, self.seed, i as u64)
            };
            let mut s = self.movers[i].get_or_insert_with(start).at(t);
            s[0] += camera[0];
            s[2] += camera[1];
            let growth = (1.0 + target.growth_per_s * (t - target.appears_s)).max(0.0);
            let extent = extent(target, s, growth);
            let seen = seen_share(&self.config, extent);
            if growth > 0.0 && s.iter().all(|v| v.is_finite()) {
                present.push((i, s, growth));
            }
            if in_picture(extent, self.config.width_px, self.config.height_px) {
                self.truth.push(TrackState {
                    id: TrackId(i as u64 + 1),
                    status: TrackStatus::Confirmed,
                    kinematics: Gaussian { mean: s, cov: Matrix4::zeros() },
                    extent,
                    detection: None,
                    innovation: None,
                    score: seen as f32,
                });
            }
        }
    }
}

/// Nominal box of a target (for a spot: two standard deviations to each side).
fn extent(target: &Target, s: Vector4<f64>, growth: f64) -> Extent {
    let (w, h) = match &target.shape {
        Shape::Rectangle(r) => {
            let [nx, ny] = grown(r.size_px, growth);
            (nx as f64, ny as f64)
        }
        Shape::Spot(p) => {
            let d = 4.0 * p.psf_sigma_px.hypot(p.sigma_px * growth);
            (d, d)
        }
        Shape::Textured(x) => (x.size_px[0] * growth, x.size_px[1] * growth),
    };
    Extent { left_px: s[0] - w / 2.0, top_px: s[2] - h / 2.0, width_px: w, height_px: h }
}

/// Whole size of a rectangle that has grown.
fn grown(size_px: [usize; 2], growth: f64) -> [usize; 2] {
    if growth == 1.0 { size_px } else { size_px.map(|n| ((n as f64 * growth).round() as usize).clamp(1, 16384)) }
}

fn in_picture(e: Extent, width: usize, height: usize) -> bool {
    e.left_px < width as f64 - 0.5
        && e.top_px < height as f64 - 0.5
        && e.left_px + e.width_px > -0.5
        && e.top_px + e.height_px > -0.5
}

/// Share of a box that lies inside the frame and behind no occluder (occluders are taken as not overlapping each other).
fn seen_share(c: &SceneConfig, e: Extent) -> f64 {
    let overlap = |l: f64, t: f64, w: f64, h: f64| {
        let x = (e.left_px + e.width_px).min(l + w) - e.left_px.max(l);
        let y = (e.top_px + e.height_px).min(t + h) - e.top_px.max(t);
        x.max(0.0) * y.max(0.0)
    };
    let whole = e.width_px * e.height_px;
    let (w, h) = (c.width_px as f64, c.height_px as f64);
    let mut seen = overlap(-0.5, -0.5, w, h);
    for o in &c.occluders {
        let (l, t) = ((o.corner_px[0] as f64 - 0.5).max(-0.5), (o.corner_px[1] as f64 - 0.5).max(-0.5));
        let (r, b) = (
            (o.corner_px[0] as f64 - 0.5 + o.size_px[0] as f64).min(w - 0.5),
            (o.corner_px[1] as f64 - 0.5 + o.size_px[1] as f64).min(h - 0.5),
        );
        if r > l && b > t {
            seen -= overlap(l, t, r - l, b - t);
        }
    }
    if whole > 0.0 { (seen / whole).clamp(0.0, 1.0) } else { 0.0 }
}

/// Level tables of a scene that needs nothing else, background first.
fn level_tables(c: &SceneConfig) -> Option<(LevelTable, Vec<LevelTable>)> {
    let Background::White(w) = &c.background else { return None };
    // The camera's jitter only moves targets on white noise, so that scenes with it can go this way too.
    let ideal = Sensor { jitter_px: c.sensor.jitter_px, ..Sensor::default() };
    if c.bits != 8 || c.sensor != ideal || !c.occluders.is_empty() {
        return None;
    }
    let tables = c.targets.iter().map(|t| match &t.shape {
        Shape::Rectangle(r) => Some(LevelTable::normal(r.mean, r.std)),
        _ => None,
    });
    Some((LevelTable::normal(w.mean, w.std), tables.collect::<Option<Vec<_>>>()?))
}

impl FrameSource for SceneSource {
    fn info(&self) -> &SourceInfo {
        &self.info
    }

    fn next_frame(&mut self) -> Result<Option<Frame>> {
        let mut present = Vec::with_capacity(self.config.targets.len());
        loop {
            let k = self.next;
            if k >= self.config.n_frames {
                self.truth.clear();
                return Ok(None);
            }
            self.next += 1;
            let (time, dropped, camera) = self.clock(k);
            // Targets move in dropped frames too: their noise is drawn frame by frame.
            self.advance(time, camera, &mut present);
            if dropped {
                continue;
            }
            let spare = self.spare.take().map(|f| f.pixels);
            let (w, h) = (self.config.width_px, self.config.height_px);
            let pixels = match &mut self.way {
                Way::Levels { background, targets } => {
                    let mut image = match spare {
                        Some(Pixels::Gray8(i)) if i.width() == w && i.height() == h => i,
                        _ => Image::filled(w, h, 0u8),
                    };
                    LevelNoise::new(self.seed, Purpose::Pixels, k).fill(background, image.as_mut_slice());
                    let mut noise = LevelNoise::new(self.target_seed, Purpose::TargetPixels, k);
                    for (i, s, growth) in &present {
                        let Shape::Rectangle(r) = &self.config.targets[*i].shape else { continue };
                        let [nx, ny] = grown(r.size_px, *growth);
                        stamp(&mut image, &mut noise, &targets[*i], (s[0], s[2]), (nx, ny));
                    }
                    Pixels::Gray8(image)
                }
                Way::Floats(painter) => painter.paint(&self.config, k, camera, &present, spare)?,
            };
            return Ok(Some(Frame { index: FrameIndex(k), time, pixels }));
        }
    }

    fn recycle(&mut self, frame: Frame) {
        self.spare = Some(frame);
    }
}

/// Draws a rectangle of noise over an 8-bit image.
fn stamp(image: &mut Image<u8>, noise: &mut LevelNoise, table: &LevelTable, centre: (f64, f64), size: (usize, usize)) {
    let x = clip(first_pixel(centre.0, size.0), size.0, image.width());
    let y = clip(first_pixel(centre.1, size.1), size.1, image.height());
    let (Some((c0, _, n)), Some((r0, _, m))) = (x, y) else { return };
    for row in r0..r0 + m {
        noise.fill(table, &mut image.row_mut(row)[c0..c0 + n]);
    }
}

#[cfg(test)]
mod tests {
    use super::super::motion::MotionConfig;
    use super::super::scene::{Clock, Correlated, Gradient, Occluder, Rectangle, Spot, Textured, White};
    use super::*;

    fn frames(c: &SceneConfig, seed: u64) -> Vec<(Frame, Vec<TrackState>)> {
        let mut source = c.build(Seed::new(seed)).unwrap();
        std::iter::from_fn(|| source.next_frame().unwrap().map(|f| (f, source.truth().to_vec()))).collect()
    }

    fn floats(f: &Frame) -> Vec<f64> {
        match &f.pixels {
            Pixels::Gray8(i) => i.as_slice().iter().map(|v| f64::from(*v)).collect(),
            Pixels::Gray16(i) => i.as_slice().iter().map(|v| f64::from(*v)).collect(),
            _ => panic!("grey frames"),
        }
    }

    fn mean_std(v: &[f64]) -> (f64, f64) {
        let m = v.iter().sum::<f64>() / v.len() as f64;
        (m, (v.iter().map(|x| (x - m).powi(2)).sum::<f64>() / v.len() as f64).sqrt())
    }

    /// A scene in which everything is on.
    fn busy() -> SceneConfig {
        let target = |shape| Target { shape, motion: MotionConfig::Singer(Default::default()), ..Target::default() };
        let mut c = SceneConfig {
            bits: 12,
            n_frames: 12,
            background: Background::Correlated(Correlated { coherence: 0.8, ..Default::default() }),
            targets: vec![
                target(Shape::Spot(Spot::default())),
                target(Shape::Textured(Textured::default())),
                target(Shape::Rectangle(Rectangle::default())),
            ],
            occluders: vec![Occluder::default()],
            ..Default::default()
        };
        c.sensor = Sensor {
            blur_sigma_px: 0.7,
            electrons_per_count: Some(5.0),
            read_noise: 1.0,
            offset_std: 1.0,
            gain_std: 0.01,
            dead_share: 0.001,
            salt_pepper_share: 0.001,
            saturation: Some(3000.0),
            jitter_px: 0.3,
        };
        c.clock.dropped_share = 0.2;
        c.clock.jitter_s = 0.05;
        c
    }

    #[test]
    fn the_same_seed_gives_the_same_bits_and_another_seed_others() {
        for c in [SceneConfig::default(), busy()] {
            assert_eq!(frames(&c, 3), frames(&c, 3));
            assert_ne!(frames(&c, 3)[0].0, frames(&c, 4)[0].0);
        }
    }

    #[test]
    fn a_recycled_frame_changes_nothing() {
        for c in [SceneConfig::default(), busy()] {
            let fresh = frames(&c, 1);
            let mut source = c.build(Seed::new(1)).unwrap();
            for (f, _) in &fresh {
                let again = source.next_frame().unwrap().unwrap();
                assert_eq!(&again, f);
                source.recycle(again);
            }
        }
    }

    #[test]
    fn dropped_frames_keep_numbers_and_times_of_the_others() {
        let mut c = SceneConfig { n_frames: 400, width_px: 16, height_px: 16, ..SceneConfig::default() };
        let whole = frames(&c, 1);
        c.clock.dropped_share = 0.25;
        let some = frames(&c, 1);
        assert!((some.len() as f64 / 400.0 - 0.75).abs() < 0.08, "{} of 400", some.len());
        for (f, _) in &some {
            assert_eq!(&whole[f.index.0 as usize].0, f);
        }
        c.clock = Clock { dropped_share: 0.0, jitter_s: 10.0 };
        let jittered = frames(&c, 1);
        assert!(jittered.windows(2).all(|w| w[0].0.time < w[1].0.time), "order stays");
    }

    #[test]
    fn a_spot_holds_its_light_and_its_centroid_is_the_truth() {
        let spot = Spot { sigma_px: 0.8, psf_sigma_px: 1.2, total: 40_000.0 };
        let target = Target {
            start_px: [30.3, 21.8],
            velocity_px_per_s: [0.27, -0.1],
            shape: Shape::Spot(spot),
            ..Target::default()
        };
        let c = SceneConfig {
            bits: 16,
            n_frames: 5,
            background: Background::White(White { mean: 0.0, std: 0.0 }),
            targets: vec![target],
            ..Default::default()
        };
        for (f, truth) in frames(&c, 1) {
            let v = floats(&f);
            let sum: f64 = v.iter().sum();
            let x: f64 = v.iter().enumerate().map(|(i, v)| v * (i % 64) as f64).sum::<f64>() / sum;
            let y: f64 = v.iter().enumerate().map(|(i, v)| v * (i / 64) as f64).sum::<f64>() / sum;
            assert!((sum - 40_000.0).abs() < 40.0, "{sum}");
            assert!(
                (x - truth[0].kinematics.mean[0]).abs() < 2e-3 && (y - truth[0].kinematics.mean[2]).abs() < 2e-3,
                "{x} {y}"
            );
        }
    }

    #[test]
    fn a_textured_target_moves_by_parts_of_a_pixel() {
        let x = Textured { size_px: [11.5, 7.0], mean: 200.0, contrast: 0.0, grain_px: 2.0 };
        let target = Target {
            start_px: [20.25, 30.4],
            velocity_px_per_s: [0.3, 0.1],
            shape: Shape::Textured(x),
            ..Target::default()
        };
        let c = SceneConfig {
            bits: 16,
            n_frames: 8,
            background: Background::White(White { mean: 0.0, std: 0.0 }),
            targets: vec![target],
            ..Default::default()
        };
        for (f, truth) in frames(&c, 1) {
            let v = floats(&f);
            let sum: f64 = v.iter().sum();
            let cx: f64 = v.iter().enumerate().map(|(i, v)| v * (i % 64) as f64).sum::<f64>() / sum;
            assert!((sum / (200.0 * 11.5 * 7.0) - 1.0).abs() < 2e-3, "{sum}");
            // Light at a sharp edge is seen at its pixel's centre: at most 1/8 px² of first moment a side.
            assert!(
                (cx - truth[0].kinematics.mean[0]).abs() < 0.125 / 11.5 + 1e-3,
                "{cx} {}",
                truth[0].kinematics.mean[0]
            );
        }
    }

    #[test]
    fn sensor_noises_have_the_spread_asked_for() {
        let flat = |sensor: Sensor| SceneConfig {
            bits: 16,
            n_frames: 2,
            width_px: 128,
            height_px: 128,
            targets: vec![],
            background: Background::White(White { mean: 1000.0, std: 0.0 }),
            sensor,
            ..Default::default()
        };
        let of = |s: Sensor| frames(&flat(s), 2).iter().map(|(f, _)| floats(f)).collect::<Vec<_>>();
        let (_, read) = mean_std(&of(Sensor { read_noise: 20.0, ..Default::default() })[0]);
        assert!((read - 20.0).abs() < 0.6, "{read}");
        let (_, shot) = mean_std(&of(Sensor { electrons_per_count: Some(2.0), ..Default::default() })[0]);
        assert!((shot - 500f64.sqrt()).abs() < 0.7, "{shot}");
        let fixed = of(Sensor { offset_std: 15.0, ..Default::default() });
        assert_eq!(fixed[0], fixed[1], "a fixed pattern stays");
        assert!((mean_std(&fixed[0]).1 - 15.0).abs() < 0.5);
        let dead = of(Sensor { dead_share: 0.05, ..Default::default() });
        let share = dead[0].iter().filter(|v| **v == 0.0).count() as f64 / dead[0].len() as f64;
        assert!((share - 0.05).abs() < 0.007 && dead[0] == dead[1], "{share}");
        let salt = of(Sensor { salt_pepper_share: 0.1, ..Default::default() });
        let (low, high) =
            (salt[0].iter().filter(|v| **v == 0.0).count(), salt[0].iter().filter(|v| **v == 65535.0).count());
        assert!(low.abs_diff(819) < 110 && high.abs_diff(819) < 110 && salt[0] != salt[1], "{low} {high}");
        let full = of(Sensor { saturation: Some(900.0), ..Default::default() });
        assert!(full[0].iter().all(|v| *v == 900.0));
    }

    #[test]
    fn correlated_clutter_has_its_spread_its_length_and_its_coherence() {
        let b = Correlated { mean: 5000.0, std: 300.0, length_px: 2.0, coherence: 0.7 };
        let c = SceneConfig {
            bits: 16,
            n_frames: 40,
            width_px: 96,
            height_px: 96,
            targets: vec![],
            background: Background::Correlated(b),
            ..Default::default()
        };
        let all: Vec<_> = frames(&c, 5)
            .iter()
            .map(|(f, _)| floats(f).iter().map(|v| (v - 5000.0) / 300.0).collect::<Vec<_>>())
            .collect();
        let n = (all.len() * 96 * 96) as f64;
        let var: f64 = all.iter().flatten().map(|v| v * v).sum::<f64>() / n;
        // A Gaussian kernel of width s gives the correlation exp(-d²/(4 s²)): at d = 4, e⁻¹.
        let along: f64 =
            all.iter().flat_map(|f| f.chunks(96).flat_map(|r| (0..92).map(|i| r[i] * r[i + 4]))).sum::<f64>()
                / (n * 92.0 / 96.0);
        let next: f64 =
            all.windows(2).flat_map(|w| w[0].iter().zip(&w[1]).map(|(a, b)| a * b)).sum::<f64>() / (n * 39.0 / 40.0);
        assert!((var - 1.0).abs() < 0.08, "{var}");
        assert!((along - (-1f64).exp()).abs() < 0.06, "{along}");
        assert!((next - 0.7).abs() < 0.07, "{next}");
    }

    #[test]
    fn an_occluder_hides_the_target_and_the_truth_says_how_much() {
        let occluder = Occluder { corner_px: [20, 0], size_px: [10, 64], mean: 10.0, std: 0.0 };
        let target = Target { start_px: [5.0, 32.0], velocity_px_per_s: [1.0, 0.0], ..Target::default() };
        let c = SceneConfig {
            background: Background::Gradient(Gradient { level: 10.0, slope_per_px: [0.0; 2], std: 0.0 }),
            targets: vec![target],
            occluders: vec![occluder],
            ..Default::default()
        };
        for (f, truth) in frames(&c, 1) {
            let seen = floats(&f).iter().filter(|v| **v != 10.0).count() as f64 / 81.0;
            assert!((seen - f64::from(truth[0].score)).abs() < 0.05, "frame {}: {seen} {}", f.index.0, truth[0].score);
        }
    }

    #[test]
    fn targets_come_go_and_grow() {
        let target = Target {
            start_px: [32.0, 32.0],
            velocity_px_per_s: [0.0; 2],
            appears_s: 10.0,
            vanishes_s: Some(20.0),
            growth_per_s: 0.1,
            ..Target::default()
        };
        let c = SceneConfig {
            background: Background::White(White { mean: 0.0, std: 0.0 }),
            targets: vec![target],
            ..Default::default()
        };
        for (f, truth) in frames(&c, 1) {
            let n = floats(&f).iter().filter(|v| **v > 0.0).count();
            match f.index.0 {
                10 => assert_eq!((n, truth.len()), (81, 1)),
                19 => assert_eq!((n, truth[0].extent.width_px), (17 * 17, 17.0)),
                k if (10..20).contains(&k) => assert_eq!(truth.len(), 1),
                _ => assert_eq!((n, truth.len()), (0, 0)),
            }
        }
    }

    #[test]
    fn both_ways_of_drawing_give_the_same_statistics() {
        // An occluder outside the picture forces the way of floats.
        let fast = SceneConfig { n_frames: 60, ..SceneConfig::default() };
        let outside = Occluder { corner_px: [-10, 0], size_px: [1, 1], ..Occluder::default() };
        let slow = SceneConfig { occluders: vec![outside], ..fast.clone() };
        let stats = |c| {
            let all: Vec<_> = frames(c, 1).iter().flat_map(|(f, _)| floats(f)).collect();
            let (m, s) = mean_std(&all);
            let in_band = all.iter().filter(|v| (90.0..=110.0).contains(*v)).count() as f64 / all.len() as f64;
            (m, s, in_band)
        };
        let (a, b) = (stats(&fast), stats(&slow));
        assert!((a.0 - b.0).abs() < 0.5 && (a.1 - b.1).abs() < 0.5 && (a.2 - b.2).abs() < 0.003, "{a:?} {b:?}");
    }
}
