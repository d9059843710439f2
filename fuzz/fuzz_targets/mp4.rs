//! Any bytes given as an MP4 file: no panic, no hang, bounded memory.
//!
//! Run with `cargo fuzz run mp4 fuzz/corpus/mp4 crates/boresight/tests/data/video` (stable: `RUSTC_BOOTSTRAP=1`), from the
//! root, with `-rss_limit_mb=1024 -timeout=20`. What is not H.264 would be handed to ffmpeg; such input is passed over.
#![no_main]

use boresight::io::OpenOptions;
use boresight::io::video::open_mp4;
use libfuzzer_sys::fuzz_target;

fuzz_target!(|data: &[u8]| {
    let path = std::env::temp_dir().join(format!("boresight-fuzz-{}.mp4", std::process::id()));
    if std::fs::write(&path, data).is_err() {
        return;
    }
    let options = OpenOptions { max_pixels: 1 << 18, ..OpenOptions::default() };
    if let Ok(mut source) = open_mp4(&path, &options) {
        for _ in 0..1000 {
            match source.next_frame() {
                Ok(Some(frame)) => source.recycle(frame),
                Ok(None) | Err(_) => break,
            }
        }
    }
});
