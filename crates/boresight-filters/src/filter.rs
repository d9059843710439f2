//! The faces of a filter: [`Filter`], object-safe, for trackers; [`GaussianFilter`], sized and typed, for mathematics.
//!
//! [`Tracked`] makes a [`Filter`] of every [`GaussianFilter`]; f32 filters are converted at this border.

use crate::check::{check_measurement, check_weighted};
use crate::gaussian::{log_likelihood, position_of};
use crate::mixture::mixture_update;
use crate::model::{Model, kinematics_from_point};
use crate::{FilterError, Gaussian, Measurement, Real, Weighted};

/// A filter of one target as a tracker sees it.
pub trait Filter {
    /// Moves the belief `dt_s` seconds ahead; `predict(0)` is the identity.
    /// # Errors
    /// [`FilterError`] if `dt_s` is negative or not finite; the state is then unchanged.
    fn predict(&mut self, dt_s: f64) -> Result<(), FilterError>;

    /// Returns the predicted position H x and its covariance H P Hᵀ (px, px²), without measurement noise.
    fn predicted(&self) -> Gaussian<2>;

    /// Corrects the belief by the hypotheses of one scan; `[]` is a missed scan, weights sum to at most 1.
    ///
    /// The rest of the weights, p0 = 1 - Σ weights, is the probability that none is the target's own: the PDA update
    /// (`docs/theory/association.md`). One hypothesis of weight 1 is the plain update.
    /// # Errors
    /// [`FilterError`] for NaN, infinity or a covariance that cannot be factored; the state is then unchanged.
    fn update(&mut self, hypotheses: &[Weighted]) -> Result<(), FilterError>;

    /// Returns mean and covariance of `[x, vx, y, vy]` (px, px/s).
    fn kinematics(&self) -> Gaussian<4>;

    /// Returns the log-likelihood of a measurement (density per px²) before the update.
    /// # Errors
    /// [`FilterError`] if the measurement is not finite or the innovation covariance cannot be factored.
    fn log_likelihood(&self, measurement: &Measurement) -> Result<f64, FilterError> {
        check_measurement(measurement)?;
        log_likelihood(&self.predicted(), measurement)
    }
}

/// A filter whose belief is a Gaussian of N states: what wrappers (mixtures, IMM, robust forms, smoothers) build on.
pub trait GaussianFilter<const N: usize>: Clone {
    /// The number type it computes in.
    type Real: Real;

    /// Moves the belief `dt_s` seconds ahead; 0 is the identity.
    /// # Errors
    /// [`FilterError`] if `dt_s` is negative or not finite, or the result is not; the state is then unchanged.
    fn predict(&mut self, dt_s: Self::Real) -> Result<(), FilterError>;

    /// Corrects the belief by one measurement of position.
    /// # Errors
    /// [`FilterError`] for NaN, infinity or a covariance that cannot be factored; the state is then unchanged.
    fn correct(&mut self, measurement: &Measurement<Self::Real>) -> Result<(), FilterError>;

    /// Returns the belief.
    fn belief(&self) -> Gaussian<N, Self::Real>;

    /// Replaces the belief.
    /// # Errors
    /// [`FilterError`] if it is not finite, not symmetric, or cannot be factored; the state is then unchanged.
    fn set_belief(&mut self, belief: &Gaussian<N, Self::Real>) -> Result<(), FilterError>;

    /// Returns where x and y stand in the state.
    fn position_at(&self) -> [usize; 2];

    /// Returns mean and covariance of `[x, vx, y, vy]`.
    fn kinematics(&self) -> Gaussian<4, Self::Real>;

    /// Returns the position H x and its covariance H P Hᵀ, without measurement noise.
    #[inline]
    fn predicted(&self) -> Gaussian<2, Self::Real> {
        position_of(&self.belief(), self.position_at())
    }

    /// Corrects the belief by weighted hypotheses (PDA update); none, or all weights 0, changes nothing.
    /// # Errors
    /// As [`GaussianFilter::correct`], and [`FilterError::OutOfRange`] for weights outside 0..=1 or summing above 1.
    fn correct_weighted<I>(&mut self, hypotheses: I) -> Result<(), FilterError>
    where
        I: Iterator<Item = Weighted<Self::Real>> + Clone,
    {
        correct_by_mixture(self, hypotheses)
    }

    /// Returns the log-likelihood of a measurement (density per px²) before the update.
    /// # Errors
    /// [`FilterError`] if the measurement is not finite or the innovation covariance cannot be factored.
    fn log_likelihood(&self, measurement: &Measurement<Self::Real>) -> Result<Self::Real, FilterError> {
        check_measurement(measurement)?;
        log_likelihood(&self.predicted(), measurement)
    }
}

/// A filter that can be started from a model and a first belief.
pub trait Start<M, const N: usize>: GaussianFilter<N> + Sized
where
    M: Model<N, Self::Real>,
{
    /// Starts from a belief in the whole state.
    /// # Errors
    /// [`FilterError`] if the belief is not finite, not symmetric, or its covariance cannot be factored.
    fn start(model: M, belief: Gaussian<N, Self::Real>) -> Result<Self, FilterError>;

    /// Returns the motion model.
    fn model(&self) -> &M;

    /// Returns the motion model to change it: the next predict uses it.
    fn model_mut(&mut self) -> &mut M;

    /// Starts from a belief in position and velocity `[x, vx, y, vy]`; further states take the model's prior.
    /// # Errors
    /// As [`Start::start`].
    fn from_kinematics(model: M, kinematics: &Gaussian<4, Self::Real>) -> Result<Self, FilterError> {
        let belief = model.lift(kinematics);
        Self::start(model, belief)
    }

    /// Starts from one measured position and a velocity known only by its standard deviation (px/s per axis).
    /// # Errors
    /// As [`Start::start`], and if `velocity_std` is not positive.
    fn from_point(model: M, point: &Measurement<Self::Real>, velocity_std: Self::Real) -> Result<Self, FilterError> {
        Self::from_kinematics(model, &kinematics_from_point(point, velocity_std)?)
    }
}

/// The parts of [`GaussianFilter`] that a wrapper leaves to the filter inside (its field `filter`).
macro_rules! belief_of_the_filter_inside {
    () => {
        fn belief(&self) -> Gaussian<N, T> {
            self.filter.belief()
        }

        fn set_belief(&mut self, belief: &Gaussian<N, T>) -> Result<(), FilterError> {
            self.filter.set_belief(belief)
        }

        fn position_at(&self) -> [usize; 2] {
            self.filter.position_at()
        }

        fn kinematics(&self) -> Gaussian<4, T> {
            self.filter.kinematics()
        }

        fn predicted(&self) -> Gaussian<2, T> {
            self.filter.predicted()
        }
    };
}
pub(crate) use belief_of_the_filter_inside;

/// Makes a [`Filter`] of a [`GaussianFilter`] with N states.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tracked<F, const N: usize>(pub F);

impl<F: GaussianFilter<N>, const N: usize> Filter for Tracked<F, N> {
    #[inline]
    fn predict(&mut self, dt_s: f64) -> Result<(), FilterError> {
        self.0.predict(F::Real::of(dt_s))
    }

    #[inline]
    fn predicted(&self) -> Gaussian<2> {
        self.0.predicted().cast()
    }

    #[inline]
    fn update(&mut self, hypotheses: &[Weighted]) -> Result<(), FilterError> {
        match hypotheses {
            [] => Ok(()),
            // Exactly one sure hypothesis is the common case of the fast path.
            [only] if only.weight == 1.0 => self.0.correct(&only.measurement.cast()),
            several => self.0.correct_weighted(several.iter().map(cast_weighted)),
        }
    }

    #[inline]
    fn kinematics(&self) -> Gaussian<4> {
        self.0.kinematics().cast()
    }

    fn log_likelihood(&self, measurement: &Measurement) -> Result<f64, FilterError> {
        self.0.log_likelihood(&measurement.cast()).map(Real::as_f64)
    }
}

/// A function, not a closure: what is generic over the iterator is then compiled once for all filters.
fn cast_weighted<T: Real>(w: &Weighted) -> Weighted<T> {
    w.cast()
}

/// The default of [`GaussianFilter::correct_weighted`].
fn correct_by_mixture<F, const N: usize, I>(filter: &mut F, hypotheses: I) -> Result<(), FilterError>
where
    F: GaussianFilter<N>,
    I: Iterator<Item = Weighted<F::Real>> + Clone,
{
    let (_, n) = check_weighted(hypotheses.clone())?;
    if n == 0 {
        return Ok(());
    }
    if n == 1
        && let Some(only) = hypotheses.clone().find(|h| h.weight > F::Real::ZERO)
        && only.weight == F::Real::ONE
    {
        return filter.correct(&only.measurement);
    }
    let posterior = mixture_update(&filter.belief(), filter.position_at(), hypotheses)?;
    filter.set_belief(&posterior)
}
