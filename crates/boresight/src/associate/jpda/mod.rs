//! Joint probabilistic data association: the weight of each pair over all joint events in which no detection is used twice.
//!
//! Source: Y. Bar-Shalom, T. E. Fortmann, *Tracking and Data Association*, 1988, ch. 9; with existence JIPDA (D. Mušicki,
//! R. Evans, IEEE Trans. AES 40, 2004). The joint weight of an event is Π ψ P_D l / λ over pairs times Π (1 − ψ P_D P_G)
//! over the rest; a pair's weight is its share of the sum.
//! Method: connected groups apart; exact by dynamic programming over the detections still contested ([`exact`]) while its
//! states stay within `max_states`, else loopy belief propagation ([`loopy`]); coalescence may be countered by JPDA*
//! ([`star`]). A track alone in its group is PDA.

mod associator;
pub(crate) mod exact;
pub(crate) mod loopy;
pub(crate) mod problem;
pub(crate) mod star;

pub use associator::{Coalescence, Jpda, JpdaConfig};
