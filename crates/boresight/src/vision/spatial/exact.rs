//! The spatial filters in f64, without rounding: for references, golden vectors and measurements of the fast forms.
//!
//! Source: `docs/theory/image.md`. Written the plain way; the fast forms must agree with these after rounding. They
//! allocate their result.

use super::convolution::{Kernel, each_row};
use super::{Border, MAX_SIGMA_PX, SpatialPixel, check_sigma, check_size, gaussian};
use crate::{Image, Result};

/// Mean of `size` x `size` pixels, unrounded.
///
/// ```
/// use boresight::{Image, vision::spatial::{Border, mean_exact}};
/// let s = Image::from_vec(3, 3, vec![10u8, 20, 30, 40, 50, 60, 70, 80, 90]).unwrap();
/// let zero = mean_exact(&s, 3, Border::Zero)?;
/// let w9 = [13.333333333333, 23.333333333333, 17.777777777778, 30.0, 50.0, 36.666666666667, 26.666666666667, 43.333333333333, 31.111111111111];
/// assert!(zero.as_slice().iter().zip(w9).all(|(a, b): (&f64, f64)| (a - b).abs() < 1e-12)); // docs/theory/image.md
/// # Ok::<(), boresight::Error>(())
/// ```
/// # Errors
/// A size that is even, zero or above 255.
pub fn mean_exact<T: SpatialPixel>(src: &Image<T>, size: usize, border: Border) -> Result<Image<f64>> {
    check_size(size, "mean")?;
    let area = (size * size) as f64;
    Ok(window_map(src, size, border, |window| window.iter().map(|v| v.to_f64()).sum::<f64>() / area))
}

/// Median of `size` x `size` pixels as f64.
/// # Errors
/// A size that is even, zero or above 255.
pub fn median_exact<T: SpatialPixel>(src: &Image<T>, size: usize, border: Border) -> Result<Image<f64>> {
    check_size(size, "median")?;
    let mut keys = Vec::new();
    Ok(window_map(src, size, border, |window| {
        keys.clear();
        keys.extend(window.iter().map(|v| v.key()));
        let (_, median, _) = keys.select_nth_unstable(window.len() / 2);
        T::from_key(*median).to_f64()
    }))
}

/// Convolution with a kernel, unrounded.
pub fn convolve_exact<T: SpatialPixel>(src: &Image<T>, kernel: &Kernel, border: Border) -> Image<f64> {
    let mut out = Image::filled(src.width(), src.height(), 0.0);
    each_row(src, kernel, border, |y, sum| out.row_mut(y).copy_from_slice(sum));
    out
}

/// Gaussian of standard deviation `sigma_px`, cut at 4 sigma, unrounded.
/// # Errors
/// A sigma outside (0, 50] px.
pub fn gaussian_exact<T: SpatialPixel>(src: &Image<T>, sigma_px: f64, border: Border) -> Result<Image<f64>> {
    check_sigma(sigma_px, "gaussian")?;
    debug_assert!(gaussian::radius_px(MAX_SIGMA_PX) == 200);
    let half = gaussian::weights(sigma_px);
    let r = half.len() - 1;
    let h: Vec<f64> = half.iter().skip(1).rev().chain(&half).copied().collect();
    let at = |i: usize, k: usize, len: usize| border.index(i as isize + k as isize - r as isize, len);
    let (w, ht) = (src.width(), src.height());
    let mut down = Image::filled(w, ht, 0.0);
    for y in 0..ht {
        for (k, &hk) in h.iter().enumerate() {
            let Some(sy) = at(y, k, ht) else { continue };
            for (o, v) in down.row_mut(y).iter_mut().zip(src.row(sy)) {
                *o += hk * v.to_f64();
            }
        }
    }
    let mut out = Image::filled(w, ht, 0.0);
    for y in 0..ht {
        let row = down.row(y);
        for (x, o) in out.row_mut(y).iter_mut().enumerate() {
            *o = h.iter().enumerate().filter_map(|(k, hk)| at(x, k, w).map(|sx| hk * row[sx])).sum();
        }
    }
    Ok(out)
}

fn window_map<T: SpatialPixel>(
    src: &Image<T>,
    size: usize,
    border: Border,
    mut f: impl FnMut(&[T]) -> f64,
) -> Image<f64> {
    let (w, h, r) = (src.width(), src.height(), (size / 2) as isize);
    let mut out = Image::filled(w, h, 0.0);
    let mut window = Vec::with_capacity(size * size);
    for y in 0..h {
        for x in 0..w {
            window.clear();
            for dy in -r..=r {
                let sy = border.index(y as isize + dy, h);
                for dx in -r..=r {
                    let sx = border.index(x as isize + dx, w);
                    window.push(sx.zip(sy).map_or(T::default(), |(sx, sy)| src.row(sy)[sx]));
                }
            }
            out.row_mut(y)[x] = f(&window);
        }
    }
    out
}
