//! The pictures that `ffmpeg` writes into its pipe, as frames: what the reading thread does.
//!
//! The pipe holds raw pictures in NUT (see [`super::nut`]). Of a picture with planes only the first, the luma, is kept.
//! What the header claims is checked before memory is taken; buffers of frames that the caller gave back are used again.

use super::nut::{Format, Head, Nut};
use crate::io::options::Colour;
use crate::io::pixels::gray_of_rgb8;
use crate::io::video::yuv::to_u16;
use crate::memory_budget::afford;
use crate::{Frame, FrameIndex, Image, PixelKind, Pixels, Timestamp};
use std::io::{BufReader, Read};
use std::process::ChildStdout;
use std::sync::mpsc::{Receiver, SyncSender};

/// What the reading thread reports.
pub(super) enum Message {
    /// Shape of the frames to come.
    Format { width: usize, height: usize, kind: PixelKind },
    /// A frame in presentation order.
    Frame(Frame),
    /// The pipe ended inside a frame, or held what it must not.
    Broken(String),
}

/// How the bytes of a picture become pixels.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Layout {
    /// First plane, one byte a pixel.
    Luma8,
    /// First plane, two bytes a pixel.
    Luma16,
    /// RGB triplets, handed out as they are.
    Rgb,
    /// RGB triplets, handed out as grey.
    RgbToGray,
}

/// Reads the pipe to its end; returns when the caller is gone.
pub(super) fn read_all(
    pipe: ChildStdout,
    colour: Colour,
    max_pixels: u64,
    out: &SyncSender<Message>,
    spare: &Receiver<Pixels>,
) {
    let mut nut = match Nut::open(BufReader::with_capacity(1 << 16, pipe)) {
        Ok(nut) => nut,
        // Nothing at all: the program itself says why.
        Err(e) if e.kind() == std::io::ErrorKind::UnexpectedEof => return,
        Err(e) => return drop(out.send(Message::Broken(e.to_string()))),
    };
    let (width, height, layout) = match shape(&nut.format, colour, max_pixels) {
        Ok(shape) => shape,
        Err(why) => return drop(out.send(Message::Broken(why))),
    };
    let kind = match layout {
        Layout::Luma8 | Layout::RgbToGray => PixelKind::Gray8,
        Layout::Luma16 => PixelKind::Gray16,
        Layout::Rgb => PixelKind::Rgb8,
    };
    if out.send(Message::Format { width, height, kind }).is_err() {
        return;
    }
    let mut scratch = Vec::new();
    let mut index = 0;
    loop {
        let read = nut.next_head().and_then(|head| match head {
            None => Ok(None),
            Some(head) => {
                let pixels =
                    read_picture(&mut nut, head, (width, height), layout, spare.try_recv().ok(), &mut scratch)?;
                Ok(Some((head.pts, pixels)))
            }
        });
        let message = match read {
            Ok(None) => return,
            Ok(Some((pts, pixels))) => {
                let (num, den) = nut.format.time_base;
                let time = Timestamp::from_ticks(pts, num as i64, den as i64);
                index += 1;
                Message::Frame(Frame { index: FrameIndex(index - 1), time, pixels })
            }
            Err(e) => Message::Broken(e.to_string()),
        };
        let over = matches!(message, Message::Broken(_));
        if out.send(message).is_err() || over {
            return;
        }
    }
}

/// Size and layout, once they are known to be sane.
fn shape(format: &Format, colour: Colour, max_pixels: u64) -> Result<(usize, usize, Layout), String> {
    let (w, h) = (format.width, format.height);
    if w == 0 || h == 0 || w.checked_mul(h).is_none_or(|n| n > max_pixels) {
        return Err(format!("its header claims {w} x {h} pixels, at most {max_pixels} are accepted"));
    }
    // The picture as it comes and as it is given, twice on their way.
    afford(w as usize, h as usize, 12).map_err(|e| e.to_string())?;
    let layout = match format.tag.as_slice() {
        b"Y800" | b"I420" | b"Y42B" | b"444P" | b"440P" | b"Y41B" | b"YUV9" => Layout::Luma8,
        [b'Y', b'1' | b'3', _, bits] if *bits > 8 => Layout::Luma16,
        b"RGB\x18" if colour == Colour::Rgb => Layout::Rgb,
        b"RGB\x18" => Layout::RgbToGray,
        other => return Err(format!("ffmpeg gives pixels of the unknown kind '{}'", other.escape_ascii())),
    };
    let size = |n: u64| usize::try_from(n).map_err(|e| e.to_string());
    Ok((size(w)?, size(h)?, layout))
}

fn read_picture<R: Read>(
    nut: &mut Nut<R>,
    head: Head,
    (width, height): (usize, usize),
    layout: Layout,
    spare: Option<Pixels>,
    scratch: &mut Vec<u8>,
) -> std::io::Result<Pixels> {
    let n = width * height;
    let need = match layout {
        Layout::Luma8 => n,
        Layout::Luma16 => 2 * n,
        Layout::Rgb | Layout::RgbToGray => 3 * n,
    };
    let wrong = |what: &str| std::io::Error::new(std::io::ErrorKind::InvalidData, what.to_string());
    if head.size < need as u64 || head.size > need as u64 * 3 + 4096 {
        return Err(wrong("a picture changes its size"));
    }
    let pixels = match layout {
        Layout::Luma8 => {
            let mut gray = if let Some(Pixels::Gray8(i)) = spare { i.into_vec() } else { Vec::new() };
            gray.resize(n, 0);
            nut.reader.read_exact(&mut gray)?;
            Image::from_vec(width, height, gray).map(Pixels::Gray8)
        }
        Layout::Luma16 => {
            read_into(nut, need, scratch)?;
            let mut gray = if let Some(Pixels::Gray16(i)) = spare { i.into_vec() } else { Vec::new() };
            to_u16(scratch, &mut gray);
            Image::from_vec(width, height, gray).map(Pixels::Gray16)
        }
        Layout::Rgb => {
            let mut rgb = if let Some(Pixels::Rgb8(i)) = spare { i.into_vec() } else { Vec::new() };
            rgb.resize(n, [0; 3]);
            nut.reader.read_exact(rgb.as_flattened_mut())?;
            Image::from_vec(width, height, rgb).map(Pixels::Rgb8)
        }
        Layout::RgbToGray => {
            read_into(nut, need, scratch)?;
            let mut gray = if let Some(Pixels::Gray8(i)) = spare { i.into_vec() } else { Vec::new() };
            gray.clear();
            gray.extend(scratch.as_chunks::<3>().0.iter().map(|&p| gray_of_rgb8(p)));
            Image::from_vec(width, height, gray).map(Pixels::Gray8)
        }
    };
    let rest = head.size - need as u64;
    if std::io::copy(&mut nut.reader.by_ref().take(rest), &mut std::io::sink())? < rest {
        return Err(std::io::ErrorKind::UnexpectedEof.into());
    }
    pixels.ok_or_else(|| wrong("a picture changes its size"))
}

/// Reads `need` bytes of the picture into `scratch`.
fn read_into<R: Read>(nut: &mut Nut<R>, need: usize, scratch: &mut Vec<u8>) -> std::io::Result<()> {
    scratch.resize(need, 0);
    nut.reader.read_exact(scratch)
}
