//! Smoothers: the belief of each scan given all scans, over slices that the caller owns.
//!
//! A forward pass of any filter fills a slice of [`Filtered`] beliefs; [`rts`] or [`rts_square_root`] replaces each by
//! the smoothed one in place. [`FixedLag`] gives the belief L updates ago while the filter runs.

mod fixed_lag;
mod rts;
mod square_root;

pub use fixed_lag::FixedLag;
pub use rts::{rts, rts_step};
pub use square_root::rts_square_root;

use crate::{Gaussian, Real};

/// The belief after the update of one scan, and the time to it from the scan before.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Filtered<const N: usize, T: Real = f64> {
    /// Time since the scan before, s; of the first entry it is not used.
    pub dt_s: T,
    /// Belief after the update (filtered), or after smoothing (smoothed).
    pub belief: Gaussian<N, T>,
}
