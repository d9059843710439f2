//! Fuzz target: a radar's plots with own ship's table beside them (the bytes behind a line `===`), and ships' reports.
#![no_main]

use boresight::io::{AzimuthFrom, TableOptions, read_detections, read_ship_reports};

libfuzzer_sys::fuzz_target!(|data: &[u8]| {
    const MARK: &[u8] = b"\n===\n";
    let at = data.windows(MARK.len()).position(|w| w == MARK);
    let (plots, own) = at.map_or((data, None), |i| (&data[..i], Some(&data[i + MARK.len()..])));
    let folder = tempfile::tempdir().expect("a temporary folder");
    let table = folder.path().join("plots.csv");
    std::fs::write(&table, plots).expect("a file that can be written");
    if let Some(own) = own {
        std::fs::write(folder.path().join("ownship.csv"), own).expect("a file that can be written");
    }
    for azimuth_from in [AzimuthFrom::North, AzimuthFrom::Bow] {
        let mut options = TableOptions { skip_bad_rows: true, ..TableOptions::default() };
        options.radar.azimuth_from = azimuth_from;
        if let Ok(read) = read_detections(&table, &options) {
            assert!(read.scans.windows(2).all(|w| w[0].time < w[1].time));
        }
    }
    let _ = read_ship_reports(&table, true);
});
