//! Writes a file of scores.

use std::path::Path;

/// Writes a text.
/// # Errors
/// A file that cannot be written.
pub fn put(path: &Path, text: &str) -> boresight::Result<()> {
    std::fs::write(path, text).map_err(|e| {
        boresight::Error::new(boresight::ErrorKind::Output, "cannot be written").at(path.display()).because(e)
    })
}
