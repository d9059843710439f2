//! A sink that makes a folder of annotated PNG files, one a frame.

use super::annotate::Annotator;
use super::canvas::Rgb;
use super::colours::Colours;
use super::options::DrawOptions;
use crate::io::{AtomicFile, AtomicFolder, remove_folder};
use crate::{Error, ErrorKind, Image, Result, Sink, View};
use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};

/// Writes a folder of PNG files, `frame_000000.png` and so on, numbered as the frames are.
///
/// The folder appears at the end, whole; frames of an earlier run in it go then, other files stay.
pub struct PngFolder {
    folder: AtomicFolder,
    annotator: Annotator,
    picture: Image<Rgb>,
}

opaque_debug!(PngFolder);

impl PngFolder {
    /// Begins the folder.
    /// # Errors
    /// [`ErrorKind::Output`] if it cannot be made, [`ErrorKind::Config`] if an option is out of range.
    pub fn create(folder: impl Into<PathBuf>, draw: DrawOptions) -> Result<Self> {
        let annotator = Annotator::new(draw)?;
        Ok(Self { folder: AtomicFolder::create(folder, is_frame)?, annotator, picture: Image::default() })
    }

    /// Draws on the same frames in colour.
    #[must_use]
    pub fn with_colours(mut self, colours: Option<Colours>) -> Self {
        self.annotator.set_colours(colours);
        self
    }

    /// Removes the frames of an earlier run, and the folder if nothing else is in it.
    pub fn remove(folder: &Path) {
        remove_folder(folder, is_frame);
    }
}

/// Whether a file has the name of a frame.
fn is_frame(name: &str) -> bool {
    let number = name.strip_prefix("frame_").and_then(|n| n.strip_suffix(".png"));
    number.is_some_and(|n| n.len() >= 6 && n.bytes().all(|b| b.is_ascii_digit()))
}

impl Sink for PngFolder {
    fn put(&mut self, view: &View<'_>) -> Result<()> {
        self.annotator.draw(view, &mut self.picture)?;
        let path = self.folder.part_path().join(format!("frame_{:06}.png", view.scan.index.0));
        let mut file = BufWriter::new(File::create(&path).map_err(|e| failed(&path, &e))?);
        encode(&mut file, &self.picture).and_then(|()| Ok(file.flush()?)).map_err(|e| failed(&path, &e))
    }

    fn finish(self: Box<Self>) -> Result<()> {
        self.folder.finish()
    }
}

fn failed(path: &Path, e: &dyn std::fmt::Display) -> Error {
    Error::new(ErrorKind::Output, format!("cannot be written: {e}")).at(path.display())
}

/// Writes one RGB picture as PNG; the file appears whole.
/// # Errors
/// [`ErrorKind::Output`] if it cannot be written.
pub fn write_png(path: &Path, picture: &Image<Rgb>) -> Result<()> {
    let mut file = AtomicFile::create(path)?;
    let mut out = BufWriter::new(&mut file);
    encode(&mut out, picture).and_then(|()| Ok(out.flush()?)).map_err(|e| failed(path, &e))?;
    drop(out);
    file.finish()
}

fn encode(out: &mut impl Write, picture: &Image<Rgb>) -> std::result::Result<(), png::EncodingError> {
    let side = |n: usize| u32::try_from(n).map_err(std::io::Error::other);
    let mut encoder = png::Encoder::new(out, side(picture.width())?, side(picture.height())?);
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_depth(png::BitDepth::Eight);
    encoder.set_compression(png::Compression::Fast);
    let mut writer = encoder.write_header()?;
    writer.write_image_data(picture.as_slice().as_flattened())?;
    writer.finish()
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
    fn png_files_carry_the_frames_numbers() {
        let dir = tempfile::tempdir().unwrap();
        let mut sink = Box::new(PngFolder::create(dir.path().join("png"), DrawOptions::default()).unwrap());
        let frame = frame(7);
        let scan = Scan { index: frame.index, time: frame.time, ..Scan::default() };
        sink.put(&View { frame: Some(&frame), scan: &scan, tracks: &[] }).unwrap();
        sink.finish().unwrap();
        assert!(dir.path().join("png/frame_000007.png").exists());
    }

    #[test]
    fn views_without_frames_are_refused_with_a_way_out() {
        let dir = tempfile::tempdir().unwrap();
        let mut sink = PngFolder::create(dir.path(), DrawOptions::default()).unwrap();
        let err = sink.put(&View { frame: None, scan: &Scan::default(), tracks: &[] }).unwrap_err();
        assert!(err.to_string().contains("hint: give the frames"), "{err}");
    }
}
