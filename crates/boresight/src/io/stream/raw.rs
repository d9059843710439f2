//! Raw frames without a header: size and pixel type come from the options.
//!
//! One file, a folder of files (each holds one frame or several), or a pipe. Bytes behind the last whole frame are
//! left out with a warning, since they mostly mean that the size or the type is not the right one.

use crate::io::options::{Colour, OpenOptions, RawFormat, RawType};
use crate::io::pixels::gray_of_rgb8;
use crate::{
    Error, ErrorKind, Frame, FrameIndex, FrameSource, Image, PixelKind, Pixels, Result, SourceInfo, Timestamp,
};
use std::fs::File;
use std::io::Read;
use std::path::PathBuf;

/// Frames without a header.
pub struct RawFrames {
    info: SourceInfo,
    format: RawFormat,
    gray: bool,
    rate_hz: f64,
    /// The input being read, and its name.
    current: Option<(Box<dyn Read + Send>, String)>,
    waiting: std::vec::IntoIter<PathBuf>,
    n_given: u64,
    /// Frames given from the current input.
    n_here: u64,
    bytes: Vec<u8>,
    spare: Option<Pixels>,
    warnings: Vec<String>,
}

opaque_debug!(RawFrames);

impl RawType {
    /// Bytes of a pixel.
    pub fn bytes(self) -> usize {
        match self {
            Self::U8 => 1,
            Self::U16Le | Self::U16Be => 2,
            Self::Rgb8 => 3,
            Self::F32Le => 4,
        }
    }
}

impl RawFrames {
    /// Reads files one after the other.
    /// # Errors
    /// [`ErrorKind::NotFound`] if the list is empty.
    pub fn files(label: &str, files: Vec<PathBuf>, format: RawFormat, options: &OpenOptions) -> Result<Self> {
        if files.is_empty() {
            return Err(Error::new(ErrorKind::NotFound, "the folder holds no files").at(label));
        }
        let frame_bytes = (format.width * format.height * format.pixel.bytes()) as u64;
        let mut n_frames = 0;
        for file in &files {
            let cannot =
                |e: std::io::Error| Error::new(ErrorKind::NotFound, "cannot be read").at(file.display()).because(e);
            let data = file.metadata().map_err(cannot)?;
            // A named pipe or a device has no length beforehand.
            if data.is_file() && data.len() < frame_bytes {
                let what = format!("{} bytes, but one frame of {} has {frame_bytes}", data.len(), described(&format));
                return Err(Error::new(ErrorKind::Damaged, what)
                    .at(file.display())
                    .hint("check the frames' size and type"));
            }
            n_frames += data.len() / frame_bytes;
        }
        let mut source = Self::new(label, None, format, options);
        source.info.n_frames = (n_frames > 0).then_some(n_frames);
        source.waiting = files.into_iter();
        Ok(source)
    }

    /// Reads a pipe.
    pub fn stream(label: &str, reader: Box<dyn Read + Send>, format: RawFormat, options: &OpenOptions) -> Self {
        Self::new(label, Some((reader, label.to_string())), format, options)
    }

    fn new(
        label: &str,
        current: Option<(Box<dyn Read + Send>, String)>,
        format: RawFormat,
        options: &OpenOptions,
    ) -> Self {
        let gray = options.colour == Colour::Gray;
        let kind = match format.pixel {
            RawType::U8 => PixelKind::Gray8,
            RawType::U16Le | RawType::U16Be => PixelKind::Gray16,
            RawType::F32Le => PixelKind::GrayF32,
            RawType::Rgb8 if gray => PixelKind::Gray8,
            RawType::Rgb8 => PixelKind::Rgb8,
        };
        let info = SourceInfo {
            label: label.to_string(),
            reader: format!("raw frames, {}", described(&format)),
            width: format.width,
            height: format.height,
            kind,
            n_frames: None,
            rate_hz: Some(options.rate_hz),
            true_times: false,
        };
        Self {
            info,
            format,
            gray,
            rate_hz: options.rate_hz,
            current,
            waiting: Vec::new().into_iter(),
            n_given: 0,
            n_here: 0,
            bytes: Vec::new(),
            spare: None,
            warnings: Vec::new(),
        }
    }

    /// Fills the buffer with the next frame's bytes; false at the end.
    fn read_bytes(&mut self) -> Result<bool> {
        let size = self.format.width * self.format.height * self.format.pixel.bytes();
        loop {
            let Some((reader, name)) = &mut self.current else {
                let Some(path) = self.waiting.next() else { return Ok(false) };
                let name = path.display().to_string();
                let file = File::open(&path)
                    .map_err(|e| Error::new(ErrorKind::NotFound, "cannot be read").at(&name).because(e))?;
                self.current = Some((Box::new(file), name));
                self.n_here = 0;
                continue;
            };
            self.bytes.clear();
            reader
                .by_ref()
                .take(size as u64)
                .read_to_end(&mut self.bytes)
                .map_err(|e| Error::new(ErrorKind::Damaged, "cannot be read").at(&*name).because(e))?;
            if self.bytes.len() == size {
                self.n_here += 1;
                return Ok(true);
            }
            let (left, name) = (self.bytes.len(), std::mem::take(name));
            self.current = None;
            let what = described(&self.format);
            if self.n_here == 0 {
                return Err(Error::new(
                    ErrorKind::Damaged,
                    format!("{left} bytes, but one frame of {what} has {size}"),
                )
                .at(name)
                .hint("check the frames' size and type"));
            }
            if left > 0 {
                self.warnings.push(format!(
                    "{name}: the last {left} bytes are no whole frame of {what} ({size} bytes): 1 frame is lost, or the size is wrong."
                ));
            }
        }
    }

    fn pixels(&mut self) -> Option<Pixels> {
        let (w, h) = (self.format.width, self.format.height);
        let bytes = &self.bytes;
        let spare = self.spare.take();
        Some(match (self.format.pixel, self.gray) {
            (RawType::U8, _) => {
                let mut data = if let Some(Pixels::Gray8(i)) = spare { i.into_vec() } else { Vec::new() };
                data.clear();
                data.extend_from_slice(bytes);
                Pixels::Gray8(Image::from_vec(w, h, data)?)
            }
            (RawType::U16Le | RawType::U16Be, _) => {
                let mut data = if let Some(Pixels::Gray16(i)) = spare { i.into_vec() } else { Vec::new() };
                data.clear();
                let pairs = bytes.as_chunks::<2>().0.iter();
                if self.format.pixel == RawType::U16Le {
                    data.extend(pairs.map(|&b| u16::from_le_bytes(b)));
                } else {
                    data.extend(pairs.map(|&b| u16::from_be_bytes(b)));
                }
                Pixels::Gray16(Image::from_vec(w, h, data)?)
            }
            (RawType::F32Le, _) => {
                let mut data = if let Some(Pixels::GrayF32(i)) = spare { i.into_vec() } else { Vec::new() };
                data.clear();
                data.extend(bytes.as_chunks::<4>().0.iter().map(|&b| f32::from_le_bytes(b)));
                Pixels::GrayF32(Image::from_vec(w, h, data)?)
            }
            (RawType::Rgb8, true) => {
                let mut data = if let Some(Pixels::Gray8(i)) = spare { i.into_vec() } else { Vec::new() };
                data.clear();
                data.extend(bytes.as_chunks::<3>().0.iter().map(|&p| gray_of_rgb8(p)));
                Pixels::Gray8(Image::from_vec(w, h, data)?)
            }
            (RawType::Rgb8, false) => {
                let mut data = if let Some(Pixels::Rgb8(i)) = spare { i.into_vec() } else { Vec::new() };
                data.clear();
                data.extend_from_slice(bytes.as_chunks::<3>().0);
                Pixels::Rgb8(Image::from_vec(w, h, data)?)
            }
        })
    }
}

fn described(format: &RawFormat) -> String {
    let pixel = match format.pixel {
        RawType::U8 => "8-bit grey",
        RawType::U16Le => "16-bit grey (little-endian)",
        RawType::U16Be => "16-bit grey (big-endian)",
        RawType::F32Le => "32-bit float grey",
        RawType::Rgb8 => "8-bit RGB",
    };
    format!("{} x {} pixels of {pixel}", format.width, format.height)
}

impl FrameSource for RawFrames {
    fn info(&self) -> &SourceInfo {
        &self.info
    }

    fn next_frame(&mut self) -> Result<Option<Frame>> {
        if !self.read_bytes()? {
            return Ok(None);
        }
        let Some(pixels) = self.pixels() else { return Ok(None) };
        let index = FrameIndex(self.n_given);
        self.n_given += 1;
        let time = Timestamp::from_secs_f64(index.0 as f64 / self.rate_hz);
        Ok(Some(Frame { index, time, pixels }))
    }

    fn recycle(&mut self, frame: Frame) {
        self.spare = Some(frame.pixels);
    }

    fn warnings(&self) -> &[String] {
        &self.warnings
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn stream(bytes: &'static [u8], pixel: RawType) -> RawFrames {
        let format = RawFormat { width: 2, height: 1, pixel };
        RawFrames::stream("test", Box::new(bytes), format, &OpenOptions::default())
    }

    #[test]
    fn sixteen_bits_are_read_in_the_named_byte_order() {
        for (pixel, want) in [(RawType::U16Le, [0x0201u16, 0x0403]), (RawType::U16Be, [0x0102, 0x0304])] {
            let frame = stream(&[1, 2, 3, 4], pixel).next_frame().unwrap().unwrap();
            assert_eq!(frame.pixels, Pixels::Gray16(Image::from_vec(2, 1, want.to_vec()).unwrap()));
        }
    }

    #[test]
    fn bytes_behind_the_last_whole_frame_are_named_and_too_few_bytes_are_an_error() {
        let mut source = stream(&[1, 2, 3, 4, 5], RawType::U8);
        assert_eq!(std::iter::from_fn(|| source.next_frame().unwrap()).count(), 2);
        assert!(source.warnings()[0].contains("last 1 bytes"));
        assert!(stream(&[1], RawType::U8).next_frame().is_err());
        assert!(stream(&[], RawType::U8).next_frame().is_err());
    }
}
