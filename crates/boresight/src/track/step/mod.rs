//! One scan's step, part by part: predict, gate, associate, update, (confirm,) delete, report, initiate.
//!
//! Free functions over explicit state; the order of their calls stands in [`super::tracker`]: confirmed tracks are gated while they are
//! predicted, tentative ones once the confirmed have chosen; confirmation ([`super::confirm`]), deletion and report follow each update. A part reads what it needs from
//! [`context::Context`] and keeps its memory in a struct of its own.

pub(super) mod associate;
pub(super) mod context;
pub(super) mod delete;
pub mod gate;
pub(super) mod initiate;
pub(super) mod plot_time;
pub(super) mod predict;
pub(super) mod report;
mod stage;
pub(super) mod update;
