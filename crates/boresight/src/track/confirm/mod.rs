//! Whether a track is real: the rule that confirms and deletes it, and the gate that a confirmed track must pass to be reported.
//!
//! [`rule`] chooses among [`m_of_n`], [`sprt`] and [`existence`]; [`motion_test`] stands behind every rule; [`status`] says "confirmed" to the
//! outside, of a track as it runs. What was before its confirmation is called so afterwards by `pipeline/retrospect.rs` and `track/backward.rs`.

pub mod existence;
pub mod history;
pub mod m_of_n;
pub mod motion_test;
pub mod rule;
pub mod sprt;
pub(in crate::track) mod status;
