//! The value of a rank among rows, column by column: medians over frames, of many pixels side by side.
//!
//! Source: our own; selection by bits from the top, as in a binary search of the value. A bit belongs to the value of rank k if no more than k of the rows lie below what it makes.
//! Cost: two or three instructions a row and bit for a whole vector of columns, where a selection of each column alone takes hundreds.
//! Limits: whole numbers, and at most as many rows as the pixel type counts (255 of u8, and of floats that are bytes).

/// Columns that are ranked side by side.
pub const LANES: usize = 64;

/// So many pixels beside each other.
#[allow(unnameable_types)] // of a trait that is not implemented outside
pub type Lanes<T> = [T; LANES];

macro_rules! ranked {
    ($name:ident, $t:ty) => {
        widest! {
            /// For each column the value of a rank, from 0, among the rows.
            fn $name(rows: &[Lanes<$t>], rank: $t, out: &mut Lanes<$t>) {
                *out = [0; LANES];
                for bit in (0..<$t>::BITS).rev() {
                    let tried = out.map(|v| v | (1 << bit));
                    let mut below = [0; LANES];
                    for row in rows {
                        for ((n, v), t) in below.iter_mut().zip(row).zip(&tried) {
                            *n += <$t>::from(v < t);
                        }
                    }
                    for ((v, t), n) in out.iter_mut().zip(&tried).zip(&below) {
                        *v = if *n <= rank { *t } else { *v };
                    }
                }
            }
        }
    };
}

ranked!(rank_u8, u8);
ranked!(rank_u16, u16);

/// Pixels that may be ranked side by side.
#[allow(unnameable_types)] // a bound of traits that are not implemented outside
pub trait Ranked: Copy + Default {
    /// For each column the value of a rank, from 0, among the rows; `false`, and nothing done, where the type has no such way or there are too many rows.
    fn rank(rows: &[Lanes<Self>], rank: usize, out: &mut Lanes<Self>) -> bool;
    /// How far two values lie apart.
    fn distance(self, other: Self) -> Self;
}

macro_rules! whole {
    ($t:ty, $ranked:ident) => {
        impl Ranked for $t {
            fn rank(rows: &[Lanes<Self>], rank: usize, out: &mut Lanes<Self>) -> bool {
                let Ok(last) = <$t>::try_from(rows.len()) else { return false };
                let Ok(rank) = <$t>::try_from(rank) else { return false };
                if rank < last {
                    $ranked(rows, rank, out);
                }
                rank < last
            }

            fn distance(self, other: Self) -> Self {
                self.abs_diff(other)
            }
        }
    };
}

whole!(u8, rank_u8);
whole!(u16, rank_u16);

impl Ranked for f32 {
    /// Floats that are bytes, as those of a frame of bytes are, are ranked as bytes.
    fn rank(rows: &[Lanes<Self>], rank: usize, out: &mut Lanes<Self>) -> bool {
        let mut bytes = vec![[0u8; LANES]; rows.len()];
        let mut ranked = [0u8; LANES];
        let are_bytes = bytes.iter_mut().zip(rows).all(|(b, r)| to_bytes(r, b));
        if !(are_bytes && u8::rank(&bytes, rank, &mut ranked)) {
            return false;
        }
        *out = ranked.map(f32::from);
        true
    }

    fn distance(self, other: Self) -> Self {
        (self - other).abs()
    }
}

widest! {
    /// Writes the bytes that floats are; `false` where one of them is none.
    fn to_bytes(row: &Lanes<f32>, out: &mut Lanes<u8>) -> bool {
        let mut all = true;
        for (b, v) in out.iter_mut().zip(row) {
            *b = *v as u8;
            all &= f32::from(*b) == *v;
        }
        all
    }
}

/// A block of columns of a row, filled up with zeros beyond its end.
pub(super) fn block<T: Ranked>(row: &[T], first: usize) -> Lanes<T> {
    let mut out = [T::default(); LANES];
    let part = row.get(first..).unwrap_or_default();
    let part = &part[..part.len().min(LANES)];
    out[..part.len()].copy_from_slice(part);
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn check<T: Ranked + Ord + std::fmt::Debug>(rows: &[Vec<T>], rank: usize) {
        let blocks: Vec<Lanes<T>> = rows.iter().map(|r| block(r, 0)).collect();
        let mut out = [T::default(); LANES];
        assert_eq!(T::rank(&blocks, rank, &mut out), rank < rows.len());
        for (x, found) in out.iter().enumerate().filter(|_| rank < rows.len()) {
            let mut column: Vec<T> = blocks.iter().map(|b| b[x]).collect();
            column.sort();
            assert_eq!(*found, column[rank]);
        }
    }

    proptest! {
        #[test]
        fn the_value_of_a_rank_is_that_of_the_sorted_column(
            bytes in proptest::collection::vec(proptest::collection::vec(any::<u8>(), 1..80), 1..40),
            rank in 0usize..42,
        ) {
            check(&bytes, rank);
            let floats: Vec<Vec<f32>> = bytes.iter().map(|r| r.iter().map(|v| f32::from(*v)).collect()).collect();
            let blocks: Vec<Lanes<f32>> = floats.iter().map(|r| block(r, 0)).collect();
            let (mut of_floats, mut of_bytes) = ([0.0; LANES], [0; LANES]);
            let of_u8: Vec<Lanes<u8>> = bytes.iter().map(|r| block(r, 0)).collect();
            prop_assert_eq!(f32::rank(&blocks, rank, &mut of_floats), u8::rank(&of_u8, rank, &mut of_bytes));
            prop_assert_eq!(of_floats, of_bytes.map(f32::from));
            let wide: Vec<Vec<u16>> = bytes.iter().map(|r| r.iter().map(|v| (u16::from(*v) * 257) ^ 0x0f0f).collect()).collect();
            check(&wide, rank);
        }
    }

    #[test]
    fn too_many_rows_and_floats_that_are_no_bytes_are_left_to_others() {
        assert!(u8::rank(&[[3; LANES]; 255], 254, &mut [0; LANES]));
        assert!(!u8::rank(&[[3; LANES]; 256], 100, &mut [0; LANES]));
        assert!(!u8::rank(&[], 0, &mut [0; LANES]));
        for no_byte in [0.5, -1.0, 256.0, f32::NAN, f32::INFINITY] {
            let mut rows = [[3.0; LANES]; 3];
            rows[1][40] = no_byte;
            assert!(!f32::rank(&rows, 1, &mut [0.0; LANES]), "{no_byte}");
        }
    }
}
