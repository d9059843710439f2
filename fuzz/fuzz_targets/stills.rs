//! Fuzz target: PNG, JPEG, BMP and PNM images.
#![no_main]

use boresight_fuzz::{frames, options};

libfuzzer_sys::fuzz_target!(|data: &[u8]| {
    // Animated PNG and unknown bitmaps would go to ffmpeg: the first frame header must be a still one.
    if data.get(37..41) == Some(b"acTL") {
        return;
    }
    frames(data, &[b"\x89PNG\r\n\x1a\n", b"\xff\xd8\xff", b"P5\n", b"P6\n", b"P2\n", b"P3\n", b"P4\n", b"Pf\n"], ".img", &options());
});
