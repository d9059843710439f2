//! Difference of boxes: a frame smoothed by a box applied twice, less its mean over a wider box, in one pass down the frame at a cost that hardly grows with the boxes.
//!
//! Source: textbook sliding sums down the columns; along the rows windows of 1, 2, 4 ... columns, each of two of the one before, are put together to the side: no sum waits
//! for the one of the pixel beside it, so rows are summed many pixels at a time. Of the sums of the first box as many rows are kept as the second reads. Whole pixels are summed in
//! i32 while the largest sum fits, without rounding; others in f64. Pixels outside repeat the edge.
//! Symbols: s side of the smoothing box, applied twice (so s⁴ pixels in the sum); w side of the wide one, px.

use crate::Image;
use crate::vision::pixel::Pixel;
use std::ops::{Add, AddAssign, SubAssign};

/// What sums are made in.
trait Sum: Copy + Default + Add<Output = Self> + AddAssign + SubAssign {
    fn real(self) -> f64;
}

impl Sum for f64 {
    #[inline(always)]
    fn real(self) -> f64 {
        self
    }
}

impl Sum for i32 {
    #[inline(always)]
    fn real(self) -> f64 {
        f64::from(self)
    }
}

/// A value that is summed: a pixel, or a sum that is summed once more.
trait Term<S>: Copy {
    fn term(self) -> S;
}

impl<T: Pixel> Term<f64> for T {
    #[inline(always)]
    fn term(self) -> f64 {
        self.value()
    }
}

impl<T: Pixel> Term<i32> for T {
    #[inline(always)]
    fn term(self) -> i32 {
        // At most 16 bit.
        self.index() as i32
    }
}

impl Term<Self> for i32 {
    #[inline(always)]
    fn term(self) -> Self {
        self
    }
}

impl Term<Self> for f64 {
    #[inline(always)]
    fn term(self) -> Self {
        self
    }
}

/// The filter with the sums it works in.
#[derive(Clone, Debug)]
pub(super) struct Boxes {
    smooth: usize,
    surround: usize,
    real: Sums<f64>,
    whole: Sums<i32>,
}

impl Boxes {
    /// Builds the filter; both sides are odd, px.
    pub(super) fn new(smooth: usize, surround: usize) -> Self {
        Self { smooth, surround, real: Sums::default(), whole: Sums::default() }
    }

    /// Writes the filter's response around each pixel, counts. The pixels must be finite.
    pub(super) fn run<T: Pixel>(&mut self, src: &Image<T>, out: &mut Image<f32>) {
        let (w, h) = (src.width(), src.height());
        if (out.width(), out.height()) != (w, h) {
            out.reset(w, h, 0.0);
        }
        if w == 0 || h == 0 {
            return;
        }
        // Neither overflows: sides are below 2¹⁶ and products saturate.
        let most = self.smooth.saturating_pow(4).max(self.surround.saturating_pow(2));
        let largest = if size_of::<T>() == 1 { usize::from(u8::MAX) } else { usize::from(u16::MAX) };
        if T::STEP > 0.0 && most.saturating_mul(largest) <= i32::MAX as usize {
            self.whole.run(src, self.smooth, self.surround, out);
        } else {
            self.real.run(src, self.smooth, self.surround, out);
        }
    }
}

/// The sums of one kind.
#[derive(Clone, Debug, Default)]
struct Sums<S> {
    /// Of the frame for the first box, of its sums for the second, and of the frame for the wide one.
    first: Columns<S>,
    second: Columns<S>,
    wide: Columns<S>,
    /// Rows of sums of the first box, that of row j at j modulo their number.
    rows: Vec<S>,
    smoothed: Vec<S>,
    around: Vec<S>,
    windows: [Vec<S>; 2],
}

impl<S: Sum> Sums<S> {
    fn run<T: Pixel + Term<S>>(&mut self, src: &Image<T>, smooth: usize, surround: usize, out: &mut Image<f32>)
    where
        S: Term<S>,
    {
        let (w, h, r) = (src.width(), src.height(), smooth / 2);
        let (per_smooth, per_surround) = (1.0 / (smooth as f64).powi(4), 1.0 / (surround as f64).powi(2));
        // The rows that enter and leave, and those between.
        let kept = smooth + 1;
        self.rows.clear();
        self.rows.resize(kept * w, S::default());
        self.first.begin(smooth, w);
        self.wide.begin(surround, w);
        self.smoothed.resize(w, S::default());
        self.around.resize(w, S::default());
        for columns in [&mut self.first, &mut self.wide] {
            (0..columns.side).for_each(|k| columns.enter(src.row(k.saturating_sub(columns.side / 2).min(h - 1))));
        }
        let mut done = 0;
        self.second.begin(smooth, w);
        for k in 0..smooth {
            let row = k.saturating_sub(r).min(h - 1);
            while done <= row {
                self.first_row(src, done);
                done += 1;
            }
            self.second.enter(&self.rows[(row % kept) * w..][..w]);
        }
        for y in 0..h {
            self.second.neighbours(&mut self.windows, &mut self.smoothed);
            self.wide.neighbours(&mut self.windows, &mut self.around);
            difference(out.row_mut(y), &self.smoothed, &self.around, per_smooth, per_surround);
            let (enters, leaves) = ((y + 1 + r).min(h - 1), y.saturating_sub(r));
            if done <= enters {
                self.first_row(src, done);
                done += 1;
            }
            let row = |j: usize| &self.rows[(j % kept) * w..][..w];
            self.second.replace(row(enters), row(leaves));
            let reach = surround / 2;
            self.wide.replace(src.row((y + 1 + reach).min(h - 1)), src.row(y.saturating_sub(reach)));
        }
    }

    /// The sums of the first box around the pixels of row `j`, and its columns moved on to the next.
    fn first_row<T: Pixel + Term<S>>(&mut self, src: &Image<T>, j: usize) {
        let (h, w, side) = (src.height(), src.width(), self.first.side);
        self.first.neighbours(&mut self.windows, &mut self.rows[(j % (side + 1)) * w..][..w]);
        self.first.replace(src.row((j + 1 + side / 2).min(h - 1)), src.row(j.saturating_sub(side / 2)));
    }
}

/// Sums of `side` rows, column by column, with room for the columns outside.
#[derive(Clone, Debug, Default)]
struct Columns<S> {
    side: usize,
    sums: Vec<S>,
}

impl<S: Sum> Columns<S> {
    fn begin(&mut self, side: usize, width: usize) {
        self.side = side;
        self.sums.clear();
        self.sums.resize(width + side - 1, S::default());
    }

    fn inner(&mut self) -> &mut [S] {
        let (r, n) = (self.side / 2, self.sums.len());
        &mut self.sums[r..n - r]
    }

    fn enter<T: Term<S>>(&mut self, row: &[T]) {
        enter(self.inner(), row);
    }

    fn replace<T: Term<S>>(&mut self, enters: &[T], leaves: &[T]) {
        replace(self.inner(), enters, leaves);
    }

    /// The sums over `side` columns around each; `windows` is scratch.
    fn neighbours(&mut self, windows: &mut [Vec<S>; 2], out: &mut [S]) {
        let (side, r, n) = (self.side, self.side / 2, self.sums.len());
        let [first, last] = [r, n - 1 - r].map(|x| self.sums[x]);
        self.sums[..r].fill(first);
        self.sums[n - r..].fill(last);
        // The windows of one column are the columns themselves, the first of which stands in every odd sum.
        let one = &self.sums[..n + 1 - side];
        match side {
            1 => return out.copy_from_slice(one),
            3 => return add_three(out, one, &self.sums[1..], &self.sums[2..]),
            _ => {}
        }
        let [window, twice] = windows;
        window.resize(n - 1, S::default());
        add_two(window, &self.sums, &self.sums[1..]);
        let (mut wide, mut from) = (2, 1);
        loop {
            if side & wide != 0 {
                match from {
                    1 => add_two(out, one, &window[from..]),
                    _ => add(out, &window[from..]),
                }
                from += wide;
            }
            if 2 * wide > side {
                return;
            }
            twice.resize(window.len() - wide, S::default());
            add_two(twice, window, &window[wide..]);
            std::mem::swap(window, twice);
            wide *= 2;
        }
    }
}

widest! {
    fn enter<S: Sum, T: Term<S>>(columns: &mut [S], row: &[T]) {
        for (c, v) in columns.iter_mut().zip(row) {
            *c += v.term();
        }
    }
}

widest! {
    fn replace<S: Sum, T: Term<S>>(columns: &mut [S], enters: &[T], leaves: &[T]) {
        for ((c, enters), leaves) in columns.iter_mut().zip(enters).zip(leaves) {
            *c += enters.term();
            *c -= leaves.term();
        }
    }
}

widest! {
    fn add<S: Sum>(sums: &mut [S], of: &[S]) {
        for (sum, v) in sums.iter_mut().zip(of) {
            *sum += *v;
        }
    }
}

widest! {
    fn add_two<S: Sum>(out: &mut [S], a: &[S], b: &[S]) {
        for ((out, a), b) in out.iter_mut().zip(a).zip(b) {
            *out = *a + *b;
        }
    }
}

widest! {
    fn add_three<S: Sum>(out: &mut [S], a: &[S], b: &[S], c: &[S]) {
        for (((out, a), b), c) in out.iter_mut().zip(a).zip(b).zip(c) {
            *out = *a + (*b + *c);
        }
    }
}

widest! {
    fn difference<S: Sum>(out: &mut [f32], smoothed: &[S], around: &[S], per_smooth: f64, per_surround: f64) {
        for ((out, s), a) in out.iter_mut().zip(smoothed).zip(around) {
            *out = (s.real() * per_smooth - a.real() * per_surround) as f32;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The response written out.
    fn plain(
        value: &dyn Fn(i64, i64) -> f64,
        (w, h): (i64, i64),
        (smooth, surround): (i64, i64),
        x: i64,
        y: i64,
    ) -> f64 {
        let at = |x: i64, y: i64| value(x.clamp(0, w - 1), y.clamp(0, h - 1));
        let mean = |of: &dyn Fn(i64, i64) -> f64, side: i64, x: i64, y: i64| {
            let r = side / 2;
            let around = (-r..=r).flat_map(|dy| (-r..=r).map(move |dx| (dx, dy)));
            around.map(|(dx, dy)| of(x + dx, y + dy)).sum::<f64>() / (side * side) as f64
        };
        let once = |x: i64, y: i64| mean(&at, smooth, x.clamp(0, w - 1), y.clamp(0, h - 1));
        mean(&once, smooth, x, y) - mean(&at, surround, x, y)
    }

    #[test]
    fn the_response_is_the_one_written_out_whatever_the_sides_the_frame_and_its_pixels() {
        let value = |x: i64, y: i64| ((x * 7919 + y * 104_729) % 65_536) as f64;
        for (w, h) in [(1, 1), (4, 3), (1, 9), (23, 2), (70, 11)] {
            for (smooth, surround) in [(1, 3), (3, 11), (5, 7), (9, 23), (15, 31)] {
                let pixels = || (0..w * h).map(|i| value(i % w, i / w));
                let mut real = Image::default();
                let mut whole = Image::default();
                let mut bytes = Image::default();
                let mut boxes = Boxes::new(smooth as usize, surround as usize);
                let (width, height) = (w as usize, h as usize);
                boxes.run(&Image::from_vec(width, height, pixels().map(|v| v as f32).collect()).unwrap(), &mut real);
                boxes.run(&Image::from_vec(width, height, pixels().map(|v| v as u16).collect()).unwrap(), &mut whole);
                boxes.run(
                    &Image::from_vec(width, height, pixels().map(|v| (v as u32 % 256) as u8).collect()).unwrap(),
                    &mut bytes,
                );
                for (y, x) in (0..h).flat_map(|y| (0..w).map(move |x| (y, x))) {
                    let expected = plain(&value, (w, h), (smooth, surround), x, y);
                    let of_bytes = plain(&|x, y| value(x, y) % 256.0, (w, h), (smooth, surround), x, y);
                    let read = |image: &Image<f32>| f64::from(image.row(y as usize)[x as usize]);
                    // The rounding of the result to f32, and of sums in f64.
                    assert!(
                        (read(&real) - expected).abs() < 1e-6 * expected.abs() + 1e-8,
                        "f32 {w} {h} {smooth} {x} {y}"
                    );
                    assert!(
                        (read(&whole) - expected).abs() < 1e-6 * expected.abs() + 1e-8,
                        "u16 {w} {h} {smooth} {x} {y}"
                    );
                    assert!(
                        (read(&bytes) - of_bytes).abs() < 1e-6 * of_bytes.abs() + 1e-8,
                        "u8 {w} {h} {smooth} {x} {y}"
                    );
                }
            }
        }
    }

    #[test]
    fn the_largest_sums_that_are_made_in_whole_numbers_fit() {
        // 53⁴ · 255 and 13⁴ · 65 535 are the largest below 2³¹.
        for smooth in [53, 55] {
            let mut out = Image::default();
            Boxes::new(smooth, 101).run(&Image::filled(60, 60, u8::MAX), &mut out);
            assert!(out.as_slice().iter().all(|v| v.abs() < 1e-9), "{smooth}");
        }
        for smooth in [13, 15] {
            let mut out = Image::default();
            Boxes::new(smooth, 181).run(&Image::filled(40, 40, u16::MAX), &mut out);
            assert!(out.as_slice().iter().all(|v| v.abs() < 1e-9), "{smooth}");
        }
    }
}
