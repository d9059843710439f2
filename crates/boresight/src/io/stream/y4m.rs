//! YUV4MPEG2: uncompressed video in a file or a pipe; what `ffmpeg -f yuv4mpegpipe -` writes.
//!
//! Native and grey frames are the luma plane as it stands (8 bits, or 9 to 16 bits unscaled). RGB frames are made by
//! BT.601 from 8-bit planes, chroma taken from the nearest sample. Times are exact from the header's rate. A last frame
//! that breaks off is left out with a warning. Source: mjpegtools yuv4mpeg(5); depth tags as FFmpeg writes them
//! (`C420p10`, `Cmono12`).
//! Why not the crate `y4m` 0.8.0: it does not read `Cmono16` and `C444alpha`, and takes a frame that breaks off for the end of the
//! stream (645 of the 689 beginnings of the tests' `g8.y4m` pass for whole), where a loss must be said.

use crate::io::options::{Colour, OpenOptions};
use crate::io::pixels::check_size;
use crate::memory_budget::afford;
use crate::{
    ASSUMED_RATE_HZ, Error, ErrorKind, Frame, FrameIndex, FrameSource, Image, PixelKind, Pixels, Result, SourceInfo,
    Timestamp,
};
use std::io::{BufRead, Read};

/// A header line or a frame's line longer than this is not YUV4MPEG2.
const MAX_LINE: u64 = 1024;

/// Frames of a YUV4MPEG2 stream.
pub struct Y4m<R> {
    info: SourceInfo,
    reader: R,
    layout: Layout,
    want_rgb: bool,
    /// Seconds of a frame as a fraction, or `None`: made from the nominal rate.
    period: Option<(i64, i64)>,
    n_given: u64,
    /// The planes of one frame.
    planes: Vec<u8>,
    spare: Option<Pixels>,
    warnings: Vec<String>,
    ended: bool,
}

opaque_debug!(Y4m<R>);

#[derive(Clone, Copy, Debug, PartialEq)]
struct Layout {
    width: usize,
    height: usize,
    /// log₂ of how many luma columns and rows share a chroma sample; `None`: no chroma.
    chroma: Option<(u32, u32)>,
    alpha: bool,
    depth: u32,
    full_range: bool,
}

impl Layout {
    fn sample_bytes(&self) -> usize {
        if self.depth > 8 { 2 } else { 1 }
    }

    fn chroma_size(&self) -> (usize, usize) {
        let (sx, sy) = self.chroma.unwrap_or((0, 0));
        (self.width.div_ceil(1 << sx), self.height.div_ceil(1 << sy))
    }

    /// Bytes of luma, and of the whole frame.
    fn bytes(&self) -> (usize, usize) {
        let luma = self.width * self.height;
        let (w, h) = self.chroma_size();
        let chroma = if self.chroma.is_some() { 2 * w * h } else { 0 };
        let alpha = if self.alpha { luma } else { 0 };
        (luma * self.sample_bytes(), (luma + chroma + alpha) * self.sample_bytes())
    }
}

/// Reads a line without its end; `None` at the end of the stream.
fn line(reader: &mut impl BufRead, what: &str) -> Result<Option<String>> {
    let mut text = Vec::new();
    reader
        .take(MAX_LINE)
        .read_until(b'\n', &mut text)
        .map_err(|e| Error::new(ErrorKind::Damaged, "the stream cannot be read").because(e))?;
    if text.is_empty() {
        return Ok(None);
    }
    if text.last() != Some(&b'\n') {
        return Err(Error::new(ErrorKind::Damaged, format!("{what} has no end")));
    }
    text.pop();
    Ok(Some(String::from_utf8_lossy(&text).into_owned()))
}

/// Depth of a colour tag's end: `p10` or `10`, nothing for 8 bits.
fn depth_of(tail: &str) -> Option<u32> {
    if tail.is_empty() {
        return Some(8);
    }
    tail.strip_prefix('p').unwrap_or(tail).parse().ok().filter(|d| (8..=16).contains(d))
}

fn parse_header(text: &str, max_pixels: u64) -> Result<(Layout, Option<(i64, i64)>)> {
    let mut words = text.split_ascii_whitespace();
    if words.next() != Some("YUV4MPEG2") {
        return Err(Error::new(ErrorKind::Damaged, "expected a stream that starts with YUV4MPEG2"));
    }
    let (mut w, mut h, mut period) = (0u64, 0u64, None);
    let mut layout = Layout { width: 0, height: 0, chroma: Some((1, 1)), alpha: false, depth: 8, full_range: false };
    for word in words {
        let (tag, value) = word.split_at_checked(1).unwrap_or(("", ""));
        let number = |v: &str| {
            v.parse()
                .map_err(|_| Error::new(ErrorKind::Damaged, format!("YUV4MPEG2 header: {word}: expected a number")))
        };
        match tag {
            "W" => w = number(value)?,
            "H" => h = number(value)?,
            "F" => {
                let (num, den) = value.split_once(':').unwrap_or((value, "1"));
                let ratio = (num.parse().unwrap_or(0i64), den.parse().unwrap_or(0i64));
                period = (ratio.0 > 0 && ratio.1 > 0).then_some((ratio.1, ratio.0));
            }
            "C" => {
                let unknown = || {
                    Error::new(ErrorKind::Unsupported, format!("YUV4MPEG2 colour {word} is not read"))
                        .hint("write the stream with ffmpeg -pix_fmt gray or yuv420p")
                };
                let (name, chroma) = [
                    ("420jpeg", Some((1, 1))),
                    ("420mpeg2", Some((1, 1))),
                    ("420paldv", Some((1, 1))),
                    ("420", Some((1, 1))),
                    ("411", Some((2, 0))),
                    ("422", Some((1, 0))),
                    ("440", Some((0, 1))),
                    ("444alpha", Some((0, 0))),
                    ("444", Some((0, 0))),
                    ("mono", None),
                ]
                .into_iter()
                .find(|(name, _)| value.starts_with(name))
                .ok_or_else(unknown)?;
                layout.chroma = chroma;
                layout.alpha = name == "444alpha";
                layout.depth = depth_of(&value[name.len()..]).ok_or_else(unknown)?;
            }
            "X" => layout.full_range |= value == "COLORRANGE=FULL",
            _ => {} // interlacing, pixel aspect: no matter here
        }
    }
    (layout.width, layout.height) = check_size(w, h, max_pixels)?;
    // Three planes of two bytes, and the frame made of them.
    afford(layout.width, layout.height, 12)?;
    Ok((layout, period))
}

impl<R: BufRead + Send> Y4m<R> {
    /// Opens a stream; `n_bytes` is the length of the whole input if known.
    /// # Errors
    /// [`ErrorKind::Damaged`] or [`ErrorKind::Unsupported`] for a header that is not understood.
    pub fn open(label: &str, mut reader: R, n_bytes: Option<u64>, options: &OpenOptions) -> Result<Self> {
        let text = line(&mut reader, "the YUV4MPEG2 header")
            .and_then(|l| l.ok_or_else(|| Error::new(ErrorKind::Damaged, "the stream is empty")))
            .map_err(|e| e.at(label))?;
        let (layout, period) = parse_header(&text, options.max_pixels).map_err(|e| e.at(label))?;
        let want_rgb = options.colour == Colour::Rgb && layout.chroma.is_some();
        if want_rgb && layout.depth > 8 {
            return Err(Error::new(
                ErrorKind::Unsupported,
                format!("{}-bit YUV4MPEG2 is not read in colour", layout.depth),
            )
            .at(label)
            .hint("read it as grey, or write it with ffmpeg -pix_fmt yuv420p"));
        }
        let kind = match (want_rgb, layout.depth) {
            (true, _) => PixelKind::Rgb8,
            (false, 8) => PixelKind::Gray8,
            (false, _) => PixelKind::Gray16,
        };
        // Frames without tags of their own have a 6-byte line; then the length tells their number.
        let frame_bytes = layout.bytes().1 as u64 + 6;
        let body = n_bytes.map(|n| n.saturating_sub(text.len() as u64 + 1));
        let info = SourceInfo {
            label: label.to_string(),
            reader: "YUV4MPEG2".to_string(),
            width: layout.width,
            height: layout.height,
            kind,
            n_frames: body.filter(|b| b % frame_bytes == 0).map(|b| b / frame_bytes),
            rate_hz: Some(period.map_or(options.rate_hz, |(num, den)| den as f64 / num as f64)),
            true_times: period.is_some(),
        };
        Ok(Self {
            info,
            reader,
            layout,
            want_rgb,
            period,
            n_given: 0,
            planes: Vec::new(),
            spare: None,
            warnings: Vec::new(),
            ended: false,
        })
    }

    /// Fills the planes with the next frame; false at the end.
    fn read_planes(&mut self) -> Result<bool> {
        let n = self.n_given;
        let place = |e: Error, label: &str| e.at(format!("{label}, frame {n}"));
        let text = match line(&mut self.reader, "the frame's line") {
            Ok(None) => return Ok(false),
            Ok(Some(text)) => text,
            Err(_) if n > 0 && self.at_end() => return Ok(self.broken_off()),
            Err(e) => return Err(place(e, &self.info.label)),
        };
        if text != "FRAME" && !text.starts_with("FRAME ") {
            let what =
                Error::new(ErrorKind::Damaged, "expected a line that starts with FRAME; the stream is out of step");
            return Err(place(what, &self.info.label));
        }
        let size = self.layout.bytes().1;
        self.planes.clear();
        let got = self.reader.by_ref().take(size as u64).read_to_end(&mut self.planes);
        got.map_err(|e| {
            place(Error::new(ErrorKind::Damaged, "the stream cannot be read").because(e), &self.info.label)
        })?;
        if self.planes.len() < size {
            if n == 0 {
                let what = format!("the stream ends inside its first frame: {} of {size} bytes", self.planes.len());
                return Err(Error::new(ErrorKind::Damaged, what).at(&self.info.label));
            }
            return Ok(self.broken_off());
        }
        Ok(true)
    }

    fn at_end(&mut self) -> bool {
        self.reader.fill_buf().is_ok_and(<[u8]>::is_empty)
    }

    fn broken_off(&mut self) -> bool {
        self.ended = true;
        let n = self.n_given;
        self.warnings.push(format!("{}: the stream breaks off inside frame {n}; 1 frame is lost.", self.info.label));
        false
    }

    fn pixels(&mut self) -> Option<Pixels> {
        let (width, height) = (self.layout.width, self.layout.height);
        let luma = self.planes.get(..self.layout.bytes().0)?;
        if self.want_rgb {
            let mut rgb = match self.spare.take() {
                Some(Pixels::Rgb8(image)) => image,
                _ => Image::default(),
            };
            rgb.reset(width, height, [0; 3]);
            rgb_from_planes(&self.planes, &self.layout, rgb.as_mut_slice());
            return Some(Pixels::Rgb8(rgb));
        }
        if self.layout.depth > 8 {
            let mut data = match self.spare.take() {
                Some(Pixels::Gray16(image)) => image.into_vec(),
                _ => Vec::new(),
            };
            data.clear();
            data.extend(luma.as_chunks::<2>().0.iter().map(|&b| u16::from_le_bytes(b)));
            return Image::from_vec(width, height, data).map(Pixels::Gray16);
        }
        let mut data = match self.spare.take() {
            Some(Pixels::Gray8(image)) => image.into_vec(),
            _ => Vec::new(),
        };
        data.clear();
        data.extend_from_slice(luma);
        Image::from_vec(width, height, data).map(Pixels::Gray8)
    }
}

/// BT.601 to 8-bit RGB in 16.16 fixed point (ITU-R BT.601-7, inverse of eqs for E'Y, E'CB, E'CR; limited or full range).
fn rgb_from_planes(planes: &[u8], layout: &Layout, out: &mut [[u8; 3]]) {
    let (cw, ch) = layout.chroma_size();
    let luma = layout.width * layout.height;
    let (u, v) = planes[luma..].split_at(cw * ch);
    let (sx, sy) = layout.chroma.unwrap_or((0, 0));
    let one = f64::from(1 << 16);
    let (zero, y_scale, c_scale) = if layout.full_range { (0, 1.0, 1.0) } else { (16, 255.0 / 219.0, 255.0 / 224.0) };
    let fixed = |k: f64| (k * one).round() as i32;
    let (ky, kr, kb) = (fixed(y_scale), fixed(1.402 * c_scale), fixed(1.772 * c_scale));
    // 0.344136 = 1.772 * 0.114 / 0.587, 0.714136 = 1.402 * 0.299 / 0.587
    let (kgu, kgv) = (fixed(0.344_136 * c_scale), fixed(0.714_136 * c_scale));
    for (y, row) in out.chunks_exact_mut(layout.width).enumerate() {
        let c = (y >> sy) * cw;
        for (x, pixel) in row.iter_mut().enumerate() {
            let luma = (i32::from(planes[y * layout.width + x]) - zero) * ky + (1 << 15);
            let cb = i32::from(u[c + (x >> sx)]) - 128;
            let cr = i32::from(v[c + (x >> sx)]) - 128;
            let byte = |value: i32| (value >> 16).clamp(0, 255) as u8;
            *pixel = [byte(luma + kr * cr), byte(luma - kgu * cb - kgv * cr), byte(luma + kb * cb)];
        }
    }
}

impl<R: BufRead + Send> FrameSource for Y4m<R> {
    fn info(&self) -> &SourceInfo {
        &self.info
    }

    fn next_frame(&mut self) -> Result<Option<Frame>> {
        if self.ended || !self.read_planes()? {
            self.ended = true;
            return Ok(None);
        }
        let Some(pixels) = self.pixels() else { return Ok(None) };
        let index = FrameIndex(self.n_given);
        self.n_given += 1;
        let time = match self.period {
            Some((num, den)) => Timestamp::from_ticks(i64::try_from(index.0).unwrap_or(i64::MAX), num, den),
            None => Timestamp::from_secs_f64(index.0 as f64 / self.info.rate_hz.unwrap_or(ASSUMED_RATE_HZ)),
        };
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

    fn open(bytes: &[u8], colour: Colour) -> Result<Y4m<&[u8]>> {
        Y4m::open("test", bytes, Some(bytes.len() as u64), &OpenOptions { colour, ..OpenOptions::default() })
    }

    #[test]
    fn luma_is_handed_out_with_exact_times_of_a_rational_rate() {
        let mut source = open(b"YUV4MPEG2 W2 H1 F30000:1001 Cmono\nFRAME\nabFRAME Ixyz\ncd", Colour::Native).unwrap();
        let first = source.next_frame().unwrap().unwrap();
        let second = source.next_frame().unwrap().unwrap();
        assert_eq!(first.pixels, Pixels::Gray8(Image::from_vec(2, 1, b"ab".to_vec()).unwrap()));
        assert_eq!(second.time.ns, 33_366_667);
        assert!(source.next_frame().unwrap().is_none());
        assert!(source.warnings().is_empty());
    }

    #[test]
    fn ten_bit_luma_is_unscaled() {
        let mut source = open(b"YUV4MPEG2 W1 H1 F25:1 C420p10\nFRAME\n\xff\x03\0\x02\0\x02", Colour::Gray).unwrap();
        let frame = source.next_frame().unwrap().unwrap();
        assert_eq!(frame.pixels, Pixels::Gray16(Image::from_vec(1, 1, vec![1023]).unwrap()));
    }

    #[test]
    fn limited_range_white_black_and_red_become_rgb() {
        // BT.601 red is Y 81, Cb 90, Cr 240.
        let bytes = b"YUV4MPEG2 W3 H1 F25:1 C444\nFRAME\n\xeb\x10\x51\x80\x80\x5a\x80\x80\xf0";
        let frame = open(bytes, Colour::Rgb).unwrap().next_frame().unwrap().unwrap();
        let Pixels::Rgb8(image) = frame.pixels else { panic!("expected RGB") };
        assert_eq!(image.as_slice()[..2], [[255; 3], [0; 3]]);
        assert!(image.as_slice()[2][0] >= 253 && image.as_slice()[2][1] <= 1 && image.as_slice()[2][2] <= 1);
    }

    #[test]
    fn a_stream_that_stops_gives_the_frames_before_and_a_warning() {
        let whole = b"YUV4MPEG2 W2 H1 F25:1 Cmono\nFRAME\nabFRAME\ncd";
        for n in whole.len() - 7..whole.len() {
            let mut source = open(&whole[..n], Colour::Native).unwrap();
            assert!(source.next_frame().unwrap().is_some());
            assert!(source.next_frame().unwrap().is_none());
            assert!(source.warnings()[0].contains("1 frame is lost"), "{n}");
        }
        assert!(open(&whole[..30], Colour::Native).unwrap().next_frame().is_err());
    }

    #[test]
    fn absurd_sizes_and_lost_steps_are_errors() {
        assert!(open(b"YUV4MPEG2 W100000 H100000 F25:1 Cmono\n", Colour::Native).is_err());
        assert!(open(b"YUV4MPEG2 W2 H2 F25:1 Cxyz\n", Colour::Native).is_err());
        assert!(open(&[b'Y'; 5000], Colour::Native).is_err());
        let mut source = open(b"YUV4MPEG2 W2 H1 Cmono\nFRAME\nabGARBAGE\ncd", Colour::Native).unwrap();
        assert!(source.next_frame().unwrap().is_some());
        assert!(source.next_frame().unwrap_err().to_string().contains("frame 1"));
    }
}
