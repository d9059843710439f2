//! Networks of minima and maxima for the median of 9 and of 25, on anything that has a minimum and a maximum.
//!
//! The columns of the window come sorted (neighbouring windows share them); then every rank row is sorted as far as
//! needed, after which only the pixels on the falling diagonal can be the median: a pixel with more than 12 others
//! surely below or surely above it is out. Source of the idea: the matrix sorted by columns and then by rows stays
//! sorted by columns (Knuth, *The Art of Computer Programming* 3, 5.2.1, exercise on sorting a matrix twice).
//! The last network, for the 13 pixels left, was found by a search over the 162 possible threshold patterns.
//! Proof: a network of minima and maxima is right for all inputs if it is right for all inputs of 0 and 1
//! (Knuth 5.3.4, theorem Z); the tests run all 2⁹ and all 2²⁵ of them.

use super::pixel::Key;

/// A lattice: what a sorting network needs.
pub(super) trait Lattice: Copy {
    /// The smaller.
    fn low(self, other: Self) -> Self;
    /// The larger.
    fn high(self, other: Self) -> Self;
}

impl<K: Key> Lattice for K {
    #[inline(always)]
    fn low(self, other: Self) -> Self {
        self.min(other)
    }
    #[inline(always)]
    fn high(self, other: Self) -> Self {
        self.max(other)
    }
}

#[inline(always)]
fn sort2<L: Lattice>(a: L, b: L) -> (L, L) {
    (a.low(b), a.high(b))
}

/// Sorts three, smallest first.
#[inline(always)]
pub(super) fn sort3<L: Lattice>([a, b, c]: [L; 3]) -> [L; 3] {
    let (b, c) = sort2(b, c);
    let (a, b) = sort2(a, b);
    let (b, c) = sort2(b, c);
    [a, b, c]
}

/// Sorts five, smallest first: 9 exchanges, the fewest possible.
#[inline(always)]
pub(super) fn sort5<L: Lattice>([a, b, c, d, e]: [L; 5]) -> [L; 5] {
    let (a, d) = sort2(a, d);
    let (b, e) = sort2(b, e);
    let (a, c) = sort2(a, c);
    let (b, d) = sort2(b, d);
    let (a, b) = sort2(a, b);
    let (c, e) = sort2(c, e);
    let (b, c) = sort2(b, c);
    let (d, e) = sort2(d, e);
    let (c, d) = sort2(c, d);
    [a, b, c, d, e]
}

/// Median of a 3x3 window; `rank[k]` holds the k-th smallest of each of its three columns.
#[inline(always)]
pub(super) fn median9<L: Lattice>(rank: [[L; 3]; 3]) -> L {
    let [low, middle, high] = rank;
    let a = low[0].high(low[1]).high(low[2]);
    let [_, b, _] = sort3(middle);
    let c = high[0].low(high[1]).low(high[2]);
    let [_, median, _] = sort3([a, b, c]);
    median
}

/// Median of a 5x5 window; `rank[k]` holds the k-th smallest of each of its five columns.
#[inline(always)]
pub(super) fn median25<L: Lattice>(rank: [[L; 5]; 5]) -> L {
    // Letters are rank rows, digits the place in the sorted rank row; results that are not used cost nothing.
    let [_, _, _, a3, a4] = sort5(rank[0]);
    let [_, _, b2, b3, b4] = sort5(rank[1]);
    let [_, c1, c2, c3, _] = sort5(rank[2]);
    let [d0, d1, d2, _, _] = sort5(rank[3]);
    let [e0, e1, _, _, _] = sort5(rank[4]);
    let (l1, h1) = sort2(e0, a4);
    let (l2, h2) = sort2(d0, a3);
    let (l3, h3) = sort2(d1, b3);
    let (l4, h4) = sort2(e1, b4);
    let (l5, h5) = sort2(c1, b2);
    let (l6, h6) = sort2(d2, c3);
    let (l7, h7) = sort2(l1, h2);
    let (l8, h8) = sort2(c2, h7);
    let (l9, h9) = sort2(l6, h1);
    let (_, h10) = sort2(l7, h5);
    let (l11, h11) = sort2(l4, h8);
    let (_, h12) = sort2(l3, h10);
    let (l15, h15) = sort2(l11, h12);
    let (l16, _) = sort2(l9, h3);
    // The search's exchanges 13, 14 and 17 do not reach the median.
    let _ = (l2, l5, h4, h6, h9, h11);
    let (_, h18) = sort2(l15, l8);
    let (l19, _) = sort2(h15, l16);
    l19.high(h18)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 64 inputs of 0 and 1 at a time.
    #[derive(Clone, Copy)]
    struct Bits(u64);

    impl Lattice for Bits {
        fn low(self, o: Self) -> Self {
            Self(self.0 & o.0)
        }
        fn high(self, o: Self) -> Self {
            Self(self.0 | o.0)
        }
    }

    /// Bit planes of the inputs `first .. first + 64`: plane i holds bit i of each.
    fn planes<const N: usize>(first: u32) -> [Bits; N] {
        std::array::from_fn(|i| {
            let mut plane = 0;
            for k in 0..64u32 {
                plane |= u64::from((first + k) >> i & 1) << k;
            }
            Bits(plane)
        })
    }

    fn majority(first: u32, n: u32) -> u64 {
        (0..64u32).fold(0, |m, k| m | u64::from((first + k).count_ones() > n / 2) << k)
    }

    #[test]
    fn the_median_of_9_is_right_for_all_inputs_of_zeros_and_ones() {
        for first in (0..1u32 << 9).step_by(64) {
            let p = planes::<9>(first);
            let columns = [sort3([p[0], p[1], p[2]]), sort3([p[3], p[4], p[5]]), sort3([p[6], p[7], p[8]])];
            let ranks = std::array::from_fn(|k| columns.map(|c| c[k]));
            assert_eq!(median9(ranks).0, majority(first, 9), "inputs from {first}");
        }
    }

    #[test]
    fn the_median_of_25_is_right_for_all_inputs_of_zeros_and_ones() {
        // The low 6 planes are the same for every block of 64.
        let low = planes::<6>(0);
        for first in (0..1u32 << 25).step_by(64) {
            let bit = |i: usize| if i < 6 { low[i] } else { Bits(((first >> i & 1) as u64).wrapping_neg()) };
            let columns: [[Bits; 5]; 5] = std::array::from_fn(|c| sort5(std::array::from_fn(|i| bit(5 * c + i))));
            let ranks = std::array::from_fn(|k| columns.map(|c| c[k]));
            assert_eq!(median25(ranks).0, majority(first, 25), "inputs from {first}");
        }
    }
}
