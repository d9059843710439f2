//! The colours of frames that are detected in as grey: the same frames, read a second time for drawing.
//!
//! A picture that cannot be had (the second reading broke off, or lost that frame) is drawn grey.

use crate::{Frame, FrameIndex, FrameSource, Pixels};
use std::cmp::Ordering;

/// Largest difference of the channels of a pixel that is grey: what the conversion from luma and chroma leaves.
const GREY: u8 = 12;

/// Coloured frames in the order of their numbers.
pub struct Colours {
    source: Option<Box<dyn FrameSource>>,
    newest: Option<Frame>,
}

opaque_debug!(Colours);

impl Colours {
    /// Takes a source of the same frames; `None` if its first frame has no colour in it.
    pub fn of(mut source: Box<dyn FrameSource>) -> Option<Self> {
        let first = source.next_frame().ok().flatten()?;
        let Pixels::Rgb8(image) = &first.pixels else { return None };
        let is_coloured = |p: &[u8; 3]| p.iter().max().zip(p.iter().min()).is_some_and(|(a, b)| a - b > GREY);
        // One pixel in 500: a coloured speck of codec noise is no colour.
        let n = image.as_slice().iter().filter(|p| is_coloured(p)).count();
        (500 * n > image.as_slice().len()).then_some(Self { source: Some(source), newest: Some(first) })
    }

    /// The pixels of a frame, which must come after those asked for before.
    pub fn pixels(&mut self, index: FrameIndex) -> Option<&Pixels> {
        while let Some(source) = &mut self.source {
            match self.newest.as_ref().map_or(Ordering::Less, |f| f.index.cmp(&index)) {
                Ordering::Less => {}
                Ordering::Equal | Ordering::Greater => break,
            }
            if let Some(old) = self.newest.take() {
                source.recycle(old);
            }
            match source.next_frame() {
                Ok(Some(frame)) => self.newest = Some(frame),
                _ => self.source = None,
            }
        }
        self.newest.as_ref().filter(|f| f.index == index).map(|f| &f.pixels)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Image, PixelKind, Result, SourceInfo, Timestamp};

    struct Numbered(Vec<u64>, [u8; 3], SourceInfo);

    impl FrameSource for Numbered {
        fn info(&self) -> &SourceInfo {
            &self.2
        }

        fn next_frame(&mut self) -> Result<Option<Frame>> {
            if self.0.is_empty() {
                return Ok(None);
            }
            let index = FrameIndex(self.0.remove(0));
            let [r, g, b] = self.1;
            let pixels = Pixels::Rgb8(Image::filled(4, 4, [r + index.0 as u8, g, b]));
            Ok(Some(Frame { index, time: Timestamp::default(), pixels }))
        }
    }

    fn colours(numbers: &[u64], colour: [u8; 3]) -> Option<Colours> {
        let info = SourceInfo {
            label: String::new(),
            reader: String::new(),
            width: 4,
            height: 4,
            kind: PixelKind::Rgb8,
            n_frames: None,
            rate_hz: None,
            true_times: false,
        };
        Colours::of(Box::new(Numbered(numbers.to_vec(), colour, info)))
    }

    #[test]
    fn each_frame_gets_its_own_colours_and_a_lost_one_none() {
        let mut all = colours(&[0, 1, 3, 4], [100, 20, 20]).unwrap();
        let mut red = |k: u64| match all.pixels(FrameIndex(k)) {
            Some(Pixels::Rgb8(i)) => i.get(0, 0).map(|p| p[0]),
            _ => None,
        };
        assert_eq!([0, 1, 2, 3, 4, 5].map(&mut red), [Some(100), Some(101), None, Some(103), Some(104), None]);
    }

    #[test]
    fn a_grey_video_is_read_once() {
        assert!(colours(&[0, 1], [100, 100, 104]).is_none() && colours(&[], [100, 0, 0]).is_none());
    }
}
