//! Band threshold: pixel is target iff low <= I <= high (SPEC C.1, eq. 4.13); a fixed level is a band with one open end.
//!
//! Bits, not bytes, leave this file: bit `x % 64` of word `x / 64` is pixel `x`; bits past the width are 0.

use crate::vision::pixel::Pixel;

/// Number of words for a row of `width` bits.
pub fn words(width: usize) -> usize {
    width.div_ceil(64)
}

/// Writes bit `x` for every `low <= row[x] <= high`; `bits` holds at least [`words`]`(row.len())` words.
pub fn band_bits<T: Pixel>(row: &[T], low: T, high: T, bits: &mut [u64]) {
    for (word, chunk) in bits.iter_mut().zip(row.chunks(64)) {
        let mut w = 0u64;
        for (i, &v) in chunk.iter().enumerate() {
            w |= u64::from((v >= low) & (v <= high)) << i;
        }
        *word = w;
    }
}

/// Writes bit `x` for every `row[x] >= level[x]` (`ABOVE`) or `row[x] <= level[x]`.
pub fn level_bits<T: Pixel, const ABOVE: bool>(row: &[T], level: &[f32], bits: &mut [u64]) {
    for ((word, chunk), levels) in bits.iter_mut().zip(row.chunks(64)).zip(level.chunks(64)) {
        let mut w = 0u64;
        for (i, (&v, &l)) in chunk.iter().zip(levels).enumerate() {
            let v = v.value_f32();
            w |= u64::from(if ABOVE { v >= l } else { v <= l }) << i;
        }
        *word = w;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nan_is_never_in_the_band() {
        let mut bits = [0u64];
        band_bits(&[f32::NAN, 1.0, f32::INFINITY], 0.0, f32::INFINITY, &mut bits);
        assert_eq!(bits, [0b110]);
    }

    #[test]
    fn both_ends_of_the_band_are_inside() {
        let row: Vec<u16> = (0..130).collect();
        let mut bits = [u64::MAX; 3];
        band_bits(&row, 63, 128, &mut bits);
        assert_eq!(bits, [1 << 63, u64::MAX, 1]);
    }
}
