//! Tables of other programs, as they really come: counts and numbers taken from the files with other tools.

use crate::needs::{data, real_tests};
use boresight::FrameSource;
use boresight::io::{Colour, OpenOptions, Pictures, SequenceInfo, TableOptions, open, read_detections, read_tracks};

real_tests! {
    trackpy_btrack_and_mot_tables_are_read_whole
        needs [
            "trackpy_bulk_water/trackpy_link_first60.csv",
            "btrack_examples/objects.csv",
            "mot15_text/PETS09-S2L1/det_frcnn_sort.txt",
            "ir_drone_svanstrom/IR_BIRD_027.gt.csv",
        ];
    the_rate_of_a_mot_sequence_is_found_beside_its_table needs ["pets09_vtest/det_acf.txt"];
    pictures_of_a_mot_sequence_are_those_of_its_table
        needs ["mot15_text/TUD-Campus/det_acf.txt", "dctracking_pets_tud/TUD-Campus/img1/000071.jpg"];
    btrack_tracks_keep_their_identities needs ["btrack_examples/tracks.csv"];
}

fn trackpy_btrack_and_mot_tables_are_read_whole() {
    // Rows counted with wc -l, frames from the first and last rows, values from the first row.
    let cases = [
        ("trackpy_bulk_water/trackpy_link_first60.csv", None, 60, (334.7788, 22.028)),
        ("btrack_examples/objects.csv", Some(52581), 500, (517.5595092773438, 9.081632614135742)),
        (
            "mot15_text/PETS09-S2L1/det_frcnn_sort.txt",
            None,
            795,
            (649.441 - 1.5 + 44.417 / 2.0, 231.502 - 1.5 + 86.13 / 2.0),
        ),
        ("ir_drone_svanstrom/IR_BIRD_027.gt.csv", None, 0, (142.0 - 0.5 + 20.1245 / 2.0, 29.0 - 0.5 + 17.1654 / 2.0)),
    ];
    for (file, rows, frames, (x, y)) in cases {
        let path = data(file);
        let table = read_detections(&path, &TableOptions::default()).unwrap();
        let n: usize = table.scans.iter().map(|s| s.detections.len()).sum();
        assert_eq!(n as u64, table.n_rows, "{file}");
        assert_eq!(table.n_skipped, 0, "{file}");
        if let Some(rows) = rows {
            assert_eq!(n, rows, "{file}");
        }
        if frames > 0 {
            assert_eq!(table.scans.len(), frames, "{file}");
        }
        let first = &table.scans[0].detections[0];
        assert!((first.position.x - x).abs() < 1e-9 && (first.position.y - y).abs() < 1e-9, "{file}: {first:?}");
    }
}

fn the_rate_of_a_mot_sequence_is_found_beside_its_table() {
    let path = data("pets09_vtest/det_acf.txt");
    let table = read_detections(&path, &TableOptions::default()).unwrap();
    let ini = std::fs::read_to_string(path.with_file_name("seqinfo.ini")).unwrap();
    let rate: f64 = ini.lines().find_map(|l| l.strip_prefix("frameRate=")).unwrap().trim().parse().unwrap();
    assert_eq!(table.rate_hz, rate);
}

fn pictures_of_a_mot_sequence_are_those_of_its_table() {
    let (path, folder) = (data("mot15_text/TUD-Campus/det_acf.txt"), data("dctracking_pets_tud/TUD-Campus/img1"));
    let table = read_detections(&path, &TableOptions::default()).unwrap();
    let sequence = SequenceInfo::beside(&path);
    assert_eq!((sequence.n_frames, sequence.size_px), (Some(71), Some((640.0, 480.0))));
    let options = OpenOptions::default();
    let mut pictures = Pictures::open(folder.to_str().unwrap(), &options, &table, &sequence).unwrap();
    for want in &table.scans {
        let frame = pictures.next_frame().unwrap().unwrap();
        assert_eq!((frame.index, frame.time), (want.index, want.time));
        let one = folder.join(format!("{:06}.jpg", want.index.0 + 1));
        let rgb = OpenOptions { colour: Colour::Rgb, ..options.clone() };
        let alone = open(one.to_str().unwrap(), &rgb).unwrap().next_frame().unwrap().unwrap();
        assert!(frame.pixels == alone.pixels, "{}", one.display());
    }
    assert!(pictures.next_frame().unwrap().is_none() && pictures.warnings().is_empty(), "{:?}", pictures.warnings());
}

fn btrack_tracks_keep_their_identities() {
    let path = data("btrack_examples/tracks.csv");
    let table = read_tracks(&path, &TableOptions::default()).unwrap();
    let rows: usize = table.frames.iter().map(|f| f.tracks.len()).sum();
    assert_eq!(rows, 52678); // SOURCE.md
    assert_eq!(table.frames[0].tracks[0].id.0, 1);
}
