//! Motion with a velocity that is forgotten: particles that diffuse, cells that wander.
//!
//! Source: an Ornstein-Uhlenbeck velocity (`boresight_filters::model::OrnsteinUhlenbeck`), whose limit for a memory shorter than the interval is diffusion: D = σ² τ (px²/s) an axis. R, σ and τ by the
//! likelihood of the innovations as in [`super::fit`], from the same series; the model is taken if they are far more probable with it than with constant velocity ([`LEAST_GAIN`]).
//! Departures: the memory is [`SHORTEST`] of an interval at least: what is shorter shows only in D, and a velocity of infinite variance in no table.
//! Symbols: σ deviation of the velocity per axis (px/s), τ its memory (s); the law is [`super::forgotten`].
//! Limits: one law for all targets; where some diffuse and others go somewhere, the one that explains more of the steps.

use super::super::quantile::{WITHIN_ONE, quantile};
use super::fit::{self, LEAST, Motion, Noise, Step, log_likelihood, most_probable};
use super::forgotten::Persistence;

/// Logarithm of the factor by which the innovations must be more probable: very strong evidence, 150 to 1 (R. E. Kass, A. E. Raftery, *J. Am. Stat. Assoc.* 90, 1995, 3.2).
pub(super) const LEAST_GAIN: f64 = 5.0;
/// Least memory in intervals: the steps of a twentieth are correlated by 3 %.
const SHORTEST: f64 = 0.05;
/// Longest memory that is looked for, in intervals.
const LONGEST: f64 = 1000.0;
/// Memories in intervals from which the search begins, and the longest that it may find. A memory of about an interval and noise in the measurement are hard to tell from one another: no memory
/// is tried first, by itself.
const BEGINNINGS: [[f64; 2]; 3] = [[SHORTEST, SHORTEST], [1.0, LONGEST], [10.0, LONGEST]];
/// What is remembered for more intervals is a course, and for the time that a track goes unseen constant velocity says as much; how fast targets are in the mean of all times, which the
/// other model needs, some tracks of some memories each do not tell.
const COURSE: f64 = 10.0;
/// Steps that decide between the models: some hundred would.
const COMPARED: usize = 1000;

/// What was assumed before: noise, the least density of an acceleration, the deviation of speeds (px/s) and the area of the field.
#[derive(Clone, Copy, Debug)]
pub struct Assumed {
    pub noise: Noise,
    pub least_density: f64,
    pub speed_std: f64,
    pub area_px2: f64,
}

/// What explains the series better than constant velocity does, the simplest first and each much better than the one before: noise and motion, looked for as they are asked for.
pub fn better(series: &[Vec<Step>], assumed: Assumed) -> impl Iterator<Item = (Noise, Persistence)> + use<> {
    let Assumed { noise: before, least_density, speed_std, area_px2 } = assumed;
    let some = lasting(series);
    let ever_better = Usual::of(&some).map(|usual| {
        let driven = fit::fit(&some, before, least_density, speed_std, area_px2);
        let mut most = log_likelihood(&some, &driven, Motion::Accelerated(speed_std), area_px2);
        BEGINNINGS.into_iter().filter_map(move |[memory, longest]| {
            let (noise, motion) = fit_memory(&some, &before, usual.moving(memory), &usual, longest, area_px2);
            let gain = log_likelihood(&some, &noise, Motion::Persistent(motion), area_px2);
            let is_better = gain >= most + LEAST_GAIN && motion.memory_s <= COURSE * usual.interval_s;
            is_better.then(|| {
                most = gain;
                (noise, motion)
            })
        })
    });
    ever_better.into_iter().flatten()
}

/// The longest series that hold half of all steps, of many some: what false detections made does not last, and would be taken for noise.
fn lasting(series: &[Vec<Step>]) -> Vec<Vec<Step>> {
    let n: usize = series.iter().map(Vec::len).sum();
    let mut longest: Vec<&Vec<Step>> = series.iter().collect();
    longest.sort_by_key(|t| std::cmp::Reverse(t.len()));
    let mut left = n.div_ceil(2);
    let take = |t: &&Vec<Step>| (left > 0, left = left.saturating_sub(t.len())).0;
    longest.into_iter().take_while(take).step_by((n / 2).div_ceil(COMPARED).max(1)).cloned().collect()
}

/// The usual interval of the series, s, and the deviation of the speed between two of its positions per axis, px/s.
struct Usual {
    interval_s: f64,
    speed_std: f64,
}

impl Usual {
    fn of(series: &[Vec<Step>]) -> Option<Self> {
        let steps = || series.iter().flat_map(|t| t.windows(2)).filter(|pair| pair[1].dt_s > 0.0);
        let speed = |pair: &[Step], a: usize| (pair[1].position[a] - pair[0].position[a]).abs() / pair[1].dt_s;
        let interval_s = quantile(&mut steps().map(|pair| pair[1].dt_s).collect::<Vec<_>>(), 0.5);
        // The deviation by the point of the magnitudes, as strangers do not count.
        let mut speeds: Vec<f64> = steps().flat_map(|pair| [speed(pair, 0), speed(pair, 1)]).collect();
        let speed_std = quantile(&mut speeds, WITHIN_ONE);
        (speed_std > 0.0).then_some(Self { interval_s, speed_std })
    }

    /// A motion with such steps whose velocity is remembered for so many intervals.
    fn moving(&self, memory: f64) -> Persistence {
        let forgets = f64::max(1.0, 0.5 / memory).sqrt();
        Persistence { speed_std_px_per_s: self.speed_std * forgets, memory_s: memory * self.interval_s }
    }
}

/// The most probable noise and motion with a memory of so many intervals at most; the prior of the noise is around what was assumed before, that of the motion around where it begins.
fn fit_memory(
    series: &[Vec<Step>],
    before: &Noise,
    began: Persistence,
    usual: &Usual,
    longest: f64,
    area_px2: f64,
) -> (Noise, Persistence) {
    let interval_s = usual.interval_s;
    let parts = |[scale, extra_px, extra_per_height, diffusion, memory_s]: [f64; 5]| {
        let speed_std_px_per_s = (diffusion / memory_s).sqrt();
        (Noise { scale, extra_px, extra_per_height, ..*before }, Persistence { speed_std_px_per_s, memory_s })
    };
    let start = [before.scale, before.extra_px, before.extra_per_height, began.diffusion_px2_per_s(), began.memory_s];
    let low = [LEAST, LEAST, LEAST, LEAST * LEAST / interval_s, SHORTEST * interval_s];
    let high = [f64::INFINITY, f64::INFINITY, f64::INFINITY, f64::INFINITY, longest * interval_s];
    let likelihood = |x| {
        let (noise, motion) = parts(x);
        log_likelihood(series, &noise, Motion::Persistent(motion), area_px2)
    };
    parts(most_probable(start, [low, high], likelihood))
}

#[cfg(test)]
mod tests {
    use super::*;
    use boresight_filters::model::{Model, OrnsteinUhlenbeck};
    use nalgebra::SVector;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use rand_distr::StandardNormal;

    /// Ten targets of a hundred scans with an exact law of motion and a noise of 0.1 px.
    fn series(mut next: impl FnMut(&mut [f64; 2], &mut dyn FnMut() -> f64)) -> Vec<Vec<Step>> {
        let mut rng = ChaCha8Rng::seed_from_u64(17);
        let mut normal = || rng.sample::<f64, _>(StandardNormal);
        (0..10)
            .map(|_| {
                let mut axes = [[50.0, 3.0 * normal()], [50.0, 3.0 * normal()]];
                let step = |_| {
                    axes.iter_mut().for_each(|axis| next(axis, &mut normal));
                    let position = [0, 1].map(|a| axes[a][0] + 0.1 * normal());
                    Step { dt_s: 0.1, position, variance: [0.01; 2], height_px: 5.0, weight: 1.0 }
                };
                (0..100).map(step).collect()
            })
            .collect()
    }

    fn found(series: &[Vec<Step>]) -> Option<(Noise, Persistence)> {
        let noise =
            Noise { scale: 1.0, extra_px: 0.3, extra_per_height: 0.0, density: 100.0, density_per_height2: 0.0 };
        let assumed = Assumed { noise, least_density: LEAST, speed_std: 50.0, area_px2: 1e5 };
        better(series, assumed).last()
    }

    #[test]
    fn what_diffuses_is_told_with_its_coefficient() {
        // Steps of 1.2 px an axis in 0.1 s: 2 D = 14.4 px²/s.
        let found = found(&series(|axis, normal| axis[0] += 1.2 * normal()));
        let (noise, p) = found.expect("a diffusion");
        let grows = 2.0 * p.speed_std_px_per_s.powi(2) * p.memory_s;
        assert!((grows / 14.4).ln().abs() < 0.12, "{grows} px²/s: {p:?}");
        assert!(p.memory_s < 0.02, "{p:?}");
        assert!(noise.extra_px < 0.4, "{noise:?}");
    }

    #[test]
    fn a_velocity_that_is_forgotten_in_some_scans_is_told_with_its_memory() {
        let model = OrnsteinUhlenbeck::new(12.0, 0.4).unwrap();
        let (phi, q) = (model.transition(0.1, &SVector::zeros()), model.process_noise(0.1));
        let l00 = f64::sqrt(q[(0, 0)]);
        let l10 = q[(0, 1)] / l00;
        let l11 = f64::sqrt(q[(1, 1)] - l10 * l10);
        let found = found(&series(|axis, normal| {
            let (a, b) = (normal(), normal());
            axis[0] += phi[(0, 1)] * axis[1] + l00 * a;
            axis[1] = phi[(1, 1)] * axis[1] + l10 * a + l11 * b;
        }));
        let (_, p) = found.expect("a memory of four scans");
        assert!((p.memory_s / 0.4).ln().abs() < 0.3 && (p.speed_std_px_per_s / 12.0).ln().abs() < 0.15, "{p:?}");
    }

    #[test]
    fn what_goes_somewhere_keeps_its_velocity() {
        let found = found(&series(|axis, normal| {
            axis[0] += 0.1 * axis[1];
            axis[1] += 0.3 * normal();
        }));
        assert_eq!(found, None);
    }
}
