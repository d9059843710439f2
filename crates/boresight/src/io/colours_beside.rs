//! Frames kept in colour beside the grey ones that a source hands out, so that a look at their colours needs no second reading.
//!
//! Some sources read colour and hand out grey; one that is asked keeps some of its first frames in colour as well, evenly spread.
//! Which sources do: MP4 files decoded in process. Limits: memory, which [`KeepColours`] is to keep in mind.

use crate::{Frame, FrameIndex, Image, Pixels, Timestamp};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// Which frames are kept.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct KeepColours {
    /// Of so many frames, from the first on.
    pub over: usize,
    /// At most so many of them; 0 for none.
    pub most: usize,
    /// Of each every so many-th pixel, both ways; at least 1.
    pub every_px: usize,
}

/// Which frames of a width and a height, px, are kept.
pub type KeepOf = fn(usize, usize) -> KeepColours;

/// Asks a source for frames in colour beside those it hands out, and holds them.
#[derive(Clone, Debug)]
pub struct ColoursBeside(Arc<Mutex<Kept>>);

#[derive(Debug)]
struct Kept {
    of: KeepOf,
    over: u64,
    every_px: usize,
    /// Every how many-th frame is kept; `None` as long as no source said that it keeps any, or when enough are kept.
    step: Option<u64>,
    frames: Vec<Frame>,
}

impl ColoursBeside {
    /// Asks for frames as `of` says.
    pub fn new(of: KeepOf) -> Self {
        Self(Arc::new(Mutex::new(Kept { of, over: 0, every_px: 1, step: None, frames: Vec::new() })))
    }

    fn kept(&self) -> MutexGuard<'_, Kept> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// A source of so many frames of that width and height begins.
    pub(crate) fn begin(&self, n_frames: u64, (width, height): (usize, usize)) {
        let mut kept = self.kept();
        let KeepColours { over, most, every_px } = (kept.of)(width, height);
        (kept.over, kept.every_px) = (over as u64, every_px.max(1));
        if most > 0 {
            kept.step = Some(n_frames.min(kept.over).div_ceil(most as u64).next_power_of_two());
        }
    }

    /// Whether the frame of a number is to be kept.
    pub(crate) fn wants(&self, k: u64) -> bool {
        let kept = self.kept();
        k < kept.over && kept.step.is_some_and(|step| k.is_multiple_of(step))
    }

    /// Keeps what is wanted of a picture's pixels.
    pub(crate) fn keep(&self, index: FrameIndex, time: Timestamp, rgb: &Image<[u8; 3]>) {
        let mut kept = self.kept();
        let every = kept.every_px;
        let pixels = (0..rgb.height()).step_by(every).flat_map(|y| rgb.row(y).iter().step_by(every).copied()).collect();
        let image = Image::from_vec(rgb.width().div_ceil(every), rgb.height().div_ceil(every), pixels);
        kept.frames.extend(image.map(|image| Frame { index, time, pixels: Pixels::Rgb8(image) }));
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

    fn keep(colours: &ColoursBeside, k: u64) {
        let rgb = Image::from_vec(5, 3, (0..15).map(|i| [i, k as u8, 0]).collect()).unwrap();
        colours.keep(FrameIndex(k), Timestamp::from_ns(0), &rgb);
    }

    /// Of small frames 48 over 400, every third pixel.
    fn asked() -> ColoursBeside {
        ColoursBeside::new(|w, h| KeepColours { over: 400, most: if w * h <= 1000 { 48 } else { 0 }, every_px: 3 })
    }

    #[test]
    fn frames_are_kept_evenly_and_none_may_be_missing() {
        let of = |n: u64, lost: Option<u64>| {
            let colours = asked();
            colours.begin(n, (100, 10));
            (0..n).filter(|k| colours.wants(*k) && Some(*k) != lost).for_each(|k| keep(&colours, k));
            colours.take(n).map(|f| f.iter().map(|f| f.index.0).collect::<Vec<_>>())
        };
        assert_eq!(of(3, None), Some(vec![0, 1, 2]));
        assert_eq!(of(302, None), Some((0..302).step_by(8).collect()));
        assert_eq!(of(5000, None), Some((0..400).step_by(16).collect()));
        assert_eq!(of(302, Some(16)), None);
    }

    #[test]
    fn of_a_frame_every_so_many_th_pixel_is_kept() {
        let colours = asked();
        colours.begin(1, (5, 3));
        keep(&colours, 0);
        let kept = colours.take(1).unwrap();
        assert_eq!(kept[0].pixels, Pixels::Rgb8(Image::from_vec(2, 1, vec![[0, 0, 0], [3, 0, 0]]).unwrap()));
    }

    #[test]
    fn nothing_is_kept_of_large_frames_or_once_they_were_taken() {
        let colours = asked();
        colours.begin(10, (1001, 1));
        assert!(!colours.wants(0) && colours.take(10).is_none());
        colours.begin(10, (1000, 1));
        assert!(colours.wants(0) && colours.take(0).is_some() && !colours.wants(1));
    }
}
