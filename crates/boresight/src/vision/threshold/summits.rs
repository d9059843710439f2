//! Which pixels of a row reach their level and are larger than the four beside them: in most frames few do, and only these are looked at one by one.
//!
//! Of equal neighbours the first in raster order counts as the larger one. Source: textbook non-maximum suppression, a vector of pixels at a time.

use fearless_simd::prelude::*;
use fearless_simd::{Level, dispatch};

/// A row, those above and below it (empty where there is none) and the level of each of its pixels.
#[derive(Clone, Copy)]
pub(super) struct Rows<'a> {
    pub(super) above: &'a [f32],
    pub(super) row: &'a [f32],
    pub(super) below: &'a [f32],
    pub(super) level: &'a [f32],
}

/// Notes the columns, rising, of the pixels above 0 that reach their level and that none of the four beside them exceeds.
pub(super) fn find_summits(rows: Rows<'_>, out: &mut Vec<usize>) {
    dispatch!(Level::new(), simd => find_vectors(simd, rows, out));
}

#[inline(always)]
fn find_vectors<S: Simd>(simd: S, rows: Rows<'_>, out: &mut Vec<usize>) {
    let Rows { above, row, below, level } = rows;
    let (w, n) = (row.len(), S::f32s::LEN);
    let mut x = 0;
    while x < w {
        // Vectors lie inside, so that every pixel has its four neighbours.
        if x == 0 || x + n >= w || above.len() < w || below.len() < w || level.len() < w {
            if is_summit(rows, x) {
                out.push(x);
            }
            x += 1;
            continue;
        }
        let load = |row: &[f32], at: usize| S::f32s::from_slice(simd, &row[at..at + n]);
        let v = load(row, x);
        let reaches = v.simd_ge(load(level, x)) & v.simd_gt(S::f32s::splat(simd, 0.0));
        if reaches.any_true() {
            let before = v.simd_gt(load(row, x - 1)) & v.simd_gt(load(above, x));
            let after = v.simd_ge(load(row, x + 1)) & v.simd_ge(load(below, x));
            let mut bits = (reaches & before & after).to_bitmask();
            while bits != 0 {
                out.push(x + bits.trailing_zeros() as usize);
                bits &= bits - 1;
            }
        }
        x += n;
    }
}

/// The same for one pixel, anywhere.
fn is_summit(Rows { above, row, below, level }: Rows<'_>, x: usize) -> bool {
    let v = row[x];
    let is_beside = (x > 0 && row[x - 1] >= v)
        || row.get(x + 1).is_some_and(|o| *o > v)
        || above.get(x).is_some_and(|o| *o >= v)
        || below.get(x).is_some_and(|o| *o > v);
    level.get(x).is_some_and(|l| v >= *l) && v > 0.0 && !is_beside
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn vectors_of_pixels_give_what_each_pixel_gives() {
        // Few values, so that many neighbours are equal; widths below, at and above whole vectors.
        let row = |w: usize, seed: usize| -> Vec<f32> {
            (0..w).map(|x| ((x * x * 7 + x * seed) % 11) as f32 - 2.0).collect()
        };
        for w in [1, 2, 63, 64, 65, 66, 129, 193, 400] {
            let (above, middle, below, level) = (row(w, 3), row(w, 5), row(w, 8), row(w, 13));
            for (above, below) in [(&above[..], &below[..]), (&[][..], &below[..]), (&above[..], &[][..])] {
                let rows = Rows { above, row: &middle, below, level: &level };
                let mut found = Vec::new();
                find_summits(rows, &mut found);
                let plain: Vec<usize> = (0..w).filter(|x| is_summit(rows, *x)).collect();
                assert_eq!(found, plain, "{w}");
                assert!(w < 400 || found.len() > 3);
            }
        }
    }

    #[test]
    fn a_summit_reaches_its_level_is_above_zero_and_the_first_of_equals() {
        let w = 200;
        let (other, level) = (vec![0.5f32; w], vec![1.0f32; w]);
        let mut row = vec![0.5f32; w];
        (row[70], row[75], row[76], row[90], row[130]) = (2.0, 3.0, 3.0, 0.9, f32::NAN);
        let mut found = Vec::new();
        let find = |row: &[f32], level: &[f32], found: &mut Vec<usize>| {
            found.clear();
            find_summits(Rows { above: &other, row, below: &other, level }, found);
        };
        find(&row, &level, &mut found);
        assert_eq!(found, [70, 75]);
        find(&vec![-1.0; w], &vec![-2.0; w], &mut found);
        assert!(found.is_empty());
    }
}
