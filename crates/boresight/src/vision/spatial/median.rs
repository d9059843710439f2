//! Median of an n x n window: networks of minima and maxima for 3x3 and 5x5, bisection up to 15x15, histograms beyond.
//!
//! Source: SPEC B (n odd, so the median is a pixel of the window). 3x3 and 5x5: see [`super::network`]. Bisection: the
//! median's key is built from its highest bit down; a bit is set if at most half the window lies below; a block of 64
//! pixels counts at a time, with no branch: n² * bits / lanes operations a pixel.
//! Above 15x15 for u8: column histograms, see [`super::median_histogram`].

use super::border::RowRing;
use super::median_histogram::Histograms;
use super::network::{median9, median25, sort3, sort5};
use super::pixel::{Key, SpatialPixel};
use crate::Image;
use multiversion::multiversion;

/// Largest window of the bisection with 8-bit counters: 15² = 225.
const BISECTION_MAX: usize = 15;

/// Sorted columns, or the histograms of a large window.
#[derive(Clone, Debug, Default)]
pub(super) struct Scratch<K> {
    ranks: [Vec<K>; 5],
    keys: Vec<K>,
    histograms: Histograms,
}

/// Prepares for a new image; the ring has begun it.
pub(super) fn begin<T: SpatialPixel>(ring: &mut RowRing<T::Key>, src: &Image<T>, s: &mut Scratch<T::Key>) {
    let zero = T::default().key();
    for v in s.ranks.iter_mut().chain([&mut s.keys]) {
        v.clear();
    }
    for v in &mut s.ranks {
        v.resize(ring.stride(), zero);
    }
    s.keys.resize(src.width(), zero);
    if T::Key::BITS == 8 && 2 * ring.radius() + 1 > BISECTION_MAX {
        s.histograms.begin(ring.stride());
    }
}

/// Writes row `y` of the median.
pub(super) fn row<T: SpatialPixel>(
    ring: &mut RowRing<T::Key>,
    src: &Image<T>,
    y: usize,
    n: usize,
    s: &mut Scratch<T::Key>,
    out: &mut [T],
) {
    if n == 1 {
        out.copy_from_slice(src.row(y));
        return;
    }
    let large8 = T::Key::BITS == 8 && n > BISECTION_MAX;
    if large8 && y > 0 {
        let leaving = ring.row(y as isize - ring.radius() as isize - 1);
        s.histograms.remove(leaving);
    }
    while ring.wants_row(y) {
        ring.push(|i, keys| T::keys(src.row(i), keys));
    }
    let [r0, r1, r2, r3, r4] = &mut s.ranks;
    match n {
        3 => {
            sort_columns3(ring.window(y), [r0, r1, r2]);
            median3::<T::Key>([r0, r1, r2], &mut s.keys);
        }
        5 => {
            sort_columns5(ring.window(y), [r0, r1, r2, r3, r4]);
            median5::<T::Key>([r0, r1, r2, r3, r4], &mut s.keys);
        }
        _ if large8 => {
            let r = ring.radius() as isize;
            for i in if y == 0 { -r..=r } else { r..=r } {
                s.histograms.add(ring.row(y as isize + i));
            }
            s.histograms.row(n, &mut s.keys);
        }
        _ if n <= BISECTION_MAX => bisect_small(ring, y, n, &mut s.keys),
        _ => bisect_large(ring, y, n, &mut s.keys),
    }
    for (o, &k) in out.iter_mut().zip(&s.keys) {
        *o = T::from_key(k);
    }
}

#[multiversion(targets("x86_64+avx512f+avx512bw+avx512vl", "x86_64+avx2", "x86_64+sse4.2"))]
fn sort_columns3<K: Key>(rows: [&[K]; 3], ranks: [&mut [K]; 3]) {
    let [a, b, c] = rows;
    let n = a.len();
    let (b, c) = (&b[..n], &c[..n]);
    let [r0, r1, r2] = ranks;
    let (r0, r1, r2) = (&mut r0[..n], &mut r1[..n], &mut r2[..n]);
    for x in 0..n {
        [r0[x], r1[x], r2[x]] = sort3([a[x], b[x], c[x]]);
    }
}

#[multiversion(targets("x86_64+avx512f+avx512bw+avx512vl", "x86_64+avx2", "x86_64+sse4.2"))]
fn median3<K: Key>(ranks: [&[K]; 3], out: &mut [K]) {
    let w = out.len();
    let shifted = ranks.map(|r| [&r[..w], &r[1..][..w], &r[2..][..w]]);
    for x in 0..w {
        out[x] = median9(shifted.map(|r| r.map(|s| s[x])));
    }
}

#[multiversion(targets("x86_64+avx512f+avx512bw+avx512vl", "x86_64+avx2", "x86_64+sse4.2"))]
fn sort_columns5<K: Key>(rows: [&[K]; 5], ranks: [&mut [K]; 5]) {
    let n = rows[0].len();
    let [a, b, c, d, e] = rows.map(|r| &r[..n]);
    let [r0, r1, r2, r3, r4] = ranks.map(|r| &mut r[..n]);
    for x in 0..n {
        [r0[x], r1[x], r2[x], r3[x], r4[x]] = sort5([a[x], b[x], c[x], d[x], e[x]]);
    }
}

#[multiversion(targets("x86_64+avx512f+avx512bw+avx512vl", "x86_64+avx2", "x86_64+sse4.2"))]
fn median5<K: Key>(ranks: [&[K]; 5], out: &mut [K]) {
    let w = out.len();
    let shifted = ranks.map(|r| [&r[..w], &r[1..][..w], &r[2..][..w], &r[3..][..w], &r[4..][..w]]);
    for x in 0..w {
        out[x] = median25(shifted.map(|r| r.map(|s| s[x])));
    }
}

/// Pixels that a bisection treats at a time.
const BLOCK: usize = 64;

macro_rules! bisection {
    ($name:ident, $kernel:ident, $count:ty) => {
        /// Bisection with counters wide enough for the window.
        fn $name<K: Key>(ring: &RowRing<K>, y: usize, n: usize, out: &mut [K]) {
            let w = out.len();
            let mut x0 = 0;
            while x0 < w {
                // A last partial block goes back over pixels already done, or stays short in a narrow image.
                let at = if x0 + BLOCK <= w { x0 } else { w.saturating_sub(BLOCK) };
                let len = BLOCK.min(w);
                $kernel(ring, y, n, at, &mut out[at..at + len]);
                x0 += BLOCK;
            }
        }

        #[multiversion(targets("x86_64+avx512f+avx512bw+avx512vl", "x86_64+avx2", "x86_64+sse4.2"))]
        fn $kernel<K: Key>(ring: &RowRing<K>, y: usize, n: usize, x0: usize, out: &mut [K]) {
            let half = (n * n / 2) as $count;
            let len = out.len();
            let mut low = [K::default(); BLOCK];
            for bit in (0..K::BITS).rev() {
                let mut trial = low;
                for t in &mut trial {
                    *t = t.with_bit(bit);
                }
                let mut below = [0 as $count; BLOCK];
                let r = ring.radius() as isize;
                for i in -r..=r {
                    let row = &ring.row(y as isize + i)[x0..];
                    for dx in 0..n {
                        if len == BLOCK {
                            let part = &row[dx..dx + BLOCK];
                            for j in 0..BLOCK {
                                below[j] += <$count>::from(part[j] < trial[j]);
                            }
                        } else {
                            for (j, &v) in row[dx..dx + len].iter().enumerate() {
                                below[j] += <$count>::from(v < trial[j]);
                            }
                        }
                    }
                }
                for j in 0..BLOCK {
                    low[j] = if below[j] <= half { trial[j] } else { low[j] };
                }
            }
            out.copy_from_slice(&low[..len]);
        }
    };
}
bisection!(bisect_small, bisect_block8, u8);
bisection!(bisect_large, bisect_block16, u16);
