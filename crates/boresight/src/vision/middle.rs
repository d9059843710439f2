//! The median of many numbers, without moving them.
//!
//! Source: our own; a search for the value between the smallest and the largest, by halves and by ranks in turn. Each pass counts the numbers below a trial value, many side by side. As soon as few lie between the bounds it also takes the largest
//! of those below and the smallest of the others: the bounds are then numbers that are there, so equal ones end the search at once.
//! Cost: a pass takes a few instructions for a whole vector of numbers, and none that depends on how they compare.
//! Limits: no NaN; at most 2²⁴ numbers.

use fearless_simd::prelude::*;
use fearless_simd::{Level, dispatch};

/// So many numbers between the bounds or fewer, and they are moved to numbers that are there, which takes longer than counting; and passes after which they are if there are more: of equal ones there always may be.
const FEW: usize = 4;
const MOST_COUNTED: usize = 12;

/// How many lie below a trial value.
#[inline(always)]
fn count_below<S: Simd>(simd: S, values: &[f32], trial: f32) -> usize {
    let tried = S::f32s::splat(simd, trial);
    let chunks = values.chunks_exact(S::f32s::LEN);
    let rest = chunks.remainder();
    let mut n = rest.iter().filter(|v| **v < trial).count();
    for chunk in chunks {
        n += S::f32s::from_slice(simd, chunk).simd_lt(tried).to_bitmask().count_ones() as usize;
    }
    n
}

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
    let (below, at) = dispatch!(Level::new(), simd => around_middle(simd, values));
    if values.len() % 2 == 1 { at } else { 0.5 * (below + at) }
}

/// The middle one of an odd number of values, or the greater of the two in the middle; none of none.
pub fn upper_middle(values: &[f32]) -> Option<f32> {
    (!values.is_empty()).then(|| dispatch!(Level::new(), simd => around_middle(simd, values)).1)
}

/// The values of the ranks n/2 - 1 and n/2, from 0; of one value twice that.
#[inline(always)]
fn around_middle<S: Simd>(simd: S, values: &[f32]) -> (f32, f32) {
    let (n, rank) = (values.len(), values.len() / 2);
    let (mut low, mut high) = range(simd, values);
    // By halves, which leaves outliers behind, and by ranks, which lands near the value where numbers lie evenly; in turn. Halves first: their sum could be too large.
    let mut halves = false;
    let mut between = |low: f32, high: f32, n_below: usize, n_upto: usize| {
        halves = !halves;
        let share = if halves { 0.5 } else { (rank - n_below) as f32 / (n_upto - n_below) as f32 };
        let between = low * (1.0 - share) + high * share;
        // Of two infinite ones there is no mean.
        if between.is_nan() { 0.0 } else { between }
    };
    // The number of that rank, from 0, lies between `low` and `high`; below `low` lie `n_below`, and below `high`, or up to it where it is the largest, `n_upto`.
    let (mut n_below, mut n_upto) = (0, n);
    for _ in 0..MOST_COUNTED {
        let trial = between(low, high, n_below, n_upto);
        if n_upto - n_below <= FEW || !(low < trial && trial < high) {
            break;
        }
        match count_below(simd, values, trial) {
            n if n <= rank => (low, n_below) = (trial, n),
            n => (high, n_upto) = (trial, n),
        }
    }
    // From here on `low` is there, and `below` is the largest of those below it.
    let at = sides(simd, values, low);
    let mut below = if n_below > 0 { at.largest_below } else { low };
    low = at.smallest_above;
    while low < high && n_below < rank {
        // Not the least itself, so that each pass parts the two.
        let trial = between(low, high, n_below, n_upto).clamp(low.next_up(), high);
        let s = sides(simd, values, trial);
        if s.n_below <= rank {
            (low, n_below, below) = (s.smallest_above, s.n_below, s.largest_below);
        } else {
            (high, n_upto) = (s.largest_below, s.n_below);
        }
    }
    (if n_below < rank { low } else { below }, low)
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
            even in prop::collection::vec(-100.0f32..100.0, 1..300),
        ) {
            let few: Vec<f32> = few.into_iter().map(f32::from).collect();
            prop_assert_eq!(middle(&few), sorted(&few));
            let upper = |values: &[f32]| {
                let mut values = values.to_vec();
                let middle = values.len() / 2;
                *values.select_nth_unstable_by(middle, f32::total_cmp).1
            };
            prop_assert_eq!(upper_middle(&few), Some(upper(&few)));
            prop_assert_eq!(upper_middle(&even), Some(upper(&even)));
            prop_assert_eq!(middle(&even), sorted(&even));
            // So that no mean of two is beyond what f32 holds.
            let any: Vec<f32> = any.into_iter().map(|v| v * 0.25).collect();
            prop_assert_eq!(middle(&any), sorted(&any));
        }
    }

    #[test]
    fn equal_numbers_neighbouring_ones_and_none_have_a_middle() {
        assert_eq!((middle(&[]), upper_middle(&[])), (0.0, None));
        assert_eq!(middle(&[7.0; 100]), 7.0);
        let mut values = vec![0.0; 90];
        values.extend([f32::MIN_POSITIVE, 1e30, -1e30]);
        assert_eq!(middle(&values), 0.0);
        // The deviations of numbers as far apart as f32 holds them.
        assert_eq!(middle(&[f32::MAX, f32::INFINITY, 0.0, f32::INFINITY, 1.0]), f32::MAX);
        assert_eq!(middle(&[f32::INFINITY, 0.0, f32::INFINITY]), f32::INFINITY);
        assert_eq!(middle(&[f32::INFINITY, f32::NEG_INFINITY, 3.0, f32::INFINITY, f32::NEG_INFINITY]), 3.0);
        assert_eq!(middle(&[1.0, 1f32.next_up(), 1f32.next_up().next_up()]), 1f32.next_up());
    }
}
