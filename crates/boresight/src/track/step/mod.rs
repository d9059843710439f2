//! One scan's step, part by part: predict, gate, associate, update, delete, initiate, report.
//!
//! Free functions over explicit state; [`super::tracker`] calls them in this order. A part reads what it needs from
//! [`context::Context`] and keeps its memory in a struct of its own.

pub(super) mod associate;
pub(super) mod context;
pub(super) mod delete;
pub mod gate;
pub(super) mod initiate;
pub(super) mod predict;
pub(super) mod report;
mod stage;
pub(super) mod update;
