//! Fuzz target: TIFF and BigTIFF pages.
#![no_main]

use boresight_fuzz::{catch_panics_of_others, frames, options};

libfuzzer_sys::fuzz_target!(init: catch_panics_of_others(), |data: &[u8]| {
    frames(data, &[b"II\x2a\0", b"MM\0\x2a", b"II\x2b\0", b"MM\0\x2b"], ".tif", &options());
});
