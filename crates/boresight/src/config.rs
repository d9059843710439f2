//! The whole configuration of a run, as it stands in a file: input, detector, tracker.
//!
//! [`Config`] is read from TOML and `--set`; [`explain()`] and [`reference()`] say what its keys mean, from the comments beside them.

mod explain;
mod reference;
mod renamed;
mod schema_tree;
mod sensor_frames;
mod typo;
mod whole;

pub use explain::{Explanation, explain};
pub use reference::reference;
pub use whole::{Config, InputConfig, schema};
