//! What stands between this crate and the decoders of others: their panics and their words become errors of the file.

use crate::{Error, ErrorKind, Result};

/// Runs a foreign decoder; its panic becomes an error of the file.
pub(crate) fn guarded<T>(decode: impl FnOnce() -> Result<T>) -> Result<T> {
    std::panic::catch_unwind(std::panic::AssertUnwindSafe(decode))
        .unwrap_or_else(|_| Err(Error::new(ErrorKind::Damaged, "the decoder gave up on damaged data")))
}

/// An error of damaged data with the decoder's own words.
pub(crate) fn damaged(what: &str, cause: impl std::fmt::Display) -> Error {
    Error::new(ErrorKind::Damaged, format!("{what}: {cause}"))
}

/// Refuses a picture whose file is too short for what its header claims: it takes at least `least` bytes, however well it was packed.
pub(crate) fn backed(least: u64, bytes: usize, (width, height): (usize, usize)) -> Result<()> {
    if bytes as u64 >= least {
        return Ok(());
    }
    let what = format!("the header claims {width} x {height} pixels, for which {bytes} bytes are too few");
    Err(Error::new(ErrorKind::Damaged, what))
}
