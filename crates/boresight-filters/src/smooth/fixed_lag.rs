//! Fixed-lag smoother: runs beside a filter and gives the belief L updates ago, given everything since.
//!
//! Source: J. B. Moore, Automatica 9(2), 1973, by L steps of [`super::rts_step`] over a ring of beliefs: the same answer
//! as a full smoother that stops at the newest scan. Cost: L N³ a scan. Limits: memory for L beliefs in the value itself.
//! Symbols: L beliefs of N states; dt_s between them, s.

use super::{Filtered, rts_step};
use crate::model::Model;
use crate::{FilterError, Gaussian, Real};

/// The last L filtered beliefs and their times.
#[derive(Clone, Copy, Debug)]
pub struct FixedLag<const N: usize, const L: usize, T: Real = f64> {
    ring: [Option<Filtered<N, T>>; L],
    newest: usize,
}

impl<const N: usize, const L: usize, T: Real> Default for FixedLag<N, L, T> {
    fn default() -> Self {
        Self { ring: [None; L], newest: 0 }
    }
}

impl<const N: usize, const L: usize, T: Real> FixedLag<N, L, T> {
    /// Takes the belief after an update, `dt_s` after the one before, and returns the smoothed belief of L - 1 updates
    /// ago; `None` while fewer are known.
    /// # Errors
    /// [`FilterError`] as [`rts_step`].
    pub fn push<M: Model<N, T>>(
        &mut self,
        model: &M,
        belief: &Gaussian<N, T>,
        dt_s: T,
    ) -> Result<Option<Gaussian<N, T>>, FilterError> {
        if L == 0 {
            return Ok(None);
        }
        self.newest = (self.newest + 1) % L;
        if let Some(place) = self.ring.get_mut(self.newest) {
            *place = Some(Filtered { dt_s, belief: *belief });
        }
        let (mut smoothed, mut dt) = (*belief, dt_s);
        for back in 1..L {
            let Some(Some(scan)) = self.ring.get((self.newest + L - back) % L) else { return Ok(None) };
            smoothed = rts_step(model, &scan.belief, &smoothed, dt)?;
            dt = scan.dt_s;
        }
        Ok(Some(smoothed))
    }
}
