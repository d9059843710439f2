//! Fuzz target: tables of detections and of tracks, as the tracker reads them.
#![no_main]

use boresight::io::{TableOptions, read_detections, read_tracks};
use boresight_fuzz::with_file;

libfuzzer_sys::fuzz_target!(|data: &[u8]| {
    with_file(data, ".csv", |path| {
        for skip_bad_rows in [false, true] {
            let options = TableOptions { skip_bad_rows, ..TableOptions::default() };
            let _ = read_detections(path, &options);
            let _ = read_tracks(path, &options);
        }
    });
});
