//! Fuzz target: MP4 and MOV with H.264, in process.
#![no_main]

use boresight_fuzz::{catch_panics_of_others, options, with_file};

libfuzzer_sys::fuzz_target!(init: catch_panics_of_others(), |data: &[u8]| {
    // What is not H.264 would be handed to ffmpeg, another program.
    if !data.windows(4).any(|w| w == b"avc1" || w == b"avc3") {
        return;
    }
    with_file(data, ".mp4", |path| {
        let Ok(mut source) = boresight::io::video::open_mp4(path, &options()) else { return };
        for _ in 0..1000 {
            if !matches!(source.next_frame(), Ok(Some(_))) {
                break;
            }
        }
    });
});
