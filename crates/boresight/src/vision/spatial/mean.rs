//! Mean of an n x n window: column sums that run down the image, then the sum of n neighbouring columns.
//!
//! Source: `docs/theory/image.md` (thesis eq. 4.2). Integers: column sums are updated by the row that enters and the
//! row that leaves; u8 up to 15x15 stays in 16-bit lanes (15² * 255 < 2¹⁶), the rest in 32 bits; the result is the
//! nearest integer (n² is odd, so there are no ties: OpenCV's `blur` gives the same). f32: summed afresh in f64,
//! rounded once, so that one NaN or infinity spoils its own windows only. The sums are padded, not the pixels: a padded
//! column is a copy of another. The sum of n neighbours: n additions up to 5; above, doubling (1, 2, 4, ... columns)
//! or, in 32 bits, a running sum.

use super::border::Border;
use super::pixel::SpatialPixel;
use crate::Image;

/// Column sums, padded, and room for the sums of neighbours.
#[derive(Clone, Debug, Default)]
pub(super) struct Scratch {
    columns16: Vec<u16>,
    columns32: Vec<u32>,
    columns64: Vec<f64>,
    work16: [Vec<u16>; 3],
    sum32: Vec<u32>,
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
pub(super) fn begin<T: SpatialPixel>(width: usize, n: usize, s: &mut Scratch) {
    let len = width + n - 1;
    if narrow::<T>(n) {
        refill(&mut s.columns16, len, 0);
        s.work16.iter_mut().for_each(|v| refill(v, len, 0));
    } else if T::INTEGER {
        refill(&mut s.columns32, len, 0);
        refill(&mut s.sum32, width, 0);
    } else {
        refill(&mut s.columns64, len, 0.0);
        s.work64.iter_mut().for_each(|v| refill(v, len, 0.0));
    }
}

/// Writes row `y` of the mean.
pub(super) fn row<T: SpatialPixel>(src: &Image<T>, y: usize, n: usize, border: Border, s: &mut Scratch, out: &mut [T]) {
    if n == 1 {
        return out.copy_from_slice(src.row(y));
    }
    let (w, r, top) = (out.len(), n / 2, y as isize);
    let reach = r as isize;
    let at = |i: isize| border.index(i, src.height()).map(|i| src.row(i));
    let entering = || if y == 0 { -reach..=reach } else { reach..=reach };
    let leaving = if y == 0 { None } else { at(top - reach - 1) };
    if narrow::<T>(n) {
        let columns = &mut s.columns16[r..r + w];
        match (at(top + reach), leaving) {
            (Some(new), Some(old)) => exchange_u16(new, old, columns),
            _ => {
                leaving.into_iter().for_each(|old| sub_u16(old, columns));
                entering().filter_map(|i| at(top + i)).for_each(|new| add_u16(new, columns));
            }
        }
        border.pad(&mut s.columns16, r, w, 0);
        match n {
            3 => mean_u16::<3, T>(&s.columns16, out),
            5 => mean_u16::<5, T>(&s.columns16, out),
            _ => divide_u16(neighbours_u16(n, &s.columns16, &mut s.work16, w), n * n, out),
        }
    } else if T::INTEGER {
        let columns = &mut s.columns32[r..r + w];
        leaving.into_iter().for_each(|old| sub_u32(old, columns));
        entering().filter_map(|i| at(top + i)).for_each(|new| add_u32(new, columns));
        border.pad(&mut s.columns32, r, w, 0);
        running_u32(n, &s.columns32, &mut s.sum32);
        if size_of::<T>() == 1 {
            divide_u24(&s.sum32, n * n, out);
        } else {
            divide_u32(&s.sum32, n * n, out);
        }
    } else {
        s.columns64.fill(0.0);
        let columns = &mut s.columns64[r..r + w];
        (-reach..=reach).filter_map(|i| at(top + i)).for_each(|new| add_f64(new, columns));
        border.pad(&mut s.columns64, r, w, 0.0);
        divide_f64(neighbours_f64(n, &s.columns64, &mut s.work64, w), (n * n) as f64, out);
    }
}

macro_rules! accumulate {
    ($name:ident, $v:ty, $get:ident, $op:ident) => {
        widest! {
            fn $name<T: SpatialPixel>(row: &[T], columns: &mut [$v]) {
                for (c, &v) in columns.iter_mut().zip(row) {
                    *c = c.$op(v.$get() as $v);
                }
            }
        }
    };
}
accumulate!(add_u16, u16, to_u32, wrapping_add);
accumulate!(sub_u16, u16, to_u32, wrapping_sub);
accumulate!(add_u32, u32, to_u32, wrapping_add);
accumulate!(sub_u32, u32, to_u32, wrapping_sub);

widest! {
    fn exchange_u16<T: SpatialPixel>(new: &[T], old: &[T], columns: &mut [u16]) {
        for ((c, &new), &old) in columns.iter_mut().zip(new).zip(old) {
            *c = c.wrapping_add(new.to_u32() as u16).wrapping_sub(old.to_u32() as u16);
        }
    }
}

widest! {
    fn add_f64<T: SpatialPixel>(row: &[T], columns: &mut [f64]) {
        for (c, &v) in columns.iter_mut().zip(row) {
            *c += v.to_f64();
        }
    }
}

/// Division of 16-bit sums by multiplication: floor(2^(16 + t) / area) + 1 and t = floor(log2(area)); exact for every sum
/// up to 255 `area` + `area / 2` and every odd window up to 15x15 (tested one by one).
fn reciprocal(area: usize) -> (u16, u32) {
    let t = area.ilog2();
    (((1u32 << (16 + t)) / area as u32 + 1) as u16, t)
}

#[inline(always)]
fn divide(sum: u16, half: u16, (k, t): (u16, u32)) -> u16 {
    ((u32::from(sum.wrapping_add(half)) * u32::from(k)) >> 16) as u16 >> t
}

fn mean_u16<const N: usize, T: SpatialPixel>(columns: &[u16], out: &mut [T]) {
    fearless_simd::dispatch!(fearless_simd::Level::new(), _simd => mean_u16_each_width::<N, T>(columns, out));
}

#[inline(always)]
fn mean_u16_each_width<const N: usize, T: SpatialPixel>(columns: &[u16], out: &mut [T]) {
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

widest! {
    fn divide_u16<T: SpatialPixel>(sum: &[u16], area: usize, out: &mut [T]) {
        let (half, k) = ((area / 2) as u16, reciprocal(area));
        for (o, &s) in out.iter_mut().zip(sum) {
            *o = T::from_u16_exact(divide(s, half, k));
        }
    }
}

widest! {
    /// Sums of 8-bit pixels over 17x17 to 255x255: below 2²⁴, and 2⁴⁰ / area below 2³².
    fn divide_u24<T: SpatialPixel>(sum: &[u32], area: usize, out: &mut [T]) {
        let (half, k) = (area as u32 / 2, ((1u64 << 40) / area as u64 + 1) as u32);
        for (o, &s) in out.iter_mut().zip(sum) {
            *o = T::from_u16_exact(((u64::from(s + half) * u64::from(k)) >> 40) as u16);
        }
    }
}

widest! {
    /// Sums of 16-bit pixels up to 255x255: below 2³²; the product stays below 2⁶⁴ since sum / area <= 2¹⁶ - 1.
    fn divide_u32<T: SpatialPixel>(sum: &[u32], area: usize, out: &mut [T]) {
        let (half, k) = (area as u64 / 2, (1u64 << 48) / area as u64 + 1);
        for (o, &s) in out.iter_mut().zip(sum) {
            *o = T::from_u16_exact(((u64::from(s) + half).wrapping_mul(k) >> 48) as u16);
        }
    }
}

widest! {
    fn divide_f64<T: SpatialPixel>(sum: &[f64], area: f64, out: &mut [T]) {
        for (o, &s) in out.iter_mut().zip(sum) {
            *o = T::from_f64(s / area);
        }
    }
}

/// Sums of `n` neighbours, each from the one before it.
fn running_u32(n: usize, columns: &[u32], sum: &mut [u32]) {
    let mut s = columns[..n - 1].iter().fold(0u32, |s, &c| s.wrapping_add(c));
    // One addition is on the way from one sum to the next: the difference is ready before.
    let mut left = 0u32;
    for ((o, &new), &old) in sum.iter_mut().zip(&columns[n - 1..]).zip(columns) {
        s = s.wrapping_add(new.wrapping_sub(left));
        *o = s;
        left = old;
    }
}

macro_rules! neighbours {
    ($name:ident, $step:ident, $add:ident, $v:ty, $op:ident) => {
        widest! {
            fn $step(from: &[$v], shift: usize, to: &mut [$v]) {
                let n = from.len() - shift;
                let (a, b, to) = (&from[..n], &from[shift..], &mut to[..n]);
                for i in 0..n {
                    to[i] = a[i].$op(b[i]);
                }
            }
        }

        widest! {
            fn $add(part: &[$v], sum: &mut [$v]) {
                for (s, &p) in sum.iter_mut().zip(part) {
                    *s = s.$op(p);
                }
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
        }
    }

    #[test]
    fn the_division_of_large_sums_is_exact_next_to_every_half() {
        for n in (3..=255u64).step_by(2) {
            let area = n * n;
            // The hardest sums lie on both sides of a half; every tenth quotient and the last.
            let quotients = (0..65_535u64).step_by(10).chain([65_534]);
            let sums: Vec<u32> =
                quotients.flat_map(|q| [q * area + area / 2, q * area + area / 2 + 1]).map(|s| s as u32).collect();
            let mut ours = vec![0u16; sums.len()];
            divide_u32(&sums, area as usize, &mut ours);
            assert!(
                sums.iter().zip(&ours).all(|(&s, &o)| u64::from(o) == (u64::from(s) + area / 2) / area),
                "{n} x {n}"
            );
            if n >= 17 {
                let sums: Vec<u32> = sums.into_iter().filter(|&s| u64::from(s) <= 255 * area).collect();
                let mut ours = vec![0u8; sums.len()];
                divide_u24(&sums, area as usize, &mut ours);
                assert!(
                    sums.iter().zip(&ours).all(|(&s, &o)| u64::from(o) == (u64::from(s) + area / 2) / area),
                    "{n} x {n}"
                );
            }
        }
    }
}
