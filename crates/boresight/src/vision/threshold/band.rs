//! Band threshold: pixel is target iff low <= I <= high (thesis eq. 4.13); a fixed level is a band with one open end.
//!
//! Bits, not bytes, leave this file: bit `x % 64` of word `x / 64` is pixel `x`; bits past the width are 0.

use crate::vision::background::pack;
use crate::vision::pixel::Pixel;
use fearless_simd::{Simd, SimdBase, SimdMask};

/// Number of words for a row of `width` bits.
pub fn words(width: usize) -> usize {
    width.div_ceil(64)
}

/// Writes bit `x` for every `low <= row[x] <= high`; `bits` holds at least [`words`]`(row.len())` words.
pub fn band_bits<T: Pixel>(row: &[T], low: T, high: T, bits: &mut [u64]) {
    T::band_bits(row, low, high, bits);
}

/// The plain form, for what is left of a row and as the twin of the vector forms.
pub(crate) fn band_word<T: Pixel>(pixels: &[T], low: T, high: T) -> u64 {
    pixels.iter().enumerate().fold(0, |w, (i, &v)| w | u64::from((v >= low) & (v <= high)) << i)
}

/// Makes the vector form for one pixel type: 64 pixels give one word of bits, in as many vectors as the machine needs.
macro_rules! vector_band {
    ($name:ident, $inner:ident, $t:ty, $vector:ident) => {
        pub(crate) fn $name(row: &[$t], low: $t, high: $t, bits: &mut [u64]) {
            fearless_simd::dispatch!(fearless_simd::Level::new(), simd => $inner(simd, row, low, high, bits));
        }

        #[inline(always)]
        fn $inner<S: Simd>(simd: S, row: &[$t], low: $t, high: $t, bits: &mut [u64]) {
            let n = S::$vector::LEN;
            let (lows, highs) = (S::$vector::splat(simd, low), S::$vector::splat(simd, high));
            let chunks = row.chunks_exact(64);
            let rest = chunks.remainder();
            for (word, chunk) in bits.iter_mut().zip(chunks) {
                let mut w = 0u64;
                for (k, part) in chunk.chunks_exact(n).enumerate() {
                    let v = S::$vector::from_slice(simd, part);
                    w |= (v.simd_ge(lows) & v.simd_le(highs)).to_bitmask() << (k * n);
                }
                *word = w;
            }
            if let (false, Some(word)) = (rest.is_empty(), bits.get_mut(row.len() / 64)) {
                *word = band_word(rest, low, high);
            }
        }
    };
}
vector_band!(band_bits_u8, band_u8, u8, u8s);
vector_band!(band_bits_u16, band_u16, u16, u16s);
vector_band!(band_bits_f32, band_f32, f32, f32s);

/// Writes bit `x` for every `row[x] >= level[x]` (`above`) or `row[x] <= level[x]`; `states` is scratch.
pub fn level_bits<T: Pixel>(row: &[T], level: &[f32], above: bool, states: &mut Vec<u8>, bits: &mut [u64]) {
    // Bytes first, then bits: both are plain loops over vectors.
    states.resize(row.len().next_multiple_of(64), 0);
    let n = row.len().min(level.len());
    states[n..].fill(0);
    T::level_states(&row[..n], &level[..n], above, &mut states[..n]);
    fearless_simd::dispatch!(fearless_simd::Level::new(), simd => pack(simd, states, bits));
}

macro_rules! level_states {
    ($name:ident, $t:ty) => {
        widest! {
            pub(crate) fn $name(row: &[$t], level: &[f32], above: bool, states: &mut [u8]) {
                let n = row.len().min(level.len()).min(states.len());
                let (row, level, states) = (&row[..n], &level[..n], &mut states[..n]);
                if above {
                    for x in 0..n {
                        states[x] = u8::from(f32::from(row[x]) >= level[x]);
                    }
                } else {
                    for x in 0..n {
                        states[x] = u8::from(f32::from(row[x]) <= level[x]);
                    }
                }
            }
        }
    };
}
level_states!(level_states_u8, u8);
level_states!(level_states_u16, u16);
level_states!(level_states_f32, f32);

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
