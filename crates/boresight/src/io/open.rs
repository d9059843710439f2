//! Opens any input by what it is: a folder, a glob, a numbered pattern, a file (told by content), standard input.

use super::natural::natural_order;
use super::options::OpenOptions;
use super::sniff::{self, Content, sniff};
use super::stream::raw::RawFrames;
use super::stream::y4m::Y4m;
use crate::{Error, ErrorKind, FrameSource, Result};
use std::ffi::OsStr;
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
pub fn open(input: impl AsRef<OsStr>, options: &OpenOptions) -> Result<Box<dyn FrameSource>> {
    options.validate()?;
    let input = input.as_ref();
    if input == "-" {
        return open_stdin(options);
    }
    if input.to_str().is_some_and(|t| t.contains("://") || t.starts_with("/dev/video")) {
        return open_other_video(input, options);
    }
    let (path, label) = (Path::new(input), &*input.to_string_lossy());
    if path.is_dir() {
        if let Some(format) = options.raw {
            return Ok(Box::new(RawFrames::files(label, list_folder(path, |_| true)?, format, options)?));
        }
        return open_images(label, list_folder(path, has_image_name)?, options);
    }
    if path.exists() {
        return open_file(input, path, options);
    }
    #[cfg(feature = "images")]
    if let Some(files) = input.to_str().map(super::pattern::expand).transpose()?.flatten() {
        return open_images(label, files, options);
    }
    if path.is_symlink() {
        return Err(Error::new(ErrorKind::NotFound, "is a link that leads nowhere, or in a circle").at(label));
    }
    Err(Error::new(ErrorKind::NotFound, "no such file or folder")
        .at(label)
        .hint("give a video, an image, a folder of images, a quoted glob such as 'frames/*.png', an address, or - for standard input"))
}

/// The files that an input is read from, as far as it names any: itself, a folder and the images in it, the files of a pattern.
pub(super) fn files_of(path: &Path) -> Vec<PathBuf> {
    if path.is_dir() {
        let inside = std::fs::read_dir(path).into_iter().flatten().flatten().map(|e| e.path());
        return std::iter::once(path.to_path_buf()).chain(inside.filter(|p| has_image_name(p))).collect();
    }
    if path.exists() {
        return vec![path.to_path_buf()];
    }
    #[cfg(feature = "images")]
    if let Some(Ok(Some(files))) = path.to_str().map(super::pattern::expand) {
        // Frames are written by the folder.
        let folder =
            files.first().and_then(|f| f.parent()).filter(|f| !f.as_os_str().is_empty()).map(Path::to_path_buf);
        return files.into_iter().chain(folder).collect();
    }
    Vec::new()
}

/// The images that a folder or a pattern stands for, in their order; `None` for any other input.
#[cfg(feature = "images")]
pub(super) fn images_of(input: &OsStr) -> Option<Vec<PathBuf>> {
    let path = Path::new(input);
    if path.is_dir() {
        return list_folder(path, has_image_name).ok();
    }
    if path.exists() {
        return None;
    }
    super::pattern::expand(input.to_str()?).ok().flatten()
}

/// Whether an input is a file of text: a table of detections or tracks, not frames.
pub fn is_table(input: impl AsRef<OsStr>) -> bool {
    let path = Path::new(input.as_ref());
    let head = path.is_file().then(|| sniff::read_up_to(&mut File::open(path).ok()?, sniff::SNIFF_BYTES).ok());
    head.flatten().is_some_and(|head| matches!(sniff(&head), Content::Text | Content::Utf16))
}

fn open_file(input: &OsStr, path: &Path, options: &OpenOptions) -> Result<Box<dyn FrameSource>> {
    let label = &*input.to_string_lossy();
    if let Some(format) = options.raw {
        return Ok(Box::new(RawFrames::files(label, vec![path.to_path_buf()], format, options)?));
    }
    let cannot = |e: std::io::Error| Error::new(ErrorKind::NotFound, "cannot be read").at(label).because(e);
    let mut file = File::open(path).map_err(cannot)?;
    let data = file.metadata().map_err(cannot)?;
    let head = sniff::read_up_to(&mut file, sniff::SNIFF_BYTES).map_err(cannot)?;
    let whole = BufReader::new(Cursor::new(head.clone()).chain(file));
    match sniff(&head) {
        Content::Empty => Err(Error::new(ErrorKind::Damaged, "the file is empty (0 bytes)").at(label)),
        Content::Text | Content::Utf16 => {
            Err(Error::new(ErrorKind::Unsupported, "expected images or a video, found text")
                .at(label)
                .hint("a table of detections goes to 'boresight track' as it is, and needs no frames"))
        }
        Content::Y4m => Ok(Box::new(Y4m::open(label, whole, data.is_file().then_some(data.len()), options)?)),
        Content::Gif => open_gif(label, whole, options),
        content if content.is_image() && content != Content::Apng => {
            open_images(label, vec![path.to_path_buf()], options)
        }
        Content::Mp4 => open_mp4(path, options),
        _ => open_other_video(input, options),
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
        Content::Y4m => Ok(Box::new(Y4m::open(LABEL, whole, None, options)?)),
        Content::Gif => open_gif(LABEL, whole, options),
        Content::Empty => Err(Error::new(ErrorKind::Damaged, "nothing came (0 bytes)").at(LABEL)),
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
    files.sort_by(|a, b| natural_order(&a.to_string_lossy(), &b.to_string_lossy()).then_with(|| a.cmp(b)));
    Ok(files)
}

fn has_image_name(path: &Path) -> bool {
    const NAMES: [&str; 12] = ["png", "jpg", "jpeg", "jpe", "tif", "tiff", "pgm", "pbm", "ppm", "pnm", "pfm", "bmp"];
    path.extension().is_some_and(|e| NAMES.iter().any(|n| e.eq_ignore_ascii_case(n)))
}

#[cfg_attr(not(feature = "images"), allow(unused_variables))]
fn open_images(input: &str, files: Vec<PathBuf>, options: &OpenOptions) -> Result<Box<dyn FrameSource>> {
    #[cfg(feature = "images")]
    return Ok(Box::new(super::folder::ImageFiles::open(input, files, options)?));
    #[cfg(not(feature = "images"))]
    return Err(not_built(input, "images", "images"));
}

#[cfg_attr(not(feature = "images"), allow(unused_variables))]
fn open_gif(input: &str, whole: impl Read + Send + 'static, options: &OpenOptions) -> Result<Box<dyn FrameSource>> {
    #[cfg(feature = "images")]
    return Ok(Box::new(super::stack::gif::GifFrames::open(input, whole, options)?));
    #[cfg(not(feature = "images"))]
    return Err(not_built(input, "GIF", "images"));
}

#[cfg_attr(not(feature = "video"), allow(unused_variables))]
fn open_mp4(path: &Path, options: &OpenOptions) -> Result<Box<dyn FrameSource>> {
    #[cfg(feature = "video")]
    return super::video::open_mp4(path, options);
    #[cfg(not(feature = "video"))]
    return Err(not_built(&path.to_string_lossy(), "video", "video"));
}

/// What is neither image nor MP4: through `ffmpeg`.
#[cfg_attr(not(feature = "video"), allow(unused_variables))]
fn open_other_video(input: &OsStr, options: &OpenOptions) -> Result<Box<dyn FrameSource>> {
    #[cfg(feature = "video")]
    return super::video::open_ffmpeg(input, options);
    #[cfg(not(feature = "video"))]
    return Err(not_built(&input.to_string_lossy(), "video", "video"));
}

#[cfg(not(all(feature = "images", feature = "video")))]
fn not_built(input: &str, what: &str, feature: &str) -> Error {
    Error::new(ErrorKind::Unsupported, format!("this build of boresight does not read {what}"))
        .at(input)
        .hint(format!("switch on the feature '{feature}' of the crate boresight"))
}
