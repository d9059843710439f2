//! Fuzz target: the NUT stream that ffmpeg writes to its pipe.
#![no_main]

libfuzzer_sys::fuzz_target!(|data: &[u8]| {
    let _ = boresight::io::video::read_nut(data);
});
