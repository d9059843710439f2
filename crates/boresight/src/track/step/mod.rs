//! The parts of one scan's step: gate, associate, update, initiate.

pub mod associate;
pub mod gate;
pub mod initiate;
pub mod update;
