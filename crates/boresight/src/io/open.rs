//! Opens any input by what it is: a folder, a glob, a numbered pattern, a file (told by content), standard input.

use super::folder::ImageFiles;
use super::gif_frames::GifFrames;
use super::natural::natural_order;
use super::raw::RawFrames;
use super::sniff::{self, Format, sniff};
use super::y4m::Y4m;
use super::{OpenOptions, video};
use crate::{Error, ErrorKind, FrameSource, Result};
use std::fs::File;
use std::io::{BufReader, Cursor, Read};
use std::path::{Path, PathBuf};

/// Opens a sequence of frames.
///
/// `input` is a folder of images, a glob (`'frames/*.png'`), a numbered pattern (`frame_%04d.png`), an image, a video
/// file, an address (`rtsp://`, `http://`), a camera (`/dev/video0`), or `-` for YUV4MPEG2 or raw frames on standard
/// input.
/// # Errors
/// [`ErrorKind::NotFound`] if nothing is there, [`ErrorKind::Damaged`] or [`ErrorKind::Unsupported`] if its first frame
/// cannot be read, [`ErrorKind::MissingTool`] if it needs an `ffmpeg` that is not installed.
pub fn open(input: &str, options: &OpenOptions) -> Result<Box<dyn FrameSource>> {
    options.validate()?;
    if input == "-" {
        return open_stdin(options);
    }
    if input.contains("://") || input.starts_with("/dev/video") {
        return video::open_ffmpeg(input, options);
    }
    let path = Path::new(input);
    if path.is_dir() {
        if let Some(format) = options.raw {
            return Ok(Box::new(RawFrames::files(input, list_folder(path, |_| true)?, format, options)?));
        }
        return Ok(Box::new(ImageFiles::open(input, list_folder(path, has_image_name)?, options)?));
    }
    if path.exists() {
        return open_file(input, path, options);
    }
    if let Some(files) = expand(input)? {
        return Ok(Box::new(ImageFiles::open(input, files, options)?));
    }
    Err(Error::new(ErrorKind::NotFound, "no such file or folder")
        .at(input)
        .hint("give a video, an image, a folder of images, a quoted glob such as 'frames/*.png', an address, or - for standard input"))
}

/// Whether an input is a file of text: a table of detections or tracks, not frames.
pub fn is_table(input: &str) -> bool {
    let path = Path::new(input);
    let head = path.is_file().then(|| sniff::read_up_to(&mut File::open(path).ok()?, sniff::SNIFF_BYTES).ok());
    head.flatten().is_some_and(|head| matches!(sniff(&head), Format::Text | Format::Utf16))
}

fn open_file(input: &str, path: &Path, options: &OpenOptions) -> Result<Box<dyn FrameSource>> {
    if let Some(format) = options.raw {
        return Ok(Box::new(RawFrames::files(input, vec![path.to_path_buf()], format, options)?));
    }
    let cannot = |e: std::io::Error| Error::new(ErrorKind::NotFound, "cannot be read").at(input).because(e);
    let mut file = File::open(path).map_err(cannot)?;
    let data = file.metadata().map_err(cannot)?;
    let head = sniff::read_up_to(&mut file, sniff::SNIFF_BYTES).map_err(cannot)?;
    let whole = BufReader::new(Cursor::new(head.clone()).chain(file));
    match sniff(&head) {
        Format::Empty => Err(Error::new(ErrorKind::Damaged, "the file is empty (0 bytes)").at(input)),
        Format::Text | Format::Utf16 => {
            Err(Error::new(ErrorKind::Unsupported, "expected images or a video, found text")
                .at(input)
                .hint("a table of detections goes to 'boresight track' as it is, and needs no frames"))
        }
        Format::Y4m => Ok(Box::new(Y4m::open(input, whole, data.is_file().then_some(data.len()), options)?)),
        Format::Gif => Ok(Box::new(GifFrames::open(input, whole, options)?)),
        format if format.is_image() && format != Format::Apng => {
            Ok(Box::new(ImageFiles::open(input, vec![path.to_path_buf()], options)?))
        }
        Format::Mp4 => video::open_mp4(path, options),
        _ => video::open_ffmpeg(input, options),
    }
}

/// Standard input: raw frames if their layout is given, else YUV4MPEG2 or GIF.
fn open_stdin(options: &OpenOptions) -> Result<Box<dyn FrameSource>> {
    const LABEL: &str = "standard input";
    let mut input = BufReader::with_capacity(1 << 20, std::io::stdin());
    if let Some(format) = options.raw {
        return Ok(Box::new(RawFrames::stream(LABEL, Box::new(input), format, options)));
    }
    let cannot = |e: std::io::Error| Error::new(ErrorKind::NotFound, "cannot be read").at(LABEL).because(e);
    let head = sniff::read_up_to(&mut input, sniff::SNIFF_BYTES).map_err(cannot)?;
    let whole = BufReader::new(Cursor::new(head.clone()).chain(input));
    match sniff(&head) {
        Format::Y4m => Ok(Box::new(Y4m::open(LABEL, whole, None, options)?)),
        Format::Gif => Ok(Box::new(GifFrames::open(LABEL, whole, options)?)),
        Format::Empty => Err(Error::new(ErrorKind::Damaged, "nothing came (0 bytes)").at(LABEL)),
        other => Err(Error::new(ErrorKind::Unsupported, format!("expected YUV4MPEG2, found {}", other.name()))
            .at(LABEL)
            .hint("pipe video in with: ffmpeg -i INPUT -f yuv4mpegpipe - | boresight track -; raw frames need their size and type")),
    }
}

/// The image files of a folder in natural order; hidden files and other kinds are passed over.
fn list_folder(folder: &Path, wanted: fn(&Path) -> bool) -> Result<Vec<PathBuf>> {
    let cannot = |e: std::io::Error| Error::new(ErrorKind::NotFound, "cannot be read").at(folder.display()).because(e);
    let mut files = Vec::new();
    let mut folders = Vec::new();
    for entry in std::fs::read_dir(folder).map_err(cannot)? {
        let path = entry.map_err(cannot)?.path();
        let hidden = path.file_name().is_none_or(|n| n.to_string_lossy().starts_with('.'));
        if hidden {
            continue;
        }
        if path.is_dir() {
            folders.push(path);
        } else if wanted(&path) {
            files.push(path);
        }
    }
    if files.is_empty() {
        folders.sort();
        let error = Error::new(ErrorKind::NotFound, "the folder holds no image files (PNG, JPEG, TIFF, PNM, BMP)")
            .at(folder.display());
        return Err(match folders.first() {
            Some(inner) => error.hint(format!("give the folder with the frames itself, perhaps {}", inner.display())),
            None => error,
        });
    }
    files.sort_by(|a, b| natural_order(&a.to_string_lossy(), &b.to_string_lossy()));
    Ok(files)
}

fn has_image_name(path: &Path) -> bool {
    const NAMES: [&str; 12] = ["png", "jpg", "jpeg", "jpe", "tif", "tiff", "pgm", "pbm", "ppm", "pnm", "pfm", "bmp"];
    path.extension().is_some_and(|e| NAMES.iter().any(|n| e.eq_ignore_ascii_case(n)))
}

/// The files that a glob or a numbered pattern names, in natural order; `None` if the text is neither.
fn expand(input: &str) -> Result<Option<Vec<PathBuf>>> {
    let pattern = match numbered(input) {
        Some(pattern) => pattern,
        None if input.contains(['*', '?', '[']) => input.to_string(),
        None => return Ok(None),
    };
    let paths = glob::glob(&pattern).map_err(|e| Error::new(ErrorKind::NotFound, e.to_string()).at(input))?;
    let mut files: Vec<PathBuf> = Vec::new();
    for path in paths {
        let path = path.map_err(|e| Error::new(ErrorKind::NotFound, e.to_string()).at(input))?;
        if path.is_file() && numbered(input).is_none_or(|_| matches_number(input, &path)) {
            files.push(path);
        }
    }
    if files.is_empty() {
        let error = Error::new(ErrorKind::NotFound, "no file has such a name").at(input);
        return Err(if input.contains('[') {
            error.hint(
                "[ ] stand for one of the letters between them; write [[] for a bracket itself, or give the folder",
            )
        } else {
            error
        });
    }
    files.sort_by(|a, b| natural_order(&a.to_string_lossy(), &b.to_string_lossy()));
    Ok(Some(files))
}

/// Splits `head%04dtail` at its number.
fn split_number(input: &str) -> Option<(&str, &str)> {
    let at = input.find('%')?;
    let rest = input[at + 1..].trim_start_matches(|c: char| c.is_ascii_digit());
    Some((&input[..at], rest.strip_prefix('d')?))
}

/// Turns `frame_%04d.png` into a glob.
fn numbered(input: &str) -> Option<String> {
    let (head, tail) = split_number(input)?;
    Some(format!("{}*{}", glob::Pattern::escape(head), glob::Pattern::escape(tail)))
}

fn matches_number(input: &str, path: &Path) -> bool {
    let Some((head, tail)) = split_number(input) else { return false };
    let name = path.to_string_lossy();
    let digits = name.strip_prefix(head.trim_start_matches("./")).or_else(|| name.strip_prefix(head));
    digits.and_then(|d| d.strip_suffix(tail)).is_some_and(|d| !d.is_empty() && d.bytes().all(|b| b.is_ascii_digit()))
}
