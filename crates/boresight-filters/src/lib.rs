//! Kalman-family filters for tracking: `no_std`, no heap, interchangeable, numerically robust.
//!
//! Outside a filter there is only measurement space (position 2x1, covariance 2x2) and kinematics
//! ([`Gaussian`]`<4>`, order `[x, vx, y, vy]`). The size of a filter's own state never leaks.
#![no_std]
#![forbid(unsafe_code)]

mod error;
mod filter;
mod gaussian;

pub use error::FilterError;
pub use filter::Filter;
pub use gaussian::{Gaussian, Measurement, Weighted};
