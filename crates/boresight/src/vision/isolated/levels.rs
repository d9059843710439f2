//! The levels of the sweep: evenly spaced over the bulk of the values, and on a geometric scale from there to the extreme.
//!
//! Three quarters of the levels are evenly spaced between the 2 % and the 99.5 % point, where a dim target on an even ground
//! must be crossed by several; the rest go on to the extreme value with growing steps, so that one hot pixel does not stretch
//! them all. Neighbouring levels are at least one pixel step and half the noise apart.

use crate::Image;
use crate::vision::pixel::Pixel;
use crate::vision::threshold::Side;

/// Pixels looked at for the two quantiles, at most.
const MAX_SAMPLES: usize = 16_384;

/// Writes the levels for `side`, from the background towards the extreme: `high` is the highest value, negated if dark targets are looked for. It
/// comes from every pixel, for a target may be one.
pub fn choose<T: Pixel>(
    image: &Image<T>,
    side: Side,
    n: usize,
    noise: f64,
    high: f64,
    samples: &mut Vec<f32>,
    levels: &mut Vec<f64>,
) {
    levels.clear();
    samples.clear();
    let data = image.as_slice();
    let sign = if side == Side::Bright { 1.0f32 } else { -1.0 };
    let step = (data.len() / MAX_SAMPLES).max(1) | 1;
    // Two points of the order are all that is needed of it.
    let places = |n: usize| [0.02, 0.995].map(|share| ((n - 1) as f64 * share) as usize);
    let (low, bulk) = if T::STEP > 0.0 && size_of::<T>() == 1 {
        let mut counts = [0u32; 256];
        data.iter().step_by(step).for_each(|p| counts[p.index()] += 1);
        let n = data.len().div_ceil(step);
        if n == 0 {
            return;
        }
        let [low, bulk] = places(n).map(|at| match side {
            Side::Bright => of_rank(&counts, at),
            Side::Dark => -of_rank(&counts, n - 1 - at),
        });
        (low, bulk)
    } else {
        samples.extend(data.iter().step_by(step).map(|p| sign * p.value_f32()).filter(|v| v.is_finite()));
        if samples.is_empty() {
            return;
        }
        let [low_at, bulk_at] = places(samples.len());
        let (_, &mut low, above) = samples.select_nth_unstable_by(low_at, f32::total_cmp);
        let bulk = match (bulk_at - low_at).checked_sub(1) {
            Some(i) => *above.select_nth_unstable_by(i, f32::total_cmp).1,
            None => low,
        };
        (low, bulk)
    };
    let (low, bulk) = (f64::from(low), f64::from(bulk));
    let even = n * 3 / 4;
    levels.extend((1..=even).map(|i| low + (bulk - low) * i as f64 / even as f64));
    let first = (bulk - low) / even as f64;
    let tail = n - even;
    if first > 0.0 && high > bulk {
        let growth = ((high - low) / (bulk - low)).powf(1.0 / tail as f64);
        levels.extend((1..=tail).map(|i| low + (bulk - low) * growth.powi(i as i32)));
    } else {
        // Nearly all pixels are alike: what stands out lies anywhere up to the extreme.
        levels.extend((1..=n).map(|i| low + (high - low) * i as f64 / (n + 1) as f64));
    }
    if T::STEP > 0.0 {
        // Between two whole values all levels are the same.
        levels.iter_mut().for_each(|l| *l = l.ceil());
    }
    levels.sort_unstable_by(f64::total_cmp);
    let apart = f64::from(T::STEP).max(0.5 * noise);
    let mut last = low;
    levels.retain(|&l| {
        let keep = l >= last + apart && l > low && l <= high;
        if keep {
            last = l;
        }
        keep
    });
    levels.iter_mut().for_each(|l| *l *= f64::from(sign));
}

/// The value of that rank, counted from 0, of so many of each value.
fn of_rank(counts: &[u32; 256], rank: usize) -> f32 {
    let mut upto = 0;
    counts.iter().position(|n| (upto += *n as usize, upto > rank).1).unwrap_or(255) as f32
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    #[test]
    fn levels_of_bytes_are_those_of_the_same_values_in_16_bit() {
        let mut rng = ChaCha8Rng::seed_from_u64(13);
        for most in [1u8, 7, 60, 255] {
            let bytes: Vec<u8> = (0..300 * 200).map(|_| rng.random_range(0..=most) / rng.random_range(1..4)).collect();
            let words = bytes.iter().map(|v| u16::from(*v)).collect();
            let (a, b) = (Image::from_vec(300, 200, bytes).unwrap(), Image::<u16>::from_vec(300, 200, words).unwrap());
            for side in [Side::Bright, Side::Dark] {
                let high = if side == Side::Bright { f64::from(most) } else { 0.0 };
                let (mut of_a, mut of_b) = (Vec::new(), Vec::new());
                choose(&a, side, 40, 1.0, high, &mut Vec::new(), &mut of_a);
                choose(&b, side, 40, 1.0, high, &mut Vec::new(), &mut of_b);
                assert_eq!(of_a, of_b);
                assert!(most < 7 || !of_a.is_empty());
            }
        }
    }
}
