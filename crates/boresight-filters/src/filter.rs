//! The object-safe face of every filter: what a tracker needs, in measurement space and kinematics only.

use crate::{FilterError, Gaussian, Weighted};

/// A filter of one target as a tracker sees it.
pub trait Filter {
    /// Moves the belief `dt_s` seconds ahead; `predict(0)` is the identity.
    /// # Errors
    /// [`FilterError`] if `dt_s` is negative or not finite; the state is then unchanged.
    fn predict(&mut self, dt_s: f64) -> Result<(), FilterError>;
    /// Returns the predicted position H x and its covariance H P Hᵀ (px, px²), without measurement noise.
    fn predicted(&self) -> Gaussian<2>;
    /// Corrects the belief by the hypotheses of one scan; `[]` is a missed scan, weights sum to at most 1.
    /// # Errors
    /// [`FilterError`] for NaN, infinity or a covariance that cannot be factored; the state is then unchanged.
    fn update(&mut self, hypotheses: &[Weighted]) -> Result<(), FilterError>;
    /// Returns mean and covariance of `[x, vx, y, vy]` (px, px/s).
    fn kinematics(&self) -> Gaussian<4>;
}
