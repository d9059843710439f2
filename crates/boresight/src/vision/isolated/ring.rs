//! The ring around a cluster's box: a plane through it, the spread about the plane, and how far the cluster stands clear.
//!
//! The ring begins one pixel outside the box (blurred edges) and is as wide as half the cluster's longer side, at least 3 px; beyond [`WIDE`] px no wider than half its shorter side. Large rings are
//! sampled evenly with at most about 600 pixels. The plane takes a gradient of the sky or of the optics out.

use super::blob::Blob;
use crate::Image;
use crate::vision::pixel::Pixel;
use nalgebra::{Matrix3, Vector3};

/// Pixels of a ring looked at, at most and at least; a plane has three parameters.
const MAX_SAMPLES: f64 = 600.0;
const MIN_SAMPLES: usize = 8;

/// Share of the spread of a ring's edge, seen at twelve pairs, that is sure: it is known to 28 %. The error of the ground, a quarter of the spread, and the height above
/// the ring's 99 % point, more than twice the spread, are not counted.
const EDGE_SPREAD: f64 = 0.5;
/// Share of the squares about the plane that is surely there: sums of f32 round.
const SURE: f64 = 0.98;
pub const TAIL: f64 = 0.5;

/// Least and usual widths of a ring, px. Around a box of twice the usual one its 1 800 px tell their spread to 2 %, or, where texture is 4 px wide, to 7 %: what a wider one adds is what stands
/// farther off, a roof below a helicopter. Of 8, 12 and 16 px, all of which tell enough, 12 holds most of the public clips' targets.
const LEAST: u32 = 3;
const WIDE: u32 = 12;

/// The ring's width around a box, px.
fn margin(w: u32, h: u32) -> u32 {
    (w.max(h) / 2).max(LEAST).min((w.min(h) / 2).max(WIDE))
}

/// A cluster of one level; values times the sign of the side.
#[derive(Clone, Copy, Debug)]
pub struct Cluster {
    pub blob: Blob,
    pub level: f64,
    pub mean: f64,
}

/// What a ring says; values times the sign of the side.
#[derive(Clone, Copy, Debug)]
pub struct Ground {
    /// Of the plane, in the middle of the box.
    pub level: f64,
    /// Standard deviation about the plane.
    spread: f64,
    /// 99 % point of the deviations, at least 0.
    clear: f64,
}

impl Ground {
    /// How far a cluster of that mean stands clear, in units of `unit` and the spread; `None` if it does not.
    pub fn score(&self, mean: f64, unit: f64) -> Option<f64> {
        let height = mean - self.level - self.clear;
        let unit = unit + self.spread;
        (height > 0.0).then(|| if unit > 0.0 { height / unit } else { f64::from(f32::MAX) })
    }
}

/// Scratch of the ring's samples, and the last ring.
#[derive(Debug, Default)]
pub struct Ring {
    /// From the box's middle, px.
    x: Vec<f32>,
    y: Vec<f32>,
    /// From the first one, counts.
    values: Vec<f32>,
    last: Option<([u32; 4], Option<Ground>)>,
}

impl Ring {
    /// Forgets the last frame's rings.
    pub fn forget(&mut self) {
        self.last = None;
    }

    /// What the ring around a cluster says; `None` if most of it lies beyond the cluster's level, if it has too few pixels, or if the quick look at its edge says that
    /// the cluster cannot reach `min_score`. `sign` is -1 for dark targets.
    pub fn ground<T: Pixel>(
        &mut self,
        image: &Image<T>,
        sign: f64,
        cluster: &Cluster,
        unit: f64,
        min_score: f64,
    ) -> Option<Ground> {
        let blob = &cluster.blob;
        let (w, h) = blob.sides();
        let margin = margin(w, h) as usize;
        let inner = [blob.left as usize - 1, blob.top as usize - 1, blob.right as usize + 1, blob.bottom as usize + 1];
        let outer = [
            inner[0].saturating_sub(margin),
            inner[1].saturating_sub(margin),
            (inner[2] + margin).min(image.width() - 1),
            (inner[3] + margin).min(image.height() - 1),
        ];
        let edge = Edge::of(image, sign, outer, cluster.level);
        if edge.beyond > 12 || cluster.mean < edge.bar(unit, min_score) {
            return None;
        }
        if let Some((bounds, ground)) = self.last
            && bounds == blob.bounds()
        {
            return ground;
        }
        let ground = self.measure(image, sign, blob, inner, outer, (cluster.mean, unit, min_score));
        if ground.is_some() {
            self.last = Some((blob.bounds(), ground));
        }
        ground
    }

    fn measure<T: Pixel>(
        &mut self,
        image: &Image<T>,
        sign: f64,
        blob: &Blob,
        inner: [usize; 4],
        [x0, y0, x1, y1]: [usize; 4],
        (mean, unit, min_score): (f64, f64, f64),
    ) -> Option<Ground> {
        let stride = ((((x1 - x0 + 1) * (y1 - y0 + 1)) as f64 / MAX_SAMPLES).sqrt() as usize).max(1);
        let middle = [blob.left + blob.right, blob.top + blob.bottom].map(|twice| 0.5 * twice as f32);
        let (base, sign) = (image.row(y0)[x0].value_f32(), sign as f32);
        let base = if base.is_finite() { base } else { 0.0 };
        let shape = Shape { inner, outer: [x0, y0, x1, y1], stride, middle, base, sign };
        let most = ((x1 - x0) / stride + 1) * ((y1 - y0) / stride + 1);
        for v in [&mut self.x, &mut self.y, &mut self.values] {
            v.resize(most, 0.0);
        }
        let n = gather(image, &shape, &mut self.x, &mut self.y, &mut self.values);
        for v in [&mut self.x, &mut self.y, &mut self.values] {
            v.truncate(n);
        }
        if T::STEP == 0.0 {
            self.drop_unknown();
        }
        if self.values.len() < MIN_SAMPLES {
            return None;
        }
        let (plane, square) = fit(&self.x, &self.y, &self.values)?;
        // Without the 99 % point, and with a spread a little too small, for its rounding.
        let level = plane[0] + f64::from(sign * base);
        let spread = (SURE * square / self.values.len() as f64).max(0.0).sqrt();
        if mean - level < min_score * (unit + spread) {
            return None;
        }
        let (square, clear) = residuals(&self.x, &self.y, &mut self.values, plane.map(|p| p as f32).into());
        let spread = (square / self.values.len() as f64).sqrt();
        Some(Ground { level, spread, clear: f64::from(clear.max(0.0)) })
    }

    /// Leaves out what is not finite.
    fn drop_unknown(&mut self) {
        let mut kept = 0;
        for i in 0..self.values.len() {
            if self.values[i].is_finite() {
                (self.x[kept], self.y[kept], self.values[kept]) = (self.x[i], self.y[i], self.values[i]);
                kept += 1;
            }
        }
        for v in [&mut self.x, &mut self.y, &mut self.values] {
            v.truncate(kept);
        }
    }
}

/// The samples of a ring.
struct Shape {
    /// `[left, top, right, bottom]` of what it surrounds, and its own.
    inner: [usize; 4],
    outer: [usize; 4],
    /// Columns and rows from one sample to the next.
    stride: usize,
    /// From where places are counted, px, and values, counts.
    middle: [f32; 2],
    base: f32,
    sign: f32,
}

widest! {
    /// Writes place and value of each sample and returns their number.
    fn gather<T: Pixel>(image: &Image<T>, shape: &Shape, x: &mut [f32], y: &mut [f32], values: &mut [f32]) -> usize {
        let &Shape { inner, outer: [x0, y0, x1, y1], stride, middle, base, sign } = shape;
        let columns = x1 - x0 + 1;
        // The first column of the grid past the box.
        let past = (inner[2] + 1 - x0).next_multiple_of(stride);
        let mut n = 0;
        let mut at = y0;
        while at <= y1 {
            let row = &image.row(at)[x0..=x1];
            let beside = at >= inner[1] && at <= inner[3];
            let spans = if beside { [(0, inner[0] - x0), (past.min(columns), columns)] } else { [(0, columns), (0, 0)] };
            let below = at as f32 - middle[1];
            for (from, to) in spans {
                let m = (to - from).div_ceil(stride);
                let (x, y, values) = (&mut x[n..][..m], &mut y[n..][..m], &mut values[n..][..m]);
                // Columns of an image are far fewer than i32 holds, and vectors turn i32 into f32.
                let first = (x0 + from) as i32;
                if stride == 1 {
                    let row = &row[from..][..m];
                    for i in 0..m {
                        x[i] = (first + i as i32) as f32 - middle[0];
                        y[i] = below;
                        values[i] = sign * (row[i].value_f32() - base);
                    }
                } else {
                    for i in 0..m {
                        x[i] = (first + (i * stride) as i32) as f32 - middle[0];
                        y[i] = below;
                        values[i] = sign * (row[from + i * stride].value_f32() - base);
                    }
                }
                n += m;
            }
            at += stride;
        }
        n
    }
}

/// What 24 points of a ring's outer edge say; values times the sign of the side.
#[derive(Clone, Copy, Debug)]
pub struct Edge {
    ground: f64,
    spread: f64,
    /// Of the 24, those at or beyond the level.
    beyond: usize,
}

impl Edge {
    /// A quick look at the outer edge of a ring, `[left, top, right, bottom]`. The points face each other in pairs: of a pair's mean a plane leaves nothing but its height in
    /// the middle.
    pub fn of<T: Pixel>(image: &Image<T>, sign: f64, [x0, y0, x1, y1]: [usize; 4], level: f64) -> Self {
        let mut beyond = 0;
        let (top, bottom) = (image.row(y0), image.row(y1));
        let (mut sum, mut square) = (0.0, 0.0);
        let (w, h) = (x1 - x0, y1 - y0);
        let mut pair = |a: T, b: T| {
            let (a, b) = (sign * a.value(), sign * b.value());
            beyond += usize::from(a >= level && a.is_finite()) + usize::from(b >= level && b.is_finite());
            let mean = 0.5 * (a + b);
            sum += mean;
            square += mean * mean;
        };
        for i in 0..6 {
            let (dx, dy) = (w * i / 6, h * (i + 1) / 6);
            pair(top[x0 + dx], bottom[x1 - dx]);
            pair(image.row(y0 + dy)[x0], image.row(y1 - dy)[x1]);
        }
        let ground = sum / 12.0;
        // A pair's mean has a variance of half a point's.
        let spread = (2.0 * (square / 12.0 - ground * ground).max(0.0)).sqrt();
        if spread.is_finite() {
            Self { ground, spread, beyond }
        } else {
            Self { ground: f64::NEG_INFINITY, spread: 0.0, beyond }
        }
    }

    /// Least mean with which a cluster inside can reach `min_score`; `unit` is the noise and the step of a pixel.
    pub fn bar(&self, unit: f64, min_score: f64) -> f64 {
        self.ground + min_score * unit + (min_score + TAIL) * EDGE_SPREAD * self.spread
    }
}

/// Least-squares plane v = p0 + p1 x + p2 y, and the sum of squares that it leaves.
fn fit(x: &[f32], y: &[f32], v: &[f32]) -> Option<(Vector3<f64>, f64)> {
    let [sx, sy, sxx, sxy, syy, sv, sxv, syv, svv] = moments(x, y, v).map(f64::from);
    let a = Matrix3::new(v.len() as f64, sx, sy, sx, sxx, sxy, sy, sxy, syy);
    let b = Vector3::new(sv, sxv, syv);
    let plane = a.cholesky()?.solve(&b);
    Some((plane, svv - plane.dot(&b)))
}

/// Lanes of the sums: as many as the widest vectors hold, so that the order of adding is the same on every machine.
const LANES: usize = 16;

widest! {
    /// The sums of the normal equations one by one: x, y, x², xy, y², v, xv, yv, v².
    fn moments(x: &[f32], y: &[f32], v: &[f32]) -> [f32; 9] {
        let mut sums = [[0.0f32; LANES]; 9];
        let mut add = |x: &[f32; LANES], y: &[f32; LANES], v: &[f32; LANES]| {
            for l in 0..LANES {
                sums[0][l] += x[l];
                sums[1][l] += y[l];
                sums[2][l] += x[l] * x[l];
                sums[3][l] += x[l] * y[l];
                sums[4][l] += y[l] * y[l];
                sums[5][l] += v[l];
                sums[6][l] += x[l] * v[l];
                sums[7][l] += y[l] * v[l];
                sums[8][l] += v[l] * v[l];
            }
        };
        let ((xs, x), (ys, y), (vs, v)) = (x.as_chunks(), y.as_chunks(), v.as_chunks());
        for ((x, y), v) in xs.iter().zip(ys).zip(vs) {
            add(x, y, v);
        }
        let rest = |r: &[f32]| -> [f32; LANES] { std::array::from_fn(|i| r.get(i).copied().unwrap_or(0.0)) };
        add(&rest(x), &rest(y), &rest(v));
        sums.map(|lanes| lanes.iter().sum())
    }
}

/// Takes the plane out of the values; Σ of their squares and their 99 % point.
fn residuals(x: &[f32], y: &[f32], v: &mut [f32], plane: [f32; 3]) -> (f64, f32) {
    let square = subtract(x, y, v, plane);
    let n = v.len();
    let above = n - 1 - (n - 1) * 99 / 100;
    // The largest so far, the least of them first; some 600 samples have seven.
    let mut top = [f32::NEG_INFINITY; 8];
    let top = &mut top[..(above + 1).min(8)];
    for &r in v.iter() {
        if r > top[0] {
            let mut i = 0;
            while i + 1 < top.len() && top[i + 1] < r {
                top[i] = top[i + 1];
                i += 1;
            }
            top[i] = r;
        }
    }
    (f64::from(square), top[0])
}

widest! {
    fn subtract(x: &[f32], y: &[f32], v: &mut [f32], plane: [f32; 3]) -> f32 {
        let n = v.len().min(x.len()).min(y.len());
        let mut sums = [0.0f32; LANES];
        for i in 0..n {
            v[i] -= plane[0] + plane[1] * x[i] + plane[2] * y[i];
        }
        let (whole, rest) = v.as_chunks::<LANES>();
        for r in whole {
            for l in 0..LANES {
                sums[l] += r[l] * r[l];
            }
        }
        for (sum, r) in sums.iter_mut().zip(rest) {
            *sum += r * r;
        }
        sums.iter().sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    /// The scores of random blobs in noise about `level`, with the quick bounds and without them.
    fn scores<T: Pixel>(level: f64, amplitude: f64, pixel: impl Fn(f64) -> T) -> [Vec<Option<f64>>; 2] {
        const SIDE: usize = 64;
        let mut rng = ChaCha8Rng::seed_from_u64(5);
        let noise: Vec<T> = (0..SIDE * SIDE).map(|_| pixel(level + amplitude * (rng.random::<f64>() - 0.5))).collect();
        let mut out = [Vec::new(), Vec::new()];
        for n in 0..400u32 {
            let mut image = Image::from_vec(SIDE, SIDE, noise.clone()).unwrap();
            let (left, top) = (8 + rng.random_range(0..40u32), 8 + rng.random_range(0..40u32));
            let (right, bottom) = (left + rng.random_range(0..6u32), top + rng.random_range(0..6u32));
            // From invisible to far above the noise.
            let height = amplitude * (0.5 + f64::from(n % 20) / 4.0);
            for y in top..=bottom {
                for x in left..=right {
                    image.row_mut(y as usize)[x as usize] = pixel(level + height);
                }
            }
            let mean = pixel(level + height).value();
            let blob = Blob::of_box([left, top, right, bottom]);
            let cluster = Cluster { blob, level: level + 0.45 * height, mean };
            let unit = 0.3 * amplitude + f64::from(T::STEP);
            for (bound, out) in [4.0, f64::MIN].iter().zip(&mut out) {
                let ground = Ring::default().ground(&image, 1.0, &cluster, unit, *bound);
                out.push(ground.and_then(|g| g.score(mean, unit)).filter(|s| *s >= 4.0));
            }
        }
        out
    }

    #[test]
    fn the_quick_bounds_lose_no_blob() {
        let same = |[quick, slow]: [Vec<Option<f64>>; 2]| {
            assert_eq!(quick, slow);
            let n = slow.iter().flatten().count();
            assert!((40..360).contains(&n), "{n} of 400 reach the score: both answers must occur");
        };
        same(scores(100.0, 20.0, |v| v as u8));
        same(scores(3000.0, 500.0, |v| v as u16));
        same(scores(0.5, 0.1, |v| v as f32));
        same(scores(1e9, 2e4, |v| v as f32));
    }

    #[test]
    fn a_roof_below_a_long_target_is_not_in_its_ring() {
        let mut rng = ChaCha8Rng::seed_from_u64(3);
        let ground = |y: usize| if y < 80 { 50 } else { 200 };
        let pixels = (0..160 * 120).map(|i| ground(i / 160) + rng.random_range(0..3u8)).collect();
        let mut image = Image::from_vec(160, 120, pixels).unwrap();
        (50..64).for_each(|y| image.row_mut(y)[60..100].fill(250));
        let cluster = Cluster { blob: Blob::of_box([60, 50, 99, 63]), level: 220.0, mean: 250.0 };
        // 12 px, which end above the roof; half the longer side are 20.
        let found = Ring::default().ground(&image, 1.0, &cluster, 1.0, 4.0).unwrap();
        assert!((found.level - 51.0).abs() < 0.2 && found.score(250.0, 1.0).unwrap() > 80.0, "{found:?}");
        assert_eq!([(1, 1), (12, 9), (40, 14), (63, 35), (90, 80)].map(|(w, h)| margin(w, h)), [3, 6, 12, 17, 40]);
    }

    #[test]
    fn a_plane_is_taken_out_whatever_the_offset() {
        let pixels = (0..40 * 40).map(|i| 5000.0 + 3.0 * (i % 40) as f32 - 2.0 * (i / 40) as f32).collect();
        let mut image = Image::from_vec(40, 40, pixels).unwrap();
        let plane = 5000.0 + 3.0 * 20.5 - 2.0 * 15.0;
        for x in [20, 21] {
            image.row_mut(15)[x] = 5200.0;
        }
        let cluster = Cluster { blob: Blob::of_box([20, 15, 21, 15]), level: 5150.0, mean: 5200.0 };
        let ground = Ring::default().ground(&image, 1.0, &cluster, 1.0, 4.0).unwrap();
        assert!((ground.level - plane).abs() < 1e-2, "{}", ground.level);
        // What is left is nothing, so the score is the height in units of the noise.
        assert!((ground.score(5200.0, 1.0).unwrap() - (5200.0 - plane)).abs() < 0.1);
    }
}
