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
    samples.extend(data.iter().step_by(step).map(|p| sign * p.value_f32()).filter(|v| v.is_finite()));
    if samples.is_empty() {
        return;
    }
    // Two points of the order are all that is needed of it.
    let rank = |share: f64| ((samples.len() - 1) as f64 * share) as usize;
    let (low_at, bulk_at) = (rank(0.02), rank(0.995));
    let (_, &mut low, above) = samples.select_nth_unstable_by(low_at, f32::total_cmp);
    let bulk = match (bulk_at - low_at).checked_sub(1) {
        Some(i) => *above.select_nth_unstable_by(i, f32::total_cmp).1,
        None => low,
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
