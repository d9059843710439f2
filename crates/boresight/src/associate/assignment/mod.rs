//! Linear assignment: least total cost, one to one; dense, sparse with misses, and the k best.

pub(crate) mod csr;
pub(crate) mod dense;
pub(crate) mod murty;
pub(crate) mod sparse;
pub use csr::Csr;
pub use dense::Dense;
pub use murty::{Ranked, k_best};
pub use sparse::{SparseSolver, UNASSIGNED};
