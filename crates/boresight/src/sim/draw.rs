//! Draws a frame of a general scene as floats and passes it through the sensor.
//!
//! Order: background, targets, occluders, optics blur, shot noise, fixed pattern, read noise, dead pixels, salt and pepper,
//! saturation, rounding (half up). Shot noise is Gaussian with the variance of the photon count (v / electrons per count):
//! right to a few per cent above 10 electrons. Correlated clutter is white noise smoothed by a Gaussian and scaled to its
//! spread; from frame to frame it is an AR(1) sequence. Spots are integrated over each pixel (difference of error functions).
//! Units: counts, px. Limits: one frame, one clutter image, two fixed-pattern images are held.

use super::ground::Texture;
use super::random::{Purpose, Seed};
use super::render::{clip, first_pixel};
use super::scene::{Background, SceneConfig, Shape, Target, Textured};
use crate::{Frame, FrameSource, Image, Pixels, Result, Similarity};
use nalgebra::{Vector2, Vector4};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use statrs::function::erf::erf;

/// Frame of the stream of [`Purpose::Sensor`] is the low part of its index; the high part tells kinds of noise apart.
const KIND: u64 = 1 << 40;

/// Draws the frames of one scene.
pub(super) struct Painter {
    seed: Seed,
    canvas: Vec<f32>,
    scratch: Vec<f32>,
    clutter: Vec<f32>,
    clutter_frame: Option<u64>,
    ground: Texture,
    textures: Vec<Option<Image<f32>>>,
    offset: Vec<f32>,
    gain: Vec<f32>,
    dead: Vec<u32>,
    video: Option<Box<dyn FrameSource>>,
    video_frame: Option<Frame>,
    video_next: u64,
}

impl Painter {
    pub(super) fn new(c: &SceneConfig, seed: Seed, video: Option<Box<dyn FrameSource>>) -> Self {
        let n = c.width_px * c.height_px;
        let textures = c.targets.iter().enumerate().map(|(i, t)| texture(t, seed, i as u64)).collect();
        let fixed = |kind: u64, std: f64, mean: f32| {
            let mut rng = seed.stream(Purpose::FixedPattern, kind);
            if std > 0.0 { (0..n).map(|_| mean + normal(&mut rng, std)).collect() } else { Vec::new() }
        };
        let mut rng = seed.stream(Purpose::FixedPattern, 2);
        let dead = if c.sensor.dead_share > 0.0 {
            (0..n as u32).filter(|_| rng.random::<f64>() < c.sensor.dead_share).collect()
        } else {
            Vec::new()
        };
        Self {
            seed,
            canvas: vec![0.0; n],
            scratch: Vec::new(),
            clutter: Vec::new(),
            clutter_frame: None,
            ground: Texture::new(seed.stream(Purpose::Clutter, KIND).random()),
            textures,
            offset: fixed(0, c.sensor.offset_std, 0.0),
            gain: fixed(1, c.sensor.gain_std, 1.0),
            dead,
            video,
            video_frame: None,
            video_next: 0,
        }
    }

    /// Draws frame `k` with the given targets (number, state in the picture, growth).
    pub(super) fn paint(
        &mut self,
        c: &SceneConfig,
        k: u64,
        camera: &Similarity,
        present: &[(usize, Vector4<f64>, f64)],
        spare: Option<Pixels>,
    ) -> Result<Pixels> {
        let mut rng = self.seed.stream(Purpose::Sensor, k);
        self.background(c, k, camera, &mut rng)?;
        for (i, s, growth) in present {
            self.target(c, *i, *s, *growth, &mut rng);
        }
        let (w, h) = (c.width_px, c.height_px);
        for o in &c.occluders {
            let (Some((c0, _, n)), Some((r0, _, m))) =
                (clip(o.corner_px[0], o.size_px[0], w), clip(o.corner_px[1], o.size_px[1], h))
            else {
                continue;
            };
            for y in r0..r0 + m {
                for v in &mut self.canvas[y * w + c0..y * w + c0 + n] {
                    *v = o.mean as f32 + if o.std > 0.0 { normal(&mut rng, o.std) } else { 0.0 };
                }
            }
        }
        self.sense(c, k);
        Ok(self.digitise(c, spare))
    }

    fn background(&mut self, c: &SceneConfig, k: u64, camera: &Similarity, rng: &mut ChaCha8Rng) -> Result<()> {
        let (w, h) = (c.width_px, c.height_px);
        if let Some(video) = &mut self.video {
            while self.video_next <= k {
                match video.next_frame()? {
                    Some(f) => {
                        if let Some(old) = self.video_frame.replace(f) {
                            video.recycle(old);
                        }
                    }
                    None => break,
                }
                self.video_next += 1;
            }
            self.video_next = k + 1;
            self.canvas.fill(0.0);
            if let Some(f) = &self.video_frame {
                copy_moved(&f.pixels, camera, w, h, &mut self.canvas);
            }
            return Ok(());
        }
        let ground = camera.inverse();
        match &c.background {
            Background::White(b) => self.canvas.iter_mut().for_each(|v| *v = b.mean as f32 + normal(rng, b.std)),
            Background::Gradient(g) => {
                for (y, row) in self.canvas.chunks_exact_mut(w).enumerate() {
                    for (x, v) in row.iter_mut().enumerate() {
                        let at = ground.apply(Vector2::new(x as f64, y as f64));
                        *v = (g.level + g.slope_per_px[1] * at.y + g.slope_per_px[0] * at.x) as f32
                            + if g.std > 0.0 { normal(rng, g.std) } else { 0.0 };
                    }
                }
            }
            Background::Correlated(b) => {
                let first = self.clutter_frame.map_or(k, |f| f + 1);
                for frame in first..=k {
                    let fresh = self.clutter.is_empty();
                    if !fresh && b.coherence >= 1.0 {
                        break;
                    }
                    let mut rng = self.seed.stream(Purpose::Clutter, frame);
                    let mut new: Vec<f32> = (0..w * h).map(|_| normal(&mut rng, 1.0)).collect();
                    blur(&mut new, &mut self.scratch, w, h, b.length_px, true);
                    if fresh {
                        self.clutter = new;
                    } else {
                        let (rho, drive) = (b.coherence as f32, (1.0 - b.coherence * b.coherence).sqrt() as f32);
                        self.clutter.iter_mut().zip(&new).for_each(|(c, n)| *c = rho * *c + drive * n);
                    }
                }
                self.clutter_frame = Some(k);
                self.canvas.iter_mut().zip(&self.clutter).for_each(|(v, z)| *v = b.mean as f32 + b.std as f32 * z);
            }
            Background::Ground(g) => {
                for (y, row) in self.canvas.chunks_exact_mut(w).enumerate() {
                    for (x, v) in row.iter_mut().enumerate() {
                        let at = ground.apply(Vector2::new(x as f64, y as f64));
                        *v = self.ground.at(g, at) as f32
                            + if g.noise_std > 0.0 { normal(rng, g.noise_std) } else { 0.0 };
                    }
                }
            }
            Background::File(_) => self.canvas.fill(0.0),
        }
        Ok(())
    }

    fn target(&mut self, c: &SceneConfig, i: usize, s: Vector4<f64>, growth: f64, rng: &mut ChaCha8Rng) {
        let (w, h) = (c.width_px, c.height_px);
        match &c.targets[i].shape {
            Shape::Rectangle(r) => {
                let [nx, ny] = r.size_px.map(|n| ((n as f64 * growth).round() as usize).clamp(1, 16384));
                let (Some((c0, _, n)), Some((r0, _, m))) =
                    (clip(first_pixel(s[0], nx), nx, w), clip(first_pixel(s[2], ny), ny, h))
                else {
                    return;
                };
                for y in r0..r0 + m {
                    self.canvas[y * w + c0..y * w + c0 + n]
                        .iter_mut()
                        .for_each(|v| *v = r.mean as f32 + normal(rng, r.std));
                }
            }
            Shape::Spot(p) => {
                let sigma = p.psf_sigma_px.hypot(p.sigma_px * growth);
                let reach = (5.0 * sigma).ceil() as usize;
                let n = 2 * reach + 1;
                let share = |centre: f64, first: i64, n: usize| -> Vec<f64> {
                    let e = |edge: f64| erf((edge - centre) / (sigma * std::f64::consts::SQRT_2));
                    (0..n).map(|j| (first + j as i64) as f64).map(|x| 0.5 * (e(x + 0.5) - e(x - 0.5))).collect()
                };
                let (Some((c0, _, nx)), Some((r0, _, ny))) =
                    (clip(first_pixel(s[0], n), n, w), clip(first_pixel(s[2], n), n, h))
                else {
                    return;
                };
                let (gx, gy) = (share(s[0], c0 as i64, nx), share(s[2], r0 as i64, ny));
                for (y, gy) in (r0..).zip(&gy) {
                    self.canvas[y * w + c0..y * w + c0 + nx]
                        .iter_mut()
                        .zip(&gx)
                        .for_each(|(v, gx)| *v += (p.total * gx * gy) as f32);
                }
            }
            Shape::Textured(x) => {
                let Some(texture) = &self.textures[i] else { return };
                self.textured(x, texture.clone(), s, growth, w, h);
            }
        }
    }

    /// Draws a textured rectangle with whole coverage inside and part coverage at its edges.
    fn textured(&mut self, x: &Textured, texture: Image<f32>, s: Vector4<f64>, growth: f64, w: usize, h: usize) {
        let (tw, th) = (x.size_px[0] * growth, x.size_px[1] * growth);
        let (left, top) = (s[0] - tw / 2.0, s[2] - th / 2.0);
        let first = |edge: f64| (edge + 0.5).floor() as i64;
        let count = |a: i64, edge: f64| ((edge + 0.5).ceil() as i64 - a).max(0) as usize;
        let (fx, fy) = (first(left), first(top));
        let (Some((c0, _, nx)), Some((r0, _, ny))) =
            (clip(fx, count(fx, left + tw), w), clip(fy, count(fy, top + th), h))
        else {
            return;
        };
        let cover =
            |p: usize, lo: f64, len: f64| ((p as f64 + 0.5).min(lo + len) - (p as f64 - 0.5).max(lo)).clamp(0.0, 1.0);
        for py in r0..r0 + ny {
            let cy = cover(py, top, th);
            for px in c0..c0 + nx {
                let a = (cy * cover(px, left, tw)) as f32;
                if a > 0.0 {
                    let value = bilinear(&texture, (px as f64 - left) / growth, (py as f64 - top) / growth);
                    let v = &mut self.canvas[py * w + px];
                    *v += a * (value - *v);
                }
            }
        }
    }

    /// Optics and electronics.
    fn sense(&mut self, c: &SceneConfig, k: u64) {
        let s = &c.sensor;
        let stream = |kind: u64| self.seed.stream(Purpose::Sensor, k + kind * KIND);
        if s.blur_sigma_px > 0.0 {
            blur(&mut self.canvas, &mut self.scratch, c.width_px, c.height_px, s.blur_sigma_px, false);
        }
        if let Some(e) = s.electrons_per_count {
            let mut rng = stream(1);
            self.canvas.iter_mut().for_each(|v| *v += normal(&mut rng, 1.0) * (v.max(0.0) / e as f32).sqrt());
        }
        if !self.gain.is_empty() {
            self.canvas.iter_mut().zip(&self.gain).for_each(|(v, g)| *v *= g);
        }
        if !self.offset.is_empty() {
            self.canvas.iter_mut().zip(&self.offset).for_each(|(v, o)| *v += o);
        }
        if s.read_noise > 0.0 {
            let mut rng = stream(2);
            self.canvas.iter_mut().for_each(|v| *v += normal(&mut rng, s.read_noise));
        }
        for &i in &self.dead {
            self.canvas[i as usize] = 0.0;
        }
        if s.salt_pepper_share > 0.0 {
            let mut rng = stream(3);
            let full = ((1u32 << c.bits) - 1) as f32;
            for v in &mut self.canvas {
                let u: f64 = rng.random();
                if u < s.salt_pepper_share {
                    *v = if u < s.salt_pepper_share / 2.0 { 0.0 } else { full };
                }
            }
        }
    }

    fn digitise(&self, c: &SceneConfig, spare: Option<Pixels>) -> Pixels {
        let full = ((1u32 << c.bits) - 1) as f32;
        let top = c.sensor.saturation.map_or(full, |s| (s as f32).min(full));
        let (w, h) = (c.width_px, c.height_px);
        let level = |v: &f32| (v + 0.5).floor().clamp(0.0, top);
        if c.bits == 8 {
            let mut image = match spare {
                Some(Pixels::Gray8(i)) if i.width() == w && i.height() == h => i,
                _ => Image::filled(w, h, 0u8),
            };
            image.as_mut_slice().iter_mut().zip(&self.canvas).for_each(|(p, v)| *p = level(v) as u8);
            Pixels::Gray8(image)
        } else {
            let mut image = match spare {
                Some(Pixels::Gray16(i)) if i.width() == w && i.height() == h => i,
                _ => Image::filled(w, h, 0u16),
            };
            image.as_mut_slice().iter_mut().zip(&self.canvas).for_each(|(p, v)| *p = level(v) as u16);
            Pixels::Gray16(image)
        }
    }
}

fn normal(rng: &mut ChaCha8Rng, std: f64) -> f32 {
    let z: f32 = StandardNormal.sample(rng);
    std as f32 * z
}

/// The texture of a target, one value a pixel of its first size and one more on each side.
fn texture(target: &Target, seed: Seed, index: u64) -> Option<Image<f32>> {
    let Shape::Textured(x) = &target.shape else { return None };
    let (w, h) = (x.size_px[0].ceil() as usize + 2, x.size_px[1].ceil() as usize + 2);
    let mut rng = seed.stream(Purpose::Texture, index);
    let mut z: Vec<f32> = (0..w * h).map(|_| normal(&mut rng, 1.0)).collect();
    blur(&mut z, &mut Vec::new(), w, h, x.grain_px.min(64.0), true);
    z.iter_mut().for_each(|v| *v = x.mean as f32 + x.contrast as f32 * *v);
    Image::from_vec(w, h, z)
}

/// Value between pixels; (0, 0) is the outer edge of the texture's first used pixel, outside the border value holds.
fn bilinear(t: &Image<f32>, x: f64, y: f64) -> f32 {
    let (x, y) = ((x + 0.5).clamp(0.0, t.width() as f64 - 1.0), (y + 0.5).clamp(0.0, t.height() as f64 - 1.0));
    let (x0, y0) = (x as usize, y as usize);
    let (x1, y1) = ((x0 + 1).min(t.width() - 1), (y0 + 1).min(t.height() - 1));
    let (fx, fy) = ((x - x0 as f64) as f32, (y - y0 as f64) as f32);
    let (a, b) = (t.row(y0), t.row(y1));
    (a[x0] * (1.0 - fx) + a[x1] * fx) * (1.0 - fy) + (b[x0] * (1.0 - fx) + b[x1] * fx) * fy
}

/// Copies a picture moved with the ground (border pixels are repeated); colour becomes BT.601 grey.
fn copy_moved(pixels: &Pixels, camera: &Similarity, w: usize, h: usize, out: &mut [f32]) {
    let (pw, ph) = (pixels.width(), pixels.height());
    if pw == 0 || ph == 0 {
        return;
    }
    let at = |x: usize, y: usize| -> f32 {
        let i = y * pw + x;
        match pixels {
            Pixels::Gray8(p) => f32::from(p.as_slice()[i]),
            Pixels::Gray16(p) => f32::from(p.as_slice()[i]),
            Pixels::GrayF32(p) => p.as_slice()[i],
            Pixels::Rgb8(p) => {
                let [r, g, b] = p.as_slice()[i];
                0.299 * f32::from(r) + 0.587 * f32::from(g) + 0.114 * f32::from(b)
            }
        }
    };
    let (still, ground) = (camera.is_identity(), camera.inverse());
    for y in 0..h {
        for x in 0..w {
            out[y * w + x] = if still {
                at(x.min(pw - 1), y.min(ph - 1))
            } else {
                let from = ground.apply(Vector2::new(x as f64, y as f64));
                let (sx, sy) = (from.x.clamp(0.0, pw as f64 - 1.0), from.y.clamp(0.0, ph as f64 - 1.0));
                let (x0, y0) = (sx as usize, sy as usize);
                let (x1, y1) = ((x0 + 1).min(pw - 1), (y0 + 1).min(ph - 1));
                let (fx, fy) = ((sx - x0 as f64) as f32, (sy - y0 as f64) as f32);
                (at(x0, y0) * (1.0 - fx) + at(x1, y0) * fx) * (1.0 - fy)
                    + (at(x0, y1) * (1.0 - fx) + at(x1, y1) * fx) * fy
            };
        }
    }
}

/// Gaussian blur in two passes; `keep_variance` scales so that white noise keeps its variance (and wraps around the border).
fn blur(image: &mut [f32], scratch: &mut Vec<f32>, w: usize, h: usize, sigma: f64, keep_variance: bool) {
    if sigma <= 0.0 {
        return;
    }
    let reach = (4.0 * sigma).ceil() as i64;
    let mut kernel: Vec<f64> = (-reach..=reach).map(|i| (-0.5 * (i as f64 / sigma).powi(2)).exp()).collect();
    let norm = if keep_variance { kernel.iter().map(|k| k * k).sum::<f64>().sqrt() } else { kernel.iter().sum() };
    kernel.iter_mut().for_each(|k| *k /= norm);
    scratch.clear();
    scratch.resize(w * h, 0.0);
    // Clutter wraps around, so that its spread is the same everywhere; pictures repeat their border.
    let inside = |i: i64, n: usize| {
        if keep_variance { i.rem_euclid(n as i64) as usize } else { i.clamp(0, n as i64 - 1) as usize }
    };
    let mut padded = vec![0.0f32; w + 2 * reach as usize];
    for (row, out) in image.chunks_exact(w).zip(scratch.chunks_exact_mut(w)) {
        for (i, p) in padded.iter_mut().enumerate() {
            *p = row[inside(i as i64 - reach, w)];
        }
        for (j, k) in kernel.iter().enumerate() {
            out.iter_mut().zip(&padded[j..]).for_each(|(o, p)| *o += *k as f32 * p);
        }
    }
    for y in 0..h {
        let out = &mut image[y * w..(y + 1) * w];
        out.fill(0.0);
        for (j, k) in kernel.iter().enumerate() {
            let from = inside(y as i64 + j as i64 - reach, h);
            out.iter_mut().zip(&scratch[from * w..(from + 1) * w]).for_each(|(o, p)| *o += *k as f32 * p);
        }
    }
}
