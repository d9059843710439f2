//! How good are tracks: image, state, consistency, set and multi-object measures; sees only records.
//!
//! [`evaluate`] judges a result by all of them ([`evaluation`]); [`mot_scores`] gives CLEAR, identity and HOTA alone, and each
//! other module one family of measures.

pub mod assignment;
pub mod bootstrap;
pub mod cells;
pub mod clear;
pub mod clear_classic;
pub mod consistency;
pub mod detection;
pub mod evaluation;
pub mod hota;
pub mod identity;
pub mod image;
pub mod multi_object;
mod near;
pub mod ospa2;
pub mod overlap;
pub mod pairs;
pub mod particle;
pub mod pcrlb;
pub mod preprocess;
pub mod sanity;
pub mod set;
pub mod siap;
pub mod state;
pub mod trajectory_gospa;
mod value;

pub use clear_classic::{ClearClassic, clear_classic};
pub use evaluation::{EvaluateOptions, Evaluation, evaluate};
pub use multi_object::{MatchOptions, MotScores, mot_scores};
pub use overlap::Similarity;
pub use preprocess::{KittiClass, Rules, preprocess};
