//! Linear assignment: least total cost, one to one; dense, sparse with misses, and the k best.

pub mod csr;
pub mod dense;
pub mod murty;
pub mod sparse;
