//! Fuzz target: YUV4MPEG2 streams.
#![no_main]

use boresight_fuzz::{frames, options};

libfuzzer_sys::fuzz_target!(|data: &[u8]| frames(data, &[b"YUV4MPEG2"], ".y4m", &options()));
