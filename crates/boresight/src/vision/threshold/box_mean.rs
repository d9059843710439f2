//! Mean over a square box of any odd side, at a cost that hardly grows with it.
//!
//! Source: textbook sliding sums down the columns; along the rows windows of 1, 2, 4 ... columns, each of two of the one before, are put together to the side: no sum waits
//! for the one of the pixel beside it, so rows are summed many pixels at a time. Sums are in f64,
//! so that f32 pixels of any size leave no trace behind. Pixels outside repeat the edge.

use crate::Image;
use std::ops::{Add, AddAssign, SubAssign};

/// Pixels of a row that are summed before the next ones: their windows stay in the nearest cache (some 16 KiB in f64).
const TILE: usize = 480;

/// Longest side whose sums of 16-bit pixels i32 holds: 181² · 65535 < 2³¹.
const MOST_WHOLE: usize = 181;

/// What sums are made in.
trait Sum: Copy + Default + Add<Output = Self> + AddAssign + SubAssign {
    fn of(v: f32) -> Self;
    fn times(self, scale: f64) -> f32;
}

impl Sum for f64 {
    #[inline(always)]
    fn of(v: f32) -> Self {
        f64::from(v)
    }
    #[inline(always)]
    fn times(self, scale: f64) -> f32 {
        (self * scale) as f32
    }
}

impl Sum for i32 {
    #[inline(always)]
    fn of(v: f32) -> Self {
        // Whole numbers below 2²³ stand in the last bits of their sum with it: no cast that saturates.
        const LAST: f32 = (1 << 23) as f32;
        ((v + LAST).to_bits() & ((1 << 23) - 1)) as i32
    }
    #[inline(always)]
    fn times(self, scale: f64) -> f32 {
        (f64::from(self) * scale) as f32
    }
}

/// Mean over a square box, the edge pixel repeated outside.
#[derive(Clone, Debug, Default)]
pub(super) struct BoxMean {
    real: Sums<f64>,
    whole: Sums<i32>,
}

impl BoxMean {
    /// Writes the mean over `side` x `side` px (odd) around each pixel.
    pub(super) fn run(&mut self, src: &Image<f32>, side: usize, dst: &mut Image<f32>) {
        self.real.run(src, side, dst);
    }

    /// The same of whole numbers of up to 16 bit: the same means, twice as many at a time.
    pub(super) fn run_whole(&mut self, src: &Image<f32>, side: usize, dst: &mut Image<f32>) {
        if side <= MOST_WHOLE { self.whole.run(src, side, dst) } else { self.real.run(src, side, dst) }
    }
}

/// The sums of one kind.
#[derive(Clone, Debug, Default)]
struct Sums<S> {
    columns: Vec<S>,
    /// Sums over windows that begin at each column and are a power of two wide, and those twice as wide.
    window: Vec<S>,
    twice: Vec<S>,
    sums: Vec<S>,
}

impl<S: Sum> Sums<S> {
    fn run(&mut self, src: &Image<f32>, side: usize, dst: &mut Image<f32>) {
        let (w, h, r) = (src.width(), src.height(), side / 2);
        if (dst.width(), dst.height()) != (w, h) {
            dst.reset(w, h, 0.0);
        }
        if w == 0 || h == 0 {
            return;
        }
        let scale = 1.0 / (side * side) as f64;
        self.columns.clear();
        self.columns.resize(w + 2 * r, S::default());
        for k in 0..side {
            // Row k - r of the first window.
            add_row(&mut self.columns[r..r + w], src.row(k.saturating_sub(r).min(h - 1)));
        }
        for y in 0..h {
            let [first, last] = [r, r + w - 1].map(|x| self.columns[x]);
            self.columns[..r].fill(first);
            self.columns[r + w..].fill(last);
            for (i, out) in dst.row_mut(y).chunks_mut(TILE).enumerate() {
                self.windows(i * TILE, out.len(), side);
                scaled(out, &self.sums, scale);
            }
            let rows = [src.row((y + 1 + r).min(h - 1)), src.row(y.saturating_sub(r))];
            replace_row(&mut self.columns[r..r + w], rows[0], rows[1]);
        }
    }

    /// The sums over `side` columns around each of `n` from `x` on.
    fn windows(&mut self, x: usize, n: usize, side: usize) {
        // The windows of one column are the columns themselves, the first of which stands in every odd sum.
        let columns = &self.columns[x..x + n + side - 1];
        self.sums.clear();
        self.sums.extend_from_slice(&columns[..n]);
        if side == 1 {
            return;
        }
        self.window.resize(columns.len() - 1, S::default());
        add_two(&mut self.window, columns, &columns[1..]);
        let (mut wide, mut from) = (2, 1);
        loop {
            if side & wide != 0 {
                add(&mut self.sums, &self.window[from..]);
                from += wide;
            }
            if 2 * wide > side {
                return;
            }
            self.twice.resize(self.window.len() - wide, S::default());
            add_two(&mut self.twice, &self.window, &self.window[wide..]);
            std::mem::swap(&mut self.window, &mut self.twice);
            wide *= 2;
        }
    }
}

widest! {
    fn add_row<S: Sum>(columns: &mut [S], row: &[f32]) {
        for (c, v) in columns.iter_mut().zip(row) {
            *c += S::of(*v);
        }
    }
}

widest! {
    fn replace_row<S: Sum>(columns: &mut [S], enters: &[f32], leaves: &[f32]) {
        for ((c, enters), leaves) in columns.iter_mut().zip(enters).zip(leaves) {
            *c += S::of(*enters);
            *c -= S::of(*leaves);
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
    fn scaled<S: Sum>(out: &mut [f32], sums: &[S], scale: f64) {
        for (out, sum) in out.iter_mut().zip(sums) {
            *out = sum.times(scale);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_box_mean_is_the_plain_mean_with_repeated_edges() {
        let src = Image::from_vec(4, 3, (0..12).map(|v| (v * v) as f32).collect()).unwrap();
        let (mut dst, mut whole) = (Image::default(), Image::default());
        for side in [1, 3, 5, 9, 15, 23] {
            BoxMean::default().run(&src, side, &mut dst);
            BoxMean::default().run_whole(&src, side, &mut whole);
            assert_eq!(dst, whole);
            let r = (side / 2) as i64;
            for y in 0..3i64 {
                for x in 0..4i64 {
                    let mut sum = 0.0;
                    for dy in -r..=r {
                        for dx in -r..=r {
                            sum += f64::from(src.row((y + dy).clamp(0, 2) as usize)[(x + dx).clamp(0, 3) as usize]);
                        }
                    }
                    let mean = sum / (side * side) as f64;
                    assert!((f64::from(dst.row(y as usize)[x as usize]) - mean).abs() < 1e-5, "{side} {x} {y}");
                }
            }
        }
    }

    #[test]
    fn rows_that_are_summed_in_parts_are_the_plain_mean_with_repeated_edges() {
        let w = TILE + 37;
        let value = |x: usize, y: usize| (x * 7919 + y * 104_729) % 65_536;
        let src = Image::from_vec(w, 5, (0..5 * w).map(|i| value(i % w, i / w) as f32).collect()).unwrap();
        for (side, runs) in
            [(7, [BoxMean::run, BoxMean::run_whole]), (MOST_WHOLE + 2, [BoxMean::run, BoxMean::run_whole])]
        {
            for run in runs {
                let mut dst = Image::default();
                run(&mut BoxMean::default(), &src, side, &mut dst);
                let r = (side / 2) as i64;
                for x in [0, 1, TILE as i64 - 1, TILE as i64, w as i64 - 1] {
                    let around = (-r..=r).flat_map(|dy| (-r..=r).map(move |dx| (dx, dy)));
                    let sum: usize = around
                        .map(|(dx, dy)| value((x + dx).clamp(0, w as i64 - 1) as usize, (2 + dy).clamp(0, 4) as usize))
                        .sum();
                    assert_eq!(
                        dst.row(2)[x as usize],
                        (sum as f64 * (1.0 / (side * side) as f64)) as f32,
                        "{side} {x}"
                    );
                }
            }
        }
    }
}
