//! Convolution with any odd n x n kernel: y(i, j) = Σ h(a, b) x(i - a, j - b), the kernel turned round.
//!
//! Source: `docs/theory/image.md` (thesis eq. 4.1): a true convolution (a correlation has x(i + a, j + b)). Sums in
//! f64; integer results round to the nearest, half away from zero, and saturate. Limits: n odd, up to
//! [`super::MAX_SIZE_PX`]; finite weights.

use super::border::{Border, RowRing};
use super::check_size;
use super::pixel::SpatialPixel;
use crate::{Error, ErrorKind, Image, Result};

/// A square kernel, rows from the top; the middle weight belongs to the pixel itself.
#[derive(Clone, Debug, PartialEq)]
pub struct Kernel {
    size: usize,
    weights: Vec<f64>,
}

impl Kernel {
    /// Builds a kernel of `size` x `size` weights, row by row.
    /// # Errors
    /// An even size, a list of another length, a weight that is not finite.
    pub fn new(size: usize, weights: Vec<f64>) -> Result<Self> {
        check_size(size, "kernel")?;
        if weights.len() != size * size {
            return Err(Error::new(ErrorKind::Config, format!("expected {} weights for {size} x {size}", size * size))
                .at(format!("kernel.weights of length {}", weights.len())));
        }
        if let Some(i) = weights.iter().position(|w| !w.is_finite()) {
            return Err(Error::new(ErrorKind::Config, "expected a finite number")
                .at(format!("kernel.weights[{i}] = {}", weights[i])));
        }
        Ok(Self { size, weights })
    }

    /// Width and height, px.
    pub fn size(&self) -> usize {
        self.size
    }

    /// The weights, row by row.
    pub fn weights(&self) -> &[f64] {
        &self.weights
    }
}

/// Convolves `src` with `kernel` into `dst`, which takes the size of `src`.
pub fn convolve<T: SpatialPixel>(src: &Image<T>, kernel: &Kernel, border: Border, dst: &mut Image<T>) {
    dst.reset(src.width(), src.height(), T::default());
    each_row(src, kernel, border, |y, sum| {
        for (o, &s) in dst.row_mut(y).iter_mut().zip(sum) {
            *o = T::from_f64(s);
        }
    });
}

/// Hands over the exact sums row by row.
pub(super) fn each_row<T: SpatialPixel>(
    src: &Image<T>,
    kernel: &Kernel,
    border: Border,
    mut put: impl FnMut(usize, &[f64]),
) {
    let (w, n) = (src.width(), kernel.size);
    let r = n / 2;
    let mut ring = RowRing::default();
    ring.begin(w, src.height(), r, border, 0.0f64);
    let mut sum = vec![0.0; w];
    for y in 0..src.height() {
        ring.read(y, |i, keys| {
            for (k, v) in keys.iter_mut().zip(src.row(i)) {
                *k = v.to_f64();
            }
        });
        sum.fill(0.0);
        for (a, weights) in kernel.weights.chunks_exact(n).enumerate() {
            // Kernel row a (from the top) takes the image row on the other side.
            let row = ring.row(y as isize + r as isize - a as isize);
            for (b, &h) in weights.iter().enumerate() {
                add_scaled(&row[2 * r - b..2 * r - b + w], h, &mut sum);
            }
        }
        put(y, &sum);
    }
}

widest! {
    fn add_scaled(row: &[f64], h: f64, sum: &mut [f64]) {
        for (s, &v) in sum.iter_mut().zip(row) {
            *s += h * v;
        }
    }
}
