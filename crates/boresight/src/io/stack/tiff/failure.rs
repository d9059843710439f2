//! What the `tiff` crate complains of, as an error of the file.

use crate::io::guard::damaged;
use crate::{Error, ErrorKind};
use tiff::TiffError;

pub(super) fn failed(e: TiffError) -> Error {
    match e {
        TiffError::UnsupportedError(what) => {
            Error::new(ErrorKind::Unsupported, format!("a kind of TIFF that is not read: {what}"))
                .hint("rewrite it uncompressed with 8, 16 or 32 bits a sample, for example with tiffcp -c none")
        }
        TiffError::LimitsExceeded => Error::new(ErrorKind::Damaged, "its header asks for more memory than is allowed"),
        other => damaged("not a whole TIFF", other),
    }
}
