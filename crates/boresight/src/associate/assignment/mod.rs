//! Linear assignment: least total cost, one to one.
//!
//! | problem | solver |
//! | --- | --- |
//! | sparse, a row may miss ([`CostTable`]) | [`GroupWise`], which calls `sparse` for groups that contest columns |
//! | sparse, as starts, indices and costs | [`Csr`] |
//! | the k best of a sparse one | [`k_best`] |
//! | weights of few pairs, ties as scipy breaks them | `matching`, with `uniqueness` and `dense_in_order` |
//! | dense and square, any optimum | [`Dense`] |

pub(crate) mod csr;
pub(crate) mod dense;
pub(crate) mod dense_in_order;
pub(crate) mod group_wise;
pub(crate) mod matching;
pub(crate) mod murty;
pub(crate) mod sparse;
pub(crate) mod table;
pub(crate) mod uniqueness;

pub use csr::Csr;
pub use dense::Dense;
pub use group_wise::GroupWise;
pub use murty::{Ranked, k_best};
pub use table::{Cell, CostTable, Entry, SparseTable, UNASSIGNED};
