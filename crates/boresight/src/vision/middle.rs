//! The median of many numbers, without moving them.
//!
//! Source: our own; a search for the value between the smallest and the largest, by halves and by ranks in turn. Each pass counts the numbers below a trial value, many side by side, and takes the largest of them and the smallest of the
//! others: the bounds are always numbers that are there, so equal ones end the search at once.
//! Cost: a pass takes a few instructions for a whole vector of numbers, and none that depends on how they compare.
//! Limits: no NaN; at most 2²⁴ numbers.

use fearless_simd::prelude::*;
use fearless_simd::{Level, dispatch};

/// What lies on both sides of a trial value.
struct Sides {
    n_below: usize,
    largest_below: f32,
    smallest_above: f32,
}

#[inline(always)]
fn sides<S: Simd>(simd: S, values: &[f32], trial: f32) -> Sides {
    let splat = |v| S::f32s::splat(simd, v);
    let (one, zero, least, most) = (splat(1.0), splat(0.0), splat(f32::NEG_INFINITY), splat(f32::INFINITY));
    // Counts in f32: exact up to 2²⁴.
    let (mut n, mut largest, mut smallest, tried) = (zero, least, most, splat(trial));
    let chunks = values.chunks_exact(S::f32s::LEN);
    let rest = chunks.remainder();
    for chunk in chunks {
        let v = S::f32s::from_slice(simd, chunk);
        let is_below = v.simd_lt(tried);
        n += is_below.select(one, zero);
        largest = largest.max(is_below.select(v, least));
        smallest = smallest.min(is_below.select(most, v));
    }
    let n_below = n.reduce_sum() as usize;
    let mut all = Sides { n_below, largest_below: largest.reduce_max(), smallest_above: smallest.reduce_min() };
    for &v in rest {
        if v < trial {
            all.n_below += 1;
            all.largest_below = all.largest_below.max(v);
        } else {
            all.smallest_above = all.smallest_above.min(v);
        }
    }
    all
}

/// The smallest and the largest.
#[inline(always)]
fn range<S: Simd>(simd: S, values: &[f32]) -> (f32, f32) {
    let (mut least, mut most) = (S::f32s::splat(simd, f32::INFINITY), S::f32s::splat(simd, f32::NEG_INFINITY));
    let chunks = values.chunks_exact(S::f32s::LEN);
    let rest = chunks.remainder();
    for chunk in chunks {
        let v = S::f32s::from_slice(simd, chunk);
        (least, most) = (least.min(v), most.max(v));
    }
    rest.iter().fold((least.reduce_min(), most.reduce_max()), |(least, most), v| (least.min(*v), most.max(*v)))
}

/// The middle one of an odd number of values, or the mean of the two in the middle; 0 of none.
pub fn middle(values: &[f32]) -> f32 {
    if values.is_empty() {
        return 0.0;
    }
    dispatch!(Level::new(), simd => middle_vectors(simd, values))
}

#[inline(always)]
fn middle_vectors<S: Simd>(simd: S, values: &[f32]) -> f32 {
    let (n, rank) = (values.len(), values.len() / 2);
    // The number of that rank, from 0, lies between `low` and `high`, both of which are there; below `low` lie `n_below`, the largest of them `below`, and up to `high` lie `n_upto`.
    let (mut low, mut high) = range(simd, values);
    let (mut n_below, mut below, mut n_upto, mut halves) = (0, low, n, true);
    while low < high {
        // By halves, which leaves outliers behind, and by ranks, which lands near the value where numbers lie evenly; in turn. Halves first: their sum could be too large.
        let share = if halves { 0.5 } else { (rank - n_below) as f32 / (n_upto - n_below) as f32 };
        halves = !halves;
        // Not the least itself, so that each pass parts the two.
        let trial = (low * (1.0 - share) + high * share).clamp(low.next_up(), high);
        let s = sides(simd, values, trial);
        if s.n_below <= rank {
            (low, n_below, below) = (s.smallest_above, s.n_below, s.largest_below);
            if n_below == rank {
                break;
            }
        } else {
            (high, n_upto) = (s.largest_below, s.n_below);
        }
    }
    if n % 2 == 1 || n_below < rank { low } else { 0.5 * (below + low) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn sorted(values: &[f32]) -> f32 {
        let mut sorted = values.to_vec();
        sorted.sort_unstable_by(f32::total_cmp);
        let n = sorted.len();
        0.5 * (sorted[(n - 1) / 2] + sorted[n / 2])
    }

    proptest! {
        #[test]
        fn the_middle_is_that_of_the_sorted_numbers(
            few in prop::collection::vec(-3i8..3, 1..60),
            any in prop::collection::vec(prop::num::f32::NORMAL | prop::num::f32::ZERO, 1..200),
        ) {
            let few: Vec<f32> = few.into_iter().map(f32::from).collect();
            prop_assert_eq!(middle(&few), sorted(&few));
            // So that no mean of two is beyond what f32 holds.
            let any: Vec<f32> = any.into_iter().map(|v| v * 0.25).collect();
            prop_assert_eq!(middle(&any), sorted(&any));
        }
    }

    #[test]
    fn equal_numbers_neighbouring_ones_and_none_have_a_middle() {
        assert_eq!(middle(&[]), 0.0);
        assert_eq!(middle(&[7.0; 100]), 7.0);
        let mut values = vec![0.0; 90];
        values.extend([f32::MIN_POSITIVE, 1e30, -1e30]);
        assert_eq!(middle(&values), 0.0);
        // The deviations of numbers as far apart as f32 holds them.
        assert_eq!(middle(&[f32::MAX, f32::INFINITY, 0.0, f32::INFINITY, 1.0]), f32::MAX);
        assert_eq!(middle(&[f32::INFINITY, 0.0, f32::INFINITY]), f32::INFINITY);
        assert_eq!(middle(&[1.0, 1f32.next_up(), 1f32.next_up().next_up()]), 1f32.next_up());
    }
}
