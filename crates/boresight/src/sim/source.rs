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
    Error, ErrorKind, Extent, Frame, FrameIndex, FrameSource, Image, PixelKind, Pixels, Result, Similarity, SourceInfo,
    Timestamp, TrackId, TrackState, TrackStatus,
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

impl SceneConfig {
    /// Starts the scene; a `file` background must be given by [`SceneConfig::build_over`] instead.
    /// # Errors
    /// [`ErrorKind::Config`] that names the wrong parameter.
    pub fn build(&self, seed: Seed) -> Result<SceneSource> {
        SceneSource::new(self, seed, None)
    }

    /// Starts the scene over the frames of another source (a picture, a video).
    /// # Errors
    /// As [`SceneConfig::build`]; or the source cannot be read.
    pub fn build_over(&self, seed: Seed, background: Box<dyn FrameSource>) -> Result<SceneSource> {
        SceneSource::new(self, seed, Some(background))
    }
}

impl SceneSource {
    fn new(config: &SceneConfig, seed: Seed, background: Option<Box<dyn FrameSource>>) -> Result<Self> {
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
            n_frames: (config.clock.dropped_share == 0.0 && config.clock.silent_s.is_empty())
                .then_some(config.n_frames),
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

    /// The image's middle, px.
    fn middle_px(&self) -> Vector2<f64> {
        Vector2::new(0.5 * (self.config.width_px as f64 - 1.0), 0.5 * (self.config.height_px as f64 - 1.0))
    }

    /// Where the ground lies in the image in frame `k`: what the camera does, as the truth has it.
    pub fn image_from_ground(&self, k: u64) -> Similarity {
        let (time, _, jitter) = self.clock(k);
        self.config.camera.image_from_ground(time.as_secs_f64(), self.middle_px(), jitter)
    }

    /// Time of frame `k` and whether it is dropped, and the camera's jitter in it.
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
    fn advance(&mut self, time: Timestamp, camera: &Similarity, present: &mut Vec<(usize, Vector4<f64>, f64)>) {
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
            if self.config.camera.is_still() {
                let moved = camera.apply(Vector2::new(s[0], s[2]));
                (s[0], s[2]) = (moved.x, moved.y);
            } else {
                s = self.config.camera.state_in_image(camera, self.middle_px(), &s);
            }
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
            let (time, dropped, jitter) = self.clock(k);
            let camera = self.config.camera.image_from_ground(time.as_secs_f64(), self.middle_px(), jitter);
            // Targets move in dropped frames too: their noise is drawn frame by frame.
            self.advance(time, &camera, &mut present);
            let t = time.as_secs_f64();
            if dropped || self.config.clock.silent_s.iter().any(|[from, to]| (*from..=*to).contains(&t)) {
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
                Way::Floats(painter) => painter.paint(&self.config, k, &camera, &present, spare)?,
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
mod tests;
