//! Pyramid: the frame halved again and again.
//!
//! Source: P. Burt & E. Adelson, *The Laplacian pyramid as a compact image code*, IEEE Trans. Comm. 31, 532 (1983): halving
//! after the binomial filter [1 4 6 4 1]/16. Where a level is used it is smoothed by [1 2 1]/4 as well: all in all level k is the frame filtered by
//! nearly a Gaussian of [`sigma_px`]`(k)` = 0.71, 1.73, 3.61, 7.28, 14.6 px ... Borders mirror about the outermost pixel.
//! The finest level is the frame itself, in the type that it has.

use super::lane::Lane;
use crate::Image;
use crate::vision::pixel::Pixel;
use fearless_simd::{Level as Cpu, dispatch};

/// Least side of a level, px: twice the reach of the contrast and the pixel between.
pub(super) const LEAST_SIDE: usize = 7;

/// The pixels of a level, row by row.
#[derive(Clone, Copy, Debug)]
pub(super) struct View<'a, P> {
    pub(super) width: usize,
    pub(super) height: usize,
    pub(super) pixels: &'a [P],
}

impl<'a, P: Pixel> View<'a, P> {
    /// The pixels of an image.
    pub(super) fn of(image: &'a Image<P>) -> Self {
        Self { width: image.width(), height: image.height(), pixels: image.as_slice() }
    }

    #[inline(always)]
    pub(super) fn row(self, y: usize) -> &'a [P] {
        &self.pixels[y * self.width..][..self.width]
    }

    /// The value of a pixel, smoothed by [1 2 1]/4 in both directions or not, counts; `None` outside.
    pub(super) fn value(self, x: i32, y: i32, smooth: bool) -> Option<f32> {
        let (x, y) = (
            usize::try_from(x).ok().filter(|x| *x < self.width)?,
            usize::try_from(y).ok().filter(|y| *y < self.height)?,
        );
        if !smooth {
            return Some(self.row(y)[x].value_f32());
        }
        let at = |dy: isize| self.row(mirror(y as isize + dy, self.height));
        let (above, here, below) = (at(-1), at(0), at(1));
        let column = |dx: isize| {
            let x = mirror(x as isize + dx, self.width);
            above[x].value_f32() + 2.0 * here[x].value_f32() + below[x].value_f32()
        };
        Some((column(-1) + 2.0 * column(0) + column(1)) * (1.0 / 16.0))
    }
}

/// The index inside 0..n that a mirror at the outermost elements shows.
#[inline(always)]
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

/// A level that was halved.
#[derive(Clone, Debug, Default)]
struct Level {
    width: usize,
    height: usize,
    pixels: Vec<f32>,
}

/// The levels of a frame but the finest; keeps its memory between frames.
#[derive(Clone, Debug, Default)]
pub(super) struct Pyramid {
    levels: Vec<Level>,
    n: usize,
    rows: (Vec<i16>, Vec<f32>),
}

impl Pyramid {
    /// Fills the levels of a frame, at most `most` with the frame itself, and returns how many there are.
    pub(super) fn fill<P: Pixel>(&mut self, frame: View<'_, P>, most: usize) -> usize {
        self.n = 0;
        if most == 0 || frame.width.min(frame.height) < LEAST_SIDE {
            return 0;
        }
        let (mut w, mut h) = (frame.width.div_ceil(2), frame.height.div_ceil(2));
        while self.n + 1 < most && w.min(h) >= LEAST_SIDE {
            if self.levels.len() == self.n {
                self.levels.push(Level::default());
            }
            let level = &mut self.levels[self.n];
            (level.width, level.height) = (w, h);
            level.pixels.resize(w * h, 0.0);
            self.n += 1;
            (w, h) = (w.div_ceil(2), h.div_ceil(2));
        }
        for k in 0..self.n {
            let (finer, rest) = self.levels.split_at_mut(k);
            let to = &mut rest[0];
            match finer.last() {
                None => {
                    let row = P::Lane::row(&mut self.rows);
                    dispatch!(Cpu::new(), _simd => halve(frame, to, row));
                }
                Some(from) => {
                    let (from, row) = (from.view(), &mut self.rows.1);
                    dispatch!(Cpu::new(), _simd => halve(from, to, row));
                }
            }
        }
        self.n + 1
    }

    /// A level that was filled last, from 1 on.
    pub(super) fn level(&self, k: usize) -> View<'_, f32> {
        self.levels[k - 1].view()
    }
}

impl Level {
    fn view(&self) -> View<'_, f32> {
        View { width: self.width, height: self.height, pixels: &self.pixels }
    }
}

/// [1 4 6 4 1]/16 in both directions and every other pixel, from a level to the next.
#[inline(always)]
fn halve<P: Pixel>(from: View<'_, P>, to: &mut Level, row: &mut Vec<P::Lane>) {
    let (w, h) = (from.width, from.height);
    // Two mirrored pixels at each side; two more, so that pairs always exist.
    row.resize(w + 6, P::Lane::default());
    for y in 0..to.height {
        let at = |dy: isize| from.row(mirror(2 * y as isize + dy, h));
        let (a, b, c, d, e) = (at(-2), at(-1), at(0), at(1), at(2));
        let sums = row[2..2 + w].iter_mut().zip(a).zip(b).zip(c).zip(d).zip(e);
        for (((((r, a), b), c), d), e) in sums {
            *r = a.lane().add(e.lane()).add(b.lane().add(d.lane()).times(4)).add(c.lane().times(6));
        }
        (row[1], row[0]) = (row[3], row[4]);
        (row[w + 2], row[w + 3]) = (row[w], row[w - 1]);
        let out = &mut to.pixels[y * to.width..][..to.width];
        let (p, q, r) = (row.as_chunks::<2>().0, &row.as_chunks::<2>().0[1..], &row.as_chunks::<2>().0[2..]);
        for (((o, p), q), r) in out.iter_mut().zip(p).zip(q).zip(r) {
            *o = p[0].add(r[0]).add(p[1].add(q[1]).times(4)).add(q[0].times(6)).part_of_256();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_flat_frame_stays_flat_on_every_level_and_a_gaussian_widens_as_stated() {
        let mut pyramid = Pyramid::default();
        let flat = Image::filled(101, 64, 255u8);
        let n = pyramid.fill(View::of(&flat), 9);
        assert_eq!(n, 4);
        for k in 1..n {
            let level = pyramid.level(k);
            assert!(level.pixels.iter().all(|v| (v - 255.0).abs() < 1e-4));
            assert!((level.value(0, level.height as i32 - 1, true).unwrap() - 255.0).abs() < 1e-4);
        }
        // One bright pixel: the variance of what it becomes on level k is sigma_px(k) squared.
        let mut point = Image::filled(129, 129, 0.0f32);
        point.row_mut(64)[64] = 1.0;
        let n = pyramid.fill(View::of(&point), 4);
        for k in 0..n {
            let level = if k == 0 { View::of(&point) } else { pyramid.level(k) };
            let (mut sum, mut second) = (0.0, 0.0);
            for (x, y) in (0..level.height as i32).flat_map(|y| (0..level.width as i32).map(move |x| (x, y))) {
                let v = f64::from(level.value(x, y, true).unwrap());
                let d = f64::from(x) * 2f64.powi(k as i32) - 64.0;
                sum += v;
                second += v * d * d;
            }
            assert!((second / sum - sigma_px(k).powi(2)).abs() < 1e-3 * sigma_px(k).powi(2), "{k}");
        }
    }

    #[test]
    fn whole_numbers_and_single_precision_give_the_same_bits() {
        let short = Image::from_vec(67, 43, (0..67 * 43u32).map(|i| (i * i * 31 / 7) as u8).collect()).unwrap();
        let single = Image::from_vec(67, 43, short.as_slice().iter().map(|v| f32::from(*v)).collect()).unwrap();
        let (mut a, mut b) = (Pyramid::default(), Pyramid::default());
        assert_eq!(a.fill(View::of(&short), 9), b.fill(View::of(&single), 9));
        assert_eq!(a.level(1).pixels, b.level(1).pixels);
        assert_eq!(View::of(&short).value(66, 0, true), View::of(&single).value(66, 0, true));
    }
}
