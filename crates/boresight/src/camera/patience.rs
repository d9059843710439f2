//! How often a camera is searched of which nothing is known.
//!
//! Source: our own. Before a ground of nothing but noise no motion can be measured, and the search in vain is what costs most: it goes on over the whole frame. What has shown nothing in
//! [`LONG_UNKNOWN`] frames, one after the other, is searched in one of [`ONE_IN`]: what comes into view is found that much later.
//! Limits: counted in frames, as the estimator knows no times.

/// Frames of which nothing is known, one after the other: two seconds at 25 frames/s.
const LONG_UNKNOWN: u32 = 50;
/// One in so many is searched then: a motion is found a tenth of a second later at most.
const ONE_IN: u32 = 4;

/// Counts the frames of which nothing is known.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Patience {
    n_unknown: u32,
}

impl Patience {
    /// Whether the next frame is searched.
    pub fn searches(self) -> bool {
        self.n_unknown < LONG_UNKNOWN || self.n_unknown.is_multiple_of(ONE_IN)
    }

    /// Takes whether the camera is known, or seems to be, in a frame.
    pub fn take(&mut self, seen: bool) {
        self.n_unknown = if seen { 0 } else { self.n_unknown.saturating_add(1) };
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_long_unknown_is_searched_in_one_frame_of_four_until_it_is_seen() {
        let mut patience = Patience::default();
        let mut next = |seen: bool| {
            let searches = patience.searches();
            patience.take(seen);
            searches
        };
        assert!((0..50).all(|_| next(false)));
        let searched = (0..400).filter(|_| next(false)).count();
        assert_eq!(searched, 100);
        next(true);
        assert!((0..50).all(|_| next(false)));
    }
}
