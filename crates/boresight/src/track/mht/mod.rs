//! Multiple-hypothesis tracking: decisions are put off for a few scans, until the data have made them.
//!
//! [`tracker`] is the order of a step, `grow` makes the hypotheses, `select` chooses the best compatible set, `prune` cuts the rest.

pub mod config;
mod grow;
mod hypothesis;
mod prune;
mod select;
pub mod tracker;
