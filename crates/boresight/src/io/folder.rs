//! A sequence of image files as frames: a folder, a glob, a numbered pattern or a single file.
//!
//! Files are taken in natural order of their names; each TIFF gives all its pages. All frames must have the size and
//! pixel type of the first one (RGB frames may be mixed with grey ones: these are expanded). Damage: a file that cannot
//! be read is an error that names it; but if nothing readable follows (the last file of an interrupted recording, or a
//! run of empty files behind a full disk), the sequence ends before it with a warning that counts the loss.

use super::numbered::{self, Numbering};
use super::options::OpenOptions;
use super::sniff::{self, Content, sniff};
use super::stack::tiff::{TiffPages, count_pages};
use super::still;
use crate::{
    Error, ErrorKind, Frame, FrameIndex, FrameSource, Image, PixelKind, Pixels, Result, SourceInfo, Timestamp, Wanted,
};
use std::fs::File;
use std::io::{BufReader, Read};
use std::path::{Path, PathBuf};

/// Image files as frames.
pub struct ImageFiles {
    info: SourceInfo,
    files: Vec<PathBuf>,
    /// Number of the file to be read next.
    next_file: usize,
    /// A TIFF whose pages are being read, and its file's number.
    pages: Option<(usize, TiffPages<BufReader<File>>)>,
    /// The first frame, read at opening.
    first: Option<Pixels>,
    first_file: PathBuf,
    n_given: u64,
    /// Numbers in the files' names, if they have holes.
    numbering: Option<Numbering>,
    /// Place of the newest frame in the full sequence.
    place: u64,
    options: OpenOptions,
    bytes: Vec<u8>,
    warnings: Vec<String>,
    /// Which frames are wanted, if not all.
    wanted: Option<Wanted>,
}

opaque_debug!(ImageFiles);

impl ImageFiles {
    /// Opens a list of files, already in order.
    /// # Errors
    /// If the list is empty or its first image cannot be read.
    pub fn open(label: &str, files: Vec<PathBuf>, options: &OpenOptions) -> Result<Self> {
        let first_file = files.first().cloned().ok_or_else(|| {
            Error::new(ErrorKind::NotFound, "no image files: expected PNG, JPEG, TIFF, PNM or BMP").at(label)
        })?;
        let info = SourceInfo {
            label: label.to_string(),
            reader: String::new(),
            width: 0,
            height: 0,
            kind: PixelKind::Gray8,
            n_frames: None,
            rate_hz: Some(options.rate_hz),
            true_times: false,
        };
        let mut source = Self {
            info,
            files,
            next_file: 0,
            pages: None,
            first: None,
            first_file,
            n_given: 0,
            numbering: None,
            place: 0,
            options: options.clone(),
            bytes: Vec::new(),
            warnings: Vec::new(),
            wanted: None,
        };
        let first = source.read_pixels().map_err(|(_, e)| e)?;
        let (_, first) = first.ok_or_else(|| Error::new(ErrorKind::Damaged, "it holds no image").at(label))?;
        source.info.width = first.width();
        source.info.height = first.height();
        source.info.kind = first.kind();
        let one_tiff = source.pages.is_some() && source.files.len() == 1;
        source.info.reader = match (&source.pages, source.files.len()) {
            (Some(_), 1) => "TIFF pages".to_string(),
            (_, 1) => "single image".to_string(),
            (_, _) => "image files".to_string(),
        };
        // Pages of several TIFF files are not counted beforehand.
        source.info.n_frames = match (&source.pages, one_tiff) {
            (None, _) => Some(source.files.len() as u64),
            (Some((_, pages)), true) => count_pages(&source.first_file).map(|n| pages.n_given_of(n)),
            (Some(_), false) => None,
        };
        source.first = Some(first);
        source.note_holes();
        source.note_several();
        Ok(source)
    }

    /// Where the names' numbers have holes, frames and times follow the numbers.
    fn note_holes(&mut self) {
        if let Some(found) = numbered::holes(&self.files) {
            let (before, behind) = found.first_hole;
            self.warnings.push(format!(
                "{}: {} numbers are missing in the names, the first between {} and {}: frames and times follow the numbers.",
                self.info.label,
                found.n_missing,
                self.files[before].display(),
                self.files[behind].display()
            ));
            self.numbering = Some(found);
        }
    }

    /// Two cameras in one folder are hardly one sequence.
    fn note_several(&mut self) {
        if let Some(beginnings) = numbered::several(&self.files) {
            self.warnings.push(format!(
                "{}: the names are of {} sequences ({}), taken as one behind the other; a pattern in quotes takes one: '{}*'.",
                self.info.label,
                beginnings.len(),
                beginnings.join(", "),
                self.files[0].with_file_name(&beginnings[0]).display()
            ));
        }
    }

    /// Reads the next image, with the number of its file; an error comes with the number of the file that failed.
    fn read_pixels(&mut self) -> std::result::Result<Option<(usize, Pixels)>, (usize, Error)> {
        loop {
            if let Some((at, pages)) = &mut self.pages {
                let at = *at;
                let page = pages.next_page();
                let number = pages.at();
                let page = page.map_err(|e| (at, e.at(format!("{}, page {number}", self.files[at].display()))))?;
                for note in pages.notes() {
                    let note = format!("{}: {note}.", self.info.label);
                    if !self.warnings.contains(&note) {
                        self.warnings.push(note);
                    }
                }
                match page {
                    Some(pixels) => return Ok(Some((at, pixels))),
                    None => self.pages = None,
                }
                continue;
            }
            let at = self.next_file;
            let Some(path) = self.files.get(at) else { return Ok(None) };
            self.next_file += 1;
            if self.is_unwanted(at) {
                return Ok(Some((at, Pixels::Gray8(Image::default()))));
            }
            match open_image(path, &self.options, &mut self.bytes).map_err(|e| (at, e.at(path.display())))? {
                Opened::Still(pixels) => return Ok(Some((at, pixels))),
                Opened::Pages(pages) => self.pages = Some((at, *pages)),
            }
        }
    }

    /// Whether a file of one picture is a frame that nobody wants.
    fn is_unwanted(&self, at: usize) -> bool {
        let place = self.numbering.as_ref().map_or(Some(at as u64), |n| n.place(at as u64));
        let one_each = self.info.n_frames == Some(self.files.len() as u64);
        one_each && self.wanted.as_ref().zip(place).is_some_and(|(wanted, place)| !wanted(place))
    }

    /// Whether nothing but empty files follows the file at `at`.
    fn is_tail(&self, at: usize) -> bool {
        self.files[at + 1..].iter().all(|f| f.metadata().is_ok_and(|m| m.len() == 0))
    }
}

enum Opened {
    Still(Pixels),
    Pages(Box<TiffPages<BufReader<File>>>),
}

fn open_image(path: &Path, options: &OpenOptions, bytes: &mut Vec<u8>) -> Result<Opened> {
    let cannot = |e: std::io::Error| Error::new(ErrorKind::NotFound, "cannot be read").because(e);
    let mut file = File::open(path).map_err(cannot)?;
    let head = sniff::read_up_to(&mut file, sniff::SNIFF_BYTES).map_err(cannot)?;
    let format = match sniff(&head) {
        Content::Empty => return Err(Error::new(ErrorKind::Damaged, "the file is empty (0 bytes)")),
        Content::Tiff => {
            std::io::Seek::rewind(&mut file).map_err(cannot)?;
            let pages = TiffPages::new(BufReader::new(file), options.colour, options.max_pixels)?
                .every(options.page_step, options.first_page);
            return Ok(Opened::Pages(Box::new(pages)));
        }
        Content::Apng => Content::Png,
        format if format.is_image() => format,
        format => {
            let what = format!("expected an image (PNG, JPEG, TIFF, PNM or BMP), found {}", format.name());
            let error = Error::new(ErrorKind::Damaged, what);
            let video = matches!(format, Content::Mp4 | Content::Y4m | Content::Gif);
            return Err(if video {
                error.hint("a glob or a folder takes images; give videos one at a time")
            } else {
                error
            });
        }
    };
    // No sound image needs more than this; a longer file is cut, and then fails as broken off.
    let limit = options.max_pixels.saturating_mul(16).saturating_add(1 << 24);
    bytes.clear();
    bytes.extend_from_slice(&head);
    file.take(limit).read_to_end(bytes).map_err(cannot)?;
    still::decode(bytes, format, options.colour, options.max_pixels).map(Opened::Still)
}

/// Fits a frame to the first one's pixel type where that loses nothing.
fn same_kind(pixels: Pixels, kind: PixelKind) -> Pixels {
    match (pixels, kind) {
        (Pixels::Gray8(gray), PixelKind::Rgb8) => {
            let rgb = gray.as_slice().iter().map(|&v| [v; 3]).collect();
            Image::from_vec(gray.width(), gray.height(), rgb).map_or(Pixels::Gray8(gray), Pixels::Rgb8)
        }
        (other, _) => other,
    }
}

impl FrameSource for ImageFiles {
    fn info(&self) -> &SourceInfo {
        &self.info
    }

    fn next_frame(&mut self) -> Result<Option<Frame>> {
        let n_given = self.n_given;
        let (at, pixels) = match self.first.take() {
            Some(first) => (0, first),
            None => match self.read_pixels() {
                Ok(None) => return Ok(None),
                Ok(Some((at, nothing))) if nothing.width() == 0 => (at, nothing),
                Ok(Some((at, pixels))) => {
                    let pixels = same_kind(pixels, self.info.kind);
                    if (pixels.width(), pixels.height()) != (self.info.width, self.info.height) {
                        return Err(self.differs(at, "size", (pixels.width(), pixels.height())));
                    }
                    if pixels.kind() != self.info.kind {
                        let what = format!(
                            "{}: {:?} pixels, but {} has {:?}",
                            self.files[at].display(),
                            pixels.kind(),
                            self.first_file.display(),
                            self.info.kind
                        );
                        return Err(Error::new(ErrorKind::Damaged, what)
                            .hint("one sequence has one type of pixels: read it as grey, or convert the odd files"));
                    }
                    (at, pixels)
                }
                Err((at, error)) if self.is_tail(at) => {
                    let n = self.files.len() - at;
                    let lost = match (&self.pages, n) {
                        (Some(_), 1) => "the rest of its pages is lost".to_string(),
                        (_, 1) => "1 frame is lost".to_string(),
                        (_, n) => format!("{n} frames are lost"),
                    };
                    self.warnings.push(format!("The end of the sequence is damaged, {lost}: {error}."));
                    self.next_file = self.files.len();
                    self.pages = None;
                    return Ok(None);
                }
                Err((at, error)) => {
                    self.next_file = at + 1;
                    self.pages = None;
                    return Err(error.hint("remove the damaged file, or write the sequence again"));
                }
            },
        };
        self.n_given += 1;
        // A name's number is that of a frame only as long as every file gave one.
        let own = self.numbering.as_ref().filter(|_| at as u64 == n_given).and_then(|n| n.place(n_given));
        if n_given > 0 {
            self.place = own.unwrap_or(0).max(self.place + 1);
        }
        let time = Timestamp::from_secs_f64(self.place as f64 / self.options.rate_hz);
        Ok(Some(Frame { index: FrameIndex(self.place), time, pixels }))
    }

    fn want_only(&mut self, wanted: Wanted) {
        self.wanted = Some(wanted);
    }

    fn entries(&self) -> Vec<u64> {
        match (&self.numbering, self.info.n_frames) {
            (Some(numbering), Some(_)) => numbering.places.clone(),
            (None, Some(n)) if n == self.files.len() as u64 => (0..n).collect(),
            _ => Vec::new(),
        }
    }

    fn warnings(&self) -> &[String] {
        &self.warnings
    }
}

impl ImageFiles {
    fn differs(&self, at: usize, what: &str, (w, h): (usize, usize)) -> Error {
        let text = format!(
            "the {what} changes: {} has {w} x {h} pixels, {} has {} x {}",
            self.files[at].display(),
            self.first_file.display(),
            self.info.width,
            self.info.height
        );
        Error::new(ErrorKind::Damaged, text)
            .at(&self.info.label)
            .hint("give the files of one sequence only, for example with a glob: 'frames/cam0_*.png'")
    }
}
