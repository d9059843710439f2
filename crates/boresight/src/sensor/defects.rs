//! Pixels and columns unlike their neighbours, from the mean and the variance of each pixel over frames.
//!
//! A bad pixel is one of: brighter or darker than the median of its eight neighbours by five times their spread (the largest and the smallest left out, at least the rounding) and
//! by eight deviations of its mean; it never changes while its neighbours do in most frames; it is twenty times as noisy as they, and in many frames. An optical spot is wider than a pixel: one of
//! deviation 0.5 px stands 4.7 times the spread of its neighbours above them, so that it is none. Over a scene that moves the mean is smooth, and defects stand out.
//! A column's offset is the sum of the median differences of neighbouring columns, less a line through [`SPAN`] columns by medians: what is wider is shading.
//! They count if their spread is twice what noise alone makes of it and steps have the same sign in the upper and the lower half of the rows.
//! Limits: clusters of more than two bad pixels; a point sharper than 0.5 px, or an upright edge over half the height, that never moves.

use super::mean_map::MeanMap;
use crate::Image;

/// How many spreads of its neighbours, and deviations of its mean, a bad pixel is off.
const SPREADS: f32 = 5.0;
const DEVIATIONS: f32 = 8.0;
/// Spread of neighbours that rounding alone may hide, in units of the values' distance.
const ROUNDED: f32 = 0.5;
/// Agreement in sign of the steps between columns in the upper and in the lower half of the rows from which they are the columns'.
const ALIKE: f32 = 0.5;
/// Frames from which variances tell anything.
const FRAMES: u32 = 12;
/// Times the neighbours' variance above which a pixel is bad.
const NOISY: f32 = 20.0;
/// Share of the frames over which the unrest of a noisy pixel is spread, at least: what passes over a pixel, or flashes, is no noise.
const OFTEN: f32 = 0.25;
/// Share of the frames in which all neighbours change, so that one that does not, or much more, tells anything.
const RESTLESS: f32 = 0.5;
/// Columns over which offsets are compared.
const SPAN: usize = 31;

/// What is wrong with a sensor.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Defects {
    /// Bad pixels (column, row), row by row.
    pub pixels: Vec<[u32; 2]>,
    /// Offset of each column, counts; empty if they are no more than noise makes.
    pub columns: Vec<f32>,
    /// Pixels of what is drawn on the picture, as `pixels`; dark frames tell nothing of it.
    pub overlay: Vec<[u32; 2]>,
}

impl Defects {
    /// Root mean square of the columns' offsets, counts; 0 without.
    pub fn column_rms(&self) -> f64 {
        let n = self.columns.len().max(1) as f64;
        (self.columns.iter().map(|c| f64::from(*c).powi(2)).sum::<f64>() / n).sqrt()
    }
}

/// Looks for bad pixels and for offsets of columns.
pub fn find_defects(frames: &MeanMap) -> Defects {
    let (mean, variance) = (frames.mean(), frames.variance());
    let (w, h) = (mean.width(), mean.height());
    if w < 3 || h < 3 || frames.n_frames() == 0 {
        return Defects::default();
    }
    let typical = median(&mut variance.as_slice().to_vec());
    let columns = columns(&mean, (typical / frames.n_frames() as f32).sqrt());
    let mut pixels = Vec::new();
    let (step, changes) = (frames.step(), frames.changes());
    let n = frames.n_frames();
    for y in 0..h {
        for x in 0..w {
            let offset = |x: usize| columns.get(x).copied().unwrap_or(0.0);
            let level = neighbours(&mean, x, y, |x, v| v - offset(x));
            let (own, own_noise) = (mean.row(y)[x] - offset(x), variance.row(y)[x]);
            let off = (own - level.middle).abs();
            let spread = (level.high - level.low).max(ROUNDED * step);
            // One frame has no variance. Of light that comes rarely the middle neighbour may have seen none.
            let sd = || (neighbours(&variance, x, y, |_, v| v).middle.max(own_noise) / n as f32).sqrt();
            let is_off = n > 1 && off > SPREADS * spread && off > DEVIATIONS * sd();
            let tells = || n >= FRAMES && neighbours(&changes, x, y, |_, v| v).low > RESTLESS;
            let is_still = changes.row(y)[x] == 0.0 && tells();
            // Of two neighbours one at least is no noisier than all but one of them.
            let beside =
                [variance.row(y)[if x == 0 { 1 } else { x - 1 }], variance.row(if y == 0 { 1 } else { y - 1 })[x]];
            let may_be_noisy = own_noise > NOISY * beside[0].min(beside[1]);
            let is_noisy = may_be_noisy
                && own_noise > NOISY * neighbours(&variance, x, y, |_, v| v).high
                && frames.spread_of_changes(y * w + x) > OFTEN
                && tells();
            if is_off || is_still || is_noisy || !own.is_finite() {
                pixels.push([x as u32, y as u32]);
            }
        }
    }
    Defects { pixels, columns, overlay: Vec::new() }
}

/// The neighbours of a pixel: the second smallest, the middle and the second largest; at the border the smallest and the largest.
struct Around {
    low: f32,
    middle: f32,
    high: f32,
}

fn neighbours(image: &Image<f32>, x: usize, y: usize, of: impl Fn(usize, f32) -> f32) -> Around {
    let mut v = [0.0; 8];
    let mut n = 0;
    for yy in y.saturating_sub(1)..=(y + 1).min(image.height() - 1) {
        for xx in x.saturating_sub(1)..=(x + 1).min(image.width() - 1) {
            if (xx, yy) != (x, y) {
                v[n] = of(xx, image.row(yy)[xx]);
                n += 1;
            }
        }
    }
    let v = &mut v[..n];
    v.sort_unstable_by(f32::total_cmp);
    // At the border one of few may be the other side of an edge.
    let trimmed = usize::from(n == 8);
    Around { low: v[trimmed], middle: 0.5 * (v[(n - 1) / 2] + v[n / 2]), high: v[n - 1 - trimmed] }
}

fn median(v: &mut [f32]) -> f32 {
    if v.is_empty() {
        return 0.0;
    }
    let middle = v.len() / 2;
    *v.select_nth_unstable_by(middle, f32::total_cmp).1
}

/// The value at place `at` of the line through the medians of slopes and of what is left (P. K. Sen, 1968).
fn shading(v: &[f32], at: usize) -> f32 {
    let pairs = (0..v.len()).flat_map(|i| (0..i).map(move |j| (i, j)));
    let slope = median(&mut pairs.map(|(i, j)| (v[i] - v[j]) / (i - j) as f32).collect::<Vec<f32>>());
    let mut rests: Vec<f32> = v.iter().enumerate().map(|(i, v)| v - slope * i as f32).collect();
    median(&mut rests) + slope * at as f32
}

/// Offsets of the columns; empty if noise of this deviation of a pixel's mean explains them, or if the halves of the frame do not agree.
fn columns(mean: &Image<f32>, sd: f32) -> Vec<f32> {
    let (w, h) = (mean.width(), mean.height());
    if w < SPAN || agreement(&steps(mean, 0..h / 2), &steps(mean, h / 2..h)) < ALIKE {
        return Vec::new();
    }
    let mut sum = steps(mean, 0..h);
    for x in 1..w {
        sum[x] += sum[x - 1];
    }
    if !sum.iter().all(|v| v.is_finite()) {
        return Vec::new();
    }
    let offsets: Vec<f32> = (0..w)
        .map(|x| {
            let from = x.saturating_sub(SPAN / 2).min(w - SPAN);
            sum[x] - shading(&sum[from..from + SPAN], x - from)
        })
        .collect();
    // A median of h differences is known to 1.25 √2 sd / √h; over half a span of columns they add up as a random walk.
    let step = 1.77 * sd / (h as f32).sqrt();
    let expected = step * (SPAN as f32 / 4.0).sqrt();
    let rms = (offsets.iter().map(|v| v * v).sum::<f32>() / w as f32).sqrt();
    if rms > 2.0 * expected.max(1e-6) { offsets } else { Vec::new() }
}

/// Medians over some of the rows of the differences between each column and the one before; 0 for the first.
fn steps(mean: &Image<f32>, rows: std::ops::Range<usize>) -> Vec<f32> {
    let step = |x: usize| {
        let mut differences: Vec<f32> = rows.clone().map(|y| mean.row(y)[x] - mean.row(y)[x - 1]).collect();
        median(&mut differences)
    };
    (0..mean.width()).map(|x| if x == 0 { 0.0 } else { step(x) }).collect()
}

/// How often two series lie on the same side of their medians less how often on different ones, -1..=1: an edge in one of them counts once.
fn agreement(a: &[f32], b: &[f32]) -> f32 {
    let (middle_a, middle_b) = (median(&mut a.to_vec()), median(&mut b.to_vec()));
    let side = |v: f32, middle: f32| {
        if v > middle {
            1.0
        } else if v < middle {
            -1.0
        } else {
            0.0
        }
    };
    a.iter().zip(b).map(|(a, b)| side(*a, middle_a) * side(*b, middle_b)).sum::<f32>() / a.len().max(1) as f32
}

#[cfg(test)]
mod tests;
