//! Fuzz target: a Cell Tracking Challenge folder, its table of lineages and its label images (between lines `===`).
#![no_main]

use boresight::io::tracks::{ReadOptions, read};
use boresight_fuzz::{catch_panics_of_others, parts, with_folder};

libfuzzer_sys::fuzz_target!(init: catch_panics_of_others(), |data: &[u8]| {
    let names = ["man_track.txt", "man_track000.tif", "man_track001.tif"];
    let files: Vec<(&str, &[u8])> = names.into_iter().zip(parts(data)).collect();
    with_folder(&files, |folder| {
        let _ = read(folder, None, ReadOptions::default(), false);
    });
});
