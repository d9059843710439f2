//! A sink that makes a folder of annotated PNG files, one a frame.

use super::annotate::{Annotator, DrawOptions};
use super::canvas::Rgb;
use crate::io::AtomicFile;
use crate::{Error, ErrorKind, Image, Result, Sink, View};
use std::io::Write;
use std::path::{Path, PathBuf};

/// Writes a folder of PNG files, `frame_000000.png` and so on, numbered as the frames are.
///
/// Every file appears whole; those of an earlier run are overwritten one by one.
pub struct PngFolder {
    folder: PathBuf,
    annotator: Annotator,
    picture: Image<Rgb>,
}

opaque_debug!(PngFolder);

impl PngFolder {
    /// Makes the folder.
    /// # Errors
    /// [`ErrorKind::Output`] if it cannot be made, [`ErrorKind::Config`] if an option is out of range.
    pub fn create(folder: impl Into<PathBuf>, draw: DrawOptions) -> Result<Self> {
        let folder = folder.into();
        std::fs::create_dir_all(&folder)
            .map_err(|e| Error::new(ErrorKind::Output, "the folder cannot be made").at(folder.display()).because(e))?;
        Ok(Self { folder, annotator: Annotator::new(draw)?, picture: Image::default() })
    }
}

impl Sink for PngFolder {
    fn put(&mut self, view: &View<'_>) -> Result<()> {
        self.annotator.draw(view, &mut self.picture)?;
        let path = self.folder.join(format!("frame_{:06}.png", view.scan.index.0));
        write_png(&path, &self.picture)
    }

    fn finish(self: Box<Self>) -> Result<()> {
        Ok(())
    }
}

/// Writes one RGB picture as PNG; the file appears whole.
/// # Errors
/// [`ErrorKind::Output`] if it cannot be written.
pub fn write_png(path: &Path, picture: &Image<Rgb>) -> Result<()> {
    let failed = |e: String| Error::new(ErrorKind::Output, format!("cannot be written: {e}")).at(path.display());
    let side = |n: usize| u32::try_from(n).map_err(|e| failed(e.to_string()));
    let mut file = AtomicFile::create(path)?;
    let mut encoder =
        png::Encoder::new(std::io::BufWriter::new(&mut file), side(picture.width())?, side(picture.height())?);
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_depth(png::BitDepth::Eight);
    encoder.set_compression(png::Compression::Fast);
    let mut writer = encoder.write_header().map_err(|e| failed(e.to_string()))?;
    writer.write_image_data(picture.as_slice().as_flattened()).map_err(|e| failed(e.to_string()))?;
    writer.finish().map_err(|e| failed(e.to_string()))?;
    file.flush().map_err(|e| failed(e.to_string()))?;
    file.finish()
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
