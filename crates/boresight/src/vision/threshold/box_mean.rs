//! Mean over a square box of any odd side, at a cost that does not grow with it.
//!
//! Source: textbook sliding sums: column sums are kept from row to row, a running sum over them gives the boxes. Sums are in f64,
//! so that f32 pixels of any size leave no trace behind. Pixels outside repeat the edge.

use crate::Image;

/// Mean over a square box, the edge pixel repeated outside; cost independent of the box's size.
#[derive(Clone, Debug, Default)]
pub(super) struct BoxMean {
    columns: Vec<f64>,
    prefix: Vec<f64>,
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
            self.prefix.clear();
            let mut sum = 0.0;
            self.prefix.push(sum);
            let padded = std::iter::repeat_n(self.columns[0], r)
                .chain(self.columns.iter().copied())
                .chain(std::iter::repeat_n(self.columns[w - 1], r));
            self.prefix.extend(padded.map(|c| {
                sum += c;
                sum
            }));
            for ((d, left), right) in dst.row_mut(y).iter_mut().zip(&self.prefix).zip(&self.prefix[side..]) {
                *d = ((right - left) * scale) as f32;
            }
            add_row(&mut self.columns, src.row((y + 1 + r).min(h - 1)), 1.0);
            add_row(&mut self.columns, src.row(y.saturating_sub(r)), -1.0);
        }
    }
}

fn add_row(columns: &mut [f64], row: &[f32], sign: f64) {
    for (c, v) in columns.iter_mut().zip(row) {
        *c += sign * f64::from(*v);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_box_mean_is_the_plain_mean_with_repeated_edges() {
        let src = Image::from_vec(4, 3, (0..12).map(|v| (v * v) as f32).collect()).unwrap();
        let mut dst = Image::default();
        for side in [1, 3, 5, 9] {
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
