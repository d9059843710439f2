//! Mean over a square box of any odd side, at a cost that hardly grows with it.
//!
//! Source: textbook sliding sums down the columns; along the rows windows of 1, 2, 4 ... columns, each of two of the one before, are put together to the side: no sum waits
//! for the one of the pixel beside it, so rows are summed many pixels at a time. Sums are in f64,
//! so that f32 pixels of any size leave no trace behind. Pixels outside repeat the edge.

use crate::Image;

/// Mean over a square box, the edge pixel repeated outside.
#[derive(Clone, Debug, Default)]
pub(super) struct BoxMean {
    columns: Vec<f64>,
    /// Sums over windows that begin at each column and are a power of two wide, and those twice as wide.
    window: Vec<f64>,
    twice: Vec<f64>,
    sums: Vec<f64>,
}

impl BoxMean {
    /// Writes the mean over `side` x `side` px (odd) around each pixel.
    pub(super) fn run(&mut self, src: &Image<f32>, side: usize, dst: &mut Image<f32>) {
        let (w, h, r) = (src.width(), src.height(), side / 2);
        if (dst.width(), dst.height()) != (w, h) {
            dst.reset(w, h, 0.0);
        }
        if w == 0 || h == 0 {
            return;
        }
        let scale = 1.0 / (side * side) as f64;
        self.columns.clear();
        self.columns.resize(w, 0.0);
        for k in 0..side {
            // Row k - r of the first window.
            add_row(&mut self.columns, src.row(k.saturating_sub(r).min(h - 1)), 1.0);
        }
        for y in 0..h {
            self.windows(side);
            for (d, sum) in dst.row_mut(y).iter_mut().zip(&self.sums) {
                *d = (sum * scale) as f32;
            }
            add_row(&mut self.columns, src.row((y + 1 + r).min(h - 1)), 1.0);
            add_row(&mut self.columns, src.row(y.saturating_sub(r)), -1.0);
        }
    }

    /// The sums over `side` columns around each.
    fn windows(&mut self, side: usize) {
        let (w, r) = (self.columns.len(), side / 2);
        self.window.clear();
        self.window.resize(r, self.columns[0]);
        self.window.extend_from_slice(&self.columns);
        self.window.resize(w + 2 * r, self.columns[w - 1]);
        self.sums.clear();
        self.sums.resize(w, 0.0);
        let (mut wide, mut from) = (1, 0);
        loop {
            if side & wide != 0 {
                add(&mut self.sums, &self.window[from..]);
                from += wide;
            }
            if 2 * wide > side {
                return;
            }
            self.twice.resize(self.window.len() - wide, 0.0);
            add_two(&mut self.twice, &self.window, &self.window[wide..]);
            std::mem::swap(&mut self.window, &mut self.twice);
            wide *= 2;
        }
    }
}

widest! {
    fn add_row(columns: &mut [f64], row: &[f32], sign: f64) {
        for (c, v) in columns.iter_mut().zip(row) {
            *c += sign * f64::from(*v);
        }
    }
}

widest! {
    fn add(sums: &mut [f64], of: &[f64]) {
        for (sum, v) in sums.iter_mut().zip(of) {
            *sum += v;
        }
    }
}

widest! {
    fn add_two(out: &mut [f64], a: &[f64], b: &[f64]) {
        for ((out, a), b) in out.iter_mut().zip(a).zip(b) {
            *out = a + b;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_box_mean_is_the_plain_mean_with_repeated_edges() {
        let src = Image::from_vec(4, 3, (0..12).map(|v| (v * v) as f32).collect()).unwrap();
        let mut dst = Image::default();
        for side in [1, 3, 5, 9, 15, 23] {
            BoxMean::default().run(&src, side, &mut dst);
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
}
