//! When a track is confirmed and when it is given up: the rules, and the gate that a confirmed track must pass to be reported.

pub mod config;
pub mod confirmation_gate;
pub mod rule;
