//! The ring around a blob's box: a plane through it, the spread about the plane, and how far the blob stands clear.
//!
//! The ring begins one pixel outside the box (blurred edges) and is as wide as half the blob, at least 3 px. Large rings are
//! sampled evenly with at most about 600 pixels. The plane takes a gradient of the sky or of the optics out.

use super::highest::Highest;
use super::sums::Sums;
use super::sweep::{Blob, band};
use crate::Image;
use crate::vision::pixel::Pixel;
use crate::vision::threshold::Side;
use nalgebra::{Matrix3, Vector3};

/// Pixels of a ring looked at, at most and at least; a plane has three parameters.
const MAX_SAMPLES: f64 = 600.0;
const MIN_SAMPLES: usize = 8;

/// Share of the spread of a ring's edge, seen at twelve pairs, that is sure: it is known to 28 %. The error of the ground, a quarter of the spread, and the height above
/// the ring's 99 % point, more than twice the spread, are not counted.
const EDGE_SPREAD: f64 = 0.5;

/// A blob that passed, with what its ring says.
#[derive(Clone, Debug)]
pub struct Candidate {
    pub blob: Blob,
    pub level: f64,
    pub background: f64,
    pub peak: f64,
    pub score: f64,
    /// Place in the order of the levels and, within one, of the rows.
    pub number: usize,
}

/// What is known of a frame before its blobs are judged; without the highest values nothing is left out, which is what tests compare with.
#[derive(Debug)]
pub struct Known<'a> {
    pub sums: &'a Sums,
    pub highest: Option<&'a Highest>,
}

/// Scratch of the ring's samples.
#[derive(Debug, Default)]
pub struct Ring {
    /// x, y from the blob's middle, value.
    samples: Vec<(f64, f64, f64)>,
    residuals: Vec<f64>,
}

impl Ring {
    /// Compares a blob with its surroundings; `None` if there are too few of them, or the blob does not stand clear or cannot reach `min_score`.
    pub fn judge<T: Pixel>(
        &mut self,
        image: &Image<T>,
        known: &Known<'_>,
        side: Side,
        level: f64,
        blob: &Blob,
        noise: f64,
        min_score: f64,
    ) -> Option<Candidate> {
        let sign = if side == Side::Bright { 1.0 } else { -1.0 };
        let (w, h) = (blob.right - blob.left + 1, blob.bottom - blob.top + 1);
        let margin = (w.max(h) / 2).max(3) as usize;
        let inner = (blob.left as usize - 1, blob.top as usize - 1, blob.right as usize + 1, blob.bottom as usize + 1);
        let x0 = inner.0.saturating_sub(margin);
        let y0 = inner.1.saturating_sub(margin);
        let x1 = (inner.2 + margin).min(image.width() - 1);
        let y1 = (inner.3 + margin).min(image.height() - 1);
        let (cx, cy) = (f64::from(blob.left + blob.right) / 2.0, f64::from(blob.top + blob.bottom) / 2.0);
        let least_unit = noise + f64::from(T::STEP);
        let stride = ((((x1 - x0 + 1) * (y1 - y0 + 1)) as f64 / MAX_SAMPLES).sqrt() as usize).max(1);
        let whole = inner.0 >= margin && inner.1 >= margin && inner.2 + margin == x1 && inner.3 + margin == y1;
        // No mean is above the largest value near.
        let most = known
            .highest
            .map_or(f64::INFINITY, |h| f64::from(h.near([blob.left, blob.top, blob.right, blob.bottom]).next_up()));
        let edge = outer_edge(image, side, level, [x0, y0, x1, y1])?;
        let mut bar = edge.ground + min_score * (least_unit + EDGE_SPREAD * edge.spread);
        if known.highest.is_none() {
            bar = f64::NEG_INFINITY;
        }
        if most < bar {
            return None;
        }
        let (mean, peak) = inside(image, side, level, blob)?;
        if sign * mean < bar {
            return None;
        }
        // Of a whole ring the plane's height in the middle is the mean. The rest of the judgement only lowers the score.
        if stride == 1
            && whole
            && let (Some(all), Some(middle)) =
                (known.sums.of([x0, y0, x1, y1]), known.sums.of([inner.0, inner.1, inner.2, inner.3]))
        {
            let n = ((x1 - x0 + 1) * (y1 - y0 + 1) - (inner.2 - inner.0 + 1) * (inner.3 - inner.1 + 1)) as f64;
            let error = 2.0 * known.sums.error() / n;
            bar = sign * (all - middle) / n - error + min_score * least_unit * (1.0 - 1e-9);
        }
        if sign * mean < bar {
            return None;
        }
        self.samples.clear();
        for y in (y0..=y1).step_by(stride) {
            let row = image.row(y);
            let beside = y >= inner.1 && y <= inner.3;
            let mut x = x0;
            while x <= x1 {
                let v = sign * row[x].value();
                if !(beside && x >= inner.0 && x <= inner.2) && v.is_finite() {
                    self.samples.push((x as f64 - cx, y as f64 - cy, v));
                }
                x += stride;
            }
        }
        if self.samples.len() < MIN_SAMPLES {
            return None;
        }
        let plane = fit(&self.samples)?;
        self.residuals.clear();
        self.residuals.extend(self.samples.iter().map(|&(x, y, v)| v - plane[0] - plane[1] * x - plane[2] * y));
        let n = self.residuals.len();
        let spread = (self.residuals.iter().map(|r| r * r).sum::<f64>() / n as f64).sqrt();
        let at = (n - 1) * 99 / 100;
        let (_, &mut clear, _) = self.residuals.select_nth_unstable_by(at, f64::total_cmp);
        let height = sign * mean - plane[0] - clear.max(0.0);
        if height <= 0.0 {
            return None;
        }
        let unit = least_unit + spread;
        let score = if unit > 0.0 { height / unit } else { f64::from(f32::MAX) };
        Some(Candidate { blob: *blob, level, background: sign * plane[0], peak, score, number: 0 })
    }
}

/// What 24 points of a ring's outer edge say; values times the sign of the side.
#[derive(Clone, Copy, Debug)]
struct Edge {
    ground: f64,
    spread: f64,
}

/// A quick look at the outer edge; `None` unless most of it lies on the other side of the level. The points face each other in pairs: of a pair's mean a plane leaves nothing
/// but its height in the middle.
fn outer_edge<T: Pixel>(image: &Image<T>, side: Side, level: f64, [x0, y0, x1, y1]: [usize; 4]) -> Option<Edge> {
    let (low, high) = band::<T>(side, level)?;
    let (mut n, mut pairs) = (0, [0.0f64; 12]);
    let mut point = |x: usize, y: usize| {
        let p = image.row(y)[x];
        n += usize::from(p >= low && p <= high);
        p.value()
    };
    for i in 0..6 {
        let (x, y) = (x0 + (x1 - x0) * i / 6, y0 + (y1 - y0) * (i + 1) / 6);
        pairs[2 * i] = point(x, y0) + point(x1 - (x - x0), y1);
        pairs[2 * i + 1] = point(x0, y) + point(x1, y1 - (y - y0));
    }
    if n > 12 {
        return None;
    }
    let sign = if side == Side::Bright { 0.5 } else { -0.5 };
    pairs.iter_mut().for_each(|p| *p *= sign);
    if !pairs.iter().all(|p| p.is_finite()) {
        return Some(Edge { ground: f64::NEG_INFINITY, spread: 0.0 });
    }
    pairs.sort_unstable_by(f64::total_cmp);
    // The third and the tenth of twelve normal values lie 1.58 deviations apart; a pair's mean has a variance of half a point's.
    let spread = std::f64::consts::SQRT_2 * (pairs[9] - pairs[2]) / 1.58;
    Some(Edge { ground: 0.5 * (pairs[5] + pairs[6]), spread })
}

/// Mean and extreme of the pixels beyond the level inside the blob's box.
fn inside<T: Pixel>(image: &Image<T>, side: Side, level: f64, blob: &Blob) -> Option<(f64, f64)> {
    let (low, high) = band::<T>(side, level)?;
    let (mut n, mut sum) = (0u32, 0.0);
    let (mut least, mut most) = (f64::INFINITY, f64::NEG_INFINITY);
    for y in blob.top..=blob.bottom {
        let row = image.row(y as usize).get(blob.left as usize..=blob.right as usize)?;
        for &p in row.iter().filter(|p| **p >= low && **p <= high) {
            let v = p.value();
            n += 1;
            sum += v;
            least = least.min(v);
            most = most.max(v);
        }
    }
    (n > 0).then(|| (sum / f64::from(n), if side == Side::Bright { most } else { least }))
}

/// Least-squares plane v = p0 + p1 x + p2 y.
fn fit(samples: &[(f64, f64, f64)]) -> Option<Vector3<f64>> {
    // The sums of the normal equations one by one: the products with 1 cost nothing, and each pair is summed once.
    let [mut sx, mut sy, mut sxx, mut sxy, mut syy, mut sv, mut sxv, mut syv] = [0.0f64; 8];
    for &(x, y, v) in samples {
        sx += x;
        sy += y;
        sxx += x * x;
        sxy += x * y;
        syy += y * y;
        sv += v;
        sxv += x * v;
        syv += y * v;
    }
    let a = Matrix3::new(samples.len() as f64, sx, sy, sx, sxx, sxy, sy, sxy, syy);
    let b = Vector3::new(sv, sxv, syv);
    a.cholesky().map(|c| c.solve(&b))
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    /// The scores of random blobs in noise about `level`, with the quick bound and without it.
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
            let blob = Blob::of_box([left, top, right, bottom]);
            let (mut sums, mut highest) = (Sums::default(), Highest::default());
            sums.read(&image);
            highest.read(&image, 1.0);
            let quick = Known { sums: &sums, highest: Some(&highest) };
            let nothing = Known { sums: &Sums::default(), highest: None };
            for (known, out) in [quick, nothing].iter().zip(&mut out) {
                let cut = level + 0.45 * height;
                let found = Ring::default().judge(&image, known, Side::Bright, cut, &blob, 0.3 * amplitude, 4.0);
                out.push(found.map(|c| c.score).filter(|s| *s >= 4.0));
            }
        }
        out
    }

    #[test]
    fn the_quick_bound_loses_no_blob() {
        let same = |[quick, slow]: [Vec<Option<f64>>; 2]| {
            assert_eq!(quick, slow);
            let n = slow.iter().flatten().count();
            assert!((40..360).contains(&n), "{n} of 400 reach the score: both answers must occur");
        };
        same(scores(100.0, 20.0, |v| v as u8));
        same(scores(3000.0, 500.0, |v| v as u16));
        same(scores(0.5, 0.1, |v| v as f32));
        // Far from zero: sums of a frame round by more than the blobs are high.
        same(scores(1e9, 2e4, |v| v as f32));
        same(scores(1e16, 3e10, |v| v as f32));
    }
}
