//! CTFSRIF: the square-root information filter with the fuzzy-logic correlator in front (Parimala and Raol).
//!
//! Source: `docs/theory/adaptive.md`. Per update: ν = z - H x~, S = H P~ Hᵀ + R_m, z is replaced by H x~ +
//! r_flc(ν, ν - ν_last, S), then the SRIF measurement update; the covariance is that of the plain filter.
//! Departures: see [`crate::fuzzy`]. The published gain is small (error ratio 0.975-0.986): robustness to
//! heavy-tailed centroids, nothing else; with light tails (mask centroid) it is 1 % worse than the plain SRIF.
//! Symbols: ν, r_flc 2 x 1 (px); S 2 x 2 (px²). Limits: those of [`crate::srif`] and [`crate::fuzzy`]. Cost: the SRIF's
//! and two inferences.

use crate::fuzzy::Correlator;
use crate::model::Model;
use crate::{FilterError, Fuzzy, Gaussian, Real, Srif, Start};

/// Square-root information filter with fuzzy correlator.
pub type FuzzySrif<M, const N: usize, T = f64> = Fuzzy<Srif<M, N, T>, T>;

impl<M: Model<N, T>, const N: usize, T: Real> Start<M, N> for FuzzySrif<M, N, T> {
    fn start(model: M, belief: Gaussian<N, T>) -> Result<Self, FilterError> {
        Fuzzy::new(Srif::start(model, belief)?, Correlator::default())
    }
    fn model(&self) -> &M {
        self.inner().model()
    }
    fn model_mut(&mut self) -> &mut M {
        self.inner_mut().model_mut()
    }
}
