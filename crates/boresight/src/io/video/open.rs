//! Opens a video: H.264 in MP4 in process, everything else through the program `ffmpeg`.

use super::{ffmpeg, mp4};
use crate::io::options::OpenOptions;
use crate::{Error, ErrorKind, FrameSource, Result};
use std::ffi::OsStr;
use std::path::Path;

/// The program that reads what is not read in process.
const FFMPEG: &str = "ffmpeg";

/// Opens an MP4 or MOV file: H.264 in process with the file's own times, anything else in it through `ffmpeg`.
/// # Errors
/// [`ErrorKind::NotFound`] or [`ErrorKind::Damaged`] for the file, [`ErrorKind::MissingTool`] if
/// its video is not H.264 (or 4:4:4 or lossless) and there is no `ffmpeg`.
pub fn open_mp4(path: &Path, options: &OpenOptions) -> Result<Box<dyn FrameSource>> {
    match mp4::open(path, options)? {
        mp4::Opened::Source(source) => Ok(source),
        mp4::Opened::Other(why) => match ffmpeg::open(OsStr::new(FFMPEG), path.as_os_str(), options) {
            Err(e) if e.kind() == ErrorKind::MissingTool => Err(Error::new(e.kind(), why.to_string()).hint(format!(
                "such a video is read through the program ffmpeg, which is not installed; {}",
                ffmpeg::INSTALL
            ))),
            other => other,
        },
    }
}

/// Opens anything that the program `ffmpeg` reads: a file, an address (`rtsp://`, `http://`), a camera (`/dev/video0`).
/// # Errors
/// [`ErrorKind::MissingTool`] if there is no `ffmpeg` on the PATH, else what it says of the input.
pub fn open_ffmpeg(input: impl AsRef<OsStr>, options: &OpenOptions) -> Result<Box<dyn FrameSource>> {
    ffmpeg::open(OsStr::new(FFMPEG), input.as_ref(), options)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_missing_ffmpeg_is_named_with_the_way_to_install_it() {
        let here = Path::new(env!("CARGO_MANIFEST_DIR")).join("Cargo.toml");
        let name = OsStr::new("no-such-program-as-ffmpeg");
        let err = ffmpeg::open(name, here.as_os_str(), &OpenOptions::default()).err().unwrap();
        assert_eq!(err.kind(), ErrorKind::MissingTool);
        let text = err.to_string();
        assert!(
            text.contains("not installed") && text.contains("apt install ffmpeg") && text.contains("winget"),
            "{text}"
        );
    }
}
