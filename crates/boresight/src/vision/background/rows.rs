//! The loops over one row of pixels and its model, in vectors chosen when the program runs: judge, follow, pack to bits.

use super::BackgroundPixel;
use fearless_simd::{Simd, SimdBase, SimdMask};

widest! {
    /// Writes 1 for each pixel that moves and 0 for the rest, also past the width.
    pub(super) fn judge<T: BackgroundPixel>(
        row: &[T],
        mean: &[T::Level],
        deviation: &[T::Level],
        terms: &T::Terms,
        states: &mut [u8],
    ) {
        let n = row.len();
        let (mean, deviation) = (&mean[..n], &deviation[..n]);
        let (inside, outside) = states.split_at_mut(n);
        for x in 0..n {
            inside[x] = u8::from(row[x].moves(mean[x], deviation[x], terms));
        }
        outside.fill(0);
    }
}

widest! {
    /// Lets mean and deviation of each pixel follow the row.
    pub(super) fn adapt<T: BackgroundPixel>(
        row: &[T],
        states: &[u8],
        terms: &T::Terms,
        steps: &T::Steps,
        mean: &mut [T::Level],
        deviation: &mut [T::Level],
    ) {
        let n = row.len();
        let (states, mean, deviation) = (&states[..n], &mut mean[..n], &mut deviation[..n]);
        for x in 0..n {
            (mean[x], deviation[x]) = row[x].adapt(mean[x], deviation[x], states[x], terms, steps);
        }
    }
}

/// Packs bytes 0 and 1 into bits; `states` has 64 bytes for every word.
#[inline(always)]
pub(crate) fn pack<S: Simd>(simd: S, states: &[u8], bits: &mut [u64]) {
    let lanes = S::u8s::LEN;
    for (bytes, word) in states.chunks_exact(64).zip(bits) {
        let mut w = 0;
        for (i, part) in bytes.chunks_exact(lanes).enumerate() {
            w |= S::u8s::from_slice(simd, part).simd_gt(0).to_bitmask() << (i * lanes);
        }
        *word = w;
    }
}
