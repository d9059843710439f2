//! What every associator does.

use super::gates::{Assignment, Gates};

/// Decides from gates which track takes which detections.
pub trait Associator: Send {
    /// Fills `out` with one row per row of `gates`; what `out` held before is dropped, its memory is used again.
    fn associate(&mut self, gates: &Gates, out: &mut Assignment);

    /// Whether the associator reads log-likelihoods (else they may be left at zero to save time).
    fn needs_likelihood(&self) -> bool;
}
