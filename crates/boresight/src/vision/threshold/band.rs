//! Band threshold: pixel is target iff low <= I <= high (thesis eq. 4.13); a fixed level is a band with one open end. The vector forms, one
//! for each pixel type; `bits` has the same for any pixel.
//!
//! Bits, not bytes, leave this file: bit `x % 64` of word `x / 64` is pixel `x`; bits past the width are 0.

use fearless_simd::{Simd, SimdBase, SimdMask};

/// Number of words for a row of `width` bits.
pub fn words(width: usize) -> usize {
    width.div_ceil(64)
}

/// The plain form, for what is left of a row and as the twin of the vector forms.
pub(crate) fn band_word<T: Copy + PartialOrd>(pixels: &[T], low: T, high: T) -> u64 {
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
