//! A frame is pixels in their native type, a number and a time; a source hands frames out one by one.

use crate::{FrameIndex, Image, Result, Timestamp};

/// The pixels of one frame in the type the file holds.
#[derive(Debug, PartialEq)]
pub enum Pixels {
    /// 8-bit grey.
    Gray8(Image<u8>),
    /// 16-bit grey (10, 12 and 14 bit data lie in the low bits, unscaled).
    Gray16(Image<u16>),
    /// 32-bit float grey, any range.
    GrayF32(Image<f32>),
    /// 8-bit red, green, blue.
    Rgb8(Image<[u8; 3]>),
}

impl Clone for Pixels {
    fn clone(&self) -> Self {
        match self {
            Self::Gray8(i) => Self::Gray8(i.clone()),
            Self::Gray16(i) => Self::Gray16(i.clone()),
            Self::GrayF32(i) => Self::GrayF32(i.clone()),
            Self::Rgb8(i) => Self::Rgb8(i.clone()),
        }
    }

    /// Uses the memory of pixels of the same kind again.
    fn clone_from(&mut self, source: &Self) {
        match (self, source) {
            (Self::Gray8(to), Self::Gray8(of)) => to.clone_from(of),
            (Self::Gray16(to), Self::Gray16(of)) => to.clone_from(of),
            (Self::GrayF32(to), Self::GrayF32(of)) => to.clone_from(of),
            (Self::Rgb8(to), Self::Rgb8(of)) => to.clone_from(of),
            (to, of) => *to = of.clone(),
        }
    }
}

/// The type of a frame's pixels.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum PixelKind {
    /// [`Pixels::Gray8`].
    Gray8,
    /// [`Pixels::Gray16`].
    Gray16,
    /// [`Pixels::GrayF32`].
    GrayF32,
    /// [`Pixels::Rgb8`].
    Rgb8,
}

impl PixelKind {
    /// Bytes of a pixel.
    pub fn bytes(self) -> usize {
        match self {
            Self::Gray8 => 1,
            Self::Gray16 => 2,
            Self::GrayF32 => 4,
            Self::Rgb8 => 3,
        }
    }
}

impl Pixels {
    /// A black image of a kind; width and height in px.
    pub(crate) fn black(kind: PixelKind, width: usize, height: usize) -> Self {
        match kind {
            PixelKind::Gray8 => Self::Gray8(Image::filled(width, height, 0)),
            PixelKind::Gray16 => Self::Gray16(Image::filled(width, height, 0)),
            PixelKind::GrayF32 => Self::GrayF32(Image::filled(width, height, 0.0)),
            PixelKind::Rgb8 => Self::Rgb8(Image::filled(width, height, [0; 3])),
        }
    }

    /// Width, px.
    pub fn width(&self) -> usize {
        match self {
            Self::Gray8(i) => i.width(),
            Self::Gray16(i) => i.width(),
            Self::GrayF32(i) => i.width(),
            Self::Rgb8(i) => i.width(),
        }
    }

    /// Height, px.
    pub fn height(&self) -> usize {
        match self {
            Self::Gray8(i) => i.height(),
            Self::Gray16(i) => i.height(),
            Self::GrayF32(i) => i.height(),
            Self::Rgb8(i) => i.height(),
        }
    }

    /// Whether others are of the same size and type.
    pub(crate) fn are_like(&self, others: &Self) -> bool {
        (self.width(), self.height(), self.kind()) == (others.width(), others.height(), others.kind())
    }

    /// The type of the pixels.
    pub fn kind(&self) -> PixelKind {
        match self {
            Self::Gray8(_) => PixelKind::Gray8,
            Self::Gray16(_) => PixelKind::Gray16,
            Self::GrayF32(_) => PixelKind::GrayF32,
            Self::Rgb8(_) => PixelKind::Rgb8,
        }
    }
}

/// One frame of a sequence.
#[derive(Clone, Debug, PartialEq)]
pub struct Frame {
    /// Number in the sequence, from 0.
    pub index: FrameIndex,
    /// Presentation time.
    pub time: Timestamp,
    /// The pixels.
    pub pixels: Pixels,
}

/// What a source knows of its frames before the first is read.
#[derive(Clone, Debug, PartialEq)]
pub struct SourceInfo {
    /// Where the frames come from, for messages (a path, an address).
    pub label: String,
    /// How they are read, for the summary: `H.264 in process, fast decoder`, `PNG folder`, `ffmpeg pipe`.
    pub reader: String,
    /// Width, px.
    pub width: usize,
    /// Height, px.
    pub height: usize,
    /// Type of the pixels handed out.
    pub kind: PixelKind,
    /// Number of frames, if known beforehand.
    pub n_frames: Option<u64>,
    /// Nominal rate, frames/s, if known; true times are on the frames.
    pub rate_hz: Option<f64>,
    /// Whether the frames' times come from the file (else they are made from a nominal rate).
    pub true_times: bool,
}

/// Whether the frame of a number is wanted.
pub type Wanted = Box<dyn Fn(u64) -> bool + Send + Sync>;

/// A sequence of frames.
///
/// One of one's own, a dot that moves through ten frames:
/// ```
/// use boresight::{Frame, FrameIndex, FrameSource, Image, PixelKind, Pixels, Result, SourceInfo, Timestamp};
///
/// struct Dot(SourceInfo, u64);
///
/// impl FrameSource for Dot {
///     fn info(&self) -> &SourceInfo {
///         &self.0
///     }
///     fn next_frame(&mut self) -> Result<Option<Frame>> {
///         let Self(info, k) = self;
///         let mut image = Image::filled(info.width, info.height, 10_u8);
///         image.as_mut_slice()[*k as usize] = 200;
///         *k += 1;
///         let time = Timestamp::from_secs_f64(*k as f64 / 25.0);
///         Ok((*k <= 10).then(|| Frame { index: FrameIndex(*k - 1), time, pixels: Pixels::Gray8(image) }))
///     }
/// }
///
/// let (label, reader) = ("dot".to_string(), "made here".to_string());
/// let (kind, n_frames, rate_hz) = (PixelKind::Gray8, Some(10), Some(25.0));
/// let mut dot = Dot(SourceInfo { label, reader, width: 16, height: 12, kind, n_frames, rate_hz, true_times: true }, 0);
/// assert_eq!(std::iter::from_fn(|| dot.next_frame().ok().flatten()).count(), 10);
/// ```
pub trait FrameSource: Send {
    /// What is known of the sequence.
    fn info(&self) -> &SourceInfo;
    /// Returns the next frame, or `None` at the end.
    /// # Errors
    /// A frame that cannot be read; a damaged tail is a warning and an early end instead.
    fn next_frame(&mut self) -> Result<Option<Frame>>;
    /// Takes a frame back so that its memory can be used again; optional.
    fn recycle(&mut self, frame: Frame) {
        drop(frame);
    }
    /// Says that the caller is going to hold the first `n` frames, so that they may be read as fast as it goes.
    fn will_hold(&mut self, n: usize) {
        let _ = n;
    }
    /// Says by their numbers which frames are wanted; the others may come without pixels (0 x 0), or not be decoded at all.
    fn want_only(&mut self, wanted: Wanted) {
        drop(wanted);
    }
    /// Numbers of the frames at which it can go on without reading those before, where frames that nobody wants are passed over; none if it must read them all.
    fn entries(&self) -> Vec<u64> {
        Vec::new()
    }
    /// Whether the frames are decoded from lossy video: single pixels are not as the sensor gave them.
    fn is_coded(&self) -> bool {
        false
    }
    /// Whether it reads on a thread of its own already, ahead of the caller.
    fn reads_ahead(&self) -> bool {
        false
    }
    /// Warnings so far (frames lost in a damaged tail, times made up), each a whole sentence.
    fn warnings(&self) -> &[String] {
        &[]
    }
}
