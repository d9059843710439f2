//! Sorts whole numbers of a small range, as the pixels of 8-bit frames and their differences are, by counting them.
//!
//! Source: textbook counting sort. Units: counts.
//! Limits: numbers of a wider range than [`RANGE`] are compared with each other.

/// Widest range that is counted: the counts stay in the nearest cache (8 KiB).
const RANGE: usize = 2048;

/// Sorts finite whole numbers, rising.
pub fn sort(values: &mut [f32]) {
    let (low, high) = values
        .iter()
        .fold((f32::INFINITY, f32::NEG_INFINITY), |(l, h), &v| (if v < l { v } else { l }, if v > h { v } else { h }));
    // Few are sorted sooner than so many counts are gone through.
    if high - low >= RANGE as f32 || values.len() < RANGE / 8 {
        values.sort_unstable_by(f32::total_cmp);
        return;
    }
    let mut counts = [0u32; RANGE];
    for v in values.iter() {
        // Whole numbers: the cast is exact.
        counts[(v - low) as usize] += 1;
    }
    let mut rest = values;
    for (i, &n) in counts[..=(high - low) as usize].iter().enumerate() {
        let (same, after) = rest.split_at_mut(n as usize);
        same.fill(low + i as f32);
        rest = after;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    #[test]
    fn counted_numbers_are_in_the_order_of_compared_ones() {
        let mut rng = ChaCha8Rng::seed_from_u64(11);
        for (n, low, high) in
            [(0, 0, 1), (5, -3, 3), (5000, -255, 256), (3000, 0, 2048), (3000, 0, 2049), (3000, 0, 65_536)]
        {
            let mut values: Vec<f32> = (0..n).map(|_| rng.random_range(low..high) as f32).collect();
            let mut expected = values.clone();
            expected.sort_unstable_by(f32::total_cmp);
            sort(&mut values);
            assert_eq!(values, expected, "{n} {low} {high}");
        }
    }
}
