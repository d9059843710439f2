//! Writes frames: a folder of PNG or PGM files, or one YUV4MPEG2 stream (a file or standard output).
//!
//! Files are named `frame_000000.png` by the frame's number; 16-bit frames keep their values (PGM: big end first, as the format asks).
//! Folder and file appear at the end, whole; frames of an earlier scene in the folder go then.

use boresight::io::{AtomicFile, AtomicFolder, remove_folder};
use boresight::{ASSUMED_RATE_HZ, Error, ErrorKind, Frame, Pixels, SourceInfo};
use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::Path;

/// How frames are written.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum FrameFormat {
    /// A folder of PNG files (8 or 16 bit grey).
    Png,
    /// A folder of PGM files (8 or 16 bit grey).
    Pgm,
    /// One YUV4MPEG2 file (8 bit grey), which carries the frame rate.
    Y4m,
}

impl FrameFormat {
    fn extension(self) -> &'static str {
        if self == Self::Pgm { "pgm" } else { "png" }
    }
}

/// An open output for frames.
pub enum FrameWriter {
    /// A folder and the format of its files.
    Folder(AtomicFolder, FrameFormat),
    /// A YUV4MPEG2 file.
    File(BufWriter<AtomicFile>),
    /// A YUV4MPEG2 stream.
    Stream(Box<dyn Write>),
}

/// Whether a file has the name of a frame.
fn is_frame(name: &str) -> bool {
    let number = name.strip_prefix("frame_").and_then(|n| n.strip_suffix(".png").or_else(|| n.strip_suffix(".pgm")));
    number.is_some_and(|n| n.len() >= 6 && n.bytes().all(|b| b.is_ascii_digit()))
}

/// An image in the folder that is no frame of an earlier scene, so not to be removed.
fn stranger(folder: &Path) -> Option<String> {
    const IMAGES: [&str; 6] = [".png", ".pgm", ".tif", ".tiff", ".jpg", ".bmp"];
    let names = std::fs::read_dir(folder).ok()?.flatten().filter_map(|e| e.file_name().into_string().ok());
    let image = |n: &str| IMAGES.iter().any(|e| n.to_lowercase().ends_with(e));
    names.filter(|n| image(n) && !is_frame(n)).min()
}

fn output_error(path: &Path, e: std::io::Error) -> Error {
    Error::new(ErrorKind::Output, "cannot be written").at(path.display()).because(e)
}

impl FrameWriter {
    /// Opens `dir/frames/` or `dir/frames.y4m`.
    pub fn create(dir: &Path, format: FrameFormat, info: &SourceInfo) -> boresight::Result<Self> {
        if format == FrameFormat::Y4m {
            let mut file = BufWriter::with_capacity(1 << 20, AtomicFile::create(dir.join("frames.y4m"))?);
            header(&mut file, FILE, info)?;
            return Ok(Self::File(file));
        }
        let path = dir.join("frames");
        if let Some(other) = stranger(&path) {
            return Err(Error::new(
                ErrorKind::Output,
                format!("holds {other}, which would be read as a frame of this run"),
            )
            .at(path.display())
            .hint("remove that folder, or choose another with --output"));
        }
        Ok(Self::Folder(AtomicFolder::create(path, is_frame)?, format))
    }

    /// Removes what an earlier scene wrote in another format.
    pub fn remove_others(dir: &Path, format: FrameFormat) {
        if format == FrameFormat::Y4m {
            remove_folder(&dir.join("frames"), is_frame);
        } else {
            let _ = std::fs::remove_file(dir.join("frames.y4m"));
        }
    }

    /// Starts a YUV4MPEG2 stream.
    pub fn stream(mut out: Box<dyn Write>, info: &SourceInfo) -> boresight::Result<Self> {
        header(&mut out, STDOUT, info)?;
        Ok(Self::Stream(out))
    }

    /// Writes one frame.
    pub fn put(&mut self, frame: &Frame) -> boresight::Result<()> {
        let (w, h) = (frame.pixels.width(), frame.pixels.height());
        match self {
            Self::Stream(out) => append(out, STDOUT, frame),
            Self::File(file) => append(file, FILE, frame),
            Self::Folder(folder, format) => {
                let dir = folder.part_path();
                let (sixteen, bytes) = match &frame.pixels {
                    Pixels::Gray8(i) => (false, i.as_slice().to_vec()),
                    Pixels::Gray16(i) => (true, i.as_slice().iter().flat_map(|v| v.to_be_bytes()).collect()),
                    _ => {
                        return Err(Error::new(ErrorKind::Unsupported, "only grey frames of 8 or 16 bit are written")
                            .at(dir.display()));
                    }
                };
                let path = dir.join(format!("frame_{:06}.{}", frame.index.0, format.extension()));
                let fail = |e| output_error(&path, e);
                let mut file = BufWriter::new(File::create(&path).map_err(fail)?);
                if *format == FrameFormat::Pgm {
                    let max = if sixteen { 65535 } else { 255 };
                    file.write_all(format!("P5\n{w} {h}\n{max}\n").as_bytes()).map_err(fail)?;
                    file.write_all(&bytes).map_err(fail)?;
                } else {
                    let mut encoder = png::Encoder::new(&mut file, w as u32, h as u32);
                    encoder.set_color(png::ColorType::Grayscale);
                    encoder.set_depth(if sixteen { png::BitDepth::Sixteen } else { png::BitDepth::Eight });
                    encoder.set_compression(png::Compression::Fast);
                    let written = encoder.write_header().and_then(|mut w| w.write_image_data(&bytes));
                    written.map_err(|e| output_error(&path, std::io::Error::other(e)))?;
                }
                file.flush().map_err(fail)
            }
        }
    }

    /// Ends the output.
    pub fn finish(self) -> boresight::Result<()> {
        match self {
            Self::Stream(mut out) => out.flush().map_err(|e| output_error(Path::new(STDOUT), e)),
            Self::File(file) => match file.into_inner() {
                Ok(file) => file.finish(),
                Err(e) => Err(output_error(Path::new(FILE), e.into_error())),
            },
            Self::Folder(folder, _) => folder.finish(),
        }
    }
}

/// What frames in one go are called in errors.
const FILE: &str = "frames.y4m";
const STDOUT: &str = "standard output";

fn header(out: &mut dyn Write, name: &str, info: &SourceInfo) -> boresight::Result<()> {
    if info.kind != boresight::PixelKind::Gray8 {
        return Err(Error::new(ErrorKind::Config, "YUV4MPEG2 holds 8-bit frames, these have more bits")
            .at("--format y4m")
            .hint("take --format png"));
    }
    // Rates are written as a fraction of thousandths.
    let rate = (info.rate_hz.unwrap_or(ASSUMED_RATE_HZ) * 1000.0).round().max(1.0) as u64;
    let text = format!("YUV4MPEG2 W{} H{} F{rate}:1000 Ip A1:1 Cmono\n", info.width, info.height);
    out.write_all(text.as_bytes()).map_err(|e| output_error(Path::new(name), e))
}

fn append(out: &mut dyn Write, name: &str, frame: &Frame) -> boresight::Result<()> {
    let Pixels::Gray8(image) = &frame.pixels else {
        return Err(Error::new(ErrorKind::Unsupported, "YUV4MPEG2 holds 8-bit grey frames").at(name));
    };
    let written = out.write_all(b"FRAME\n").and_then(|()| out.write_all(image.as_slice()));
    written.map_err(|e| output_error(Path::new(name), e))
}
