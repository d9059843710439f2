//! Fuzz target: tables of tracks, read, judged and written in every format.
#![no_main]

use boresight::io::tracks::{Format, ReadOptions, read, write};
use boresight::metrics::{MatchOptions, mot_scores};
use boresight_fuzz::with_file;

libfuzzer_sys::fuzz_target!(|data: &[u8]| {
    with_file(data, ".txt", |path| {
        for skip_bad_rows in [false, true] {
            let options = ReadOptions { skip_bad_rows, keep_extra: true, ..ReadOptions::default() };
            let Ok(file) = read(path, None, options, true) else { continue };
            let _ = mot_scores(&file.table, &file.table, &MatchOptions::default());
            for to in Format::ALL.into_iter().chain(Format::EXPORTS) {
                let _ = write(&file.table, to, &mut Vec::new());
            }
        }
    });
});
