//! Pairs of real textured images of one ground, the second warped by a known motion: both are drawn from one larger image, so that the truth is exact.
//!
//! A pixel of either view is the mean of 2 x 2 samples of the source over its area, each by cubic convolution (R. Keys, *IEEE Trans. ASSP* 29, 1981), at up to [`SCALE`] source
//! pixels a pixel and with a fraction of a pixel of its own: neither view is a copy of the source's pixels, and both are as sharp. White noise is added after that,
//! in both anew. In every second pair rectangles with another image's texture cover up to a third of the view and move by themselves.

use crate::limit::scenes::random;
use anyhow::{Context, Result};
use boresight::{Image, Pixels};
use nalgebra::{Matrix3, Vector2};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, Normal};
use std::path::Path;

/// Source pixels along a side of a pixel of a view, at most: fewer where views would be lower than [`LEAST_SIDE`] px.
const SCALE: f64 = 1.15;
const LEAST_SIDE: f64 = 240.0;
/// Pixels of a view around it that the source must hold: the largest shift, turn, zoom and perspective at a corner.
const MARGIN: f64 = 62.0;

/// Files or folders of frames, the frame that is taken, and what is seen.
const SOURCES: [(&str, usize, &str); 8] = [
    ("pets09_vtest/vtest.avi", 0, "campus, people"),
    ("pets09_vtest/vtest.avi", 420, "campus, people"),
    ("intel_sample_videos/car-detection.mp4", 100, "car park"),
    ("uav_uavdt_S1001/frames", 0, "town from the air"),
    ("uav_uavdt_S1001/frames", 120, "town from the air"),
    ("dctracking_pets_tud/TUD-Campus/img1", 30, "street, people"),
    ("anti_uav410/3700000000002_132726_2.mp4", 600, "hills, thermal"),
    ("ball_green_trflorian/ball2.mp4", 200, "room"),
];

/// An image that views are drawn from.
pub struct Source {
    pub shows: &'static str,
    image: Image<f32>,
    scale: f64,
}

/// Kinds of motion, in equal numbers.
pub const KINDS: [&str; 4] = ["shift", "turn and zoom", "affine", "perspective"];
/// Deviations of the noise, counts.
const NOISES: [f64; 3] = [1.0, 3.0, 6.0];

/// Two views and the motion between them.
pub struct Pair {
    pub source: usize,
    pub kind: usize,
    /// Share of the first view that moves by itself.
    pub patched: f64,
    /// Shift (px), turn (rad), zoom, two numbers of an affine part and two of a perspective; the last in shares a half width.
    pub numbers: [f64; 8],
    /// Deviation of the noise, counts.
    pub noise: f64,
    pub views: [Image<u8>; 2],
    /// Takes a point of the first view to its place in the second.
    pub truth: Matrix3<f64>,
}

/// The images of the data folder that are there.
pub fn sources(data: &Path) -> Result<Vec<Source>> {
    let mut out = Vec::new();
    for (file, k, shows) in SOURCES {
        let path = data.join(file);
        if path.exists() {
            let image = frame(&path, k).with_context(|| format!("frame {k} of {file}"))?;
            let least = image.width().min(image.height()) as f64;
            out.push(Source { shows, scale: SCALE.min(least / (LEAST_SIDE + 2.0 * MARGIN)), image });
        }
    }
    Ok(out)
}

fn frame(path: &Path, k: usize) -> Result<Image<f32>> {
    let mut source = boresight::io::open(path, &Default::default())?;
    for _ in 0..k {
        let frame = source.next_frame()?.context("too few frames")?;
        source.recycle(frame);
    }
    let frame = source.next_frame()?.context("too few frames")?;
    let (w, h) = (frame.pixels.width(), frame.pixels.height());
    let values: Vec<f32> = match &frame.pixels {
        Pixels::Gray8(i) => i.as_slice().iter().map(|p| f32::from(*p)).collect(),
        Pixels::Rgb8(i) => i.as_slice().iter().map(|p| f32::from(p[1])).collect(),
        _ => anyhow::bail!("frames of 8 bits"),
    };
    Image::from_vec(w, h, values).context("a whole image")
}

/// Value between pixels by cubic convolution, the border's outside.
fn cubic(image: &Image<f32>, p: Vector2<f64>) -> f32 {
    let (x, y) = (p.x.floor(), p.y.floor());
    let weights = |t: f32| {
        let (t2, t3) = (t * t, t * t * t);
        [-0.5 * t3 + t2 - 0.5 * t, 1.5 * t3 - 2.5 * t2 + 1.0, -1.5 * t3 + 2.0 * t2 + 0.5 * t, 0.5 * t3 - 0.5 * t2]
    };
    let (wx, wy) = (weights((p.x - x) as f32), weights((p.y - y) as f32));
    let (x, y) = (x as i64 - 1, y as i64 - 1);
    let (w, h) = (image.width() as i64, image.height() as i64);
    let mut sum = 0.0;
    for (r, wy) in (y..).zip(wy) {
        let row = image.row(r.clamp(0, h - 1) as usize);
        let across: f32 = if x >= 0 && x + 4 <= w {
            row[x as usize..x as usize + 4].iter().zip(wx).map(|(v, w)| v * w).sum()
        } else {
            (x..).zip(wx).map(|(c, wx)| wx * row[c.clamp(0, w - 1) as usize]).sum()
        };
        sum += wy * across;
    }
    sum
}

/// A rectangle of the first view with another image's texture, and its own way, px of the second view.
struct Patch {
    corner: Vector2<f64>,
    size: Vector2<f64>,
    way: Vector2<f64>,
    texture: Vector2<f64>,
}

fn apply(m: &Matrix3<f64>, p: Vector2<f64>) -> Vector2<f64> {
    let q = m * p.push(1.0);
    Vector2::new(q.x / q.z, q.y / q.z)
}

/// Homography of a shift, turn (rad), zoom, two numbers of an affine part and two of a perspective about a point; the last in shares a half width.
fn motion(middle: Vector2<f64>, v: [f64; 8]) -> Matrix3<f64> {
    let [dx, dy, turn, zoom, a, b, g, h] = v;
    let about = |x: f64, y: f64| Matrix3::new(1.0, 0.0, x, 0.0, 1.0, y, 0.0, 0.0, 1.0);
    let (c, s) = ((1.0 + zoom) * turn.cos(), (1.0 + zoom) * turn.sin());
    let linear = Matrix3::new(c, -s, 0.0, s, c, 0.0, 0.0, 0.0, 1.0);
    let affine = Matrix3::new(1.0 + a, b, 0.0, b, 1.0 - a, 0.0, 0.0, 0.0, 1.0);
    let tilt = Matrix3::new(1.0, 0.0, 0.0, 0.0, 1.0, 0.0, g / middle.x, h / middle.x, 1.0);
    let m = about(middle.x + dx, middle.y + dy) * linear * affine * tilt * about(-middle.x, -middle.y);
    m / m[(2, 2)]
}

/// Whether pair `k` belongs to the half that is looked at; the other one is only reported. Blocks of pairs with every image, every kind, with and without things that move by
/// themselves take turns: an even number alone would take half of the images.
pub fn is_looked_at(sources: &[Source], k: usize) -> bool {
    (k / (2 * KINDS.len() * sources.len())).is_multiple_of(2)
}

/// Pair `k` of a set: its own seed, so that it is the same however many are made. Set 0 is that of the page.
pub fn pair(sources: &[Source], set: u32, k: usize) -> Result<Pair> {
    let mut rng = random((u64::from(set) << 32) + 7_000_000 + k as u64);
    let (source, kind) = (k % sources.len(), k / sources.len() % KINDS.len());
    let Source { image: of, scale, .. } = &sources[source];
    let size = [of.width(), of.height()].map(|n| (n as f64 / scale - 2.0 * MARGIN).floor());
    let middle = 0.5 * Vector2::new(size[0] - 1.0, size[1] - 1.0);
    let mut even = |most: f64| most * (2.0 * rng.random::<f64>() - 1.0);
    let direction = even(std::f64::consts::PI);
    // Shifts of 0 to 30 px, evenly; 3 degrees; 3 %; a shear of 1 %; a perspective of 1.5 % over half the width.
    let length = 15.0 + even(15.0);
    let mut v = [length * direction.cos(), length * direction.sin(), 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];
    let most = [3f64.to_radians(), 0.03, 0.01, 0.01, 0.015, 0.015];
    let n = [0, 2, 4, 6][kind];
    v[2..2 + n].iter_mut().zip(most).for_each(|(v, most)| *v = even(most));
    let truth = motion(middle, v);
    let offset = Vector2::new(0.5 + even(0.5), 0.5 + even(0.5));
    let (patches, patched) =
        if k / (KINDS.len() * sources.len()) % 2 == 1 { patches(size, &mut rng) } else { (Vec::new(), 0.0) };
    let texture = &sources[(source + 1 + k % (sources.len().max(2) - 1)) % sources.len()].image;
    let noise = NOISES[k % NOISES.len()];
    let back = truth.try_inverse().context("a motion with a way back")?;
    let scene = |p: Vector2<f64>| cubic(of, *scale * (p + Vector2::repeat(MARGIN)) + offset);
    let in_patch = |patch: &Patch, p: Vector2<f64>| {
        let d = p - patch.corner;
        let inside = d.x >= 0.0 && d.y >= 0.0 && d.x < patch.size.x && d.y < patch.size.y;
        inside.then(|| cubic(texture, *scale * (patch.texture + d)))
    };
    let first = |p: Vector2<f64>| patches.iter().find_map(|a| in_patch(a, p)).unwrap_or_else(|| scene(p));
    let second = |q: Vector2<f64>| {
        let own = patches.iter().find_map(|a| in_patch(a, apply(&back, q - a.way)));
        own.unwrap_or_else(|| scene(apply(&back, q)))
    };
    let size = size.map(|n| n as usize);
    let views = [draw(size, &first, noise, &mut rng)?, draw(size, &second, noise, &mut rng)?];
    Ok(Pair { source, kind, patched, numbers: v, noise, views, truth })
}

/// One to five rectangles of up to a third of the view together; in half of the pairs all go one way.
fn patches([w, h]: [f64; 2], rng: &mut ChaCha8Rng) -> (Vec<Patch>, f64) {
    let n = rng.random_range(1..=5usize);
    let share = rng.random_range(0.05..1.0 / 3.0);
    let area = share * w * h / n as f64;
    let together = rng.random_bool(0.5);
    let way = |rng: &mut ChaCha8Rng| {
        let (length, angle) = (rng.random_range(1.0..15.0f64), rng.random_range(0.0..std::f64::consts::TAU));
        length * Vector2::new(angle.cos(), angle.sin())
    };
    let common = way(rng);
    let out = (0..n).map(|_| {
        let aspect = rng.random_range(0.6..1.7f64);
        let size = Vector2::new((area * aspect).sqrt().min(0.9 * w), (area / aspect).sqrt().min(0.9 * h));
        let corner = Vector2::new(rng.random_range(0.0..w - size.x), rng.random_range(0.0..h - size.y));
        let texture = Vector2::new(rng.random_range(0.0..40.0), rng.random_range(0.0..40.0));
        Patch { corner, size, way: if together { common } else { way(rng) }, texture }
    });
    (out.collect(), share)
}

fn draw(
    [w, h]: [usize; 2],
    value: &dyn Fn(Vector2<f64>) -> f32,
    noise: f64,
    rng: &mut ChaCha8Rng,
) -> Result<Image<u8>> {
    let noise = Normal::new(0.0, noise as f32)?;
    let mut out = Image::filled(w, h, 0u8);
    for y in 0..h {
        for (x, p) in out.row_mut(y).iter_mut().enumerate() {
            let places = [(-0.25, -0.25), (0.25, -0.25), (-0.25, 0.25), (0.25, 0.25)];
            let sum: f32 = places.into_iter().map(|(dx, dy)| value(Vector2::new(x as f64 + dx, y as f64 + dy))).sum();
            *p = (0.25 * sum + noise.sample(rng)).round().clamp(0.0, 255.0) as u8;
        }
    }
    Ok(out)
}

/// Frames of 1920 x 1080 px before which the camera pans, turns and zooms a little, for times: of the largest source, drawn larger than it is.
pub fn film(sources: &[Source], n: usize) -> Result<Vec<Image<u8>>> {
    let of = sources.iter().map(|s| &s.image).max_by_key(|i| i.width() * i.height()).context("no source")?;
    let scale = f64::min(of.width() as f64 / 2100.0, of.height() as f64 / 1240.0);
    let middle = Vector2::new(959.5, 539.5);
    let mut rng = random(11);
    (0..n)
        .map(|k| {
            let k = k as f64 - 0.5 * n as f64;
            let m = motion(middle, [4.0 * k, -1.5 * k, 5e-4 * k, 4e-4 * k, 0.0, 0.0, 0.0, 0.0]);
            let back = m.try_inverse().context("a motion with a way back")?;
            let scene = |p: Vector2<f64>| cubic(of, scale * (apply(&back, p) + Vector2::repeat(80.0)));
            draw([1920, 1080], &scene, 2.0, &mut rng)
        })
        .collect()
}
