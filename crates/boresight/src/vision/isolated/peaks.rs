//! The pixels that a target's cluster can begin at: local maxima above the bar of their cell.
//!
//! Units: px, counts; values times the sign of the side.

use super::bars::{Bar, Bars, SideClass};
use super::cells::{CELL, Cells};
use crate::Image;
use crate::vision::pixel::Pixel;

/// A local maximum.
#[derive(Clone, Copy, Debug)]
pub struct Peak {
    pub x: u32,
    pub y: u32,
    /// Its cell, in the order of the rows.
    pub cell: usize,
    /// Whether it is the highest of its cell.
    pub highest: bool,
    /// By which peaks are ordered: the highest first, equals in the order of the rows.
    order: u64,
}

/// Finds the peaks of one side above `lowest`, the highest first; equals in the order of the rows. `maxima` is scratch.
pub fn find<T: Pixel>(
    image: &Image<T>,
    cells: &Cells,
    bars: &Bars,
    bar: &Bar,
    lowest: f64,
    maxima: &mut Vec<u8>,
    peaks: &mut Vec<Peak>,
) {
    peaks.clear();
    // The border's pixels are none.
    if image.width() < 3 || image.height() < 3 {
        return;
    }
    let (columns, dark) = (cells.size().0, bar.sign < 0.0);
    let (width, small) = (image.width(), SideClass::of(1));
    let Some(finite) = T::band(f64::MIN, f64::MAX) else { return };
    // A byte a pixel, rows of whole cells: eight are one number.
    let stride = columns * CELL;
    maxima.clear();
    maxima.resize(stride * CELL, 0);
    // The row of cells whose maxima are known.
    let mut known = None;
    for (cell, high) in cells.highest(dark).enumerate() {
        let high = f64::from(high);
        if high < lowest || high < bars.floor() {
            continue;
        }
        let Some(need) = bars.need(cells, bar, (cell, true), small, false) else { continue };
        if high < need.mean {
            continue;
        }
        // Of the others of the cell only small clusters are looked for.
        let least = bars.need(cells, bar, (cell, false), small, false).map_or(high, |n| n.mean.min(high)).max(lowest);
        let band = if dark { T::band(f64::MIN, -least) } else { T::band(least, f64::MAX) };
        let Some((low, most)) = band else { continue };
        let (left, top) = (cell % columns * CELL, cell / columns * CELL);
        let rows = top.max(1)..(top + CELL).min(image.height().saturating_sub(1));
        if known != Some(top) {
            known = Some(top);
            for y in rows.clone() {
                let around = [y - 1, y, y + 1].map(|y| image.row(y));
                let out = &mut maxima[(y - top) * stride..][..width];
                if dark { find_minima(around, finite, out) } else { find_maxima(around, finite, out) }
            }
        }
        for y in rows {
            let row = image.row(y);
            let mask = maxima[(y - top) * stride + left..].first_chunk().copied().unwrap_or_default();
            let mut rest = u64::from_le_bytes(mask);
            while rest != 0 {
                let i = rest.trailing_zeros() as usize / 8;
                rest &= !(0xff << (8 * i));
                let x = left + i;
                let p = row[x];
                if p >= low && p <= most {
                    let value = bar.sign * p.value();
                    let order = descending(value as f32) | (y * width + x) as u64;
                    peaks.push(Peak { x: x as u32, y: y as u32, cell, highest: value >= high, order });
                }
            }
        }
    }
    peaks.sort_unstable_by_key(|p| p.order);
}

/// A number that falls with a value, in the upper half.
fn descending(value: f32) -> u64 {
    // The bits of floats are in the order of their values, those of negative ones in the reverse of it.
    let bits = value.to_bits();
    let rising = if bits >> 31 == 0 { bits | 1 << 31 } else { !bits };
    u64::from(!rising) << 32
}

/// Makes a function that writes 1 in a row, but for its ends, where no finite neighbour is beyond the pixel; of equal neighbours the first counts, else 0. `finite` are the least and the largest
/// finite value.
macro_rules! maxima {
    ($name:ident, $as_high:tt, $higher:tt) => {
        widest! {
            fn $name<T: Pixel>(around: [&[T]; 3], finite: (T, T), out: &mut [u8]) {
                let n = out.len().saturating_sub(2);
                let (least, most) = finite;
                let (a, b, c) = (&around[0][..n], &around[0][1..][..n], &around[0][2..][..n]);
                let (d, own, e) = (&around[1][..n], &around[1][1..][..n], &around[1][2..][..n]);
                let (f, g, h) = (&around[2][..n], &around[2][1..][..n], &around[2][2..][..n]);
                let out = &mut out[1..][..n];
                for i in 0..n {
                    let v = own[i];
                    let first = ((a[i] $as_high v) & (a[i] >= least) & (a[i] <= most))
                        | ((b[i] $as_high v) & (b[i] >= least) & (b[i] <= most))
                        | ((c[i] $as_high v) & (c[i] >= least) & (c[i] <= most))
                        | ((d[i] $as_high v) & (d[i] >= least) & (d[i] <= most));
                    let later = ((e[i] $higher v) & (e[i] >= least) & (e[i] <= most))
                        | ((f[i] $higher v) & (f[i] >= least) & (f[i] <= most))
                        | ((g[i] $higher v) & (g[i] >= least) & (g[i] <= most))
                        | ((h[i] $higher v) & (h[i] >= least) & (h[i] <= most));
                    out[i] = u8::from(!(first | later));
                }
            }
        }
    };
}
maxima!(find_maxima, >=, >);
maxima!(find_minima, <=, <);

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    #[test]
    fn a_maximum_is_what_no_finite_neighbour_exceeds_and_the_first_of_equals() {
        let mut rng = ChaCha8Rng::seed_from_u64(12);
        let strange = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY];
        let mut n_found = 0;
        for _ in 0..50 {
            let rows: Vec<Vec<f32>> = (0..3)
                .map(|_| {
                    let mut value = || match rng.random_range(0..12) {
                        i @ 0..3 => strange[i],
                        v => v as f32 % 4.0,
                    };
                    (0..40).map(|_| value()).collect()
                })
                .collect();
            let around = [&rows[0][..], &rows[1], &rows[2]];
            for dark in [false, true] {
                let sign = if dark { -1.0 } else { 1.0 };
                let mut out = vec![0; 40];
                let run = if dark { find_minima } else { find_maxima };
                run(around, (f32::MIN, f32::MAX), &mut out);
                for x in 1..39 {
                    let c = sign * rows[1][x];
                    let mut beside = (0..3).flat_map(|y| (x - 1..=x + 1).map(move |i| (y, i))).filter(|p| *p != (1, x));
                    let is_beyond = |(y, i): (usize, usize)| {
                        let v = sign * rows[y][i];
                        v.is_finite() && (v > c || (v == c && (y, i) < (1, x)))
                    };
                    assert_eq!(out[x] == 1, !beside.any(is_beyond), "{x} {dark}");
                    n_found += usize::from(out[x]);
                }
            }
        }
        assert!(n_found > 100, "{n_found}");
    }
}
