//! Random walk: a position that diffuses, without velocity; for particles, slow drift, aimless targets.
//!
//! Source: Bar-Shalom, Li, Kirubarajan 2001, 6.2.1 (Wiener process position). Symbols: state `[x, y]` (px); diffusion:
//! variance q dt per axis (px²/s; a particle of diffusion coefficient D has q = 2 D).
//! Kinematics: the velocity is reported as 0 with the variance of the displacement of one second, q per axis (px²/s²),
//! so that nothing downstream takes it for a known standstill.
//! Limits: nothing is predicted but the growth of the uncertainty. Cost: two additions.

use super::Model;
use crate::check::check_strength;
use crate::{FilterError, Gaussian, Real};
use nalgebra::{SMatrix, SVector};

/// Diffusing position.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RandomWalk<T = f64> {
    diffusion: T,
}

impl<T: Real> RandomWalk<T> {
    /// Position variance grows by `diffusion` (px²) per second and axis.
    /// # Errors
    /// [`FilterError::OutOfRange`] if it is negative or not finite.
    pub fn new(diffusion: T) -> Result<Self, FilterError> {
        Ok(Self { diffusion: check_strength(diffusion, "a diffusion of at least 0 px²/s")? })
    }
}

impl<T: Real> Model<2, T> for RandomWalk<T> {
    const POSITION: [usize; 2] = [0, 1];
    const VELOCITY: Option<[usize; 2]> = None;
    const AXES: bool = true;

    fn transition(&self, _dt: T, _at: &SVector<T, 2>) -> SMatrix<T, 2, 2> {
        SMatrix::identity()
    }

    fn inverse_transition(&self, _dt: T, _at: &SVector<T, 2>) -> Result<SMatrix<T, 2, 2>, FilterError> {
        Ok(SMatrix::identity())
    }

    fn process_noise(&self, dt: T) -> SMatrix<T, 2, 2> {
        SMatrix::identity() * (self.diffusion * dt)
    }

    fn lift(&self, k: &Gaussian<4, T>) -> Gaussian<2, T> {
        Gaussian {
            mean: SVector::<T, 2>::new(k.mean[0], k.mean[2]),
            cov: SMatrix::<T, 2, 2>::new(k.cov[(0, 0)], k.cov[(0, 2)], k.cov[(2, 0)], k.cov[(2, 2)]),
        }
    }

    fn kinematics(&self, b: &Gaussian<2, T>) -> Gaussian<4, T> {
        let mut k = Gaussian { mean: SVector::zeros(), cov: SMatrix::zeros() };
        for r in 0..2 {
            k.mean[2 * r] = b.mean[r];
            for c in 0..2 {
                k.cov[(2 * r, 2 * c)] = b.cov[(r, c)];
            }
            k.cov[(2 * r + 1, 2 * r + 1)] = self.diffusion;
        }
        k
    }
}
