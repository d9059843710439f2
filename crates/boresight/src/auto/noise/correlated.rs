//! Errors of measurements that last: how large they are and what they leave in a track.
//!
//! Source: first-order Gauss-Markov errors of the measurement as further states of each axis (A. Gelb (ed.), *Applied Optimal Estimation*, 1974, ch. 4; S. R. Rogers, *IEEE Trans. AES* 23(4), 1987). A codec that moves a target's picture along by
//! its vectors and codes anew only what is off by more than its quantiser makes errors that last from some frames to seconds, no memory more than another: the sum of some Gauss-Markov errors of
//! equal variance, whose memories are as far apart in their logarithms (flicker noise; A. van der Ziel, *Physica* 16, 1950), from [`SHORTEST`] intervals to [`LONGEST`] of a usual track. One number,
//! their variance, is found with R and q by the likelihood of the innovations as in [`super::fit`], from the same series, and believed if they are far more probable with it than without ([`LEAST_GAIN`]).
//! What they leave: the tracker keeps its filter, which takes errors for independent. Its error is followed as what it is, with the gains of that filter and the law of these, over a usual
//! track; its variance beyond the one that the filter states is the result (the covariance of a linear filter with any gain: Gelb, ch. 7).
//! Departures: one memory found with its variance is that of the most errors, some frames, and left tracks stated as sure as before: what lasts longer and is rarer is what a filter cannot average. The velocity is left out: the q that was found without such errors makes its variance
//! larger than they do.
//! Symbols: per axis the error `[x, v, b...]` of position (px), velocity (px/s) and measurement (px); B variance of all b together (px²), τ their memories (s).
//! Limits: one law for all targets of a run. A target that swings about its course, or a box that does, is told from such an error only by how it goes on: what is not told apart counts as an error
//! and the covariances become wider. An error that stays for longer than a quarter of the tracks is where the target is. Cameras that move are not asked: their own errors last as well.

use super::fit::{self, LEAST, Noise, Scalar, Step, most_probable, of_innovations};
use super::persistence::LEAST_GAIN;
use crate::auto::quantile::quantile;
use crate::track::AccelerationNoise;
use crate::track::filter::constant_velocity::{Axis, step_noise};
use nalgebra::{SMatrix, SVector};

/// Steps that are fitted: the variance of an error that lasts ten of them is known to a tenth.
const FITTED: usize = 4000;
/// Memories: with three, from some frames to some hundred, no time is farther than a factor of three from one.
const MEMORIES: usize = 3;
/// Shortest memory in intervals; an error that is gone in less is as good as white.
const SHORTEST: f64 = 3.0;
/// Longest as a share of a usual track: four of them in a track are the fewest whose variance is seen.
const LONGEST: f64 = 0.25;
/// Part of the variance of the measurements that the search begins with.
const BEGUN: f64 = 0.1;
/// Position, velocity and the errors that last.
const N: usize = 2 + MEMORIES;

/// What is found: see the head of the file.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Correlated {
    /// Standard deviation of the errors that last, px, and their shortest and longest memory, s.
    pub std_px: f64,
    pub memories_s: [f64; 2],
    /// Standard deviation that they leave in the position of a usual track, per axis, beyond what the filter states, px.
    pub position_px: f64,
}

/// The errors that last in these series, beside `white` noise and motion that was found without them; `speed_std` is that of first velocities, px/s, `area_px2` the field's.
pub fn find(series: &[Vec<Step>], white: &Noise, speed_std: f64, area_px2: f64) -> Option<Correlated> {
    let usual = Usual::of(series)?;
    let some = sample(series, usual.length);
    let ends = [SHORTEST * usual.interval_s, LONGEST * usual.interval_s * usual.length as f64];
    if ends[1] <= ends[0] {
        return None;
    }
    let without = fit::log_likelihood(&some, white, fit::Motion::Accelerated(speed_std), area_px2);
    let parts = |[scale, extra_px, density, variance]: [f64; 4]| {
        (Noise { scale, extra_px, density, ..*white }, Law::between(ends, variance))
    };
    let likelihood = |x| {
        let (noise, law) = parts(x);
        log_likelihood(&some, &noise, law, speed_std, area_px2)
    };
    let measured = white.variance(usual.stated, usual.height_px);
    let low = [LEAST, LEAST, f64::MIN_POSITIVE, LEAST * measured];
    let high = [f64::INFINITY, f64::INFINITY, f64::INFINITY, measured];
    let start = [white.scale, white.extra_px, white.density, BEGUN * measured];
    let x = most_probable(start, [low, high], likelihood);
    if likelihood(x) < without + LEAST_GAIN {
        return None;
    }
    let (noise, law) = parts(x);
    let position_px = left(white, &noise, &law, &usual, speed_std).sqrt();
    Some(Correlated { std_px: x[3].sqrt(), memories_s: ends, position_px })
}

/// Series of every kind, for the longest are those of the targets that are measured best; without those shorter than half of a usual one, which false detections may have made.
fn sample(series: &[Vec<Step>], usual: usize) -> Vec<Vec<Step>> {
    let long = || series.iter().filter(|t| 2 * t.len() >= usual);
    let share = FITTED as f64 / long().map(Vec::len).sum::<usize>() as f64;
    let mut due = 0.5;
    let take = |_: &&Vec<Step>| {
        due += share.min(1.0);
        let now = due >= 1.0;
        due -= f64::from(u8::from(now));
        now
    };
    long().filter(take).cloned().collect()
}

/// The law of the errors that last.
#[derive(Clone, Copy, Debug)]
struct Law {
    /// Variance of each, px².
    each: f64,
    memories_s: [f64; MEMORIES],
}

impl Law {
    /// Of that variance together, with memories from the first to the second end.
    fn between([first, last]: [f64; 2], variance: f64) -> Self {
        let step = (last / first).ln() / (MEMORIES - 1) as f64;
        Self { each: variance / MEMORIES as f64, memories_s: std::array::from_fn(|i| first * (step * i as f64).exp()) }
    }

    /// The part of each that is left after a time.
    fn kept(&self, dt_s: f64) -> [f64; MEMORIES] {
        self.memories_s.map(|memory_s| (-dt_s / memory_s).exp())
    }

    /// The covariance of `[x, v, b...]` after a first measurement of that white variance.
    fn begun(&self, r: f64, speed_variance: f64) -> SMatrix<f64, N, N> {
        let mut p = SMatrix::zeros();
        (p[(0, 0)], p[(1, 1)]) = (r + self.each * MEMORIES as f64, speed_variance);
        for i in 2..N {
            p[(i, i)] = self.each;
            (p[(0, i)], p[(i, 0)]) = (-self.each, -self.each);
        }
        p
    }
}

/// What is usual of the series.
struct Usual {
    interval_s: f64,
    /// Steps of a series: half of all steps are in longer ones.
    length: usize,
    /// Stated variance, px², and height of a box, px.
    stated: f64,
    height_px: f64,
}

impl Usual {
    fn of(series: &[Vec<Step>]) -> Option<Self> {
        let middle = |of: fn(&Step) -> f64| {
            let mut values: Vec<f64> = series.iter().flat_map(|t| t.iter().skip(1)).map(of).collect();
            quantile(&mut values, 0.5)
        };
        let mut lengths: Vec<f64> = series.iter().flat_map(|t| t.iter().map(|_| t.len() as f64)).collect();
        let interval_s = middle(|s| s.dt_s);
        let (stated, height_px) = (middle(|s| 0.5 * (s.variance[0] + s.variance[1])), middle(|s| s.height_px));
        let length = quantile(&mut lengths, 0.5) as usize;
        (interval_s > 0.0).then_some(Self { interval_s, length, stated, height_px })
    }
}

/// An axis with the errors as further states.
#[derive(Clone, Copy, Debug)]
struct Lagging {
    x: SVector<f64, N>,
    p: SMatrix<f64, N, N>,
}

impl Lagging {
    fn predict(&mut self, dt_s: f64, q: &[f64; 3], kept: &[f64; MEMORIES], each: f64) {
        self.x[0] += dt_s * self.x[1];
        for i in 0..N {
            self.p[(i, 0)] += dt_s * self.p[(i, 1)];
        }
        for i in 0..N {
            self.p[(0, i)] += dt_s * self.p[(1, i)];
        }
        for (i, kept) in (2..N).zip(kept) {
            self.x[i] *= kept;
            for j in 0..N {
                self.p[(j, i)] *= kept;
            }
            for j in 0..N {
                self.p[(i, j)] *= kept;
            }
            self.p[(i, i)] += (1.0 - kept * kept) * each;
        }
        self.p[(0, 0)] += q[0];
        self.p[(0, 1)] += q[1];
        self.p[(1, 0)] += q[1];
        self.p[(1, 1)] += q[2];
    }

    /// Covariance of the states with what is measured, x and all b.
    fn measured(&self) -> SVector<f64, N> {
        let mut h = self.p.column(0).into_owned();
        (2..N).for_each(|i| h += self.p.column(i));
        h
    }
}

/// What is measured of a state: position and all errors.
fn seen(x: &SVector<f64, N>) -> f64 {
    x[0] + x.iter().skip(2).sum::<f64>()
}

impl Scalar for Lagging {
    fn expected(&self) -> [f64; 2] {
        [seen(&self.x), seen(&self.measured())]
    }

    fn correct(&mut self, z: f64, r: f64) {
        let h = self.measured();
        let gain = h / (seen(&h) + r);
        self.x += gain * (z - seen(&self.x));
        self.p -= gain * h.transpose();
    }
}

/// Logarithm of the likelihood of all series with such errors.
fn log_likelihood(series: &[Vec<Step>], noise: &Noise, law: Law, speed_std: f64, area_px2: f64) -> f64 {
    let begin = |z: f64, r: f64| {
        let mut x = SVector::zeros();
        x[0] = z;
        Lagging { x, p: law.begun(r, speed_std * speed_std) }
    };
    let mut kept = (f64::NAN, [0.0; MEMORIES]);
    of_innovations(series, noise, area_px2, begin, |axes, t, q| {
        if kept.0 != t {
            kept = (t, law.kept(t));
        }
        let step = step_noise(AccelerationNoise::Continuous(q), t);
        axes.iter_mut().for_each(|axis| axis.predict(t, &step, &kept.1, law.each));
    })
}

/// Variance of the position at the end of a usual track of a filter that knows only `white`, beyond that which it states, where errors are as `noise` and `law` say, px².
fn left(white: &Noise, noise: &Noise, law: &Law, usual: &Usual, speed_std: f64) -> f64 {
    let t = usual.interval_s;
    let r = |n: &Noise| n.variance(usual.stated, usual.height_px);
    let q = |n: &Noise| {
        let density = n.density + n.density_per_height2 * usual.height_px * usual.height_px;
        step_noise(AccelerationNoise::Continuous(density), t)
    };
    let (stated, stated_q, true_q, kept) = (r(white), q(white), q(noise), law.kept(t));
    let mut filter = Axis { x: 0.0, v: 0.0, xx: stated, xv: 0.0, vv: speed_std * speed_std };
    let mut error = Lagging { x: SVector::zeros(), p: law.begun(r(noise), speed_std * speed_std) };
    for _ in 1..usual.length {
        filter.predict(t, &stated_q);
        error.predict(t, &true_q, &kept, law.each);
        let s = filter.xx + stated;
        let mut gain = SVector::<f64, N>::zeros();
        (gain[0], gain[1]) = (filter.xx / s, filter.xv / s);
        filter.correct(0.0, stated);
        // P - K H P - (K H P)ᵀ + K (H P Hᵀ + R) Kᵀ, for any gain.
        let h = error.measured();
        let crossed = gain * h.transpose();
        error.p += gain * gain.transpose() * (seen(&h) + r(noise)) - crossed - crossed.transpose();
    }
    (error.p[(0, 0)] - filter.xx).max(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use rand_distr::StandardNormal;

    const DT_S: f64 = 0.04;

    /// Twenty targets of 200 scans driven by that density (px²/s³) with white errors of 0.1 px and others of that deviation (px) together, of these memories (s); with them where each truly is at
    /// the end.
    fn series(density: f64, std: f64, memories_s: &[f64], seed: u64) -> (Vec<Vec<Step>>, Vec<[f64; 2]>) {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut normal = || rng.sample::<f64, _>(StandardNormal);
        let each = std / (memories_s.len() as f64).sqrt();
        (0..20)
            .map(|_| {
                let (mut x, mut v) = ([100.0; 2], [normal() * 20.0, normal() * 20.0]);
                let mut errors: Vec<[f64; 2]> = memories_s.iter().map(|_| [each * normal(), each * normal()]).collect();
                let steps = (0..200)
                    .map(|_| {
                        for a in 0..2 {
                            let dv = (density * DT_S).sqrt() * normal();
                            x[a] += v[a] * DT_S + 0.5 * dv * DT_S + (density * DT_S.powi(3) / 12.0).sqrt() * normal();
                            v[a] += dv;
                            for (b, memory_s) in errors.iter_mut().zip(memories_s) {
                                let kept = (-DT_S / memory_s).exp();
                                b[a] = kept * b[a] + each * (1.0 - kept * kept).sqrt() * normal();
                            }
                        }
                        let lasts = |a: usize| errors.iter().map(|b| b[a]).sum::<f64>();
                        let position = [0, 1].map(|a| x[a] + lasts(a) + 0.1 * normal());
                        Step { dt_s: DT_S, position, variance: [0.01; 2], height_px: 5.0, weight: 1.0 }
                    })
                    .collect();
                (steps, x)
            })
            .unzip()
    }

    fn white(series: &[Vec<Step>]) -> Noise {
        let before =
            Noise { scale: 1.0, extra_px: 0.3, extra_per_height: 0.0, density: 100.0, density_per_height2: 0.0 };
        fit::fit(series, before, LEAST, 50.0, 1e5)
    }

    /// Mean squares of the errors of tracks at their ends beside their variances, as the filter states them and with what is found, for errors of 0.06 px of these memories (s).
    fn nees(memories_s: &[f64]) -> [f64; 2] {
        let mut sums = [0.0; 2];
        for seed in 1..6 {
            let (series, truth) = series(0.01, 0.06, memories_s, seed);
            let noise = white(&series);
            let found = find(&series, &noise, 50.0, 1e5).expect("errors that last");
            assert!((found.std_px / 0.06).ln().abs() < 0.5, "{memories_s:?} {found:?}");
            // The filter that knows nothing of them, at the end of each series, beside the truth.
            let r = noise.variance(0.01, 5.0);
            let q = step_noise(AccelerationNoise::Continuous(noise.density + 25.0 * noise.density_per_height2), DT_S);
            for (steps, truth) in series.iter().zip(&truth) {
                for a in 0..2 {
                    let mut axis = Axis { x: steps[0].position[a], v: 0.0, xx: r, xv: 0.0, vv: 2500.0 };
                    for s in &steps[1..] {
                        axis.predict(s.dt_s, &q);
                        axis.correct(s.position[a], r);
                    }
                    let e2 = (axis.x - truth[a]).powi(2);
                    sums[0] += e2 / axis.xx / 200.0;
                    sums[1] += e2 / (axis.xx + found.position_px.powi(2)) / 200.0;
                }
            }
        }
        sums
    }

    #[test]
    fn what_errors_that_last_leave_is_what_tracks_are_off_by() {
        let [stated, with] = nees(&[0.12, 0.49, 2.0]);
        assert!(stated > 1.8, "there is something to mend: {stated}");
        // 200 values are known to a tenth.
        assert!((0.75..1.3).contains(&with), "{with}, {stated} without");
        // Where all errors have one memory, three that stand for it take most of it away.
        for memory_s in [0.3, 0.8] {
            let [stated, with] = nees(&[memory_s]);
            assert!(with > 0.7 && with - 1.0 < 0.4 * (stated - 1.0), "{memory_s} s: {with}, {stated} without");
        }
    }

    #[test]
    fn white_errors_and_targets_that_turn_are_none() {
        for (density, seed) in [(0.0, 1), (0.01, 2), (4.0, 3), (400.0, 4), (4e4, 5)] {
            let (series, _) = series(density, 0.0, &[], seed);
            let found = find(&series, &white(&series), 50.0, 1e5);
            assert_eq!(found, None, "{density} px²/s³");
        }
    }
}
