//! Animated GIF with its delays as times; frames are composed on the canvas as a browser shows them.
//!
//! Where the first frame's palette is all grey the frames are grey, else RGB. What is transparent shows black. A delay of
//! zero counts as 0.1 s, as browsers and ffmpeg take it, with a warning. Source: CompuServe, *GIF89a*, section 23
//! (graphic control extension: disposal, delay in 1/100 s).
//! Why not `gif-dispose` 6.0.0 for the canvas: it brings three crates for 50 lines, and panics on 31 of 4000 damaged copies of the
//! tests' `g8.gif`.

use crate::io::guard::{damaged, guarded};
use crate::io::options::{Colour, OpenOptions};
use crate::io::pixels::{check_size, gray_of_rgb8};
use crate::memory_budget::afford;
use crate::{
    Error, ErrorKind, Frame, FrameIndex, FrameSource, Image, PixelKind, Pixels, Result, SourceInfo, Timestamp,
};
use gif::{ColorOutput, DecodeOptions, Decoder, DisposalMethod, MemoryLimit};
use std::io::Read;
use std::num::NonZeroU64;

/// A GIF counts delays in hundredths of a second; one of 0 is shown for a tenth, as browsers do.
const NS_PER_DELAY: i64 = 10_000_000;
const NS_OF_NO_DELAY: i64 = 100_000_000;

/// Frames of an animated GIF.
pub struct GifFrames<R: Read> {
    info: SourceInfo,
    decoder: Decoder<R>,
    canvas: Image<[u8; 3]>,
    /// The canvas before the frame on it, if that frame asks for it back.
    before: Option<Image<[u8; 3]>>,
    disposal: DisposalMethod,
    /// The last frame's place: left, top, width, height.
    place: [usize; 4],
    first: Option<Frame>,
    time_ns: i64,
    n_read: u64,
    warnings: Vec<String>,
    ended: bool,
}

opaque_debug!(GifFrames<R: Read>);

impl<R: Read + Send> GifFrames<R> {
    /// Opens the stream and reads its first frame.
    /// # Errors
    /// [`ErrorKind::Damaged`] if there is no whole first frame.
    pub fn open(label: &str, reader: R, options: &OpenOptions) -> Result<Self> {
        let mut decode = DecodeOptions::new();
        decode.set_color_output(ColorOutput::Indexed);
        decode.set_memory_limit(MemoryLimit::Bytes(NonZeroU64::new(options.max_pixels).unwrap_or(NonZeroU64::MIN)));
        let not_whole = |e: gif::DecodingError| damaged("not a whole GIF", e).at(label);
        let decoder = guarded(|| decode.read_info(reader).map_err(not_whole))?;
        let (width, height) =
            check_size(decoder.width().into(), decoder.height().into(), options.max_pixels).map_err(|e| e.at(label))?;
        // The canvas, one to go back to, the frame that is read, the one that is given.
        afford(width, height, 10).map_err(|e| e.at(label))?;
        let info = SourceInfo {
            label: label.to_string(),
            reader: "GIF".to_string(),
            width,
            height,
            kind: PixelKind::Rgb8,
            n_frames: None,
            rate_hz: None,
            true_times: true,
        };
        let mut source = Self {
            info,
            decoder,
            canvas: Image::filled(width, height, [0; 3]),
            before: None,
            disposal: DisposalMethod::Any,
            place: [0; 4],
            first: None,
            time_ns: 0,
            n_read: 0,
            warnings: Vec::new(),
            ended: false,
        };
        let first = source.read(Some(options.colour)).map_err(|e| e.at(label))?;
        let first = first.ok_or_else(|| Error::new(ErrorKind::Damaged, "the GIF holds no frame").at(label))?;
        source.first = Some(first);
        Ok(source)
    }

    /// Undoes the last frame as it asked.
    fn dispose(&mut self) {
        match self.disposal {
            DisposalMethod::Previous => {
                if let Some(before) = self.before.take() {
                    self.canvas = before;
                }
            }
            DisposalMethod::Background => {
                let [left, top, width, height] = self.place;
                for y in top..(top + height).min(self.canvas.height()) {
                    let to = (left + width).min(self.canvas.width());
                    if let Some(pixels) = self.canvas.row_mut(y).get_mut(left..to) {
                        pixels.fill([0; 3]);
                    }
                }
            }
            _ => {}
        }
    }

    /// Reads the next frame; at the first, `decide` says which kind of pixels is wanted.
    fn read(&mut self, decide: Option<Colour>) -> Result<Option<Frame>> {
        self.dispose();
        let global: Option<Vec<u8>> = self.decoder.global_palette().map(<[u8]>::to_vec);
        let decoder = &mut self.decoder;
        let Some(frame) = guarded(|| decoder.read_next_frame().map_err(|e| damaged("not a whole GIF", e)))? else {
            return Ok(None);
        };
        let palette = frame.palette.as_deref().or(global.as_deref());
        let palette = palette.ok_or_else(|| Error::new(ErrorKind::Damaged, "a GIF frame without a palette"))?;
        let colours = palette.as_chunks::<3>().0;
        let gray_palette = colours.iter().all(|c| c[0] == c[1] && c[1] == c[2]);
        match decide {
            Some(Colour::Gray) => self.info.kind = PixelKind::Gray8,
            Some(Colour::Native) if gray_palette => self.info.kind = PixelKind::Gray8,
            _ => {}
        }
        self.before = (frame.dispose == DisposalMethod::Previous).then(|| self.canvas.clone());
        self.disposal = frame.dispose;
        let [left, top, width, height] = [frame.left, frame.top, frame.width, frame.height].map(usize::from);
        self.place = [left, top, width, height];
        for (y, row) in frame.buffer.chunks_exact(width.max(1)).enumerate().take(height) {
            for (x, &index) in row.iter().enumerate() {
                let (cx, cy) = (left + x, top + y);
                if frame.transparent == Some(index) || cx >= self.info.width || cy >= self.info.height {
                    continue;
                }
                let colour = colours.get(usize::from(index)).copied().ok_or_else(|| {
                    Error::new(
                        ErrorKind::Damaged,
                        format!("a pixel names colour {index} of a palette of {}", colours.len()),
                    )
                })?;
                self.canvas.row_mut(cy)[cx] = colour;
            }
        }
        let delay = match frame.delay {
            0 => {
                if self.warnings.is_empty() {
                    self.warnings.push(format!("{}: frames without a delay are shown for 0.1 s.", self.info.label));
                }
                NS_OF_NO_DELAY
            }
            hundredths => i64::from(hundredths) * NS_PER_DELAY,
        };
        let (width, height) = (self.info.width, self.info.height);
        let pixels = if self.info.kind == PixelKind::Gray8 {
            let data = self.canvas.as_slice().iter().map(|&p| gray_of_rgb8(p)).collect();
            Image::from_vec(width, height, data).map(Pixels::Gray8)
        } else {
            Some(Pixels::Rgb8(self.canvas.clone()))
        };
        let index = FrameIndex(self.n_read);
        let time = Timestamp::from_ns(self.time_ns);
        self.n_read += 1;
        self.time_ns = self.time_ns.saturating_add(delay);
        Ok(pixels.map(|pixels| Frame { index, time, pixels }))
    }
}

impl<R: Read + Send> FrameSource for GifFrames<R> {
    fn info(&self) -> &SourceInfo {
        &self.info
    }

    fn next_frame(&mut self) -> Result<Option<Frame>> {
        if let Some(first) = self.first.take() {
            return Ok(Some(first));
        }
        if self.ended {
            return Ok(None);
        }
        match self.read(None) {
            Ok(Some(frame)) => Ok(Some(frame)),
            Ok(None) => {
                self.ended = true;
                Ok(None)
            }
            Err(error) => {
                // Whatever follows in the stream has lost its place: all of it is the damaged tail.
                self.ended = true;
                let n = self.n_read;
                self.warnings.push(format!("{}: frame {n} and all behind it are lost: {error}.", self.info.label));
                Ok(None)
            }
        }
    }

    fn warnings(&self) -> &[String] {
        &self.warnings
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn animation(palette: &[u8], frames: &[(u16, DisposalMethod, Vec<u8>, [u16; 4])]) -> Vec<u8> {
        let mut bytes = Vec::new();
        let mut encoder = gif::Encoder::new(&mut bytes, 2, 2, palette).unwrap();
        for (delay, dispose, pixels, [left, top, width, height]) in frames {
            let frame = gif::Frame {
                delay: *delay,
                dispose: *dispose,
                left: *left,
                top: *top,
                width: *width,
                height: *height,
                buffer: pixels.clone().into(),
                ..gif::Frame::default()
            };
            encoder.write_frame(&frame).unwrap();
        }
        drop(encoder);
        bytes
    }

    const GRAYS: [u8; 12] = [0, 0, 0, 85, 85, 85, 170, 170, 170, 255, 255, 255];

    #[test]
    fn delays_add_up_and_disposals_are_obeyed() {
        let bytes = animation(
            &GRAYS,
            &[
                (4, DisposalMethod::Keep, vec![1; 4], [0, 0, 2, 2]),
                (7, DisposalMethod::Previous, vec![3], [1, 0, 1, 1]),
                (0, DisposalMethod::Background, vec![2], [0, 1, 1, 1]),
                (1, DisposalMethod::Keep, vec![3], [1, 1, 1, 1]),
            ],
        );
        let mut source = GifFrames::open("test", &bytes[..], &OpenOptions::default()).unwrap();
        let frames: Vec<_> = std::iter::from_fn(|| source.next_frame().unwrap()).collect();
        let seen: Vec<_> = frames
            .iter()
            .map(|f| match &f.pixels {
                Pixels::Gray8(image) => (f.time.ns / 1_000_000, image.as_slice().to_vec()),
                other => panic!("expected grey, got {:?}", other.kind()),
            })
            .collect();
        assert_eq!(seen[0], (0, vec![85, 85, 85, 85]));
        assert_eq!(seen[1], (40, vec![85, 255, 85, 85]));
        assert_eq!(seen[2], (110, vec![85, 85, 170, 85]));
        assert_eq!(seen[3], (210, vec![85, 85, 0, 255]));
        assert_eq!(source.warnings().len(), 1);
    }

    #[test]
    fn a_broken_end_gives_the_frames_before_it_and_a_warning() {
        let frame = (4, DisposalMethod::Keep, vec![1, 2, 3, 0], [0, 0, 2, 2]);
        let bytes = animation(&GRAYS, &[frame.clone(), frame]);
        let mut n_broken = 0;
        for n in 0..bytes.len() {
            let Ok(mut source) = GifFrames::open("test", &bytes[..n], &OpenOptions::default()) else { continue };
            let count = std::iter::from_fn(|| source.next_frame().unwrap()).count();
            assert!((1..=2).contains(&count));
            n_broken += usize::from(!source.warnings().is_empty());
        }
        assert!(n_broken > 5);
    }
}
