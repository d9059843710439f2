//! A model whose process noise is multiplied by a factor that can change from step to step (for adaptive noise).
//!
//! Symbols: Q process covariance of the model inside; s factor, no unit: s Q. Limits: at s other than 1 the model's own
//! shortcuts are not taken. Cost: that of the model.

use super::{Dense, Model, NoiseVisitor};
use crate::check::check_strength;
use crate::{FilterError, Gaussian, Real};
use nalgebra::{SMatrix, SVector};

/// A model with a factor on its process covariance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scaled<M, T = f64> {
    model: M,
    scale: T,
}

impl<M, T: Real> Scaled<M, T> {
    /// Wraps a model; the factor starts at 1.
    pub fn new(model: M) -> Self {
        Self { model, scale: T::one() }
    }

    /// Returns the factor on the process covariance (no unit).
    pub fn scale(&self) -> T {
        self.scale
    }

    /// Sets the factor on the process covariance.
    /// # Errors
    /// [`FilterError::OutOfRange`] if it is negative or not finite.
    pub fn set_scale(&mut self, scale: T) -> Result<(), FilterError> {
        self.scale = check_strength(scale, "a noise scale of at least 0")?;
        Ok(())
    }
}

struct ScaledVisitor<V, T>(V, T);

impl<const N: usize, T: Real, V: NoiseVisitor<N, T>> NoiseVisitor<N, T> for ScaledVisitor<V, T> {
    type Out = V::Out;
    fn visit<const W: usize>(self, g: &SMatrix<T, N, W>, q: &SVector<T, W>) -> Self::Out {
        self.0.visit(g, &(q * self.1))
    }
}

impl<const N: usize, T: Real, M: Model<N, T>> Model<N, T> for Scaled<M, T> {
    const POSITION: [usize; 2] = M::POSITION;
    const VELOCITY: Option<[usize; 2]> = M::VELOCITY;
    const LINEAR: bool = M::LINEAR;
    const AXES: bool = M::AXES;

    fn transition(&self, dt_s: T, at: &SVector<T, N>) -> SMatrix<T, N, N> {
        self.model.transition(dt_s, at)
    }
    fn inverse_transition(&self, dt_s: T, at: &SVector<T, N>) -> Result<SMatrix<T, N, N>, FilterError> {
        self.model.inverse_transition(dt_s, at)
    }
    fn process_noise(&self, dt_s: T) -> SMatrix<T, N, N> {
        self.model.process_noise(dt_s) * self.scale
    }
    fn moved(&self, dt_s: T, x: &SVector<T, N>) -> SVector<T, N> {
        self.model.moved(dt_s, x)
    }
    // At factor 1 the model's own shortcuts are taken; at another its noise cannot be told apart inside them.
    fn propagate(&self, dt_s: T, x: &mut SVector<T, N>, p: &mut SMatrix<T, N, N>) {
        if self.scale == T::one() {
            self.model.propagate(dt_s, x, p)
        } else {
            Dense(self.clone()).propagate(dt_s, x, p)
        }
    }
    fn propagate_axes(&self, dt_s: T, x: &mut SVector<T, N>, p: &mut SMatrix<T, N, N>) {
        if self.scale == T::one() {
            self.model.propagate_axes(dt_s, x, p);
        } else {
            Dense(self.clone()).propagate_axes(dt_s, x, p);
        }
    }
    fn transition_times(&self, dt_s: T, at: &SVector<T, N>, a: &SMatrix<T, N, N>) -> SMatrix<T, N, N> {
        self.model.transition_times(dt_s, at, a)
    }
    fn times_inverse_transition(
        &self,
        dt_s: T,
        at: &SVector<T, N>,
        a: &SMatrix<T, N, N>,
    ) -> Result<SMatrix<T, N, N>, FilterError> {
        self.model.times_inverse_transition(dt_s, at, a)
    }
    fn with_noise_factor<V: NoiseVisitor<N, T>>(&self, dt_s: T, visitor: V) -> Result<V::Out, FilterError> {
        self.model.with_noise_factor(dt_s, ScaledVisitor(visitor, self.scale))
    }
    fn lift(&self, kinematics: &Gaussian<4, T>) -> Gaussian<N, T> {
        self.model.lift(kinematics)
    }
    fn kinematics(&self, belief: &Gaussian<N, T>) -> Gaussian<4, T> {
        self.model.kinematics(belief)
    }
}
