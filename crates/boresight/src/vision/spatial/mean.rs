//! Mean of an n x n window: column sums that run down the image, then the sum of n neighbouring columns.
//!
//! Source: SPEC B, eq 4.2. Integers: column sums are updated by the row that enters and the row that leaves; u8 up to
//! 15x15 stays in 16-bit lanes (15² * 255 < 2¹⁶), the rest in 32 bits; the result is the nearest integer (n² is odd, so
//! there are no ties: OpenCV's `blur` gives the same). f32: summed afresh in f64, rounded once, so that one NaN or
//! infinity spoils its own windows only.
//! The sum of n neighbours doubles (1, 2, 4, ... columns) and adds up the powers of n: about 2 log2(n) vector additions.

use super::border::RowRing;
use super::pixel::SpatialPixel;
use crate::Image;
use multiversion::multiversion;

/// Column sums and the doubled sums.
#[derive(Clone, Debug, Default)]
pub(super) struct Scratch {
    columns16: Vec<u16>,
    columns32: Vec<u32>,
    columns64: Vec<f64>,
    work16: [Vec<u16>; 3],
    work32: [Vec<u32>; 3],
    work64: [Vec<f64>; 3],
}

fn refill<V: Copy>(v: &mut Vec<V>, len: usize, zero: V) {
    v.clear();
    v.resize(len, zero);
}

fn narrow<T: SpatialPixel>(n: usize) -> bool {
    T::INTEGER && size_of::<T>() == 1 && n <= 15
}

/// Clears the sums for a new image.
pub(super) fn begin<T: SpatialPixel>(ring: &RowRing<T>, s: &mut Scratch) {
    let len = ring.stride();
    if narrow::<T>(2 * ring.radius() + 1) {
        refill(&mut s.columns16, len, 0);
        s.work16.iter_mut().for_each(|v| refill(v, len, 0));
    } else if T::INTEGER {
        refill(&mut s.columns32, len, 0);
        s.work32.iter_mut().for_each(|v| refill(v, len, 0));
    } else {
        refill(&mut s.columns64, len, 0.0);
        s.work64.iter_mut().for_each(|v| refill(v, len, 0.0));
    }
}

/// Writes row `y` of the mean.
pub(super) fn row<T: SpatialPixel>(
    ring: &mut RowRing<T>,
    src: &Image<T>,
    y: usize,
    n: usize,
    s: &mut Scratch,
    out: &mut [T],
) {
    if n == 1 {
        out.copy_from_slice(src.row(y));
        return;
    }
    let r = ring.radius() as isize;
    let first = y == 0;
    let leaving = y as isize - r - 1;
    if !T::INTEGER {
        while ring.wants_row(y) {
            ring.push(|i, keys| keys.copy_from_slice(src.row(i)));
        }
        s.columns64.fill(0.0);
        for i in -r..=r {
            add_f64(ring.row(y as isize + i), &mut s.columns64);
        }
        let sum = neighbours_f64(n, &s.columns64, &mut s.work64, out.len());
        divide_f64(sum, (n * n) as f64, out);
        return;
    }
    // The row that leaves may share its slot with the row that enters: take it off first.
    if narrow::<T>(n) {
        if !first {
            sub_u16(ring.row(leaving), &mut s.columns16);
        }
        while ring.wants_row(y) {
            ring.push(|i, keys| keys.copy_from_slice(src.row(i)));
        }
        for i in if first { -r..=r } else { r..=r } {
            add_u16(ring.row(y as isize + i), &mut s.columns16);
        }
        match n {
            3 => mean_u16::<3, T>(&s.columns16, out),
            5 => mean_u16::<5, T>(&s.columns16, out),
            _ => {
                let sum = neighbours_u16(n, &s.columns16, &mut s.work16, out.len());
                divide_u16(sum, n * n, out);
            }
        }
    } else {
        if !first {
            sub_u32(ring.row(leaving), &mut s.columns32);
        }
        while ring.wants_row(y) {
            ring.push(|i, keys| keys.copy_from_slice(src.row(i)));
        }
        for i in if first { -r..=r } else { r..=r } {
            add_u32(ring.row(y as isize + i), &mut s.columns32);
        }
        let sum = neighbours_u32(n, &s.columns32, &mut s.work32, out.len());
        divide_u32(sum, n * n, out);
    }
}

macro_rules! accumulate {
    ($name:ident, $v:ty, $get:ident, $op:ident) => {
        #[multiversion(targets("x86_64+avx512f+avx512bw+avx512vl", "x86_64+avx2", "x86_64+sse4.2"))]
        fn $name<T: SpatialPixel>(row: &[T], columns: &mut [$v]) {
            for (c, &v) in columns.iter_mut().zip(row) {
                *c = c.$op(v.$get() as $v);
            }
        }
    };
}
accumulate!(add_u16, u16, to_u32, wrapping_add);
accumulate!(sub_u16, u16, to_u32, wrapping_sub);
accumulate!(add_u32, u32, to_u32, wrapping_add);
accumulate!(sub_u32, u32, to_u32, wrapping_sub);

#[multiversion(targets("x86_64+avx512f+avx512bw+avx512vl", "x86_64+avx2", "x86_64+sse4.2"))]
fn add_f64<T: SpatialPixel>(row: &[T], columns: &mut [f64]) {
    for (c, &v) in columns.iter_mut().zip(row) {
        *c += v.to_f64();
    }
}

/// floor(2¹⁸ / area) + 1: multiplying and dropping 18 bits divides every sum up to 255 `area` + `area / 2` exactly
/// for the areas 9 and 25 (tested one by one).
fn reciprocal(area: usize) -> u16 {
    ((1 << 18) / area as u32 + 1) as u16
}

#[inline(always)]
fn divide(sum: u16, half: u16, k: u16) -> u16 {
    ((u32::from(sum.wrapping_add(half)) * u32::from(k)) >> 16) as u16 >> 2
}

#[multiversion(targets("x86_64+avx512f+avx512bw+avx512vl", "x86_64+avx2", "x86_64+sse4.2"))]
fn mean_u16<const N: usize, T: SpatialPixel>(columns: &[u16], out: &mut [T]) {
    let (half, k) = ((N * N / 2) as u16, reciprocal(N * N));
    let w = out.len();
    let shifted: [&[u16]; N] = std::array::from_fn(|i| &columns[i..i + w]);
    for x in 0..w {
        let mut sum = 0u16;
        for s in shifted {
            sum = sum.wrapping_add(s[x]);
        }
        out[x] = T::from_u16_exact(divide(sum, half, k));
    }
}

#[multiversion(targets("x86_64+avx512f+avx512bw+avx512vl", "x86_64+avx2", "x86_64+sse4.2"))]
fn divide_u16<T: SpatialPixel>(sum: &[u16], area: usize, out: &mut [T]) {
    // The fraction is at least 1 / (2 * 225) away from 1/2; the error of a product of floats below 256 is 3e-5.
    let inverse = 1.0 / area as f32;
    for (o, &s) in out.iter_mut().zip(sum) {
        *o = T::from_u16_exact((f32::from(s) * inverse + 0.5) as u16);
    }
}

#[multiversion(targets("x86_64+avx512f+avx512bw+avx512vl", "x86_64+avx2", "x86_64+sse4.2"))]
fn divide_u32<T: SpatialPixel>(sum: &[u32], area: usize, out: &mut [T]) {
    // The sum's fraction is at least 1 / (2 * 255²) away from 1/2, far above the error of a product of doubles.
    let inverse = 1.0 / area as f64;
    for (o, &s) in out.iter_mut().zip(sum) {
        *o = T::from_u16_exact((f64::from(s) * inverse + 0.5) as u16);
    }
}

#[multiversion(targets("x86_64+avx512f+avx512bw+avx512vl", "x86_64+avx2", "x86_64+sse4.2"))]
fn divide_f64<T: SpatialPixel>(sum: &[f64], area: f64, out: &mut [T]) {
    for (o, &s) in out.iter_mut().zip(sum) {
        *o = T::from_f64(s / area);
    }
}

macro_rules! neighbours {
    ($name:ident, $step:ident, $add:ident, $v:ty, $op:ident) => {
        #[multiversion(targets("x86_64+avx512f+avx512bw+avx512vl", "x86_64+avx2", "x86_64+sse4.2"))]
        fn $step(from: &[$v], shift: usize, to: &mut [$v]) {
            let n = from.len() - shift;
            let (a, b, to) = (&from[..n], &from[shift..], &mut to[..n]);
            for i in 0..n {
                to[i] = a[i].$op(b[i]);
            }
        }

        #[multiversion(targets("x86_64+avx512f+avx512bw+avx512vl", "x86_64+avx2", "x86_64+sse4.2"))]
        fn $add(part: &[$v], sum: &mut [$v]) {
            for (s, &p) in sum.iter_mut().zip(part) {
                *s = s.$op(p);
            }
        }

        /// Sums of `n` neighbours, `width` of them.
        fn $name<'a>(n: usize, columns: &[$v], work: &'a mut [Vec<$v>; 3], width: usize) -> &'a [$v] {
            let [sum, power, next] = work;
            let sum = &mut sum[..width];
            sum.fill(<$v>::default());
            power.copy_from_slice(columns);
            let (mut offset, mut step) = (0, 1);
            // `power[x]` holds the sum of `step` columns from x on.
            while step <= n {
                if n & step != 0 {
                    $add(&power[offset..offset + width], sum);
                    offset += step;
                }
                if 2 * step <= n {
                    $step(power, step, next);
                    std::mem::swap(power, next);
                }
                step *= 2;
            }
            sum
        }
    };
}
neighbours!(neighbours_u16, double_u16, sum_u16, u16, wrapping_add);
neighbours!(neighbours_u32, double_u32, sum_u32, u32, wrapping_add);

trait PlainAdd {
    fn plain_add(self, other: Self) -> Self;
}
impl PlainAdd for f64 {
    #[inline(always)]
    fn plain_add(self, other: Self) -> Self {
        self + other
    }
}
neighbours!(neighbours_f64, double_f64, sum_f64, f64, plain_add);

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_division_is_exact_for_every_sum_and_window() {
        for n in (3..=15u32).step_by(2) {
            let area = n * n;
            let sums: Vec<u16> = (0..=255 * area).map(|s| s as u16).collect();
            let exact: Vec<u8> = sums.iter().map(|&s| (f64::from(s) / f64::from(area)).round() as u8).collect();
            let mut ours = vec![0u8; sums.len()];
            divide_u16(&sums, area as usize, &mut ours);
            assert!(ours == exact, "{n} x {n}");
            if n <= 5 {
                let (half, k) = ((area / 2) as u16, reciprocal(area as usize));
                let ours: Vec<u8> = sums.iter().map(|&s| divide(s, half, k) as u8).collect();
                assert!(ours == exact, "{n} x {n}");
            }
        }
    }
}
