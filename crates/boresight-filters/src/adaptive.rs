//! Adaptive noise: learns the measurement covariance R and the scale of the process noise from the innovations.
//!
//! Source: R. K. Mehra, "Approaches to adaptive filtering", IEEE Trans. AC 17(5), 1972 (covariance matching):
//! E[ν νᵀ] = H P Hᵀ + R, so R is the mean of ν νᵀ - H P Hᵀ; the scale s of Q follows the mean NIS by
//! s ← s · clamp(NIS/m)^rate, m = 2. Windowed: the last W innovations; recursive: exponential memory of `memory` updates.
//! Differs from it: R is kept positive (no axis below `floor` times the given variance), and NIS is clipped at 9 so that
//! an outlier does not open the filter. R and Q explain the same innovations: learn one at a time unless both are
//! well excited. Off by default: without [`Adaptive`] around it a filter uses what it is given.
//! Symbols: ν 2 x 1 (px); H P Hᵀ, R 2 x 2 (px²); s no unit. Cost: about 60 flops an update, and W sums if windowed.
//! Limits: needs some 30 updates to say anything; PDA updates do not teach, they mix in clutter.

use crate::linalg::invert_pair;
use crate::model::{Model, Scaled};
use crate::{FilterError, Gaussian, GaussianFilter, Measurement, Real, Start, Weighted};
use nalgebra::Matrix2;

/// How the past is weighed.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum Memory<T = f64> {
    /// Exponential, over about this many updates (above 1).
    Recursive(T),
    /// The last W updates, all alike; nothing is learnt before the window is full.
    Windowed,
}

/// What is learnt and how fast.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct AdaptiveConfig<T = f64> {
    /// Learn R: the given covariance is replaced once there are enough innovations.
    pub measurement_noise: bool,
    /// Learn the scale of Q.
    pub process_noise: bool,
    /// How the past is weighed.
    pub memory: Memory<T>,
    /// Least learnt variance of an axis as a fraction of the given one, 0..=1. 0.1 by default.
    pub floor: T,
    /// Exponent of one step of the scale, 0..=1; larger follows faster and is noisier. 0.1 by default.
    pub scale_rate: T,
}

impl<T: Real> Default for AdaptiveConfig<T> {
    fn default() -> Self {
        Self {
            measurement_noise: true,
            process_noise: false,
            memory: Memory::Recursive(T::of(50.0)),
            floor: T::of(0.1),
            scale_rate: T::of(0.1),
        }
    }
}

impl<T: Real> AdaptiveConfig<T> {
    /// Learns R; the rest as by default.
    pub fn measurement_noise(memory: Memory<T>) -> Self {
        Self { memory, ..Self::default() }
    }

    /// Learns the scale of Q; the rest as by default.
    pub fn process_noise(memory: Memory<T>) -> Self {
        Self { measurement_noise: false, process_noise: true, memory, ..Self::default() }
    }
}

/// What the innovations taught so far; W is the window of [`Memory::Windowed`], 0 is enough without one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NoiseLearner<const W: usize, T: Real = f64> {
    config: AdaptiveConfig<T>,
    samples: [Matrix2<T>; W],
    sum: Matrix2<T>,
    n: usize,
    scale: T,
}

impl<const W: usize, T: Real> NoiseLearner<W, T> {
    /// Starts knowing nothing.
    /// # Errors
    /// [`FilterError::OutOfRange`] for a memory of 1 or less, an empty window, or fractions outside 0..=1.
    pub fn new(config: AdaptiveConfig<T>) -> Result<Self, FilterError> {
        let unit = |v: T| v >= T::zero() && v <= T::one();
        match config.memory {
            Memory::Recursive(m) if !(m > T::one() && m <= T::MAX) => {
                return Err(FilterError::OutOfRange("a memory of more than 1 update"));
            }
            Memory::Windowed if W == 0 => return Err(FilterError::OutOfRange("a window of at least 1 update")),
            _ => {}
        }
        if !(unit(config.floor) && unit(config.scale_rate)) {
            return Err(FilterError::OutOfRange("floor and scale rate in 0..=1"));
        }
        Ok(Self { config, samples: [Matrix2::zeros(); W], sum: Matrix2::zeros(), n: 0, scale: T::one() })
    }

    /// Returns the learnt factor on Q (no unit).
    pub fn noise_scale(&self) -> T {
        self.scale
    }

    /// Returns the mean of ν νᵀ - H P Hᵀ (px²), once enough updates were seen.
    pub fn measurement_noise(&self) -> Option<Matrix2<T>> {
        match self.config.memory {
            Memory::Windowed => (self.n >= W).then(|| self.sum / T::of(W as f64)),
            Memory::Recursive(m) => (T::of(self.n as f64) >= m).then_some(self.sum),
        }
    }

    /// Takes the innovation of an update: what was predicted and the measurement as it was used.
    /// # Errors
    /// [`FilterError::NotPositiveDefinite`] if the innovation covariance cannot be factored; nothing is then learnt.
    pub fn learn(&mut self, predicted: &Gaussian<2, T>, m: &Measurement<T>) -> Result<(), FilterError> {
        let nu = m.position - predicted.mean;
        let sample = nu * nu.transpose() - predicted.cov;
        if self.config.process_noise {
            let s = invert_pair(&(predicted.cov + m.cov), "the innovation covariance")?;
            let ratio = s.distance2(&nu).min(T::of(9.0)) * T::of(0.5);
            // E[ln(χ²₂/2)] = -γ (Euler): centred, so that a consistent filter keeps its scale.
            let ln = ratio.max(T::of(1e-6)).ln() + T::of(0.577_215_664_901_532_9);
            let step = (ln * self.config.scale_rate).exp();
            self.scale = (self.scale * step).max(T::of(1e-6)).min(T::of(1e6));
        }
        match self.config.memory {
            Memory::Windowed => {
                let at = self.n % W;
                if let Some(old) = self.samples.get_mut(at) {
                    *old = sample;
                }
                // Summed anew: a running sum would drift over millions of updates.
                self.sum = self.samples.iter().fold(Matrix2::zeros(), |s, v| s + v);
            }
            Memory::Recursive(memory) => {
                let k = (T::one() / memory).max(T::one() / T::of((self.n + 1) as f64));
                self.sum += (sample - self.sum) * k;
            }
        }
        self.n += 1;
        Ok(())
    }

    /// Returns the measurement with the learnt covariance.
    pub fn with_learnt_noise(&self, m: &Measurement<T>) -> Measurement<T> {
        let Some(r) = self.measurement_noise().filter(|_| self.config.measurement_noise) else { return *m };
        let least = |i: usize| m.cov[(i, i)] * self.config.floor;
        let (a, c) = (r[(0, 0)].max(least(0)), r[(1, 1)].max(least(1)));
        // The correlation is kept below 0.9: an estimate from few samples must not become singular.
        let limit = (a * c).sqrt() * T::of(0.9);
        let b = r[(1, 0)].max(-limit).min(limit);
        Measurement { position: m.position, cov: Matrix2::new(a, b, b, c) }
    }
}

/// A filter around a [`Scaled`] model that learns its noise.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Adaptive<F, const W: usize, T: Real = f64> {
    filter: F,
    learner: NoiseLearner<W, T>,
}

impl<F, const W: usize, T: Real> Adaptive<F, W, T> {
    /// Wraps a filter.
    /// # Errors
    /// As [`NoiseLearner::new`].
    pub fn new(filter: F, config: AdaptiveConfig<T>) -> Result<Self, FilterError> {
        Ok(Self { filter, learner: NoiseLearner::new(config)? })
    }

    /// Returns the filter inside.
    pub fn inner(&self) -> &F {
        &self.filter
    }

    /// Returns what was learnt.
    pub fn learner(&self) -> &NoiseLearner<W, T> {
        &self.learner
    }
}

/// A filter whose process noise can be scaled: every form around a [`Scaled`] model.
pub trait ScaleNoise<T> {
    /// Sets the factor on Q of the next predict.
    /// # Errors
    /// [`FilterError::OutOfRange`] if it is negative or not finite.
    fn set_noise_scale(&mut self, scale: T) -> Result<(), FilterError>;
}

macro_rules! scale_noise {
    ($($filter:ident),*) => {$(
        impl<M: Model<N, T>, const N: usize, T: Real> ScaleNoise<T> for crate::$filter<Scaled<M, T>, N, T> {
            fn set_noise_scale(&mut self, scale: T) -> Result<(), FilterError> {
                self.model_mut().set_scale(scale)
            }
        }
    )*};
}
scale_noise!(Kf, Ud, Srif, Information, SquareRoot, Ukf);

impl<F, const N: usize, const W: usize, T> GaussianFilter<N> for Adaptive<F, W, T>
where
    F: GaussianFilter<N, Real = T> + ScaleNoise<T>,
    T: Real,
{
    type Real = T;

    fn predict(&mut self, dt_s: T) -> Result<(), FilterError> {
        self.filter.predict(dt_s)
    }

    fn correct(&mut self, m: &Measurement<T>) -> Result<(), FilterError> {
        crate::check::check_measurement(m)?;
        let predicted = self.filter.predicted();
        let used = self.learner.with_learnt_noise(m);
        let mut next = self.clone();
        next.filter.correct(&used)?;
        next.learner.learn(&predicted, &used)?;
        next.filter.set_noise_scale(next.learner.noise_scale())?;
        *self = next;
        Ok(())
    }

    fn correct_weighted<I>(&mut self, hypotheses: I) -> Result<(), FilterError>
    where
        I: Iterator<Item = Weighted<T>> + Clone,
    {
        let learner = self.learner;
        self.filter.correct_weighted(
            hypotheses
                .map(move |h| Weighted { measurement: learner.with_learnt_noise(&h.measurement), weight: h.weight }),
        )
    }

    crate::filter::belief_of_the_filter_inside!();
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Kf;
    use crate::model::ConstantVelocity;
    use nalgebra::Vector2;

    fn predicted() -> Gaussian<2> {
        Gaussian::new(Vector2::new(10.0, 20.0), Matrix2::new(1.0, 0.0, 0.0, 2.0))
    }

    fn seen(nu: [f64; 2], variance: f64) -> Measurement {
        Measurement::new(predicted().mean + Vector2::from(nu), Matrix2::identity() * variance)
    }

    fn taught<const W: usize>(memory: Memory) -> [Option<Matrix2<f64>>; 3] {
        let mut learner = NoiseLearner::<W>::new(AdaptiveConfig::measurement_noise(memory)).unwrap();
        [[2.0, 1.0], [0.0, 3.0], [1.0, 1.0]].map(|nu| {
            learner.learn(&predicted(), &seen(nu, 1.0)).unwrap();
            learner.measurement_noise()
        })
    }

    /// Samples ν νᵀ - P: [[3, 2], [2, -1]], [[-1, 0], [0, 7]], [[0, 1], [1, -1]].
    #[test]
    fn the_learnt_covariance_is_the_mean_of_the_samples() {
        let first_two = Some(Matrix2::new(1.0, 1.0, 1.0, 3.0));
        assert_eq!(taught::<0>(Memory::Recursive(2.0)), [None, first_two, Some(Matrix2::new(0.5, 1.0, 1.0, 1.0))]);
        assert_eq!(taught::<2>(Memory::Windowed), [None, first_two, Some(Matrix2::new(-0.5, 0.5, 0.5, 3.0))]);
        assert_eq!(taught::<0>(Memory::Recursive(2.5))[1], None);
    }

    fn used(nus: &[[f64; 2]], given: &Measurement) -> Measurement {
        let mut learner = NoiseLearner::<0>::new(AdaptiveConfig::measurement_noise(Memory::Recursive(2.0))).unwrap();
        for nu in nus {
            learner.learn(&predicted(), &seen(*nu, 1.0)).unwrap();
        }
        learner.with_learnt_noise(given)
    }

    #[test]
    fn the_learnt_covariance_keeps_a_floor_and_stays_regular() {
        let given = seen([0.0, 0.0], 2.0);
        assert_eq!(used(&[[2.0, 1.0]], &given), given, "too early");
        let free = used(&[[2.0, 1.0], [0.0, 3.0]], &given).cov;
        assert_eq!(free, Matrix2::new(1.0, 1.0, 1.0, 3.0));
        // ν = 0 twice: the mean is -P; a tenth of 2 is the least.
        assert_eq!(used(&[[0.0, 0.0]; 2], &given).cov, Matrix2::new(0.2, 0.0, 0.0, 0.2));
        // ν = ±(3, 3): [[8, 9], [9, 7]] would be indefinite; 0.9 sqrt(56) is the most.
        for sign in [1.0, -1.0] {
            let tight = used(&[[3.0, sign * 3.0]; 2], &given).cov;
            let most = sign * 0.9 * 56.0_f64.sqrt();
            assert_eq!((tight[(0, 0)], tight[(1, 1)]), (8.0, 7.0));
            assert!((tight[(0, 1)] - most).abs() < 1e-15 && tight[(0, 1)] == tight[(1, 0)]);
        }
    }

    /// S = diag(2, 3); e^{γ} = 1.781072417990198.
    #[test]
    fn the_scale_moves_by_the_centred_logarithm_of_half_the_distance() {
        let scale = |nu: [f64; 2], n: usize| {
            let mut learner = NoiseLearner::<0>::new(AdaptiveConfig::process_noise(Memory::Recursive(2.0))).unwrap();
            for _ in 0..n {
                learner.learn(&predicted(), &seen(nu, 1.0)).unwrap();
            }
            assert_eq!(learner.with_learnt_noise(&seen(nu, 5.0)), seen(nu, 5.0), "R is not learnt");
            learner.noise_scale()
        };
        let euler = 1.781_072_417_990_198_f64;
        assert_eq!(scale([1.0, 1.0], 0), 1.0);
        assert!((scale([2.0, 0.0], 1) - euler.powf(0.1)).abs() < 1e-15);
        assert!((scale([2.0, 0.0], 2) - euler.powf(0.2)).abs() < 1e-15);
        // d² counts up to 9 and half of it from 1e-6; the scale stays in 1e-6..=1e6.
        assert!((scale([50.0, 0.0], 1) - (4.5 * euler).powf(0.1)).abs() < 1e-15);
        assert!((scale([0.0, 0.0], 1) - (1e-6 * euler).powf(0.1)).abs() < 1e-15);
        assert_eq!((scale([50.0, 0.0], 99), scale([0.0, 0.0], 99)), (1e6, 1e-6));
    }

    #[test]
    fn a_configuration_out_of_range_is_refused() {
        let with = |change: fn(&mut AdaptiveConfig)| {
            let mut config = AdaptiveConfig::default();
            change(&mut config);
            (NoiseLearner::<0>::new(config).is_ok(), NoiseLearner::<1>::new(config).is_ok())
        };
        assert_eq!(with(|_| ()), (true, true));
        assert_eq!(with(|c| c.memory = Memory::Windowed), (false, true));
        assert_eq!(with(|c| (c.floor, c.scale_rate) = (0.0, 1.0)), (true, true));
        assert_eq!(with(|c| (c.floor, c.scale_rate) = (1.0, 0.0)), (true, true));
        let wrong: [fn(&mut AdaptiveConfig); 7] = [
            |c| c.memory = Memory::Recursive(1.0),
            |c| c.memory = Memory::Recursive(f64::INFINITY),
            |c| c.memory = Memory::Recursive(f64::NAN),
            |c| c.floor = -0.1,
            |c| c.floor = 1.1,
            |c| c.scale_rate = -0.1,
            |c| c.scale_rate = 1.1,
        ];
        for change in wrong {
            assert_eq!(with(change), (false, false));
        }
    }

    #[test]
    fn a_weighted_update_uses_the_learnt_noise_and_teaches_nothing() {
        let first = Measurement::isotropic(0.0, 0.0, 1.0);
        let model = Scaled::new(ConstantVelocity::discrete(0.5).unwrap());
        let kf = Kf::<_, 4>::from_point(model, &first, 1.0).unwrap();
        let mut f = Adaptive::<_, 0>::new(kf, AdaptiveConfig::measurement_noise(Memory::Recursive(2.0))).unwrap();
        for x in [0.5, -2.0, 1.0] {
            f.predict(0.5).unwrap();
            f.correct(&Measurement::isotropic(x, x, 1.0)).unwrap();
        }
        let doubtful = Weighted { measurement: first, weight: 0.4 };
        let mut twin = *f.inner();
        let measurement = f.learner().with_learnt_noise(&first);
        assert_ne!(measurement.cov, first.cov);
        twin.correct_weighted([Weighted { measurement, ..doubtful }].into_iter()).unwrap();
        let before = *f.learner();
        f.correct_weighted([doubtful].into_iter()).unwrap();
        assert_eq!((f.belief(), *f.learner()), (twin.belief(), before));
    }

    #[test]
    fn an_update_sets_the_scale_of_the_next_prediction() {
        let model = Scaled::new(ConstantVelocity::discrete(0.5).unwrap());
        let kf = Kf::<_, 4>::from_point(model, &Measurement::isotropic(0.0, 0.0, 1.0), 1.0).unwrap();
        let mut f = Adaptive::<_, 0>::new(kf, AdaptiveConfig::process_noise(Memory::Recursive(2.0))).unwrap();
        f.predict(1.0).unwrap();
        f.correct(&Measurement::isotropic(30.0, 0.0, 1.0)).unwrap();
        let scale = f.learner().noise_scale();
        assert!(scale > 1.2, "{scale}");
        let (mut scaled, mut plain) = (f, *f.inner());
        plain.model_mut().set_scale(1.0).unwrap();
        scaled.predict(1.0).unwrap();
        plain.predict(1.0).unwrap();
        // Q of the velocity is 0.25 px²/s² a second.
        let more = scaled.belief().cov[(1, 1)] - plain.belief().cov[(1, 1)];
        assert!((more - 0.25 * (scale - 1.0)).abs() < 1e-12, "{more}");
    }
}
