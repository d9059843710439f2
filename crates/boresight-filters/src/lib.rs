//! Kalman-family filters for tracking: `no_std`, no heap, interchangeable, numerically robust.
//!
#![doc = include_str!("../README.md")]
#![no_std]
#![forbid(unsafe_code)]
// `!(x > 0)` is meant: NaN must take the refusing branch.
#![allow(clippy::neg_cmp_op_on_partial_ord)]

mod adaptive;
pub mod ar1;
mod axes;
pub mod batch;
pub mod bounds;
mod check;
pub mod consistency;
pub mod converted;
mod displacement;
pub mod ekf;
mod error;
mod filter;
pub mod fuzzy;
mod fuzzy_innovation;
mod fuzzy_srif;
mod gaussian;
mod imm;
mod information;
mod information_pair;
mod kf;
/// The small dense mathematics inside; public only for this crate's own tests, may change at any time.
#[doc(hidden)]
pub mod linalg;
pub mod linear;
pub mod linearised;
pub mod lms;
mod lms_filter;
pub mod mixture;
pub mod model;
mod out_of_sequence;
pub mod pda;
mod real;
mod robust;
pub mod sensor;
pub mod smooth;
mod square_root;
pub mod srif;
mod srif_axes;
pub mod ud;
mod ud_axes;
mod ukf;

pub use adaptive::{Adaptive, AdaptiveConfig, Memory, NoiseLearner, ScaleNoise};
pub use ar1::Ar1;
pub use displacement::Displacement;
pub use error::FilterError;
pub use filter::{Filter, GaussianFilter, Start, Tracked};
pub use fuzzy_innovation::{Fuzzy, FuzzyInnovation};
pub use fuzzy_srif::FuzzySrif;
pub use gaussian::{Gaussian, Measurement, Weighted};
pub use imm::Imm;
pub use information::Information;
pub use kf::{CovarianceForm, Kf};
pub use lms::LmsRule;
pub use lms_filter::Lms;
pub use out_of_sequence::{Late, OutOfSequence};
pub use real::Real;
pub use robust::{InnovationRule, Robust};
pub use square_root::SquareRoot;
pub use srif::Srif;
pub use ud::Ud;
pub use ukf::Ukf;

/// The matrices of the beliefs, in the version that this crate is built with.
pub use nalgebra;
