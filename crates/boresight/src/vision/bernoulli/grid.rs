//! What is done on images of the grid: cells near a place, a target's light, sums over squares.
//!
//! Source: our own. Symbols: places and sizes in cells.

use super::shape::Profile;
use nalgebra::Vector2;

/// How far light is added, in σ of a spot (`Profile::reach`): 10⁻⁴ is beyond.
const LIGHT: f64 = 6.0;

/// Calls `of` with the number of each cell within a square of that half side around a place, and its offset.
pub(super) fn for_near(size: (usize, usize), at: Vector2<f64>, radius: f64, mut of: impl FnMut(usize, Vector2<f64>)) {
    let span = |c: f64, n: usize| {
        let inside = |v: f64| v.clamp(0.0, n as f64) as usize;
        inside((c - radius).ceil())..inside((c + radius).floor() + 1.0)
    };
    for y in span(at.y, size.1) {
        for x in span(at.x, size.0) {
            of(y * size.0 + x, Vector2::new(x as f64, y as f64) - at);
        }
    }
}

/// Adds a target's light to the deviations.
pub(super) fn add_light(z: &mut [f32], size: (usize, usize), at: Vector2<f64>, snr: f64, profile: &Profile) {
    for_near(size, at, profile.reach(LIGHT), |i, d| z[i] += (snr * profile.shows(d)) as f32);
}

/// Sums over squares of half side `half`; outside there is nothing. Each anew: a running sum would lose small odds beside those of a target.
pub(super) fn sum_boxes(from: &[f32], w: usize, half: usize, rows: &mut [f32], to: &mut [f32]) {
    for (from, to) in from.chunks_exact(w).zip(rows.chunks_exact_mut(w)) {
        for (x, t) in to.iter_mut().enumerate() {
            *t = from[x.saturating_sub(half)..(x + half + 1).min(w)].iter().sum();
        }
    }
    let h = from.len() / w;
    for (y, to) in to.chunks_exact_mut(w).enumerate() {
        to.fill(0.0);
        for row in rows.chunks_exact(w).take((y + half + 1).min(h)).skip(y.saturating_sub(half)) {
            to.iter_mut().zip(row).for_each(|(t, r)| *t += r);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::vision::bernoulli::BernoulliConfig;

    #[test]
    fn sums_are_those_over_the_squares_cell_by_cell() {
        let (w, h, half) = (7usize, 5usize, 2i64);
        let from: Vec<f32> = (0..w * h).map(|i| (i * i % 23) as f32).collect();
        let (mut rows, mut to) = (vec![0.0; w * h], vec![0.0; w * h]);
        sum_boxes(&from, w, half as usize, &mut rows, &mut to);
        for (i, is) in to.iter().enumerate() {
            let (x, y) = ((i % w) as i64, (i / w) as i64);
            let within = |j: usize| ((j % w) as i64 - x).abs() <= half && ((j / w) as i64 - y).abs() <= half;
            let sum: f32 = (0..w * h).filter(|j| within(*j)).map(|j| from[j]).sum();
            assert_eq!(*is, sum, "{x} {y}");
        }
    }

    #[test]
    fn light_is_what_a_target_shows_and_ends_at_the_border() {
        let profile = Profile::new(&BernoulliConfig::default());
        let (size, at) = ((9, 6), Vector2::new(1.4, 4.2));
        let mut z = [0.0; 54];
        add_light(&mut z, size, at, 3.0, &profile);
        for (i, z) in z.iter().enumerate() {
            let d = Vector2::new((i % 9) as f64, (i / 9) as f64) - at;
            assert!((f64::from(*z) - 3.0 * profile.shows(d)).abs() < 1e-3, "{d:?}: {z}");
        }
    }
}
