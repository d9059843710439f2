//! Linear assignment: least total cost, one to one; sparse with misses.

pub mod sparse;
