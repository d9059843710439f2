//! Where a key frame's patch lies in a later frame, sub-pixel.
//!
//! Source: block matching by the sum of absolute differences, then the inverse compositional form of B. Lucas, T. Kanade (IJCAI 1981) after
//! S. Baker, I. Matthews, *International Journal of Computer Vision* 56, 2004, for a shift.
//! How: the patch is turned and zoomed as predicted, looked for within [`SEARCH`] px of the predicted place, and refined by Gauss-Newton steps on the
//! differences less their mean (a change of brightness is no motion). Where the refinement leaves the pixel, a parabola through the
//! best sum and its neighbours stands in.
//! Symbols: T template; g its gradient; H = sum of g gᵀ; e = image - T; step = H^-1 sum of g e. Units: reduced px.
//! Limits: nothing is said at the border of the search or of the image; within the patch only the predicted turn and zoom.

use super::key_frame::{PATCH, Patch};
use crate::{Image, Similarity};
use nalgebra::{Matrix2, Vector2};

/// How far around the predicted place a patch is looked for, reduced px.
pub(super) const SEARCH: i64 = 10;
const SIDE: usize = 2 * SEARCH as usize + 1;
/// Columns of the search, filled up to whole vectors.
const LANES: usize = SIDE.next_multiple_of(8);
/// Rows and columns of the pixels in which a patch is looked for.
const TALL: usize = SIDE + PATCH - 1;
const WIDE: usize = LANES + PATCH - 1;
/// Gauss-Newton steps at most; three reach 0.01 px from half a pixel away.
const STEPS: usize = 6;
/// A shorter step is the last, reduced px.
const LAST_STEP: f64 = 0.003;

pub(super) type Block = [[f32; PATCH]; PATCH];
type Window = [[f32; WIDE]; TALL];

/// The sums of differences around the place where a patch is predicted.
#[derive(Clone, Debug, Default)]
pub(super) struct Search {
    /// Column and row of the first one; none where nothing was looked for.
    first: Option<(i64, i64)>,
    costs: [[f32; LANES]; SIDE],
    /// The least of them, and its row and column among them.
    best: (f32, usize, usize),
}

impl Search {
    /// Looks for a patch around its predicted place and returns what it should look like; `None`, and nothing looked for, where that needs pixels outside the key frame or lies far outside of the frame.
    pub fn take(&mut self, key: &Image<f32>, now: &Image<f32>, p: Patch, predicted: &Similarity) -> Option<Block> {
        self.first = None;
        let template = template(key, p, predicted)?;
        let half = 0.5 * (PATCH - 1) as f64;
        let corner = predicted.apply(p.middle()) - Vector2::new(half, half);
        let (w, h) = (now.width() as f64, now.height() as f64);
        // Far outside there is nothing to find, and no number too large for a whole one.
        if !(corner.x.abs() < 2.0 * w && corner.y.abs() < 2.0 * h) {
            return None;
        }
        let first = (corner.x.round() as i64 - SEARCH, corner.y.round() as i64 - SEARCH);
        self.first = Some(first);
        differences(&template, &window(now, first), &mut self.costs);
        self.best = (f32::INFINITY, 0, 0);
        for (i, line) in self.costs.iter().enumerate() {
            for (j, &cost) in line[..SIDE].iter().enumerate() {
                if cost < self.best.0 {
                    self.best = (cost, i, j);
                }
            }
        }
        Some(template)
    }

    /// Where the middle of the patch lies that was looked for.
    pub fn place(&self, template: &Block, now: &Image<f32>) -> Option<Vector2<f64>> {
        let (first, costs, (cost, i, j)) = (self.first?, &self.costs, self.best);
        if !cost.is_finite() || i == 0 || j == 0 || i + 1 == SIDE || j + 1 == SIDE {
            return None;
        }
        let vertex = |before: f32, at: f32, after: f32| -> Option<f64> {
            let bend = before - 2.0 * at + after;
            (bend.is_finite() && bend > 0.0).then(|| f64::from(0.5 * (before - after) / bend).clamp(-0.5, 0.5))
        };
        let dx = vertex(costs[i][j - 1], cost, costs[i][j + 1])?;
        let dy = vertex(costs[i - 1][j], cost, costs[i + 1][j])?;
        let (x, y) = (first.0 + j as i64, first.1 + i as i64);
        let part = refine(template, now, (x, y)).unwrap_or(Vector2::new(dx, dy));
        let half = 0.5 * (PATCH - 1) as f64;
        Some(Vector2::new(x as f64 + half, y as f64 + half) + part)
    }
}

/// Where the middle of a key frame's patch lies now; `predicted` takes the key frame's points to their places now.
pub(super) fn find(key: &Image<f32>, now: &Image<f32>, p: Patch, predicted: &Similarity) -> Option<Vector2<f64>> {
    let mut search = Search::default();
    let template = search.take(key, now, p, predicted)?;
    search.place(&template, now)
}

/// What a patch says of a motion that it did not choose.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Vote {
    For,
    /// It looks clearly more like another place than like its own.
    Against,
    /// It lies where it lay in the last frame.
    Still,
    Neither,
}

/// Times that the sum of differences at a patch's place by a motion is larger than at the best place, from which on it speaks against the motion: a sum over 144 pixels of noise
/// deviates by 6 %, and the least of 441 lies three deviations below.
const CLEARLY: f32 = 1.5;

impl Search {
    /// Whether a patch lies at `place`, where a motion has its middle, within `agree_px`; what seems to lie where it lay in the last frame, at `still`, votes neither for nor against it: a codec's copies and a
    /// sensor's pattern stand.
    pub fn vote(&self, [place, still]: [Vector2<f64>; 2], agree_px: f64) -> Vote {
        let Some(first) = self.first else { return Vote::Neither };
        let half = 0.5 * (PATCH - 1) as f64;
        let at =
            |i: usize, j: usize| Vector2::new((first.0 + j as i64) as f64 + half, (first.1 + i as i64) as f64 + half);
        // Those within a pixel and a half, of rows and columns that begin below.
        let begin = |place: f64, first: i64| (place - half - first as f64 - 2.0).clamp(0.0, SIDE as f64) as usize;
        let (top, left) = (begin(place.y, first.1), begin(place.x, first.0));
        let mut own = f32::INFINITY;
        for (i, line) in self.costs.iter().enumerate().skip(top).take(5) {
            for (j, cost) in line[..SIDE].iter().enumerate().skip(left).take(5) {
                if (at(i, j) - place).amax() <= 1.5 {
                    own = own.min(*cost);
                }
            }
        }
        let (least, i, j) = self.best;
        // A whole place is right to half a pixel.
        let is_near = |p: Vector2<f64>| (at(i, j) - p).amax() <= agree_px + 0.5;
        if !(least.is_finite() && own.is_finite()) {
            Vote::Neither
        } else if is_near(still) && !is_near(place) {
            Vote::Still
        } else if is_near(place) {
            Vote::For
        } else if own > CLEARLY * least {
            Vote::Against
        } else {
            Vote::Neither
        }
    }
}

/// As [`find`] without a search: where the middle of a key frame's patch lies now, if it lies within a pixel of the predicted place; `to_now` is the turn and
/// zoom there.
pub(super) fn find_near(
    key: &Image<f32>,
    now: &Image<f32>,
    p: Patch,
    predicted: Vector2<f64>,
    to_now: &Similarity,
) -> Option<Vector2<f64>> {
    let template = template(key, p, to_now)?;
    let half = Vector2::repeat(0.5 * (PATCH - 1) as f64);
    let corner = predicted - half;
    let (w, h) = (now.width() as f64, now.height() as f64);
    if !(corner.x >= 0.0 && corner.y >= 0.0 && corner.x < w && corner.y < h) {
        return None;
    }
    let at = (corner.x.round() as i64, corner.y.round() as i64);
    Some(Vector2::new(at.0 as f64, at.1 as f64) + half + refine(&template, now, at)?)
}

/// The pixels in which a patch is looked for, from a first column and row on; infinite outside the image.
fn window(now: &Image<f32>, (left, top): (i64, i64)) -> Window {
    let mut out = [[f32::INFINITY; WIDE]; TALL];
    let width = now.width() as i64;
    let (from, until) = (left.clamp(0, width), (left + WIDE as i64).clamp(0, width));
    for (line, y) in out.iter_mut().zip(top..) {
        if from < until && (0..now.height() as i64).contains(&y) {
            let (first, last) = ((from - left) as usize, (until - left) as usize);
            line[first..last].copy_from_slice(&now.row(y as usize)[from as usize..until as usize]);
        }
    }
    out
}

widest! {
    /// Sums of absolute differences with the template's first pixel in each row and column of the search.
    fn differences(template: &Block, window: &Window, out: &mut [[f32; LANES]; SIDE]) {
        for (i, sums) in out.iter_mut().enumerate() {
            *sums = row_of_differences(template, window[i..].iter().map(|w| &w[..]));
        }
    }
}

/// Sums of absolute differences with the template's first pixel in each of the first columns of a row of the search, added up side by side; `lines` are the pixels from there on, line by line.
#[inline(always)]
pub(super) fn row_of_differences<'a, const N: usize>(
    template: &Block,
    mut lines: impl Iterator<Item = &'a [f32]>,
) -> [f32; N] {
    let mut row = [0.0f32; N];
    for line in template {
        let Some(pixels) = lines.next() else { break };
        for c in 0..PATCH {
            let Some(beside) = pixels[c..].first_chunk::<N>() else { continue };
            for i in 0..N {
                row[i] += (line[c] - beside[i]).abs();
            }
        }
    }
    row
}

/// The patch as it should look now; `None` if that needs pixels outside the key frame.
pub(super) fn template(key: &Image<f32>, p: Patch, predicted: &Similarity) -> Option<Block> {
    let mut out = [[0.0; PATCH]; PATCH];
    if predicted.is_shift() {
        for (r, line) in out.iter_mut().enumerate() {
            line.copy_from_slice(&key.row(p.y + r)[p.x..p.x + PATCH]);
        }
        return Some(out);
    }
    let (back, middle) = (predicted.inverse(), p.middle());
    let half = 0.5 * (PATCH - 1) as f64;
    for (r, line) in out.iter_mut().enumerate() {
        for (c, v) in line.iter_mut().enumerate() {
            *v = between(key, middle + back.turn(Vector2::new(c as f64 - half, r as f64 - half)))?;
        }
    }
    Some(out)
}

/// Value between the pixels of a square; `None` outside.
#[inline]
pub(super) fn bilinear<const N: usize>(square: &[[f32; N]; N], p: Vector2<f64>) -> Option<f32> {
    let last = (N - 1) as f64;
    if !(p.x >= 0.0 && p.y >= 0.0 && p.x < last && p.y < last) {
        return None;
    }
    let (x, y) = (p.x as usize, p.y as usize);
    let (u, v) = ((p.x - x as f64) as f32, (p.y - y as f64) as f32);
    let (a, b) = (&square[y][x..x + 2], &square[y + 1][x..x + 2]);
    Some((a[0] * (1.0 - u) + a[1] * u) * (1.0 - v) + (b[0] * (1.0 - u) + b[1] * u) * v)
}

/// Value between pixels; `None` outside.
#[inline]
fn between(image: &Image<f32>, p: Vector2<f64>) -> Option<f32> {
    let (w, h) = (image.width(), image.height());
    if !(p.x >= 0.0 && p.y >= 0.0 && p.x < (w - 1) as f64 && p.y < (h - 1) as f64) {
        return None;
    }
    let (x, y) = (p.x as usize, p.y as usize);
    let (u, v) = ((p.x - x as f64) as f32, (p.y - y as f64) as f32);
    let (a, b) = (&image.row(y)[x..x + 2], &image.row(y + 1)[x..x + 2]);
    Some((a[0] * (1.0 - u) + a[1] * u) * (1.0 - v) + (b[0] * (1.0 - u) + b[1] * u) * v)
}

/// The part of a pixel between the best whole place and the true one; `None` if it leads away from there.
pub(super) fn refine(template: &Block, now: &Image<f32>, at: (i64, i64)) -> Option<Vector2<f64>> {
    let gradients = gradients(template);
    let (gx, gy) = (gradients.0.as_flattened(), gradients.1.as_flattened());
    let (mut xx, mut xy, mut yy) = (0.0, 0.0, 0.0);
    for i in 0..PATCH * PATCH {
        let (gx, gy) = (f64::from(gx[i]), f64::from(gy[i]));
        xx += gx * gx;
        xy += gx * gy;
        yy += gy * gy;
    }
    let square = Matrix2::new(xx, xy, xy, yy);
    let factor = square.cholesky()?;
    let mut part = Vector2::<f64>::zeros();
    for _ in 0..STEPS {
        let sum = pull(template, &gradients, now, Vector2::new(at.0 as f64, at.1 as f64) + part)?;
        let step = factor.solve(&sum.cast());
        part -= step;
        if !(part.x.abs() <= 1.0 && part.y.abs() <= 1.0) {
            return None;
        }
        if step.norm() < LAST_STEP {
            break;
        }
    }
    Some(part)
}

/// Gradients of a patch along x and along y.
type Gradients = (Block, Block);

widest! {
    /// The gradients, less their mean: without it a change of brightness drops out.
    fn gradients(template: &Block) -> Gradients {
        const N: f32 = (PATCH * PATCH) as f32;
        let [mut gx, mut gy] = [[[0.0f32; PATCH]; PATCH]; 2];
        for (line, t) in gx.iter_mut().zip(template) {
            for c in 1..PATCH - 1 {
                line[c] = (t[c + 1] - t[c - 1]) / 2.0;
            }
            line[0] = t[1] - t[0];
            line[PATCH - 1] = t[PATCH - 1] - t[PATCH - 2];
        }
        for r in 0..PATCH {
            let (up, down) = (r.saturating_sub(1), (r + 1).min(PATCH - 1));
            for c in 0..PATCH {
                gy[r][c] = (template[down][c] - template[up][c]) / (down - up) as f32;
            }
        }
        // Both side by side: each sum waits for itself only.
        let (flat_x, flat_y) = (gx.as_flattened_mut(), gy.as_flattened_mut());
        let (mut mean_x, mut mean_y) = (0.0f32, 0.0f32);
        for i in 0..PATCH * PATCH {
            mean_x += flat_x[i] / N;
            mean_y += flat_y[i] / N;
        }
        for i in 0..PATCH * PATCH {
            flat_x[i] -= mean_x;
            flat_y[i] -= mean_y;
        }
        (gx, gy)
    }
}

/// Sum of g e with the template's first pixel at `at`; `None` if that needs pixels outside.
fn pull(template: &Block, gradients: &Gradients, now: &Image<f32>, at: Vector2<f64>) -> Option<Vector2<f32>> {
    if !(at.x >= 0.0 && at.y >= 0.0) {
        return None;
    }
    let (x, y) = (at.x as usize, at.y as usize);
    if x + PATCH >= now.width() || y + PATCH >= now.height() {
        return None;
    }
    // All pixels of the patch lie at the same fraction of a pixel.
    let part = [(at.x - x as f64) as f32, (at.y - y as f64) as f32];
    let [mut gx_e, mut gy_e] = [[[0.0; PATCH]; PATCH]; 2];
    weighted_errors(template, gradients, (now, x, y), part, (&mut gx_e, &mut gy_e));
    // One after the other, whatever the vectors' width; both side by side.
    let (gx_e, gy_e) = (gx_e.as_flattened(), gy_e.as_flattened());
    let mut sum = [0.0f32; 2];
    for i in 0..PATCH * PATCH {
        sum[0] += gx_e[i];
        sum[1] += gy_e[i];
    }
    Some(sum.into())
}

widest! {
    /// The products of the gradients with the differences of a patch, its first pixel behind (x, y) by a part of a pixel, from the template.
    fn weighted_errors(
        template: &Block,
        gradients: &Gradients,
        patch: (&Image<f32>, usize, usize),
        part: [f32; 2],
        out: (&mut Block, &mut Block),
    ) {
        let ((now, x, y), [u, v]) = (patch, part);
        let along = |r: usize| {
            let mut line = [0.0f32; PATCH];
            if let Some(row) = now.row(y + r)[x..].first_chunk::<{ PATCH + 1 }>() {
                for (c, l) in line.iter_mut().enumerate() {
                    *l = row[c] * (1.0 - u) + row[c + 1] * u;
                }
            }
            line
        };
        let mut upper = along(0);
        for r in 0..PATCH {
            let lower = along(r + 1);
            for c in 0..PATCH {
                let e = upper[c] * (1.0 - v) + lower[c] * v - template[r][c];
                out.0[r][c] = gradients.0[r][c] * e;
                out.1[r][c] = gradients.1[r][c] * e;
            }
            upper = lower;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn waves(at: impl Fn(Vector2<f64>) -> Vector2<f64>, light: f32) -> Image<f32> {
        let mut image = Image::filled(120, 100, 0f32);
        for y in 0..100 {
            for x in 0..120 {
                let p = at(Vector2::new(x as f64, y as f64));
                image.row_mut(y)[x] =
                    light + (40.0 * ((p.x * 0.31).sin() * (p.y * 0.23).cos() + (0.11 * p.x).cos())) as f32;
            }
        }
        image
    }

    #[test]
    fn a_patch_is_found_to_a_twentieth_of_a_pixel_turned_zoomed_and_in_another_light() {
        let truth = Similarity::about(Vector2::new(60.0, 50.0), Vector2::new(3.37, -2.81), 0.08, 1.04);
        let (key, now) = (waves(|p| p, 0.0), waves(|p| truth.inverse().apply(p), 2.0));
        // The prediction is off by some pixels and a degree.
        let predicted = Similarity::about(Vector2::new(60.0, 50.0), Vector2::new(6.0, 0.0), 0.065, 1.03);
        for (x, y) in [(30, 30), (60, 44), (50, 60)] {
            let patch = Patch { x, y, weight: 1.0 };
            let found = find(&key, &now, patch, &predicted).unwrap();
            let error = found - truth.apply(patch.middle());
            assert!(error.norm() < 0.05, "{x} {y}: {error}");
        }
    }

    #[test]
    fn sums_of_differences_are_those_of_each_place_and_infinite_beyond_the_image() {
        let (key, now) = (waves(|p| p, 0.0), waves(|p| p + Vector2::new(1.3, 0.4), 1.0));
        let patch = Patch { x: 40, y: 30, weight: 1.0 };
        let template = template(&key, patch, &Similarity::identity()).unwrap();
        for (left, top) in [(30, 20), (-5, -7), (100, 85), (119, 99), (200, -40), (-1_000, 20)] {
            let mut costs = [[0.0; LANES]; SIDE];
            differences(&template, &window(&now, (left, top)), &mut costs);
            for (i, j) in (0..SIDE * SIDE).map(|n| (n / SIDE, n % SIDE)) {
                let (x, y) = (left + j as i64, top + i as i64);
                let inside = x >= 0 && y >= 0 && x + PATCH as i64 <= 120 && y + PATCH as i64 <= 100;
                let pixel = |r: usize, c: usize| (template[r][c] - now.row(y as usize + r)[x as usize + c]).abs();
                let sum =
                    inside.then(|| (0..PATCH * PATCH).map(|n| f64::from(pixel(n / PATCH, n % PATCH))).sum::<f64>());
                let cost = f64::from(costs[i][j]);
                assert!(
                    sum.map_or(cost == f64::INFINITY, |sum| (cost - sum).abs() < 1e-5 * (1.0 + sum)),
                    "{left} {top} {i} {j}"
                );
            }
        }
    }

    #[test]
    fn nothing_is_found_outside_the_search_or_the_image() {
        let (key, now) = (waves(|p| p, 0.0), waves(|p| p - Vector2::new(25.0, 0.0), 0.0));
        let patch = Patch { x: 40, y: 40, weight: 1.0 };
        assert_eq!(
            find(&key, &now, Patch { x: 100, y: 40, weight: 1.0 }, &Similarity::shift(Vector2::new(25.0, 0.0))),
            None
        );
        assert_eq!(find(&key, &now, patch, &Similarity::shift(Vector2::new(f64::NAN, 0.0))), None);
        assert_eq!(find(&key, &now, patch, &Similarity::shift(Vector2::new(1e300, 0.0))), None);
    }
}
