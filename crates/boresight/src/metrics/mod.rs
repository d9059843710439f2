//! How good are tracks: image, state, consistency, set and multi-object measures; sees only records.
//!
//! [`evaluate`] judges a result by all of them ([`evaluation`]); [`mot_scores`] gives CLEAR, identity and HOTA alone, and each
//! other module one family of measures.

pub(crate) mod bootstrap;
pub mod cells;
pub(crate) mod clear;
pub(crate) mod clear_classic;
pub mod consistency;
pub(crate) mod detection;
pub mod evaluation;
pub mod hota;
pub(crate) mod identity;
pub mod image;
pub(crate) mod multi_object;
mod near;
pub(crate) mod ospa2;
pub(crate) mod overlap;
pub(crate) mod pairs;
pub(crate) mod particle;
pub mod pcrlb;
pub(crate) mod preprocess;
pub(crate) mod sanity;
pub mod set;
pub mod siap;
pub mod state;
pub mod trajectory_gospa;
mod value;
pub use bootstrap::{Compared, Interval};
pub use clear::{Clear, Empty};
pub use detection::{DetectionScores, OperatingPoint};
pub use identity::Identity;
pub use particle::ParticleScores;
pub use sanity::{Mismatch, SanityWarning};

pub use clear_classic::{ClearClassic, clear_classic};
pub use evaluation::{EvaluateOptions, Evaluation, evaluate};
pub use multi_object::{MatchOptions, MotScores, mot_scores};
pub use overlap::Similarity;
pub use preprocess::{KittiClass, Rules, preprocess};
