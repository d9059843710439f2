//! Which pixels an encoder copied from the frame before: their difference is 0 and tells nothing of the noise.
//!
//! Source: our own. Before a camera that stands an encoder skips most blocks and draws one anew now and then, with another rounding of its noise: on grass of 4 counts of noise (x264 at its
//! usual quality, 640 x 480) 17 % of the pixels differ at all from those of 0.3 s ago, by 0.65 counts in the deviation, while the median difference of all is 0. So the noise is that of the
//! pixels that changed, where these lie all over the frame: in a few places they are targets.
//! Limits: what changes in a quarter of all places is taken for noise.

/// Places along the longer side of the frame.
const PLACES: usize = 16;
/// Samples of a place that say something.
const LEAST_SAMPLES: u32 = 8;
/// Share of a place's samples that must have changed, and of the places in which that must be so.
const CHANGED: f64 = 0.1;
const EVERYWHERE: f64 = 0.25;
/// Share of all samples that must be copies, else there are none: of a noise of one count in 8 bits a twentieth differs by nothing (sums are whole sixteenths).
const LEAST_COPIED: f64 = 0.1;

/// Counts of the samples that changed, place by place.
#[derive(Clone, Debug, Default)]
pub(super) struct Changes {
    /// Samples and those of them that changed.
    counts: Vec<[u32; 2]>,
    width: usize,
    side_px: usize,
    across: usize,
}

impl Changes {
    /// Nothing counted, in an image of that size.
    pub fn begin(&mut self, width: usize, height: usize) {
        self.width = width.max(1);
        self.side_px = width.max(height).div_ceil(PLACES).max(1);
        self.across = width.div_ceil(self.side_px);
        self.counts.clear();
        self.counts.resize(self.across * height.div_ceil(self.side_px), [0; 2]);
    }

    /// Counts the sample at pixel `i`, row by row.
    pub fn add(&mut self, i: usize, changed: bool) {
        let place = i / self.width / self.side_px * self.across + i % self.width / self.side_px;
        let count = &mut self.counts[place];
        count[0] += 1;
        count[1] += u32::from(changed);
    }

    /// Whether some pixels are copies.
    pub fn leave_copies(&self) -> bool {
        let [n, changed] = self.counts.iter().fold([0u32; 2], |sum, c| [sum[0] + c[0], sum[1] + c[1]]);
        f64::from(n - changed) >= LEAST_COPIED * f64::from(n)
    }

    /// Whether pixels that are no copies lie all over the frame.
    pub fn are_everywhere(&self) -> bool {
        let told = || self.counts.iter().filter(|c| c[0] >= LEAST_SAMPLES);
        let busy = told().filter(|c| f64::from(c[1]) >= CHANGED * f64::from(c[0])).count();
        busy > 0 && busy as f64 >= EVERYWHERE * told().count() as f64
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Every seventh pixel of 320 x 256, changed where `changed` says so.
    fn counted(changed: impl Fn(usize, usize) -> bool) -> Changes {
        let mut all = Changes::default();
        all.begin(320, 256);
        (0..320 * 256).step_by(7).for_each(|i| all.add(i, changed(i % 320, i / 320)));
        all
    }

    #[test]
    fn blocks_drawn_anew_all_over_are_noise_and_a_large_target_is_none() {
        let says = |changes: Changes| [changes.leave_copies(), changes.are_everywhere()];
        assert_eq!(says(counted(|x, y| (x / 8 + y / 8) % 4 == 0)), [true, true]);
        assert_eq!(says(counted(|x, y| x < 120 && y < 120)), [true, false], "a sixth of the frame");
        assert_eq!(says(counted(|_, _| true)), [false, true], "nothing is copied");
        assert_eq!(says(counted(|_, _| false)), [true, false]);
    }
}
