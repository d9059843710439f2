//! Fuzz target: the `seqinfo.ini` beside a table.
#![no_main]

use boresight::io::{TableOptions, read_detections};

libfuzzer_sys::fuzz_target!(|data: &[u8]| {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let table = folder.path().join("det.txt");
    std::fs::write(&table, "1,-1,10,20,5,5,1,-1,-1,-1\n2,-1,11,20,5,5,1,-1,-1,-1\n").expect("a file that can be written");
    std::fs::write(folder.path().join("seqinfo.ini"), data).expect("a file that can be written");
    let rate_hz = read_detections(&table, &TableOptions::default()).expect("the table is sound").rate_hz;
    assert!(rate_hz > 0.0 && rate_hz.is_finite());
});
