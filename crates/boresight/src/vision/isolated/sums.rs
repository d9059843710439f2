//! Sums over boxes of an image in four reads: the summed-area table.
//!
//! Source: F. C. Crow, *Summed-area tables for texture mapping*, SIGGRAPH 1984. Sums of 8- and 16-bit pixels are exact in f64; of others their error is known:
//! an entry is a sum of at most w + h steps, each rounded by ε of at most Σ|p|, and a box is four entries.
//! Limits: an image with a pixel that is not finite has no table.

use crate::Image;
use crate::vision::pixel::Pixel;

/// The table of one image; keeps its memory.
#[derive(Debug, Default)]
pub struct Sums {
    /// Sum of all pixels above and to the left, with a row and a column of zeros before them.
    table: Vec<f64>,
    width: usize,
    /// Largest error of a box's sum.
    error: f64,
}

impl Sums {
    /// Reads an image; nothing is known of one that is not finite throughout.
    pub fn read<T: Pixel>(&mut self, image: &Image<T>) {
        let (w, h) = (image.width() + 1, image.height() + 1);
        self.width = w;
        self.table.resize(w * h, 0.0);
        self.table[..w].fill(0.0);
        for y in 0..image.height() {
            let (above, row) = self.table[y * w..].split_at_mut(w);
            let mut sum = 0.0;
            row[0] = 0.0;
            for ((out, up), p) in row[1..w].iter_mut().zip(&above[1..]).zip(image.row(y)) {
                sum += p.value();
                *out = up + sum;
            }
        }
        if !self.table.last().is_some_and(|v| v.is_finite()) {
            self.table.clear();
        }
        self.error = 0.0;
        if T::STEP == 0.0 {
            let total: f64 = (0..image.height()).flat_map(|y| image.row(y)).map(|p| p.value().abs()).sum();
            self.error = 4.0 * (w + h) as f64 * f64::EPSILON * total;
        }
    }

    /// Largest error of a sum.
    pub fn error(&self) -> f64 {
        self.error
    }

    /// Sum over the columns `x0..=x1` of the rows `y0..=y1`.
    pub fn of(&self, [x0, y0, x1, y1]: [usize; 4]) -> Option<f64> {
        let at = |x: usize, y: usize| self.table.get(y * self.width + x).copied();
        Some(at(x1 + 1, y1 + 1)? - at(x0, y1 + 1)? - at(x1 + 1, y0)? + at(x0, y0)?)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sums_are_those_of_the_pixels() {
        let image = Image::from_vec(5, 4, (0..20u8).map(|v| v * 7 % 13).collect()).unwrap();
        let mut sums = Sums::default();
        sums.read(&image);
        for (x0, y0, x1, y1) in [(0, 0, 4, 3), (1, 2, 3, 3), (4, 3, 4, 3), (0, 1, 0, 2)] {
            let by_hand: f64 = (y0..=y1).flat_map(|y| image.row(y)[x0..=x1].iter()).map(|&p| f64::from(p)).sum();
            assert_eq!(sums.of([x0, y0, x1, y1]), Some(by_hand));
        }
        sums.read(&Image::from_vec(2, 1, vec![1.0f32, f32::NAN]).unwrap());
        assert_eq!(sums.of([0, 0, 0, 0]), None);
        sums.read(&Image::filled(0, 0, 1u8));
        sums.read(&Image::filled(3, 2, 2u8));
        assert_eq!(sums.of([0, 0, 2, 1]), Some(12.0));
    }
}
