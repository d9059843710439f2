//! Measurement and process noise by maximum likelihood: which R and q make the innovations of given tracks most probable.
//!
//! Source: R. K. Mehra, *IEEE Trans. AC* 15, 1970 (noise from innovations); the likelihood of a linear model is that of its innovations
//! (Bar-Shalom, Li, Kirubarajan 2001, 5.2). Each series of positions is filtered by a model of its motion, axis by axis: constant velocity driven by a white acceleration here, one that is
//! forgotten in [`super::forgotten`].
//! R = c × stated variance + e² + (f h)², q = a + b h² (a continuous density), h the height of the box: five numbers for all series together, found
//! by a compass search on their logarithms, which needs no derivative and ends at a step of 5 %.
//! Departures: an innovation is, with the probability [`STRANGE`], anywhere in the field (another thing's detection, or a turn that no model has), so that a
//! wrong association costs a bounded amount and is not filtered in; after two in a row the series begins anew there. A weak prior (a factor of [`PRIOR_FACTOR`] is one deviation) holds what the data do not
//! tell: the height's part where all boxes are alike.
//! Symbols: ν innovation (px), S its variance (px²), θ the logarithms of c, e, f, a, b.
//! Limits: errors that last for several scans are no white noise; they count as motion, and the innovations stay honest ([`super::correlated`] asks how long they last).

use super::forgotten::{Passed, Persistence};
use crate::track::AccelerationNoise;
use crate::track::filter::constant_velocity::{Axis, step_noise};

/// One detection of a series.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Step {
    /// Time since the one before, s.
    pub dt_s: f64,
    /// Position, px, and its stated variance along x and y, px².
    pub position: [f64; 2],
    pub variance: [f64; 2],
    /// Height of its box, px.
    pub height_px: f64,
    /// How much its innovation counts, 0 to 1.
    pub weight: f64,
}

/// The noise of all series.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Noise {
    /// Factor on the stated variance.
    pub scale: f64,
    /// Deviation of a position beyond what is stated, px, and in box heights.
    pub extra_px: f64,
    pub extra_per_height: f64,
    /// Density of the white acceleration, px²/s³, and in squared box heights, 1/s³.
    pub density: f64,
    pub density_per_height2: f64,
}

/// Probability that an innovation is another thing's.
const STRANGE: f64 = 0.01;
/// One deviation of the prior is this factor, around what was assumed before.
const PRIOR_FACTOR: f64 = 10.0;
/// First and last step of the search, in logarithms.
const STEPS: [f64; 2] = [2.0, 0.05];
/// The same where factors are followed that were known a moment ago.
const FACTOR_STEPS: [f64; 2] = [0.4, 0.02];
/// One deviation of the prior of the factor on stated variances: they are known better than the rest.
const SCALE_PRIOR_FACTOR: f64 = 2.0;
/// Least value of any of the five numbers: nothing beside a pixel and a second of video.
pub const LEAST: f64 = 1e-6;
/// Most detections that are fitted: more change the third digit.
pub const MOST_STEPS: usize = 20_000;
/// Innovations that every series gives before they count: its velocity is not known at first.
const SETTLING: usize = 2;

/// Finds the noise, from what was assumed before and the deviation of the targets' speeds (px/s) in a field of `area_px2`; densities are `least_density` at least.
pub fn fit(series: &[Vec<Step>], before: Noise, least_density: f64, speed_std: f64, area_px2: f64) -> Noise {
    let least = [LEAST, LEAST, LEAST, least_density, least_density];
    let start = [before.scale, before.extra_px, before.extra_per_height, before.density, before.density_per_height2];
    let likelihood = |x| log_likelihood(series, &noise_of(x), Motion::Accelerated(speed_std), area_px2);
    noise_of(most_probable(start, [least, [f64::INFINITY; 5]], likelihood))
}

/// The numbers that make the logarithm of a likelihood and of the prior around `start` largest, between the lowest and the highest of each; the first is a factor on stated variances.
pub(super) fn most_probable<const N: usize>(
    start: [f64; N],
    edges: [[f64; N]; 2],
    log_likelihood: impl Fn([f64; N]) -> f64,
) -> [f64; N] {
    let edges = edges.map(|edge| edge.map(f64::ln));
    let start: [f64; N] = std::array::from_fn(|i| start[i].ln().clamp(edges[0][i], edges[1][i]));
    let deviation = |i: usize| f64::ln(if i == 0 { SCALE_PRIOR_FACTOR } else { PRIOR_FACTOR });
    let cost = |x: &[f64; N]| {
        let prior: f64 = (0..N).map(|i| ((x[i] - start[i]) / deviation(i)).powi(2)).sum();
        0.5 * prior - log_likelihood(x.map(f64::exp))
    };
    search(start, STEPS, edges, cost).map(f64::exp)
}

/// The factors on R and on q, both within `1 / most ..= most`, that make the innovations most probable; begun at `from`. One deviation of the prior, around
/// a factor of 1, is `most`; one around where it begins is `drift_std`, of the logarithms.
pub fn fit_factors(
    series: &[Vec<Step>],
    noise: &Noise,
    from: [f64; 2],
    most: f64,
    drift_std: [f64; 2],
    speed_std: f64,
    area_px2: f64,
) -> [f64; 2] {
    let edge = most.ln();
    let start = from.map(|f| f.ln().clamp(-edge, edge));
    let cost = |x: &[f64; 2]| {
        let prior: f64 = (0..2).map(|i| (x[i] / edge).powi(2) + ((x[i] - start[i]) / drift_std[i]).powi(2)).sum();
        0.5 * prior - log_likelihood(series, &noise.times(x.map(f64::exp)), Motion::Accelerated(speed_std), area_px2)
    };
    search(start, FACTOR_STEPS, [[-edge; 2], [edge; 2]], cost).map(f64::exp)
}

impl Noise {
    /// Variance of a measurement that is stated with that variance, px², of a box of that height, px.
    pub fn variance(&self, stated: f64, height_px: f64) -> f64 {
        self.scale * stated + self.extra_px * self.extra_px + (self.extra_per_height * height_px).powi(2)
    }

    /// With these factors on R and on q.
    pub fn times(&self, [r, q]: [f64; 2]) -> Self {
        Self {
            scale: self.scale * r,
            extra_px: self.extra_px * r.sqrt(),
            extra_per_height: self.extra_per_height * r.sqrt(),
            density: self.density * q,
            density_per_height2: self.density_per_height2 * q,
        }
    }
}

/// How a target moves between two detections.
#[derive(Clone, Copy, Debug)]
pub enum Motion {
    /// As the noise's density says, with a velocity of this deviation at first, px/s.
    Accelerated(f64),
    /// With a velocity that is forgotten.
    Persistent(Persistence),
}

/// Least cost by a compass search from `at`, with the first and the last step and the lowest and highest values of each number.
fn search<const N: usize>(
    mut at: [f64; N],
    steps: [f64; 2],
    [low, high]: [[f64; N]; 2],
    cost: impl Fn(&[f64; N]) -> f64,
) -> [f64; N] {
    let mut step = steps[0];
    let mut least = cost(&at);
    while step > steps[1] {
        let mut moved = false;
        for i in 0..at.len() {
            for sign in [-1.0, 1.0] {
                let mut next = at;
                next[i] = (at[i] + sign * step).clamp(low[i], high[i]);
                let c = cost(&next);
                if c < least {
                    (at, least, moved) = (next, c, true);
                    break;
                }
            }
        }
        if !moved {
            step *= 0.5;
        }
    }
    at
}

fn noise_of([scale, extra_px, extra_per_height, density, density_per_height2]: [f64; 5]) -> Noise {
    Noise { scale, extra_px, extra_per_height, density, density_per_height2 }
}

/// The belief of one axis, as far as a likelihood asks.
pub(super) trait Scalar: Copy {
    /// What a measurement is expected to be, px, and the variance of that, px².
    fn expected(&self) -> [f64; 2];
    /// Takes a measurement of that variance.
    fn correct(&mut self, z: f64, r: f64);
}

impl Scalar for Axis {
    fn expected(&self) -> [f64; 2] {
        [self.x, self.xx]
    }

    fn correct(&mut self, z: f64, r: f64) {
        Axis::correct(self, z, r);
    }
}

/// How many innovations of the series count.
pub(super) fn n_judged(series: &[Vec<Step>]) -> usize {
    series.iter().map(|steps| steps.len().saturating_sub(1 + SETTLING)).sum()
}

/// Logarithm of the likelihood of all series.
pub(super) fn log_likelihood(series: &[Vec<Step>], noise: &Noise, motion: Motion, area_px2: f64) -> f64 {
    let begin = |speed_std: f64| move |z: f64, r: f64| Axis { x: z, v: 0.0, xx: r, xv: 0.0, vv: speed_std * speed_std };
    match motion {
        Motion::Accelerated(speed_std) => of_innovations(series, noise, area_px2, begin(speed_std), |axes, t, q| {
            let step = step_noise(AccelerationNoise::Continuous(q), t);
            axes.iter_mut().for_each(|axis| axis.predict(t, &step));
        }),
        Motion::Persistent(p) => {
            // Most scans are as far apart as the two before.
            let mut passed = Passed::NEVER;
            of_innovations(series, noise, area_px2, begin(p.speed_std_px_per_s), |axes, t, _| {
                if passed.dt_s != t {
                    passed = p.after(t);
                }
                axes.iter_mut().for_each(|axis| passed.predict(axis));
            })
        }
    }
}

/// The same with beliefs that `begin` at a measurement and its variance, and that `predict` takes over a time (s) with a density of acceleration.
pub(super) fn of_innovations<A: Scalar>(
    series: &[Vec<Step>],
    noise: &Noise,
    area_px2: f64,
    begin: impl Fn(f64, f64) -> A,
    mut predict: impl FnMut(&mut [A; 2], f64, f64),
) -> f64 {
    let strange = STRANGE / area_px2;
    let mut sum = 0.0;
    for steps in series {
        let Some(first) = steps.first() else { continue };
        let mut heights: Vec<f64> = steps.iter().map(|s| s.height_px).collect();
        let middle = heights.len() / 2;
        let height = *heights.select_nth_unstable_by(middle, f64::total_cmp).1;
        let q = noise.density + noise.density_per_height2 * height * height;
        let r = |s: &Step, a: usize| noise.variance(s.variance[a], s.height_px);
        let begin = |s: &Step| [0, 1].map(|a| begin(s.position[a], r(s, a)));
        let mut axes = begin(first);
        let (mut began, mut was_strange) = (0, false);
        for (k, s) in steps.iter().enumerate().skip(1) {
            let (mut nis, mut det) = (0.0, 1.0);
            predict(&mut axes, s.dt_s, q);
            for (a, axis) in axes.iter_mut().enumerate() {
                let [x, xx] = axis.expected();
                let (nu, var) = (s.position[a] - x, xx + r(s, a));
                nis += nu * nu / var;
                det *= var;
            }
            let own = (1.0 - STRANGE) * (-0.5 * nis).exp() / (std::f64::consts::TAU * det.sqrt());
            if k > SETTLING {
                sum += s.weight * (own + strange).ln();
            }
            // What follows a beginning is as wide as the velocity is uncertain, and corrects it.
            if own < strange && k > began + SETTLING {
                // One is another thing's detection; the second is where the target is now.
                if was_strange {
                    axes = begin(s);
                    began = k;
                }
                was_strange = !was_strange;
                continue;
            }
            was_strange = false;
            for (a, axis) in axes.iter_mut().enumerate() {
                axis.correct(s.position[a], r(s, a));
            }
        }
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use rand_distr::StandardNormal;

    /// Twelve targets of 200 scans with that density (px²/s³) and noise (px), 2 % of the detections another thing's.
    fn series(density: f64, std: f64, dt_s: f64) -> Vec<Vec<Step>> {
        let mut rng = ChaCha8Rng::seed_from_u64(9);
        let mut normal = || rng.sample::<f64, _>(StandardNormal);
        (0..12)
            .map(|_| {
                let (mut x, mut v) = ([100.0; 2], [normal() * 20.0, normal() * 20.0]);
                (0..200)
                    .map(|k| {
                        for a in 0..2 {
                            // The exact law: velocity, and position given it.
                            let dv = (density * dt_s).sqrt() * normal();
                            x[a] += v[a] * dt_s + 0.5 * dv * dt_s + (density * dt_s.powi(3) / 12.0).sqrt() * normal();
                            v[a] += dv;
                        }
                        let wrong = if k % 50 == 49 { 40.0 } else { 0.0 };
                        let position = [x[0] + wrong + std * normal(), x[1] + std * normal()];
                        Step { dt_s, position, variance: [0.01; 2], height_px: 5.0, weight: 1.0 }
                    })
                    .collect()
            })
            .collect()
    }

    #[test]
    fn a_target_that_turns_back_within_a_frame_is_no_noisier_for_it() {
        let before =
            Noise { scale: 1.0, extra_px: 0.3, extra_per_height: 0.0, density: 100.0, density_per_height2: 0.0 };
        let mut rng = ChaCha8Rng::seed_from_u64(3);
        let mut noise = || 0.1 * rng.sample::<f64, _>(StandardNormal);
        // 60 px/s to and fro between two walls, 25 a second, turned every 30 frames.
        let steps: Vec<Step> = (0..300)
            .map(|k| {
                let x = 2.4 * if k / 30 % 2 == 0 { f64::from(k % 30) } else { f64::from(30 - k % 30) };
                let position = [x + noise(), 50.0 + noise()];
                Step { dt_s: 0.04, position, variance: [0.01; 2], height_px: 5.0, weight: 1.0 }
            })
            .collect();
        let found = fit(&[steps], before, LEAST, 50.0, 1e5);
        let r = (0.01 * found.scale + found.extra_px.powi(2)).sqrt();
        assert!(r < 0.2, "0.1 px is the truth: {found:?}");
    }

    #[test]
    fn the_noise_of_simulated_tracks_is_found_at_any_frame_rate() {
        let before =
            Noise { scale: 1.0, extra_px: 0.3, extra_per_height: 0.0, density: 100.0, density_per_height2: 0.0 };
        for (density, std, dt_s) in
            [(400.0, 0.5, 1.0 / 30.0), (400.0, 0.5, 1.0 / 120.0), (4.0, 2.0, 0.1), (9e4, 0.3, 0.04)]
        {
            let found = fit(&series(density, std, dt_s), before, LEAST, 50.0, 1e5);
            let r = 0.01 * found.scale + found.extra_px.powi(2) + (5.0 * found.extra_per_height).powi(2);
            let q = found.density + 25.0 * found.density_per_height2;
            assert!((r.sqrt() / std - 1.0).abs() < 0.06, "{density} {std} {dt_s}: {found:?}");
            assert!((q / density).ln().abs() < 0.3, "{density} {std} {dt_s}: {found:?}");
        }
    }

    #[test]
    fn a_factor_on_r_is_told_as_well_as_the_theory_says() {
        // The variance of 200 innovations in two axes is told to 1/√200 = 7 % by the bound for a known q; with q unknown, worse, but not by a factor of two.
        let noise =
            Noise { scale: 1.0, extra_px: LEAST, extra_per_height: LEAST, density: 4.0, density_per_height2: LEAST };
        let mut rng = ChaCha8Rng::seed_from_u64(11);
        let mut normal = || rng.sample::<f64, _>(StandardNormal);
        let found: Vec<f64> = (0..60)
            .map(|_| {
                let (mut x, mut v) = ([0.0; 2], [0.0; 2]);
                let steps: Vec<Step> = (0..200)
                    .map(|_| {
                        for a in 0..2 {
                            let dv = (4.0f64 * 0.1).sqrt() * normal();
                            x[a] += v[a] * 0.1 + 0.05 * dv + (4.0f64 * 1e-3 / 12.0).sqrt() * normal();
                            v[a] += dv;
                        }
                        // Twice the variance that is stated.
                        let position = x.map(|x| x + 2f64.sqrt() * normal());
                        Step { dt_s: 0.1, position, variance: [1.0; 2], height_px: 5.0, weight: 1.0 }
                    })
                    .collect();
                fit_factors(&[steps], &noise, [1.0; 2], 16.0, [f64::INFINITY; 2], 50.0, 1e5)[0]
            })
            .collect();
        let mean = found.iter().sum::<f64>() / 60.0;
        let std = (found.iter().map(|f| (f - mean).powi(2)).sum::<f64>() / 59.0).sqrt();
        assert!((mean / 2.0 - 1.0).abs() < 0.05, "{mean}");
        assert!((0.05..0.14).contains(&(std / mean)), "{}", std / mean);
    }
}
