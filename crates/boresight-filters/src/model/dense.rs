//! A model with its structure hidden: every step uses full matrices.
//!
//! For tests (the dense step is the plain reading of the equations) and for benches (what the structure saves).

use super::Model;
use crate::linalg::mul;
use crate::{Gaussian, Real};
use nalgebra::{SMatrix, SVector};

/// A model whose shortcuts are not used.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Dense<M>(pub M);

impl<const N: usize, T: Real, M: Model<N, T>> Model<N, T> for Dense<M> {
    const POSITION: [usize; 2] = M::POSITION;
    const VELOCITY: Option<[usize; 2]> = M::VELOCITY;

    const LINEAR: bool = M::LINEAR;

    #[inline]
    fn transition(&self, dt_s: T, at: &SVector<T, N>) -> SMatrix<T, N, N> {
        self.0.transition(dt_s, at)
    }

    #[inline]
    fn process_noise(&self, dt_s: T) -> SMatrix<T, N, N> {
        self.0.process_noise(dt_s)
    }

    // The motion itself of a nonlinear model is not a shortcut.
    #[inline]
    fn moved(&self, dt_s: T, x: &SVector<T, N>) -> SVector<T, N> {
        if M::LINEAR { mul(&self.transition(dt_s, x), x) } else { self.0.moved(dt_s, x) }
    }

    fn kinematics(&self, belief: &Gaussian<N, T>) -> Gaussian<4, T> {
        self.0.kinematics(belief)
    }

    fn lift(&self, kinematics: &Gaussian<4, T>) -> Gaussian<N, T> {
        self.0.lift(kinematics)
    }
}
