//! Fuzz target: animated GIF.
#![no_main]

use boresight_fuzz::{frames, options};

libfuzzer_sys::fuzz_target!(|data: &[u8]| frames(data, &[b"GIF87a", b"GIF89a"], ".gif", &options()));
