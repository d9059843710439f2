//! How large a difference the ground itself makes between a frame and a steadied earlier one.
//!
//! Source: our own. The difference of a pixel of the ground has the variance a + b G: a of the pixels' noise, b (px²) of the registration's error, of
//! interpolation and of small parallax, G the squared gradient, the largest of the 3 x 3 pixels around in both frames. a and b are fitted to medians of |D| in
//! [`BINS`] bins of G, so that targets hardly count. Where the ground does not lie in the plane (a near house, trees) or moves (leaves), that is too little: of every tile
//! the [`TAIL`] quantile of |D| / √(a + b G), over that of a normal deviate, is its own factor, and of the nine tiles around the [`RANK`]-th largest counts, so
//! that a target in one or two of them does not hide itself. It never falls below 1. Pixels that an encoder copied have no say in a and b ([`super::copied`]); those that it draws anew have
//! a heavier tail than a normal deviate's (1.2 to 1.6 times at the [`FAR_TAIL`] quantile): the median of the tiles' is the least factor then.
//! Symbols: D difference (counts); z = D / (factor √(a + b G)).
//! Limits: a target that covers a fifth of three neighbouring tiles raises its own threshold; tiles are a sixteenth of the frame's longer side, and 20 px at least.

use super::copied::Changes;
use crate::Image;

/// A pixel is a copy if it differs by less than this share of the rounding's deviation, or of the noise's.
const COPIED: f32 = 0.1;
/// Bins of the gradient.
const BINS: usize = 12;
/// Pixels sampled for a and b, about.
const SAMPLES: usize = 6000;
/// Deviation over the median of the magnitude of a normal deviate.
const MAD: f32 = 1.4826;
/// The quantile of a tile, and that of the magnitude of a normal deviate.
const TAIL: f64 = 0.8;
const TAIL_SD: f32 = 1.2816;
/// The same far out, for pixels that an encoder drew anew, and how many of a tile tell it.
const FAR_TAIL: f64 = 0.95;
const FAR_TAIL_SD: f32 = 1.96;
const LEAST_CHANGED: usize = 20;
/// Of nine tiles, counted from the largest.
const RANK: usize = 2;
/// Tiles along the longer side of the frame.
const TILES: usize = 16;
/// Smaller tiles have too few pixels of their own for a quantile beside a small target, px.
const LEAST_TILE_PX: usize = 20;
/// Pixels sampled of a tile, about.
const TILE_SAMPLES: usize = 200;

/// The noise of one difference.
#[derive(Clone, Debug, Default)]
pub(super) struct GroundNoise {
    samples: Vec<(f32, f32)>,
    values: Vec<f32>,
    changes: Changes,
    /// The pixels' variance when it was last seen of those that are no copies; the encoder goes on with it where nothing changes.
    of_changed: f32,
    /// The same of their tail beside that of a normal deviate; 0 where none was seen.
    tail_of_changed: f32,
    tails: Vec<f32>,
    raw: Vec<f32>,
    /// The factors of the tiles, row by row.
    factors: Vec<f32>,
    tile_px: usize,
    tiles_x: usize,
}

/// Squared gradients, each the largest of 3 x 3: central differences.
pub(super) fn gradients(image: &Image<f32>, line: &mut Vec<f32>, out: &mut Image<f32>) {
    let (w, h) = (image.width(), image.height());
    out.reset(w, h, 0.0);
    if w < 3 || h < 3 {
        return;
    }
    line.clear();
    line.resize(3 * w, 0.0);
    // Rows of the largest of three, the last three of them.
    for y in 1..h {
        let place = (y % 3) * w;
        if y + 1 < h {
            row_gradients([image.row(y - 1), image.row(y), image.row(y + 1)], &mut line[place..][..w]);
        } else {
            line[place..][..w].fill(0.0);
        }
        let (a, rest) = line.split_at(w);
        let (b, c) = rest.split_at(w);
        largest(a, b, c, out.row_mut(y - 1));
    }
    out.as_mut_slice().copy_within((h - 2) * w..(h - 1) * w, (h - 1) * w);
}

widest! {
    fn row_gradients(rows: [&[f32]; 3], out: &mut [f32]) {
        let n = out.len();
        let (above, row, below) = (&rows[0][..n], &rows[1][..n], &rows[2][..n]);
        out.fill(0.0);
        for x in 1..n - 1 {
            let (gx, gy) = (0.5 * (row[x + 1] - row[x - 1]), 0.5 * (below[x] - above[x]));
            out[x] = gx * gx + gy * gy;
        }
    }
}

widest! {
    fn largest(a: &[f32], b: &[f32], c: &[f32], out: &mut [f32]) {
        let n = out.len();
        let (a, b, c) = (&a[..n], &b[..n], &c[..n]);
        let column = |x: usize| a[x].max(b[x]).max(c[x]);
        out[0] = column(0).max(column(1));
        out[n - 1] = column(n - 1).max(column(n - 2));
        for x in 1..n - 1 {
            out[x] = column(x - 1).max(column(x)).max(column(x + 1));
        }
    }
}

impl GroundNoise {
    /// Turns the differences of `now` from the covered frame in `z` (its pixels come in, NaN where it is not seen) into deviations of the ground's noise, but for the
    /// tiles' factors; `rounding` is the variance of the pixels' rounding, `least` the smallest difference that counts.
    pub fn judge(
        &mut self,
        now: &Image<f32>,
        gradients: [&Image<f32>; 2],
        z: &mut Image<f32>,
        rounding: f32,
        least: f32,
    ) {
        let n = now.as_slice().len();
        let step = (n / SAMPLES).max(1);
        // A step that divides the width would sample columns.
        let step = if now.width().is_multiple_of(step) { step + 1 } else { step };
        let [own, other] = gradients.map(|g| g.as_slice());
        let offset = self.offset(now.as_slice(), z.as_slice(), step);
        self.samples.clear();
        self.samples.reserve(n / step + 1);
        self.changes.begin(now.width(), now.height());
        let copied = COPIED * rounding.sqrt();
        let pixels = now.as_slice().iter().zip(z.as_slice()).zip(own.iter().zip(other)).enumerate().step_by(step);
        for (i, ((a, b), (g, h))) in pixels {
            let (g, d) = (g.max(*h), (a - b - offset).abs());
            if g.is_finite() && d.is_finite() {
                self.samples.push((g, d));
                self.changes.add(i, d > copied);
            }
        }
        let has_copies = self.changes.leave_copies();
        let drawn_anew = has_copies && self.changes.are_everywhere();
        if drawn_anew {
            self.samples.retain(|s| s.1 > copied);
        }
        let (a, b) = fit(&mut self.samples, &mut self.values, rounding);
        match (drawn_anew, has_copies) {
            (true, _) => self.of_changed = a,
            // Where nothing is a copy the pixels tell their noise themselves.
            (_, false) => (self.of_changed, self.tail_of_changed) = (0.0, 0.0),
            _ => {}
        }
        let a = a.max(self.of_changed);
        for y in 0..now.height() {
            let w = now.width();
            let row = y * w..(y + 1) * w;
            deviations(now.row(y), &own[row.clone()], &other[row], [offset, a, b], z.row_mut(y));
        }
        self.measure_tiles(z, drawn_anew);
        if least > 0.0 {
            let pixels = z.as_mut_slice().iter_mut().zip(own.iter().zip(other));
            pixels.filter(|(z, (g, h))| z.abs() * (a + b * g.max(**h)).sqrt() < least).for_each(|(z, _)| *z = 0.0);
        }
    }

    /// The median difference: the light's change.
    fn offset(&mut self, now: &[f32], covered: &[f32], step: usize) -> f32 {
        self.values.clear();
        self.values.reserve(now.len() / step + 1);
        self.values.extend(now.iter().zip(covered).step_by(step).map(|(a, b)| a - b).filter(|d| d.is_finite()));
        median(&mut self.values)
    }

    /// Measures the tiles' factors; if an encoder has drawn pixels anew all over, also the tail of those.
    fn measure_tiles(&mut self, z: &Image<f32>, drawn_anew: bool) {
        let (w, h) = (z.width(), z.height());
        self.tile_px = w.max(h).div_ceil(TILES).max(LEAST_TILE_PX);
        let t = self.tile_px;
        self.tiles_x = w.div_ceil(t);
        let tiles_y = h.div_ceil(t);
        self.raw.clear();
        self.tails.clear();
        for ty in 0..tiles_y {
            for tx in 0..self.tiles_x {
                let (columns, rows) = (tx * t..((tx + 1) * t).min(w), ty * t..((ty + 1) * t).min(h));
                let step = ((columns.len() * rows.len()) / TILE_SAMPLES).max(1);
                self.values.clear();
                let mut skip = 0;
                for y in rows {
                    let row = &z.row(y)[columns.clone()];
                    let taken = row.iter().skip(skip).step_by(step).map(|v| v.abs()).filter(|v| v.is_finite());
                    self.values.extend(taken);
                    // The phase goes on from row to row.
                    skip = (skip + step - row.len() % step) % step;
                }
                let place = (self.values.len() as f64 * TAIL) as usize;
                let tail = match self.values.len() {
                    0 => 0.0,
                    _ => *self.values.select_nth_unstable_by(place, f32::total_cmp).1,
                };
                self.raw.push((tail / TAIL_SD).max(1.0));
                if drawn_anew {
                    self.values.retain(|v| *v > COPIED);
                    if self.values.len() >= LEAST_CHANGED {
                        let place = (self.values.len() as f64 * FAR_TAIL) as usize;
                        self.tails.push(*self.values.select_nth_unstable_by(place, f32::total_cmp).1 / FAR_TAIL_SD);
                    }
                }
            }
        }
        if !self.tails.is_empty() {
            self.tail_of_changed = median(&mut self.tails).max(1.0);
        }
        self.factors.clear();
        for ty in 0..tiles_y {
            for tx in 0..self.tiles_x {
                let mut around = [0.0f32; 9];
                for (i, v) in around.iter_mut().enumerate() {
                    // The border's tiles stand for those beyond.
                    let x = (tx + i % 3).saturating_sub(1).min(self.tiles_x - 1);
                    let y = (ty + i / 3).saturating_sub(1).min(tiles_y - 1);
                    *v = self.raw[y * self.tiles_x + x];
                }
                around.sort_unstable_by(|a, b| b.total_cmp(a));
                self.factors.push(around[RANK].max(self.tail_of_changed));
            }
        }
    }

    /// The factors of the tiles that row `y` crosses, and their width, px.
    pub fn factors(&self, y: usize) -> (&[f32], usize) {
        let row = y / self.tile_px.max(1) * self.tiles_x;
        (self.factors.get(row..row + self.tiles_x).unwrap_or(&[]), self.tile_px)
    }
}

widest! {
    fn deviations(now: &[f32], own: &[f32], other: &[f32], numbers: [f32; 3], z: &mut [f32]) {
        let n = z.len();
        let (now, own, other) = (&now[..n], &own[..n], &other[..n]);
        let [offset, a, b] = numbers;
        for x in 0..n {
            z[x] = (now[x] - z[x] - offset) / (a + b * own[x].max(other[x])).sqrt();
        }
    }
}

fn median(values: &mut [f32]) -> f32 {
    if values.is_empty() {
        return 0.0;
    }
    let middle = values.len() / 2;
    *values.select_nth_unstable_by(middle, f32::total_cmp).1
}

/// a and b of the variance a + b G, by least squares on the relative errors of the bins' variances; neither is negative.
fn fit(samples: &mut [(f32, f32)], values: &mut Vec<f32>, rounding: f32) -> (f32, f32) {
    let floor = rounding.max(f32::MIN_POSITIVE.sqrt());
    if samples.len() < 4 * BINS {
        return (floor, 1.0);
    }
    samples.sort_unstable_by(|p, q| p.0.total_cmp(&q.0).then(p.1.total_cmp(&q.1)));
    let mut points = [(0.0f64, 0.0f64); BINS];
    for (i, point) in points.iter_mut().enumerate() {
        let bin = &samples[i * samples.len() / BINS..(i + 1) * samples.len() / BINS];
        values.clear();
        values.extend(bin.iter().map(|s| s.1));
        let g = bin.iter().map(|s| f64::from(s.0)).sum::<f64>() / bin.len() as f64;
        *point = (g, f64::from((MAD * median(values)).powi(2).max(floor)));
    }
    // Minimise Σ ((a + b g - v) / v)².
    let mut s = [0.0f64; 5];
    for (g, v) in points {
        let terms = [1.0 / (v * v), g / (v * v), g * g / (v * v), 1.0 / v, g / v];
        s.iter_mut().zip(terms).for_each(|(s, t)| *s += t);
    }
    let determinant = s[0] * s[2] - s[1] * s[1];
    let (mut a, mut b) = if determinant > 1e-12 * s[0] * s[2] {
        ((s[3] * s[2] - s[4] * s[1]) / determinant, (s[0] * s[4] - s[1] * s[3]) / determinant)
    } else {
        (s[3] / s[0], 0.0)
    };
    if b < 0.0 {
        (a, b) = (s[3] / s[0], 0.0);
    } else if a < 0.0 {
        (a, b) = (0.0, s[4] / s[2]);
    }
    ((a as f32).max(floor), b as f32)
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;
    use rand_distr::{Distribution, StandardNormal};

    #[test]
    fn the_noise_of_pixels_and_the_error_of_the_place_are_told_apart() {
        let mut rng = ChaCha8Rng::seed_from_u64(4);
        let mut normal = || -> f32 { StandardNormal.sample(&mut rng) };
        // Variance 4 and 0.01 px²; a tenth are targets.
        let mut samples: Vec<(f32, f32)> = (0..6000)
            .map(|i| {
                let g = (i % 100) as f32 * (i % 100) as f32;
                let strange = if i % 10 == 3 { 80.0 } else { 0.0 };
                (g, ((4.0 + 0.01 * g).sqrt() * normal() + strange).abs())
            })
            .collect();
        let (a, b) = fit(&mut samples, &mut Vec::new(), 0.0);
        // A tenth beyond shifts the median of |z| from 0.674 to 0.765, so the variances by 1.29.
        assert!((4.0..6.5).contains(&a) && (0.010..0.016).contains(&b), "{a} {b}");
        assert_eq!(fit(&mut [], &mut Vec::new(), 0.25), (0.25, 1.0));
    }

    #[test]
    fn a_restless_quarter_has_its_own_threshold_and_a_small_target_has_none() {
        let mut rng = ChaCha8Rng::seed_from_u64(5);
        let mut normal = || -> f32 { StandardNormal.sample(&mut rng) };
        let mut z = Image::filled(320, 320, 0.0f32);
        for y in 0..320 {
            for (x, v) in z.row_mut(y).iter_mut().enumerate() {
                *v = if x < 160 && y < 160 { 5.0 } else { 1.0 } * normal();
                if (240..246).contains(&x) && (240..246).contains(&y) {
                    *v += 50.0;
                }
            }
        }
        let mut noise = GroundNoise::default();
        noise.measure_tiles(&z, false);
        let at = |x: usize, y: usize| {
            let (row, tile_px) = noise.factors(y);
            row[x / tile_px]
        };
        assert!((4.3..6.3).contains(&at(60, 60)), "{}", at(60, 60));
        assert!(at(242, 242) < 1.3 && at(300, 100) < 1.3);
    }

    /// A frame and the one before it, of which an encoder has drawn every `every`-th block of 8 x 8 anew with a noise of one count, and how many pixels lie beyond four deviations.
    fn beyond(every: usize) -> usize {
        let mut rng = ChaCha8Rng::seed_from_u64(7);
        let mut normal = || -> f32 { StandardNormal.sample(&mut rng) };
        let now = Image::filled(320, 320, 100.0f32);
        let mut z = now.clone();
        for y in 0..320 {
            for (x, v) in z.row_mut(y).iter_mut().enumerate() {
                let noise = normal();
                *v += if (x / 8 + 3 * (y / 8)).is_multiple_of(every) { noise } else { 0.0 };
            }
        }
        let flat = Image::filled(320, 320, 0.0f32);
        let mut noise = GroundNoise::default();
        noise.judge(&now, [&flat, &flat], &mut z, 0.0234, 0.0);
        let row = |y: usize| {
            let (factors, tile_px) = noise.factors(y);
            let far = |(x, z): (usize, &f32)| z.abs() > 4.0 * factors[x / tile_px];
            z.row(y).iter().enumerate().filter(|p| far(*p)).count()
        };
        (0..320).map(row).sum()
    }

    #[test]
    fn the_noise_of_a_frame_that_an_encoder_mostly_copied_is_that_of_the_pixels_it_drew_anew() {
        // Beyond four deviations lie 6.3e-5 of a normal deviate's values: 6 of all pixels, fewer of those drawn anew.
        for every in [1, 2, 5, 7] {
            assert!(beyond(every) <= 12, "{every}: {}", beyond(every));
        }
    }

    #[test]
    fn the_smallest_difference_that_counts_lowers_no_threshold() {
        let mut rng = ChaCha8Rng::seed_from_u64(8);
        let mut normal = || -> f32 { StandardNormal.sample(&mut rng) };
        let now = Image::filled(160, 160, 0.0f32);
        let mut other = now.clone();
        other.as_mut_slice().iter_mut().for_each(|v| *v = 2.0 * normal());
        let flat = Image::filled(160, 160, 0.0f32);
        let factors = |least: f32| {
            let (mut noise, mut z) = (GroundNoise::default(), other.clone());
            noise.judge(&now, [&flat, &flat], &mut z, 0.0234, least);
            let small = z.as_slice().iter().filter(|z| **z == 0.0).count();
            (noise.factors(80).0.to_vec(), small)
        };
        assert_eq!(factors(3.0).0, factors(0.0).0);
        assert!(factors(3.0).1 > 160 * 160 / 2 && factors(0.0).1 <= 1, "the median itself is the offset");
    }

    #[test]
    fn gradients_are_the_largest_around() {
        let mut image = Image::filled(12, 9, 1.0f32);
        image.row_mut(4)[6] = 21.0;
        let (mut out, mut line) = (Image::default(), Vec::new());
        gradients(&image, &mut line, &mut out);
        // Beside the lone pixel the central difference is 10, and one further it is seen from around.
        assert_eq!((out.row(4)[5], out.row(3)[4], out.row(2)[6], out.row(0)[0]), (100.0, 100.0, 100.0, 0.0));
        assert_eq!(out.row(1)[6], 0.0);
    }
}
