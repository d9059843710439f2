//! Median of an n x n window: networks of minima and maxima for 3x3 and 5x5, bisection up to 15x15, histograms beyond.
//!
//! Source: `docs/theory/image.md` (n odd, so the median is a pixel of the window). 3x3 and 5x5: see [`super::network`];
//! columns are sorted once and padded after sorting, which is the same as padding the pixels. Bisection: the median's
//! key is built from its highest bit down; a bit is set if at most half the window lies below; one register of pixels
//! counts at a time, with no branch: n² * bits / lanes operations a pixel. Above 15x15 for u8:
//! [`super::median_histogram`].

use super::border::{Border, RowRing};
use super::median_histogram::Histograms;
use super::network::{Lattice, median9, median25, sort3, sort5};
use super::pixel::{Key, SpatialPixel};
use crate::Image;
use fearless_simd::{Level, Select, Simd, SimdBase, dispatch};

/// Largest window of the bisection with 8-bit counters: 15² = 225.
const BISECTION_MAX: usize = 15;

/// Sorted columns, or the histograms of a large window.
#[derive(Clone, Debug, Default)]
pub(super) struct Scratch<K> {
    ranks: [Vec<K>; 5],
    zeros: Vec<K>,
    keys: Vec<K>,
    histograms: Histograms,
}

/// Prepares for a new image; the ring has begun it.
pub(super) fn begin<T: SpatialPixel>(ring: &RowRing<T::Key>, src: &Image<T>, s: &mut Scratch<T::Key>) {
    let zero = T::default().key();
    for v in &mut s.ranks {
        v.clear();
        v.resize(ring.stride(), zero);
    }
    for v in [&mut s.keys, &mut s.zeros] {
        v.clear();
        v.resize(src.width(), zero);
    }
    if <T::Key as Key>::N_BITS == 8 && 2 * ring.radius() + 1 > BISECTION_MAX {
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
    let (zero, border) = (T::default().key(), ring.border());
    match n {
        1 => out.copy_from_slice(src.row(y)),
        3 => {
            let rows = window::<3, T>(ring, src, y, &s.zeros);
            T::fill_keys(out, &mut s.keys, |out| {
                dispatch!(Level::new(), simd => median3(simd, rows, border, zero, out));
            });
        }
        5 => {
            let rows = window::<5, T>(ring, src, y, &s.zeros);
            let ranks = s.ranks.each_mut().map(Vec::as_mut_slice);
            T::fill_keys(
                out,
                &mut s.keys,
                |out| dispatch!(Level::new(), simd => median5(simd, rows, ranks, border, zero, out)),
            );
        }
        _ if <T::Key as Key>::N_BITS == 8 && n > BISECTION_MAX => {
            let r = ring.radius() as isize;
            // The row that leaves may share its slot with the row that enters: take it off first.
            if y > 0 {
                s.histograms.remove(ring.row(y as isize - r - 1));
            }
            ring.read(y, |i, keys| T::keys(src.row(i), keys));
            for i in if y == 0 { -r..=r } else { r..=r } {
                s.histograms.add(ring.row(y as isize + i));
            }
            T::fill_keys(out, &mut s.keys, |out| s.histograms.row(n, out));
        }
        _ => {
            ring.read(y, |i, keys| T::keys(src.row(i), keys));
            let ring = &*ring;
            T::fill_keys(out, &mut s.keys, |out| dispatch!(Level::new(), simd => bisect(simd, ring, y, n, out)));
        }
    }
}

/// The rows of the window as keys, without padding: straight from the image where values are their own keys.
fn window<'a, const N: usize, T: SpatialPixel>(
    ring: &'a mut RowRing<T::Key>,
    src: &'a Image<T>,
    y: usize,
    zeros: &'a [T::Key],
) -> [&'a [T::Key]; N] {
    let (r, border) = (ring.radius(), ring.border());
    let direct = T::as_keys(&[]).is_some();
    if !direct {
        ring.read(y, |i, keys| T::keys(src.row(i), keys));
    }
    let ring = &*ring;
    std::array::from_fn(|i| {
        let at = (y + i) as isize - r as isize;
        let row = border.index(at, src.height()).map(|i| src.row(i));
        match row {
            None => zeros,
            Some(row) => T::as_keys(row).unwrap_or_else(|| &ring.row(at)[r..r + src.width()]),
        }
    })
}

/// A register of keys as a lattice: minima and maxima lane by lane.
#[derive(Clone, Copy)]
struct Register<S: Simd, K: Key>(K::Lanes<S>);

impl<S: Simd, K: Key> Lattice for Register<S, K> {
    #[inline(always)]
    fn low(self, other: Self) -> Self {
        Self(self.0.min(other.0))
    }
    #[inline(always)]
    fn high(self, other: Self) -> Self {
        Self(self.0.max(other.0))
    }
}

#[inline(always)]
fn load<S: Simd, K: Key>(simd: S, row: &[K], x: usize) -> Register<S, K> {
    Register(K::Lanes::<S>::from_slice(simd, &row[x..x + K::Lanes::<S>::LEN]))
}

#[inline(always)]
fn store<S: Simd, K: Key>(lanes: Register<S, K>, row: &mut [K], x: usize) {
    lanes.0.store_slice(&mut row[x..x + K::Lanes::<S>::LEN]);
}

/// Sorts the columns of the window and pads the sorted columns.
#[inline(always)]
fn sort_columns<const N: usize, S: Simd, K: Key>(
    simd: S,
    rows: [&[K]; N],
    ranks: &mut [&mut [K]; N],
    border: Border,
    zero: K,
    sort: impl Fn([Register<S, K>; N]) -> [Register<S, K>; N],
) {
    let (w, r) = (rows[0].len(), N / 2);
    let lanes = K::Lanes::<S>::LEN;
    let mut x = 0;
    while x < w {
        if x + lanes > w {
            // Back over columns already done, or column by column in an image narrower than a register.
            x = w.saturating_sub(lanes);
            if w < lanes {
                for x in 0..w {
                    let mut column = rows.map(|row| row[x]);
                    column.sort_unstable();
                    for (rank, key) in ranks.iter_mut().zip(column) {
                        rank[r + x] = key;
                    }
                }
                break;
            }
        }
        let column = sort(rows.map(|row| load(simd, row, x)));
        for (rank, lanes) in ranks.iter_mut().zip(column) {
            store(lanes, rank, r + x);
        }
        x += lanes;
    }
    for rank in ranks {
        border.pad(rank, r, w, zero);
    }
}

#[inline(always)]
fn sort_at<S: Simd, K: Key>(simd: S, [a, b, c]: [&[K]; 3], x: usize) -> [Register<S, K>; 3] {
    sort3([load(simd, a, x), load(simd, b, x), load(simd, c, x)])
}

#[inline(always)]
fn median3<S: Simd, K: Key>(simd: S, rows: [&[K]; 3], border: Border, zero: K, out: &mut [K]) {
    let (w, lanes) = (out.len(), K::Lanes::<S>::LEN);
    let one = |x: usize| {
        let columns: [[K; 3]; 3] = std::array::from_fn(|i| {
            let at = border.index((x + i) as isize - 1, w);
            sort3(rows.map(|row| at.map_or(zero, |x| row[x])))
        });
        median9(std::array::from_fn(|k| columns.map(|c| c[k])))
    };
    if w < lanes + 2 {
        return out.iter_mut().enumerate().for_each(|(x, o)| *o = one(x));
    }
    // Sorting a column three times costs less than storing it sorted and loading it three times.
    for block in 0..(w - 2).div_ceil(lanes) {
        let x = (block * lanes).min(w - 2 - lanes);
        let [a0, a1, a2] = sort_at(simd, rows, x);
        let [b0, b1, b2] = sort_at(simd, rows, x + 1);
        let [c0, c1, c2] = sort_at(simd, rows, x + 2);
        store(median9([[a0, b0, c0], [a1, b1, c1], [a2, b2, c2]]), out, x + 1);
    }
    (out[0], out[w - 1]) = (one(0), one(w - 1));
}

#[inline(always)]
fn five<S: Simd, K: Key>(simd: S, rank: &[K], x: usize) -> [Register<S, K>; 5] {
    [
        load(simd, rank, x),
        load(simd, rank, x + 1),
        load(simd, rank, x + 2),
        load(simd, rank, x + 3),
        load(simd, rank, x + 4),
    ]
}

#[inline(always)]
fn median5<S: Simd, K: Key>(
    simd: S,
    rows: [&[K]; 5],
    mut ranks: [&mut [K]; 5],
    border: Border,
    zero: K,
    out: &mut [K],
) {
    sort_columns(simd, rows, &mut ranks, border, zero, sort5);
    let (w, lanes) = (out.len(), K::Lanes::<S>::LEN);
    if w < lanes {
        for x in 0..w {
            out[x] = median25(std::array::from_fn(|k| std::array::from_fn(|i| ranks[k][x + i])));
        }
        return;
    }
    for block in 0..w.div_ceil(lanes) {
        let x = (block * lanes).min(w - lanes);
        let [a, b, c, d, e] = &ranks;
        let rank = [five(simd, a, x), five(simd, b, x), five(simd, c, x), five(simd, d, x), five(simd, e, x)];
        store(median25(rank), out, x);
    }
}

#[inline(always)]
fn bisect<S: Simd, K: Key>(simd: S, ring: &RowRing<K>, y: usize, n: usize, out: &mut [K]) {
    let (w, lanes, r) = (out.len(), K::Lanes::<S>::LEN, ring.radius() as isize);
    if w < lanes {
        let mut window = Vec::with_capacity(n * n);
        for x in 0..w {
            window.clear();
            for i in -r..=r {
                window.extend_from_slice(&ring.row(y as isize + i)[x..x + n]);
            }
            out[x] = *window.select_nth_unstable(n * n / 2).1;
        }
        return;
    }
    let (zero, one) = (K::Lanes::<S>::splat(simd, K::from_level(0)), K::Lanes::<S>::splat(simd, K::from_level(1)));
    let half = K::Lanes::<S>::splat(simd, K::from_level(n * n / 2));
    for block in 0..w.div_ceil(lanes) {
        let x = (block * lanes).min(w - lanes);
        let mut low = zero;
        for bit in (0..K::N_BITS).rev() {
            let trial = low + K::from_level(1 << bit);
            let mut below = zero;
            for i in -r..=r {
                let row = &ring.row(y as isize + i)[x..x + lanes + n - 1];
                for dx in 0..n {
                    let less = load::<S, K>(simd, row, dx).0.simd_lt(trial);
                    below += less.select(one, zero);
                }
            }
            low = below.simd_le(half).select(trial, low);
        }
        store(Register::<S, K>(low), out, x);
    }
}
