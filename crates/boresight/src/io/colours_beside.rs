//! Frames kept in colour beside the grey ones that a source hands out, so that a look at their colours needs no second reading.
//!
//! Some sources read colour and hand out grey; one that is asked keeps some of its first frames in colour as well, evenly spread.
//! Which sources do: MP4 files decoded in process. Limits: memory, [`ColoursBeside::new`].

use crate::Frame;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// Asks a source for frames in colour beside those it hands out, and holds them.
#[derive(Clone, Debug)]
pub struct ColoursBeside(Arc<Mutex<Kept>>);

#[derive(Debug)]
struct Kept {
    over: u64,
    most: usize,
    most_px: usize,
    /// Every how many-th frame is kept; `None` as long as no source said that it keeps any, or when enough are kept.
    step: Option<u64>,
    frames: Vec<Frame>,
}

impl ColoursBeside {
    /// Asks for at most `most` of the first `over` frames, if a frame has no more than `most_px` pixels.
    pub fn new(over: usize, most: usize, most_px: usize) -> Self {
        Self(Arc::new(Mutex::new(Kept { over: over as u64, most, most_px, step: None, frames: Vec::new() })))
    }

    fn kept(&self) -> MutexGuard<'_, Kept> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// A source of so many frames of so many pixels begins.
    pub(crate) fn begin(&self, n_frames: u64, n_px: usize) {
        let mut kept = self.kept();
        let n = n_frames.min(kept.over);
        if n_px <= kept.most_px && kept.most > 0 {
            kept.step = Some(n.div_ceil(kept.most as u64).next_power_of_two());
        }
    }

    /// Whether the frame of a number is to be kept.
    pub(crate) fn wants(&self, k: u64) -> bool {
        let kept = self.kept();
        k < kept.over && kept.step.is_some_and(|step| k.is_multiple_of(step))
    }

    /// Keeps a frame.
    pub(crate) fn keep(&self, frame: Frame) {
        self.kept().frames.push(frame);
    }

    /// The frames kept of those before frame `until`, in their order, and the end of it; `None` if one of them is missing, or the source keeps none.
    pub(crate) fn take(&self, until: u64) -> Option<Vec<Frame>> {
        let mut kept = self.kept();
        let step = kept.step.take();
        let mut frames = std::mem::take(&mut kept.frames);
        frames.retain(|f| f.index.0 < until);
        frames.sort_by_key(|f| f.index);
        let wanted = (0..until.min(kept.over)).step_by(step? as usize);
        wanted.eq(frames.iter().map(|f| f.index.0)).then_some(frames)
    }

    /// No more are wanted, and none of those kept.
    pub(crate) fn end(&self) {
        self.take(0);
    }
}

impl PartialEq for ColoursBeside {
    /// Whether both hold the same frames.
    fn eq(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.0, &other.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{FrameIndex, Image, Pixels, Timestamp};

    fn frame(k: u64) -> Frame {
        Frame { index: FrameIndex(k), time: Timestamp::from_ns(0), pixels: Pixels::Gray8(Image::filled(1, 1, 0)) }
    }

    #[test]
    fn frames_are_kept_evenly_and_none_may_be_missing() {
        let of = |n: u64, lost: Option<u64>| {
            let colours = ColoursBeside::new(400, 48, 1000);
            colours.begin(n, 1000);
            (0..n).filter(|k| colours.wants(*k) && Some(*k) != lost).for_each(|k| colours.keep(frame(k)));
            colours.take(n).map(|f| f.iter().map(|f| f.index.0).collect::<Vec<_>>())
        };
        assert_eq!(of(3, None), Some(vec![0, 1, 2]));
        assert_eq!(of(302, None), Some((0..302).step_by(8).collect()));
        assert_eq!(of(5000, None), Some((0..400).step_by(16).collect()));
        assert_eq!(of(302, Some(16)), None);
    }

    #[test]
    fn nothing_is_kept_of_large_frames_or_once_they_were_taken() {
        let colours = ColoursBeside::new(400, 48, 1000);
        colours.begin(10, 1001);
        assert!(!colours.wants(0) && colours.take(10).is_none());
        colours.begin(10, 1000);
        assert!(colours.wants(0) && colours.take(0).is_some() && !colours.wants(1));
    }
}
