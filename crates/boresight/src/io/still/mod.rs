//! One still image from the bytes of a file: PNG, JPEG, PNM, BMP (TIFF has pages: see `stack::tiff`).
//!
//! Every decoder reads the header first, refuses absurd sizes, and only then takes memory. A file that ends early is an
//! error here, never a half-grey picture. Decoders come from other crates: a panic inside one is turned into an error,
//! as a last line of defence behind the tests that mutate their input.

mod bmp;
mod jpeg;
mod png;
mod pnm;

use super::guard::guarded;
use super::options::Colour;
use super::sniff::Content;
use crate::{Error, ErrorKind, Pixels, Result};

/// Decodes one image file held in memory.
pub(crate) fn decode(bytes: &[u8], format: Content, colour: Colour, max_pixels: u64) -> Result<Pixels> {
    guarded(|| match format {
        Content::Png => png::decode(bytes, colour, max_pixels),
        Content::Jpeg => jpeg::decode(bytes, colour, max_pixels),
        Content::Pnm => pnm::decode(bytes, colour, max_pixels),
        Content::Bmp => bmp::decode(bytes, colour, max_pixels),
        other => Err(Error::new(ErrorKind::Unsupported, format!("{} is not read as a still image", other.name()))),
    })
}
