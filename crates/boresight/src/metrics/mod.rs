//! How good are tracks: image, state, consistency, set and multi-object measures; sees only records.
//!
//! [`evaluate`] gives CLEAR, identity and HOTA of a result against a truth; [`set`] the distances between sets of points.

pub mod assignment;
pub mod bootstrap;
pub mod cells;
pub mod clear;
pub mod clear_classic;
pub mod consistency;
pub mod detection;
pub mod doubts;
pub mod hota;
pub mod identity;
pub mod image;
pub mod multi_object;
pub mod ospa2;
pub mod overlap;
pub mod pairs;
pub mod particle;
pub mod pcrlb;
pub mod preprocess;
pub mod set;
pub mod siap;
pub mod state;
#[cfg(feature = "trajectory-gospa")]
pub mod trajectory_gospa;

pub use clear_classic::{ClearClassic, clear_classic};
pub use multi_object::{MatchOptions, Scores, evaluate};
pub use overlap::Similarity;
pub use preprocess::{KittiClass, Rules, preprocess};
