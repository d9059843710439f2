//! Fuzz target: YUV4MPEG2 streams.
#![no_main]

use boresight_fuzz::{catch_panics_of_others, frames, options};

libfuzzer_sys::fuzz_target!(init: catch_panics_of_others(), |data: &[u8]| frames(data, &[b"YUV4MPEG2"], ".y4m", &options()));
