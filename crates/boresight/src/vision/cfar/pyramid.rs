//! Pyramid: the frame halved again and again, and each level smoothed once more.
//!
//! Source: P. Burt & E. Adelson, *The Laplacian pyramid as a compact image code*, IEEE Trans. Comm. 31, 532 (1983): halving
//! after the binomial filter [1 4 6 4 1]/16. Each level is smoothed by [1 2 1]/4 as well: all in all level k is the frame filtered by
//! nearly a Gaussian of [`sigma_px`]`(k)` = 0.71, 1.73, 3.61, 7.28, 14.6 px ... Borders mirror about the outermost pixel.
//! Symbols: g a level (counts), b the level smoothed (counts), with [`PAD`] mirrored pixels at both sides of a row.
//! Cost: about 12 operations a pixel, in vectors.

use crate::Image;
use crate::vision::pixel::Pixel;
use fearless_simd::{Level as Cpu, dispatch};

/// Mirrored pixels at both sides of a smoothed row: the reach of the contrast.
pub(super) const PAD: usize = 4;
/// Least side of a level, px: twice the reach and the pixel between.
pub(super) const LEAST_SIDE: usize = 7;

/// One level.
#[derive(Clone, Debug, Default)]
pub(super) struct Level {
    pub(super) width: usize,
    pub(super) height: usize,
    /// The level, row by row.
    pub(super) g: Vec<f32>,
    /// The level smoothed, rows of `width + 2 PAD`.
    pub(super) b: Vec<f32>,
}

impl Level {
    pub(super) fn row(&self, y: usize) -> &[f32] {
        &self.g[y * self.width..][..self.width]
    }

    /// The value of a pixel, smoothed or not; `None` outside.
    pub(super) fn value(&self, x: i32, y: i32, smooth: bool) -> Option<f32> {
        let (x, y) = (
            usize::try_from(x).ok().filter(|x| *x < self.width)?,
            usize::try_from(y).ok().filter(|y| *y < self.height)?,
        );
        Some(if smooth { self.b[y * (self.width + 2 * PAD) + PAD + x] } else { self.g[y * self.width + x] })
    }

    /// A smoothed row with its margins; rows outside are mirrored.
    pub(super) fn smooth_row(&self, y: isize) -> &[f32] {
        let stride = self.width + 2 * PAD;
        &self.b[mirror(y, self.height) * stride..][..stride]
    }

    fn resize(&mut self, width: usize, height: usize) {
        (self.width, self.height) = (width, height);
        self.g.resize(width * height, 0.0);
        self.b.resize((width + 2 * PAD) * height, 0.0);
    }
}

/// The index inside 0..n that a mirror at the outermost elements shows.
pub(super) fn mirror(i: isize, n: usize) -> usize {
    let last = n as isize - 1;
    let i = i.abs();
    (if i > last { 2 * last - i } else { i }).clamp(0, last) as usize
}

/// Deviation of the Gaussian that level `k` is filtered by, px.
pub(super) fn sigma_px(k: usize) -> f64 {
    // σ² = (4^k - 1) / 3 by the halvings and 4^k / 2 by the smoothing.
    let n = 4f64.powi(k as i32);
    ((n - 1.0) / 3.0 + n / 2.0).sqrt()
}

/// The levels of a frame; keeps its memory between frames.
#[derive(Clone, Debug, Default)]
pub(super) struct Pyramid {
    levels: Vec<Level>,
    row: Vec<f32>,
}

impl Pyramid {
    /// Fills the levels of a frame, at most `most`, and returns them.
    pub(super) fn fill<T: Pixel>(&mut self, image: &Image<T>, most: usize) -> &[Level] {
        let (mut w, mut h) = (image.width(), image.height());
        let mut n = 0;
        while n < most && w.min(h) >= LEAST_SIDE {
            if self.levels.len() == n {
                self.levels.push(Level::default());
            }
            self.levels[n].resize(w, h);
            n += 1;
            (w, h) = (w.div_ceil(2), h.div_ceil(2));
        }
        let levels = &mut self.levels[..n];
        if let Some(first) = levels.first_mut() {
            let out = &mut first.g;
            dispatch!(Cpu::new(), _simd => convert(image, out));
        }
        let row = &mut self.row;
        for k in 0..n {
            let (done, rest) = levels.split_at_mut(k + 1);
            let this = &mut done[k];
            dispatch!(Cpu::new(), _simd => smooth(this, row));
            if let Some(next) = rest.first_mut() {
                dispatch!(Cpu::new(), _simd => halve(this, next, row));
            }
        }
        &self.levels[..n]
    }

    /// The levels filled last.
    pub(super) fn level(&self, k: usize) -> &Level {
        &self.levels[k]
    }
}

/// Pixels as f32; those without a value (NaN, infinite) take their left neighbour's.
#[inline(always)]
fn convert<T: Pixel>(image: &Image<T>, out: &mut [f32]) {
    for (o, p) in out.iter_mut().zip(image.as_slice()) {
        *o = p.value_f32();
    }
    if T::STEP == 0.0 {
        let mut last = 0.0;
        for v in out {
            if v.is_finite() {
                last = *v;
            }
            *v = last;
        }
    }
}

/// [1 2 1]/4 in both directions, from `g` to `b`.
#[inline(always)]
fn smooth(level: &mut Level, row: &mut Vec<f32>) {
    let (w, h) = (level.width, level.height);
    row.resize(w + 2, 0.0);
    for y in 0..h {
        let at = |dy: isize| &level.g[mirror(y as isize + dy, h) * w..][..w];
        let (above, here, below) = (at(-1), at(0), at(1));
        for (((r, a), b), c) in row[1..=w].iter_mut().zip(above).zip(here).zip(below) {
            *r = a + 2.0 * b + c;
        }
        (row[0], row[w + 1]) = (row[2], row[w - 1]);
        let out = &mut level.b[y * (w + 2 * PAD)..][..w + 2 * PAD];
        let (left, mid, right) = (&row[..w], &row[1..=w], &row[2..]);
        for (((o, a), b), c) in out[PAD..PAD + w].iter_mut().zip(left).zip(mid).zip(right) {
            *o = (a + 2.0 * b + c) * (1.0 / 16.0);
        }
        for i in 1..=PAD {
            out[PAD - i] = out[PAD + i.min(w - 1)];
            out[PAD + w - 1 + i] = out[PAD + w - 1 - i.min(w - 1)];
        }
    }
}

/// [1 4 6 4 1]/16 in both directions and every other pixel, from a level to the next.
#[inline(always)]
fn halve(from: &Level, to: &mut Level, row: &mut Vec<f32>) {
    let (w, h) = (from.width, from.height);
    // Two mirrored pixels at each side; one more, so that pairs always exist.
    row.resize(w + 6, 0.0);
    for y in 0..to.height {
        let at = |dy: isize| from.row(mirror(2 * y as isize + dy, h));
        let (a, b, c, d, e) = (at(-2), at(-1), at(0), at(1), at(2));
        let sums = row[2..2 + w].iter_mut().zip(a).zip(b).zip(c).zip(d).zip(e);
        for (((((r, a), b), c), d), e) in sums {
            *r = (a + e) + 4.0 * (b + d) + 6.0 * c;
        }
        (row[1], row[0]) = (row[3], row[4]);
        (row[w + 2], row[w + 3]) = (row[w], row[w - 1]);
        let out = &mut to.g[y * to.width..][..to.width];
        let (p, q, r) = (row.as_chunks::<2>().0, &row.as_chunks::<2>().0[1..], &row.as_chunks::<2>().0[2..]);
        for (((o, p), q), r) in out.iter_mut().zip(p).zip(q).zip(r) {
            *o = ((p[0] + r[0]) + 4.0 * (p[1] + q[1]) + 6.0 * q[0]) * (1.0 / 256.0);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_flat_frame_stays_flat_on_every_level_and_a_gaussian_widens_as_stated() {
        let mut pyramid = Pyramid::default();
        let flat = Image::filled(101, 64, 9u8);
        for level in pyramid.fill(&flat, 9) {
            assert!(level.g.iter().chain(&level.b).all(|v| (v - 9.0).abs() < 1e-5));
        }
        // One bright pixel: the variance of what it becomes on level k is sigma_px(k) squared.
        let mut point = Image::filled(129, 129, 0.0f32);
        point.row_mut(64)[64] = 1.0;
        for (k, level) in pyramid.fill(&point, 4).iter().enumerate() {
            let (mut sum, mut second) = (0.0, 0.0);
            for y in 0..level.height {
                for (x, v) in level.smooth_row(y as isize)[PAD..PAD + level.width].iter().enumerate() {
                    let d = x as f64 * 2f64.powi(k as i32) - 64.0;
                    sum += f64::from(*v);
                    second += f64::from(*v) * d * d;
                }
            }
            assert!((second / sum - sigma_px(k).powi(2)).abs() < 1e-3 * sigma_px(k).powi(2), "{k}");
        }
    }

    #[test]
    fn pixels_without_a_value_take_their_neighbours() {
        let mut image = Image::filled(16, 16, 3.0f32);
        image.row_mut(5)[4] = f32::NAN;
        image.row_mut(6)[4] = f32::INFINITY;
        assert!(Pyramid::default().fill(&image, 3)[0].g.iter().all(|v| *v == 3.0));
    }
}
