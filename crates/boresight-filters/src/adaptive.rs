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
