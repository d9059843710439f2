//! What the fuzz targets share: bytes as a file, and reading all frames of it with small limits.

#![forbid(unsafe_code)]

use boresight::io::{OpenOptions, open};
use std::path::Path;

/// Largest frame that is let through, px.
pub const MAX_PIXELS: u64 = 1 << 16;

/// Writes the bytes to a file in memory where the system has such a folder, and hands it over.
pub fn with_file(bytes: &[u8], ending: &str, run: impl FnOnce(&Path)) {
    let folder = Path::new("/dev/shm");
    let mut builder = tempfile::Builder::new();
    builder.suffix(ending);
    let file = if folder.is_dir() { builder.tempfile_in(folder) } else { builder.tempfile() };
    let file = file.expect("a temporary file");
    std::fs::write(file.path(), bytes).expect("a file that can be written");
    run(file.path());
}

/// Reads up to a thousand frames of bytes that begin with `magic`; others are not this target's matter.
pub fn frames(bytes: &[u8], magic: &[&[u8]], ending: &str, options: &OpenOptions) {
    if !magic.is_empty() && !magic.iter().any(|m| bytes.starts_with(m)) {
        return;
    }
    with_file(bytes, ending, |path| {
        let Ok(mut source) = open(&path.to_string_lossy(), options) else { return };
        for _ in 0..1000 {
            match source.next_frame() {
                Ok(Some(frame)) => assert!((frame.pixels.width() * frame.pixels.height()) as u64 <= MAX_PIXELS),
                _ => break,
            }
        }
    });
}

/// Options with the small limit.
pub fn options() -> OpenOptions {
    OpenOptions { max_pixels: MAX_PIXELS, ..OpenOptions::default() }
}
