//! Fuzz target: a Cell Tracking Challenge folder, its table of lineages and its label images.
#![no_main]

use boresight::io::tracks::{ReadOptions, read};

libfuzzer_sys::fuzz_target!(|data: (&[u8], &[u8], &[u8])| {
    let folder = tempfile::tempdir().expect("a temporary folder");
    for (name, bytes) in [("man_track.txt", data.0), ("man_track000.tif", data.1), ("man_track001.tif", data.2)] {
        std::fs::write(folder.path().join(name), bytes).expect("a file that can be written");
    }
    let _ = read(folder.path(), None, ReadOptions::default(), false);
});
