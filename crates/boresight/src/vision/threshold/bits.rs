//! A row of pixels of any type becomes a row of bits: by a band, or by a level for each column.

use crate::vision::background::pack;
use crate::vision::pixel::Pixel;

/// Writes bit `x` for every `low <= row[x] <= high`; `bits` holds at least [`words`](super::words)`(row.len())` words.
pub fn band_bits<T: Pixel>(row: &[T], low: T, high: T, bits: &mut [u64]) {
    T::band_bits(row, low, high, bits);
}

/// Writes bit `x` for every `row[x] >= level[x]` (`above`) or `row[x] <= level[x]`; `states` is scratch.
pub fn level_bits<T: Pixel>(row: &[T], level: &[f32], above: bool, states: &mut Vec<u8>, bits: &mut [u64]) {
    // Bytes first, then bits: both are plain loops over vectors.
    states.resize(row.len().next_multiple_of(64), 0);
    let n = row.len().min(level.len());
    states[n..].fill(0);
    T::level_states(&row[..n], &level[..n], above, &mut states[..n]);
    fearless_simd::dispatch!(fearless_simd::Level::new(), simd => pack(simd, states, bits));
}

#[cfg(test)]
mod tests {
    use super::super::band::{band_word, words};
    use super::*;

    #[test]
    fn nan_is_never_in_the_band() {
        let mut bits = [0u64];
        band_bits(&[f32::NAN, 1.0, f32::INFINITY], 0.0, f32::INFINITY, &mut bits);
        assert_eq!(bits, [0b110]);
    }

    #[test]
    fn the_vector_forms_give_the_plain_bits_for_every_length() {
        let mut state = 7u32;
        let mut next = move || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            state >> 16
        };
        for n in 0..200 {
            let values: Vec<u16> = (0..n).map(|_| next() as u16).collect();
            let bytes: Vec<u8> = values.iter().map(|v| *v as u8).collect();
            let floats: Vec<f32> =
                values.iter().map(|v| if v % 11 == 0 { f32::NAN } else { f32::from(*v) - 3e4 }).collect();
            fn check<T: Pixel>(row: &[T], low: T, high: T) {
                let mut bits = vec![!0u64; words(row.len())];
                band_bits(row, low, high, &mut bits);
                let plain: Vec<u64> = row.chunks(64).map(|c| band_word(c, low, high)).collect();
                assert_eq!(bits, plain, "{} pixels", row.len());
            }
            check(&bytes, 40, 200);
            check(&bytes, 0, 255);
            check(&values, 5000, 50_000);
            check(&values, 0x8000, u16::MAX);
            check(&floats, -1e4, 2e4);
        }
    }

    #[test]
    fn both_ends_of_the_band_are_inside() {
        let row: Vec<u16> = (0..130).collect();
        let mut bits = [u64::MAX; 3];
        band_bits(&row, 63, 128, &mut bits);
        assert_eq!(bits, [1 << 63, u64::MAX, 1]);
    }
}
