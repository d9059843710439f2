//! A sink that makes an annotated video of views.

use super::annotate::Annotator;
use super::canvas::Rgb;
use super::colours::Colours;
use super::options::DrawOptions;
use crate::io::video::{MAX_SIZE, Mp4Options, Mp4Writer};
use crate::{Image, Result, Sink, View};
use std::path::PathBuf;

/// Shortest side that the encoder takes, px.
const MIN_SIDE: usize = 16;

/// Writes `annotated.mp4`: every frame with what was found in it.
///
/// The file is created with the first frame, has its name only when whole, and is removed if the sink is dropped
/// unfinished. It can be watched, whatever the interval between frames ([`Mp4Options::watchable`]). Frames beyond the encoder's size are made smaller by a whole number, smaller ones than it takes get a black
/// margin at the right and below.
pub struct AnnotatedVideo {
    path: PathBuf,
    annotator: Annotator,
    options: Mp4Options,
    writer: Option<Mp4Writer>,
    narrow: Image<Rgb>,
}

opaque_debug!(AnnotatedVideo);

impl AnnotatedVideo {
    /// Will write to `path`.
    /// # Errors
    /// [`crate::ErrorKind::Config`] if an option is out of range.
    pub fn create(path: impl Into<PathBuf>, draw: DrawOptions, options: Mp4Options) -> Result<Self> {
        let (path, mut annotator) = (path.into(), Annotator::new(draw)?);
        annotator.set_most(MAX_SIZE);
        let options = Mp4Options { watchable: true, ..options };
        Ok(Self { path, annotator, options, writer: None, narrow: Image::default() })
    }

    /// Draws on the same frames in colour.
    #[must_use]
    pub fn with_colours(mut self, colours: Option<Colours>) -> Self {
        self.annotator.set_colours(colours);
        self
    }
}

impl Sink for AnnotatedVideo {
    fn put(&mut self, view: &View<'_>) -> Result<()> {
        let mut picture = self.writer.as_ref().and_then(Mp4Writer::spare).unwrap_or_default();
        self.annotator.draw(view, &mut picture)?;
        if picture.width().min(picture.height()) < MIN_SIDE {
            std::mem::swap(&mut picture, &mut self.narrow);
            margin(&self.narrow, &mut picture);
        }
        if self.writer.is_none() {
            self.writer = Some(Mp4Writer::create(&self.path, picture.width(), picture.height(), self.options)?);
        }
        match &mut self.writer {
            Some(writer) => writer.write(picture, view.scan.time),
            None => Ok(()),
        }
    }

    fn finish(self: Box<Self>) -> Result<()> {
        self.writer.map_or(Ok(()), Mp4Writer::finish)
    }
}

/// Puts a picture into the corner of a black one whose sides the encoder takes.
fn margin(small: &Image<Rgb>, out: &mut Image<Rgb>) {
    out.reset(small.width().max(MIN_SIDE), small.height().max(MIN_SIDE), [0; 3]);
    for y in 0..small.height() {
        out.row_mut(y)[..small.width()].copy_from_slice(small.row(y));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Frame, FrameIndex, Pixels, Scan, Timestamp};

    fn frame(k: u64) -> Frame {
        let pixels = Pixels::Gray8(Image::filled(64, 48, 60));
        Frame { index: FrameIndex(k), time: Timestamp::from_ns(k as i64 * 40_000_000), pixels }
    }

    #[test]
    fn a_video_of_three_views_has_three_frames_at_a_legible_size() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("annotated.mp4");
        let mut sink = Box::new(AnnotatedVideo::create(&path, DrawOptions::default(), Mp4Options::default()).unwrap());
        for k in 0..3 {
            let frame = frame(k);
            let scan = Scan { index: frame.index, time: frame.time, ..Scan::default() };
            sink.put(&View { frame: Some(&frame), scan: &scan, tracks: &[] }).unwrap();
            assert!(!path.exists(), "the name appears with the whole file");
        }
        sink.finish().unwrap();
        let mut source = crate::io::video::open_mp4(&path, &crate::io::OpenOptions::default()).unwrap();
        assert_eq!((source.info().width, source.info().height, source.info().n_frames), (512, 384, Some(3)));
        source.next_frame().unwrap();
        assert_eq!(source.next_frame().unwrap().unwrap().time.ns, 40_000_000);
    }

    #[test]
    fn a_single_pixel_and_the_line_of_a_line_camera_make_a_video_too() {
        for (width, height) in [(1, 1), (1, 50), (9000, 1)] {
            let dir = tempfile::tempdir().unwrap();
            let path = dir.path().join("annotated.mp4");
            let mut sink =
                Box::new(AnnotatedVideo::create(&path, DrawOptions::default(), Mp4Options::default()).unwrap());
            for k in 0..2 {
                let frame = Frame { pixels: Pixels::Gray8(Image::filled(width, height, 60)), ..frame(k) };
                let scan = Scan { index: frame.index, time: frame.time, ..Scan::default() };
                sink.put(&View { frame: Some(&frame), scan: &scan, tracks: &[] }).unwrap();
            }
            sink.finish().unwrap();
            let source = crate::io::video::open_mp4(&path, &crate::io::OpenOptions::default()).unwrap();
            assert_eq!(source.info().n_frames, Some(2), "{width} x {height}");
        }
    }
}
