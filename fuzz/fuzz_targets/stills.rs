//! Fuzz target: PNG, JPEG, BMP and PNM images.
#![no_main]

use boresight_fuzz::{catch_panics_of_others, frames, options};

libfuzzer_sys::fuzz_target!(init: catch_panics_of_others(), |data: &[u8]| {
    // A bitmap is told by its header's length, which mutations seldom hit: they mutate what stands behind it.
    if let Some(rest) = data.strip_prefix(b"BM") {
        let mut bitmap = b"BM\0\0\0\0\0\0\0\0\x36\0\0\0\x28\0\0\0".to_vec();
        bitmap.extend(rest);
        return frames(&bitmap, &[], ".bmp", &options());
    }
    // Animated PNG and unknown bitmaps would go to ffmpeg: the first frame header must be a still one.
    if data.get(37..41) == Some(b"acTL") {
        return;
    }
    frames(data, &[b"\x89PNG\r\n\x1a\n", b"\xff\xd8\xff", b"P5\n", b"P6\n", b"P2\n", b"P3\n", b"P4\n", b"Pf\n"], ".img", &options());
});
