//! What the fuzz targets share: bytes as a file or a folder of files, and reading all frames of it with small limits.

#![forbid(unsafe_code)]

use boresight::io::{OpenOptions, open};
use std::path::Path;
use tempfile::{Builder, NamedTempFile, TempDir};

/// Largest frame that is let through, px.
pub const MAX_PIXELS: u64 = 1 << 16;
/// What stands between the files of an input that is several.
const MARK: &[u8] = b"\n===\n";

/// Lets panics of other crates through that this one catches and makes errors of the file (`io/guard.rs`). Those that are not caught end the run still, and
/// those of this crate at once. Called once, at the start.
pub fn catch_panics_of_others() {
    let abort = std::panic::take_hook();
    std::panic::set_hook(Box::new(move |info| {
        if !info.location().is_some_and(|l| l.file().contains("/registry/src/")) {
            abort(info);
        }
    }));
}

/// A folder in memory where the system has one: an input a file would else be an input a write to the disk.
fn in_memory() -> Option<&'static Path> {
    Some(Path::new("/dev/shm")).filter(|p| p.is_dir())
}

fn file(ending: &str) -> std::io::Result<NamedTempFile> {
    let mut builder = Builder::new();
    builder.suffix(ending);
    in_memory().map_or_else(|| builder.tempfile(), |p| builder.tempfile_in(p))
}

fn folder() -> std::io::Result<TempDir> {
    in_memory().map_or_else(tempfile::tempdir, tempfile::tempdir_in)
}

/// Writes the bytes to a file and hands it over.
pub fn with_file(bytes: &[u8], ending: &str, run: impl FnOnce(&Path)) {
    let file = file(ending).expect("a temporary file");
    std::fs::write(file.path(), bytes).expect("a file that can be written");
    run(file.path());
}

/// Writes files to a folder and hands it over.
pub fn with_folder(files: &[(&str, &[u8])], run: impl FnOnce(&Path)) {
    let folder = folder().expect("a temporary folder");
    for (name, bytes) in files {
        std::fs::write(folder.path().join(name), bytes).expect("a file that can be written");
    }
    run(folder.path());
}

/// The parts of an input that is several files: what stands between lines `===`.
pub fn parts(bytes: &[u8]) -> Vec<&[u8]> {
    let mut parts = Vec::new();
    let mut rest = bytes;
    while let Some(at) = rest.windows(MARK.len()).position(|w| w == MARK) {
        parts.push(&rest[..at]);
        rest = &rest[at + MARK.len()..];
    }
    parts.push(rest);
    parts
}

/// Reads up to a thousand frames of bytes that begin with `magic`; others are not this target's matter.
pub fn frames(bytes: &[u8], magic: &[&[u8]], ending: &str, options: &OpenOptions) {
    if !magic.is_empty() && !magic.iter().any(|m| bytes.starts_with(m)) {
        return;
    }
    with_file(bytes, ending, |path| {
        let Ok(mut source) = open(path, options) else { return };
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
