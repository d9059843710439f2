//! A sink that makes one small annotated picture of a run: its first frame with the most tracks that are reported.

use super::annotate::Annotator;
use super::canvas::Rgb;
use super::options::DrawOptions;
use super::png_folder::write_png;
use crate::{Image, Result, Sink, TrackStatus, View};
use std::path::PathBuf;

/// Longest side of the picture, px.
const LONGEST_PX: usize = 320;

/// Writes one small PNG of a run: the first of the frames with the most tracks that are not tentative.
pub struct Thumbnail {
    path: PathBuf,
    draw: DrawOptions,
    picture: Image<Rgb>,
    most: Option<usize>,
}

opaque_debug!(Thumbnail);

impl Thumbnail {
    /// Begins the picture; the file appears at the end.
    /// # Errors
    /// [`crate::ErrorKind::Config`] if an option is out of range.
    pub fn create(path: impl Into<PathBuf>, draw: DrawOptions) -> Result<Self> {
        draw.validate("draw")?;
        Ok(Self { path: path.into(), draw, picture: Image::default(), most: None })
    }
}

impl Sink for Thumbnail {
    fn put(&mut self, view: &View<'_>) -> Result<()> {
        let reported = view.tracks.iter().filter(|t| t.status != TrackStatus::Tentative).count();
        if self.most.is_some_and(|most| reported <= most) {
            return Ok(());
        }
        self.most = Some(reported);
        // Drawn now and then only: trails and the brightness of frames before would depend on which.
        Annotator::new(self.draw.clone())?.draw(view, &mut self.picture)
    }

    fn finish(self: Box<Self>) -> Result<()> {
        write_png(&self.path, &shrunk(&self.picture, LONGEST_PX))
    }
}

/// The picture with each square of pixels as their mean, so that no side is longer than `longest_px`.
fn shrunk(picture: &Image<Rgb>, longest_px: usize) -> Image<Rgb> {
    let side = picture.width().max(picture.height()).div_ceil(longest_px).max(1);
    let (width, height) = (picture.width().div_ceil(side), picture.height().div_ceil(side));
    let mut out = Image::filled(width, height, [0; 3]);
    for y in 0..height {
        for (x, pixel) in out.row_mut(y).iter_mut().enumerate() {
            let (mut sum, mut n) = ([0_u32; 3], 0);
            for from in y * side..((y + 1) * side).min(picture.height()) {
                for rgb in &picture.row(from)[x * side..((x + 1) * side).min(picture.width())] {
                    sum.iter_mut().zip(rgb).for_each(|(s, v)| *s += u32::from(*v));
                    n += 1;
                }
            }
            *pixel = sum.map(|s| (s / n) as u8);
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Frame, FrameIndex, Pixels, Scan, Timestamp};

    #[test]
    fn a_large_picture_becomes_small_and_keeps_its_mean() {
        let mut picture = Image::filled(1000, 10, [0, 0, 0]);
        picture.row_mut(3)[998] = [160, 160, 160];
        let small = shrunk(&picture, 320);
        assert_eq!((small.width(), small.height()), (250, 3));
        assert_eq!((small.get(249, 0), small.get(0, 0)), (Some([10; 3]), Some([0; 3])));
        assert_eq!(shrunk(&picture, 2000), picture);
    }

    #[test]
    fn the_picture_appears_at_the_end() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("thumbnail.png");
        let mut sink = Box::new(Thumbnail::create(&path, DrawOptions::default()).unwrap());
        let frame = Frame {
            index: FrameIndex(0),
            time: Timestamp::from_ns(0),
            pixels: Pixels::Gray8(Image::filled(2000, 500, 60)),
        };
        sink.put(&View { frame: Some(&frame), scan: &Scan::default(), tracks: &[] }).unwrap();
        assert!(!path.exists());
        sink.finish().unwrap();
        assert!(std::fs::read(&path).unwrap().starts_with(b"\x89PNG"));
    }
}
