//! Fuzz target: a radar's plots with own ship's table beside them (the bytes behind a line `===`), and ships' reports.
#![no_main]

use boresight::io::{AzimuthFrom, TableOptions, read_detections, read_ship_reports};
use boresight_fuzz::{parts, with_folder};

libfuzzer_sys::fuzz_target!(|data: &[u8]| {
    let files: Vec<(&str, &[u8])> = ["plots.csv", "ownship.csv"].into_iter().zip(parts(data)).collect();
    with_folder(&files, |folder| {
        let table = folder.join("plots.csv");
        for azimuth_from in [AzimuthFrom::North, AzimuthFrom::Bow] {
            let mut options = TableOptions { skip_bad_rows: true, ..TableOptions::default() };
            options.radar.azimuth_from = azimuth_from;
            if let Ok(read) = read_detections(&table, &options) {
                assert!(read.scans.windows(2).all(|w| w[0].time < w[1].time));
            }
        }
        let _ = read_ship_reports(&table, true);
    });
});
