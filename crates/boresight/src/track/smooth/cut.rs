//! Where a track was begun anew: a row that its filter cannot have come to from the row before, so that neither tells of the other.
//!
//! Source: our own; the identities are the Kalman filter's. A correction takes from the predicted covariance P⁻ and leaves P: D = P⁻ − P is not negative, and the step of the mean has that
//! covariance. A row whose covariance is twice the predicted one in some direction, or whose step is larger than D explains, is none of that filter: the track was lost and found again, or
//! its camera moved.
//! How: both in the coordinates in which P⁻ is the identity.
//! Limits: a filter of another model whose steps are larger than this one's noise is cut as well, and its rows stay as they are: that costs what smoothing would have gained, no more.

use boresight_filters::Gaussian;
use nalgebra::SymmetricEigen;

/// χ² with 4 degrees of freedom: a step in a million is larger.
const STEP: f64 = 33.4;
/// Share of the predicted variance that a step may have in any direction, beyond D: rows are rounded, and the noise of the filter is known to some per cent.
const GRACE: f64 = 0.05;
/// A covariance that is larger than the predicted one by so many times that in some direction is none of a correction.
const GROWN: f64 = 1.0;

/// Whether a filter whose belief was predicted so can have come to that one by a correction, or by none.
pub(super) fn follows(predicted: &Gaussian<4>, belief: &Gaussian<4>) -> bool {
    let Some(c) = predicted.cov.cholesky() else { return true };
    let Some(inverse) = c.l().try_inverse() else { return true };
    let step = inverse * (belief.mean - predicted.mean);
    let left = inverse * belief.cov * inverse.transpose();
    let taken = SymmetricEigen::new(nalgebra::Matrix4::identity() - 0.5 * (left + left.transpose()));
    if taken.eigenvalues.min() < -GROWN {
        return false;
    }
    let along = taken.eigenvectors.transpose() * step;
    along.iter().zip(taken.eigenvalues.iter()).map(|(e, v)| e * e / (v.max(0.0) + GRACE)).sum::<f64>() <= STEP
}
