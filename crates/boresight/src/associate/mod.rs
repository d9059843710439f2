//! Which detection belongs to which track: sparse gates in, assignments out; sees only numbers.
//!
//! [`Gates`] is a sparse table (a row per track, its gated detections with cost and likelihood); an [`Associator`] turns
//! it into an [`Assignment`] (per track: detections with weights). A uniform grid finds the pairs worth gating.

pub mod assignment;
mod associator;
mod config;
pub(crate) mod gates;
pub(crate) mod global_nearest;
pub(crate) mod grid;
pub(crate) mod groups;
pub(crate) mod jpda;
pub(crate) mod nearest;
pub(crate) mod pda;

pub use global_nearest::{CostKind, GlobalNearestConfig};
pub use jpda::{Coalescence, JpdaConfig};
pub use nearest::NearestConfig;
pub use pda::PdaConfig;

pub use associator::Associator;
pub use config::AssociatorConfig;
pub use gates::{Assignment, Gates, Pair, Prior, Share};
pub(crate) use grid::UniformGrid;
