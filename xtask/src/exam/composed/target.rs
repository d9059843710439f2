//! A composed clip's targets: how they move over the ground, what they look like, and where they are in view.
//!
//! Positions are px; a target's place in the view is its place on the ground less the window's corner. Sizes are full widths: of a spot at
//! half its height, of an ellipse its longer axis. Edges are those of 4 x 4 points a pixel.

use super::scene::VIEW_PX;
use boresight::Image;
use rand::RngExt;
use rand_chacha::ChaCha8Rng;

/// Full width at half height of a Gaussian, in its deviations: 2 sqrt(2 ln 2).
const WIDTH_SIGMAS: f64 = 2.3548;
/// Range of the speeds over the ground, px a frame.
const SPEEDS: [f64; 2] = [0.3, 4.0];
const SIZES_PX: [f64; 2] = [2.0, 28.0];
const CONTRASTS: [f64; 2] = [3.0, 15.0];
/// Larger spots are not drawn, and smaller ellipses.
const LARGEST_SPOT_PX: f64 = 8.0;
const SMALLEST_ELLIPSE_PX: f64 = 5.0;
/// Means of targets lie between these counts.
const LEVELS: [f64; 2] = [15.0, 240.0];
/// An ellipse's height at its edge is so much less than in its middle, as a share.
const SHADE: f64 = 0.3;
/// Width of an ellipse's edge, px.
const EDGE_PX: f64 = 1.5;
/// Points a pixel and axis.
const POINTS: usize = 4;
/// A path is drawn again until it is in view for so many frames, or the tries are used up.
const LEAST_FRAMES: usize = 60;
const TRIES: usize = 40;
/// Out of view for longer, a target comes back as another.
const AWAY_FRAMES: u32 = 25;

#[derive(Clone, Copy, Debug, PartialEq)]
enum Shape {
    Spot {
        sigma_px: f64,
    },
    /// Half axes, along and across the way.
    Ellipse {
        along_px: f64,
        across_px: f64,
    },
}

/// One target.
#[derive(Clone, Debug, PartialEq)]
pub struct Target {
    /// Place on the ground in each frame.
    pub ground_px: Vec<[f64; 2]>,
    shape: Shape,
    /// Height over the local deviation of the ground.
    pub contrast: f64,
    /// Counts above the ground; negative is dark.
    height: f64,
}

fn in_view(at: [f64; 2]) -> bool {
    (0..2).all(|i| (0.0..=VIEW_PX[i] as f64 - 1.0).contains(&at[i]))
}

/// Drawn so that every factor is as likely as any other.
fn between(range: [f64; 2], rng: &mut ChaCha8Rng) -> f64 {
    range[0] * (range[1] / range[0]).powf(rng.random::<f64>())
}

/// A straight, curved or accelerated way that is at `place` in frame `t0`.
fn way(place: [f64; 2], t0: usize, n: usize, rng: &mut ChaCha8Rng) -> Vec<[f64; 2]> {
    let (speed, angle) = (between(SPEEDS, rng), rng.random_range(0.0..std::f64::consts::TAU));
    let (turn, growth): (f64, f64) = match rng.random_range(0..3) {
        0 => (0.0, 0.0),
        1 => (rng.random_range(-0.02..0.02), 0.0),
        _ => (0.0, rng.random_range(-0.01..0.01)),
    };
    let velocity = |t: f64| {
        let (speed, angle) = ((speed * (growth * t).exp()).clamp(SPEEDS[0], SPEEDS[1]), angle + turn * t);
        [speed * angle.cos(), speed * angle.sin()]
    };
    let mut out = vec![place; n];
    for t in t0 + 1..n {
        let v = velocity((t - t0) as f64 - 0.5);
        out[t] = [0, 1].map(|i| out[t - 1][i] + v[i]);
    }
    for t in (0..t0).rev() {
        let v = velocity(0.5 - (t0 - t) as f64);
        out[t] = [0, 1].map(|i| out[t + 1][i] - v[i]);
    }
    out
}

impl Target {
    /// A target of random looks on a given way.
    pub fn on(ground_px: Vec<[f64; 2]>, rng: &mut ChaCha8Rng) -> Self {
        let size = between(SIZES_PX, rng);
        let is_spot = size < SMALLEST_ELLIPSE_PX || (size < LARGEST_SPOT_PX && rng.random_bool(0.5));
        let shape = if is_spot {
            Shape::Spot { sigma_px: size / WIDTH_SIGMAS }
        } else {
            let across_px = 0.5 * size * rng.random_range(0.4..1.0);
            Shape::Ellipse { along_px: 0.5 * size, across_px }
        };
        let contrast = between(CONTRASTS, rng);
        Self { ground_px, shape, contrast, height: 0.0 }
    }

    /// A target that is in the view of the path for some time; with `meets`, it comes to that one's place in one frame.
    pub fn draw(path: &[[f64; 2]], meets: Option<&Self>, rng: &mut ChaCha8Rng) -> Self {
        let n = path.len();
        let frames = |ground: &[[f64; 2]]| (0..n).filter(|t| in_view(minus(ground[*t], path[*t]))).count();
        let places: Vec<usize> = meets.map_or(vec![], |m| (0..n).filter(|t| m.view(path, *t).is_some()).collect());
        let mut best: Option<(usize, Vec<[f64; 2]>)> = None;
        for _ in 0..TRIES {
            let (t0, place) = match meets {
                Some(other) if !places.is_empty() => {
                    let t = places[rng.random_range(0..places.len())];
                    (t, other.ground_px[t].map(|v| v + rng.random_range(-1.5..1.5)))
                }
                _ => {
                    let t = rng.random_range(n / 10..n - n / 10);
                    (t, [0, 1].map(|i| path[t][i] + VIEW_PX[i] as f64 * rng.random_range(0.1..0.9)))
                }
            };
            let ground = way(place, t0, n, rng);
            let n_seen = frames(&ground);
            if best.as_ref().is_none_or(|b| n_seen > b.0) {
                best = Some((n_seen, ground));
            }
            if n_seen >= LEAST_FRAMES.min(n / 2) {
                break;
            }
        }
        Self::on(best.unwrap_or_default().1, rng)
    }

    /// Where it is in the view in a frame, if its centre is there.
    pub fn view(&self, path: &[[f64; 2]], t: usize) -> Option<[f64; 2]> {
        Some(minus(self.ground_px[t], path[t])).filter(|at| in_view(*at))
    }

    fn reach_px(&self) -> f64 {
        match self.shape {
            Shape::Spot { sigma_px } => 4.0 * sigma_px,
            Shape::Ellipse { along_px, .. } => along_px + EDGE_PX,
        }
    }

    /// Mean and deviation of the ground around a place: the target's reach and 8 px more on each side.
    fn around(&self, ground: &Image<f32>, at: [f64; 2]) -> [f64; 2] {
        let reach = self.reach_px() + 8.0;
        let range = |i: usize| {
            let last = VIEW_PX[i] as f64 - 1.0;
            // At least a pixel, also around a place outside.
            let first = (at[i] - reach).clamp(0.0, last) as usize;
            first..(at[i] + reach).clamp(0.0, last) as usize + 1
        };
        let (mut n, mut sum, mut squares) = (0.0, 0.0, 0.0);
        for v in range(1).flat_map(|y| &ground.row(y)[range(0)]) {
            let v = f64::from(*v);
            (n, sum, squares) = (n + 1.0, sum + v, squares + v * v);
        }
        let mean = sum / n;
        [mean, (squares / n - mean * mean).max(0.0).sqrt()]
    }

    /// Sets the height from the ground as it is seen in some frames: `seen` gives the frame and the ground.
    pub fn set_height(&mut self, path: &[[f64; 2]], seen: &[(usize, Image<f32>)], noise: f64, rng: &mut ChaCha8Rng) {
        let here = seen.iter().filter_map(|(t, g)| Some(self.around(g, self.view(path, *t)?)));
        let (mut means, mut deviations): (Vec<f64>, Vec<f64>) = here.map(|a| (a[0], a[1].max(noise))).unzip();
        let middle = |v: &mut Vec<f64>, default: f64| {
            v.sort_by(f64::total_cmp);
            v.get(v.len() / 2).copied().unwrap_or(default)
        };
        let (mean, deviation) = (middle(&mut means, 128.0), middle(&mut deviations, noise));
        let height = self.contrast * deviation;
        // What the eight bits cut off is no contrast: where one side has no room, the other.
        let [dark, bright] = [mean - LEVELS[0], LEVELS[1] - mean].map(|room| room.max(1.0));
        let is_bright = if dark.min(bright) < height { bright > dark } else { rng.random_bool(0.5) };
        self.height = if is_bright { height.min(bright) } else { -height.min(dark) };
        self.contrast = self.height.abs() / deviation;
    }

    /// Draws it on the frame: a spot adds to the ground, an ellipse hides it.
    pub fn put(&self, frame: &mut Image<f32>, ground: &Image<f32>, path: &[[f64; 2]], t: usize) {
        let at = minus(self.ground_px[t], path[t]);
        let reach = self.reach_px();
        let range = |i: usize| {
            let end = VIEW_PX[i] as f64;
            let (first, last) = ((at[i] - reach).floor().max(0.0), (at[i] + reach).ceil().min(end - 1.0));
            (first as usize)..if last < first { first as usize } else { last as usize + 1 }
        };
        if range(0).is_empty() || range(1).is_empty() {
            return;
        }
        let heading = self.heading(t);
        let mean = self.around(ground, at)[0];
        for y in range(1) {
            for x in range(0) {
                let [covered, height] = self.covered([x as f64 - at[0], y as f64 - at[1]], heading);
                let v = &mut frame.row_mut(y)[x];
                *v += match self.shape {
                    Shape::Spot { .. } => (height * self.height) as f32,
                    Shape::Ellipse { .. } => (height * self.height + covered * (mean - f64::from(*v))) as f32,
                };
            }
        }
    }

    /// Cosine and sine of its way.
    fn heading(&self, t: usize) -> [f64; 2] {
        let (a, b) = (self.ground_px[t.saturating_sub(1)], self.ground_px[(t + 1).min(self.ground_px.len() - 1)]);
        let (dx, dy) = (b[0] - a[0], b[1] - a[1]);
        let step = dx.hypot(dy);
        if step > 0.0 { [dx / step, dy / step] } else { [1.0, 0.0] }
    }

    /// Share of a pixel that the target covers, and its height there, both from 0 to 1.
    fn covered(&self, from_centre: [f64; 2], [c, s]: [f64; 2]) -> [f64; 2] {
        let offset = |i: usize| (i as f64 + 0.5) / POINTS as f64 - 0.5;
        let (mut covered, mut height) = (0.0, 0.0);
        for i in 0..POINTS * POINTS {
            let (x, y) = (from_centre[0] + offset(i % POINTS), from_centre[1] + offset(i / POINTS));
            match self.shape {
                Shape::Spot { sigma_px } => height += (-0.5 * (x * x + y * y) / (sigma_px * sigma_px)).exp(),
                Shape::Ellipse { along_px: a, across_px: b } => {
                    let (u, v) = (c * x + s * y, c * y - s * x);
                    // Distance from the edge to the first order: F / |grad F| of F = (u/a)² + (v/b)² - 1.
                    let f = (u / a).powi(2) + (v / b).powi(2) - 1.0;
                    let slope = 2.0 * (u / (a * a)).hypot(v / (b * b));
                    let here = (0.5 - f / (slope * EDGE_PX).max(1e-9)).clamp(0.0, 1.0);
                    covered += here;
                    height += here * (1.0 - SHADE * (f + 1.0).min(1.0));
                }
            }
        }
        [covered, height].map(|sum| sum / (POINTS * POINTS) as f64)
    }
}

fn minus(a: [f64; 2], b: [f64; 2]) -> [f64; 2] {
    [a[0] - b[0], a[1] - b[1]]
}

/// Frame, number, x, y of the targets in view; one that was away for more than a second is another from then on.
pub fn truth(targets: &[Target], path: &[[f64; 2]]) -> Vec<(u32, u32, [f64; 2])> {
    let (mut rows, mut n_ids) = (Vec::new(), 0);
    for target in targets {
        let mut last = None;
        for t in 0..path.len() as u32 {
            let Some(at) = target.view(path, t as usize) else { continue };
            n_ids += u32::from(last.is_none_or(|l| t - l > AWAY_FRAMES));
            last = Some(t);
            rows.push((t, n_ids, at));
        }
    }
    rows.sort_by_key(|r| (r.0, r.1));
    rows
}

#[cfg(test)]
mod tests {
    use super::*;

    fn spot(ground_px: Vec<[f64; 2]>, shape: Shape) -> Target {
        Target { ground_px, shape, contrast: 10.0, height: 50.0 }
    }

    #[test]
    fn the_centroid_of_what_is_drawn_is_the_place_of_the_truth() {
        let ground = Image::filled(VIEW_PX[0], VIEW_PX[1], 100.0);
        let shapes = [
            Shape::Spot { sigma_px: 0.85 },
            Shape::Spot { sigma_px: 3.0 },
            Shape::Ellipse { along_px: 2.5, across_px: 1.0 },
            Shape::Ellipse { along_px: 14.0, across_px: 6.0 },
        ];
        for shape in shapes {
            let target = spot(vec![[70.3, 60.8], [71.3, 61.3]], shape);
            let mut frame = ground.clone();
            target.put(&mut frame, &ground, &[[20.0, 10.5]; 2], 0);
            let mut sums = [0.0; 3];
            for (y, x) in (0..VIEW_PX[1]).flat_map(|y| (0..VIEW_PX[0]).map(move |x| (y, x))) {
                let v = f64::from(frame.row(y)[x]) - 100.0;
                sums = [sums[0] + v, sums[1] + v * x as f64, sums[2] + v * y as f64];
            }
            let centroid = [sums[1] / sums[0], sums[2] / sums[0]];
            assert!((centroid[0] - 50.3).hypot(centroid[1] - 50.3) < 0.02, "{shape:?}: {centroid:?}");
            assert!(frame.as_slice().iter().all(|v| (100.0..=150.001).contains(v)));
        }
    }

    #[test]
    fn a_target_that_was_away_for_more_than_a_second_is_another_and_out_of_view_it_has_no_row() {
        let path = [[0.0; 2]; 100];
        let mut ground = vec![[50.0, 50.0]; 100];
        ground[10..15].fill([-1.0, 50.0]);
        ground[40..80].fill([330.0, 50.0]);
        let rows = truth(&[spot(ground, Shape::Spot { sigma_px: 1.0 })], &path);
        assert_eq!(rows.len(), 55);
        assert_eq!(rows.iter().map(|r| r.1).collect::<std::collections::BTreeSet<_>>().len(), 2);
        assert!(rows.iter().all(|r| in_view(r.2)));
    }
}
