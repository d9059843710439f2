//! Fuzz target: the `seqinfo.ini` beside a table.
#![no_main]

use boresight::io::{TableOptions, read_detections};
use boresight_fuzz::with_folder;

libfuzzer_sys::fuzz_target!(|data: &[u8]| {
    let table: &[u8] = b"1,-1,10,20,5,5,1,-1,-1,-1\n2,-1,11,20,5,5,1,-1,-1,-1\n";
    with_folder(&[("det.txt", table), ("seqinfo.ini", data)], |folder| {
        let read = read_detections(folder.join("det.txt"), &TableOptions::default());
        let rate_hz = read.expect("the table is sound").rate_hz;
        assert!(rate_hz > 0.0 && rate_hz.is_finite());
    });
});
