//! A composed clip's ground: windows of a still, sampled between its pixels, and a nearer plane before it.
//!
//! The near plane is a still of its own behind a mask of irregular shape; it moves 1 + p times as far as the far one (parallax p).
//! Sampling is separable Catmull-Rom (R. Keys, 1981, a = -1/2) of stills that were smoothed by [1 2 1]/4: sensors see them through optics,
//! and noise of a still that has not gone through one changes its strength with the place between the pixels.

use boresight::Image;
use rand::RngExt;
use rand_chacha::ChaCha8Rng;

/// The window of the camera, px.
pub const VIEW_PX: [usize; 2] = [320, 256];
/// Pixels of a still beside any window: the sampling reaches two of them.
const MARGIN_PX: f64 = 3.0;
/// Smaller stills are enlarged until they leave a window some way to go.
const LEAST_PX: [usize; 2] = [480, 384];
/// Below this, counts a px, the edge of a mask would be a slope of many pixels: places where the field is level.
const LEAST_SLOPE: f64 = 1e-3;

/// Waves of the near plane's outline are not shorter.
const LEAST_WAVE_PX: f64 = 40.0;
/// The same of what roughens it.
const LEAST_LEAF_PX: f64 = 6.0;
const N_OUTLINES: usize = 6;
/// Pixels of the smallest patch of the near plane.
const LEAST_PATCH: usize = 2500;

/// What is nearer than the ground.
pub struct Near {
    still: Image<f32>,
    mask: Image<f32>,
    parallax: f64,
}

/// Both planes.
pub struct Scene {
    pub far: Image<f32>,
    pub near: Option<Near>,
}

/// How far a window's corner may go over a still.
pub fn room(still: &Image<f32>) -> [f64; 2] {
    let size = [still.width(), still.height()];
    [0, 1].map(|i| size[i] as f64 - VIEW_PX[i] as f64 - 2.0 * MARGIN_PX)
}

/// A still as a plane: smoothed, or halved where that is asked for; enlarged where it is small.
pub fn plane(still: &Image<u8>, halve: bool) -> Image<f32> {
    let (w, h) = (still.width(), still.height());
    let at = |x: usize, y: usize| f32::from(still.row(y.min(h - 1))[x.min(w - 1)]);
    let mut out = if halve {
        let mean = |x: usize, y: usize| 0.25 * (at(x, y) + at(x + 1, y) + at(x, y + 1) + at(x + 1, y + 1));
        filled(w / 2, h / 2, |x, y| mean(2 * x, 2 * y))
    } else {
        let row = |x: usize, y: usize| 0.25 * (at(x.saturating_sub(1), y) + 2.0 * at(x, y) + at(x + 1, y));
        filled(w, h, |x, y| 0.25 * (row(x, y.saturating_sub(1)) + 2.0 * row(x, y) + row(x, y + 1)))
    };
    while out.width() < LEAST_PX[0] || out.height() < LEAST_PX[1] {
        let small = out;
        let at = |x: usize, y: usize| small.row(y.min(small.height() - 1))[x.min(small.width() - 1)];
        // A new pixel lies a quarter of an old one beside the old one it is in.
        let beside = |i: usize| if i.is_multiple_of(2) { (i / 2).saturating_sub(1) } else { i / 2 + 1 };
        let line = |x: usize, y: usize| 0.75 * at(x / 2, y) + 0.25 * at(beside(x), y);
        out = filled(2 * small.width(), 2 * small.height(), |x, y| 0.75 * line(x, y / 2) + 0.25 * line(x, beside(y)));
    }
    out
}

/// Left is right.
pub fn mirrored(mut still: Image<f32>) -> Image<f32> {
    (0..still.height()).for_each(|y| still.row_mut(y).reverse());
    still
}

fn filled(width: usize, height: usize, value: impl Fn(usize, usize) -> f32) -> Image<f32> {
    let mut out = Image::filled(width, height, 0.0);
    for y in 0..height {
        out.row_mut(y).iter_mut().enumerate().for_each(|(x, v)| *v = value(x, y));
    }
    out
}

fn weights(between: f64) -> [f32; 4] {
    let t = between as f32;
    let (t2, t3) = (t * t, t * t * t);
    [0.5 * (2.0 * t2 - t - t3), 0.5 * (2.0 - 5.0 * t2 + 3.0 * t3), 0.5 * (t + 4.0 * t2 - 3.0 * t3), 0.5 * (t3 - t2)]
}

/// The window of a plane whose corner is at `corner`.
/// # Panics
/// If the window does not lie in the plane: a bug of the path.
pub fn window(plane: &Image<f32>, corner: [f64; 2]) -> Image<f32> {
    let [w, h] = VIEW_PX;
    let [x0, y0] = corner.map(|c| (c + MARGIN_PX).floor() as usize);
    let [kx, ky] = corner.map(|c| weights((c + MARGIN_PX).fract()));
    let four = |v: [f32; 4], k: [f32; 4]| v[0] * k[0] + v[1] * k[1] + v[2] * k[2] + v[3] * k[3];
    let lines = filled(w, h + 3, |x, y| {
        let line = &plane.row(y0 + y - 1)[x0 + x - 1..x0 + x + 3];
        four([line[0], line[1], line[2], line[3]], kx)
    });
    filled(w, h, |x, y| four([0, 1, 2, 3].map(|i| lines.row(y + i)[x]), ky))
}

impl Scene {
    /// What the window sees with its corner at `corner`.
    pub fn ground(&self, corner: [f64; 2]) -> Image<f32> {
        let mut out = window(&self.far, corner);
        if let Some(near) = &self.near {
            let of_near = corner.map(|c| (1.0 + near.parallax) * c);
            let (values, mask) = (window(&near.still, of_near), window(&near.mask, of_near));
            for ((v, near), m) in out.as_mut_slice().iter_mut().zip(values.as_slice()).zip(mask.as_slice()) {
                *v += m.clamp(0.0, 1.0) * (near - *v);
            }
        }
        out
    }
}

/// Sine waves of random directions: wave vector (1/px), phase, height.
struct Waves(Vec<([f64; 2], f64, f64)>);

impl Waves {
    /// Of lengths from `shortest` to eight times that, longer ones higher.
    fn draw(shortest: f64, n: usize, rng: &mut ChaCha8Rng) -> Self {
        let wave = |_| {
            let length = shortest * 8f64.powf(rng.random::<f64>());
            let angle: f64 = rng.random_range(0.0..std::f64::consts::TAU);
            let k = std::f64::consts::TAU / length;
            ([k * angle.cos(), k * angle.sin()], rng.random_range(0.0..std::f64::consts::TAU), length / shortest)
        };
        Self((0..n).map(wave).collect())
    }

    fn at(&self, x: f64, y: f64) -> f64 {
        self.0.iter().map(|(k, phase, height)| height * (k[0] * x + k[1] * y + phase).sin()).sum()
    }
}

/// A field that is above a level in the near plane: all below a wavy line, all beside one, or large patches.
struct Outline {
    kind: u32,
    waves: Waves,
    leaves: Waves,
}

impl Outline {
    fn draw(kind: u32, rng: &mut ChaCha8Rng) -> Self {
        Self { kind, waves: Waves::draw(LEAST_WAVE_PX, 12, rng), leaves: Waves::draw(LEAST_LEAF_PX, 12, rng) }
    }

    fn at(&self, x: f64, y: f64) -> f64 {
        let edge = |along: f64| 2.0 * self.waves.at(along, 0.0) + 0.3 * self.leaves.at(x, y);
        match self.kind {
            0 | 1 => y + edge(x),
            2 => x + edge(y),
            3 => -x + edge(y),
            _ => 10.0 * self.waves.at(x, y) + 0.5 * self.leaves.at(x, y),
        }
    }

    /// The level above which `share` of the views lies, and how much larger the largest share of a view is than the smallest.
    fn level(&self, corners: &[[f64; 2]], share: f64) -> (f64, f64) {
        let places = |corner: &[f64; 2]| {
            let [x, y] = *corner;
            let row = move |dy: usize| (0..VIEW_PX[0]).step_by(8).map(move |dx| (x + dx as f64, y + dy as f64));
            (0..VIEW_PX[1]).step_by(8).flat_map(row)
        };
        let views: Vec<Vec<f64>> = corners.iter().map(|c| places(c).map(|(x, y)| self.at(x, y)).collect()).collect();
        let mut all = views.concat();
        all.sort_by(f64::total_cmp);
        let level = all[((1.0 - share) * (all.len() - 1) as f64) as usize];
        let shares = views.iter().map(|v| v.iter().filter(|v| **v > level).count() as f64 / v.len() as f64);
        let (least, most) = shares.fold((1.0, 0.0), |(a, b), s| (f64::min(a, s), f64::max(b, s)));
        (level, most - least)
    }
}

impl Near {
    /// Draws a mask over a still that covers `share` of the views along a path of corners, on the average.
    pub fn draw(still: Image<f32>, parallax: f64, path: &[[f64; 2]], share: f64, rng: &mut ChaCha8Rng) -> Self {
        let corners: Vec<[f64; 2]> =
            path.iter().step_by(10).map(|c| c.map(|c| (1.0 + parallax) * c + MARGIN_PX)).collect();
        let kind = rng.random_range(0..5);
        // Of some outlines of a kind the one whose share differs least from view to view.
        let drawn = (0..N_OUTLINES).map(|_| {
            let outline = Outline::draw(kind, rng);
            let (level, spread) = outline.level(&corners, share);
            (spread, level, outline)
        });
        let (_, level, outline) = drawn.min_by(|a, b| a.0.total_cmp(&b.0)).expect("some outlines");
        let field = filled(still.width(), still.height(), |x, y| (outline.at(x as f64, y as f64) - level) as f32);
        let mut is_near: Vec<bool> = field.as_slice().iter().map(|v| *v > 0.0).collect();
        drop_islands(&mut is_near, field.width());
        let at = |x: usize, y: usize| field.row(y.min(field.height() - 1))[x.min(field.width() - 1)];
        let mask = filled(still.width(), still.height(), |x, y| {
            let slope = [at(x + 1, y) - at(x.saturating_sub(1), y), at(x, y + 1) - at(x, y.saturating_sub(1))];
            let slope = 0.5 * slope[0].hypot(slope[1]).max(LEAST_SLOPE as f32);
            // What lies beside the edge is of the same side of it, island or not.
            let here = |dx: usize, dy: usize| {
                let (x, y) = ((x + dx).saturating_sub(1), (y + dy).saturating_sub(1));
                is_near[y.min(field.height() - 1) * field.width() + x.min(field.width() - 1)]
            };
            if !(0..9).any(|i| here(i % 3, i / 3)) {
                return 0.0;
            }
            // Half at the edge, and from nothing to all within one and a half px.
            (0.5 + at(x, y) / (1.5 * slope)).clamp(0.0, 1.0)
        });
        Self { still, mask, parallax }
    }
}

/// Takes out what is connected over fewer than `LEAST_PATCH` pixels: it would be a thing of its own that moves, not ground.
fn drop_islands(is_near: &mut [bool], width: usize) {
    let mut is_seen = vec![false; is_near.len()];
    for start in 0..is_near.len() {
        if !is_near[start] || is_seen[start] {
            continue;
        }
        is_seen[start] = true;
        let (mut patch, mut next) = (vec![start], 0);
        while let Some(&p) = patch.get(next) {
            next += 1;
            let beside = [(p % width > 0, p.wrapping_sub(1)), (p % width + 1 < width, p + 1)];
            let over = [(p >= width, p.wrapping_sub(width)), (p + width < is_near.len(), p + width)];
            for (_, q) in beside.into_iter().chain(over).filter(|b| b.0) {
                if is_near[q] && !is_seen[q] {
                    is_seen[q] = true;
                    patch.push(q);
                }
            }
        }
        if patch.len() < LEAST_PATCH {
            patch.into_iter().for_each(|p| is_near[p] = false);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ramp() -> Image<f32> {
        filled(640, 512, |x, y| 0.25 * x as f32 + 0.125 * y as f32)
    }

    #[test]
    fn a_window_of_a_ramp_is_a_ramp_moved_by_less_than_a_pixel() {
        let seen = window(&ramp(), [10.3, 20.6]);
        let expected = |x: f64, y: f64| 0.25 * (x + 13.3) + 0.125 * (y + 23.6);
        for (x, y) in [(0, 0), (319, 0), (17, 201), (319, 255)] {
            assert!((f64::from(seen.row(y)[x]) - expected(x as f64, y as f64)).abs() < 1e-3);
        }
    }

    #[test]
    fn the_near_plane_moves_by_one_and_the_parallax_times_the_camera() {
        let mask = Image::filled(640, 512, 1.0);
        let near = |parallax| Some(Near { still: ramp(), mask: mask.clone(), parallax });
        for parallax in [0.02, 0.3] {
            let scene = Scene { far: Image::filled(640, 512, 0.0), near: near(parallax) };
            let change = scene.ground([14.0, 0.0]).row(100)[100] - scene.ground([4.0, 0.0]).row(100)[100];
            assert!((f64::from(change) - 0.25 * 10.0 * (1.0 + parallax)).abs() < 1e-3, "{change}");
        }
    }

    #[test]
    fn the_near_plane_covers_the_share_asked_for_with_soft_edges() {
        for seed in 0..6 {
            let mut rng = boresight::sim::Seed::new(seed).stream(boresight::sim::Purpose::Scenario, 0);
            let path: Vec<[f64; 2]> = (0..200).map(|t| [f64::from(t), 40.0]).collect();
            let near = Near::draw(Image::filled(640, 512, 1.0), 0.1, &path, 0.2, &mut rng);
            let scene = Scene { far: Image::filled(640, 512, 0.0), near: Some(near) };
            let views: Vec<Image<f32>> = path.iter().step_by(10).map(|c| scene.ground(*c)).collect();
            let pixels = || views.iter().flat_map(|v| v.as_slice());
            let n = pixels().count() as f32;
            let covered = pixels().sum::<f32>() / n;
            let between = pixels().filter(|v| (0.1..0.9).contains(*v)).count() as f32 / n;
            // Islands are taken out after the share is set.
            assert!((covered - 0.2).abs() < 0.03, "{covered}");
            assert!(between > 0.0 && between < 0.05, "{between}");
        }
    }

    #[test]
    fn a_small_still_is_enlarged_without_a_shift() {
        let small = Image::from_vec(160, 128, (0..160 * 128).map(|i| (i % 160) as u8).collect()).unwrap();
        let large = plane(&small, false);
        assert_eq!((large.width(), large.height()), (640, 512));
        // A place x of the small one is at 4 x + 1.5 of the large.
        for x in [100, 301, 402] {
            assert!((f64::from(large.row(200)[x]) - (x as f64 - 1.5) / 4.0).abs() < 1e-3);
        }
    }
}
