//! Errors of measurements that last: what they leave in a track is added to the covariance that is stated of it.
//!
//! Source: Y. Bar-Shalom, X.-R. Li, T. Kirubarajan, *Estimation with Applications to Tracking and Navigation*, 2001, 8.2 (autocorrelated measurement noise); S. F. Schmidt, *Advances in Control
//! Systems* 3, 1966 (what is not estimated is considered in the covariance). A filter takes the errors of its measurements for independent from scan to scan. Those of a codec, which carries a
//! displaced picture of a target on from frame to frame, are not: the mean of n of them is not √n times surer than one, and no innovation shows it.
//! Departures: one number for the position and one for the velocity, of a track that has been followed for a while, instead of a cross covariance carried in each filter: gains, gates and
//! innovations stay as they are. [`crate::auto`] learns the two from the likelihood of a first pass.
//! Symbols: standard deviations per axis, px and px/s.
//! Limits: a track of some scans, whose own variance holds most of such an error already, is stated too wide by no more than it.

use crate::Result;
use crate::validate::not_negative;
use boresight_filters::Gaussian;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// What errors of measurements that last from scan to scan leave in a track: added to the covariances that are stated of it, not to its gates.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct CorrelatedErrorConfig {
    /// Standard deviation of the position per axis, px, 0 or more.
    pub position_px: f64,
    /// Standard deviation of the velocity per axis, px/s, 0 or more.
    pub velocity_px_per_s: f64,
}

impl CorrelatedErrorConfig {
    /// Checks all values; `at` names the place in the configuration.
    /// # Errors
    /// The first value outside its range.
    pub fn validate(&self, at: &str) -> Result<()> {
        not_negative(at, "position-px", self.position_px, "0 takes errors for independent from scan to scan")?;
        not_negative(
            at,
            "velocity-px-per-s",
            self.velocity_px_per_s,
            "0 takes errors for independent from scan to scan",
        )
    }

    /// Adds it to the covariance of `[x, vx, y, vy]` (px, px/s).
    #[inline]
    pub fn add_to(self, belief: &mut Gaussian<4>) {
        for (i, variance) in self.variances().into_iter().enumerate() {
            belief.cov[(i, i)] += variance;
        }
    }

    /// Takes it out again; a belief that does not hold it, of a table that was made without, stays as it is.
    pub(in crate::track) fn take_from(self, belief: &mut Gaussian<4>) {
        let mut cov = belief.cov;
        for (i, variance) in self.variances().into_iter().enumerate() {
            cov[(i, i)] -= variance;
        }
        if cov.cholesky().is_some() {
            belief.cov = cov;
        }
    }

    fn variances(self) -> [f64; 4] {
        let [p, v] = [self.position_px * self.position_px, self.velocity_px_per_s * self.velocity_px_per_s];
        [p, v, p, v]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Matrix4, Vector4};

    #[test]
    fn what_is_added_is_taken_out_again_where_it_is_held() {
        let error = CorrelatedErrorConfig { position_px: 0.3, velocity_px_per_s: 2.0 };
        let narrow =
            Gaussian { mean: Vector4::zeros(), cov: Matrix4::from_diagonal(&Vector4::new(0.1, 5.0, 0.2, 6.0)) };
        let mut wide = narrow;
        error.add_to(&mut wide);
        assert!((wide.cov[(0, 0)] - 0.19).abs() < 1e-12 && (wide.cov[(3, 3)] - 10.0).abs() < 1e-12);
        error.take_from(&mut wide);
        assert!((wide.cov - narrow.cov).abs().max() < 1e-12);
        let mut sure = Gaussian { cov: narrow.cov * 0.01, ..narrow };
        error.take_from(&mut sure);
        assert_eq!(sure.cov, narrow.cov * 0.01);
    }
}
