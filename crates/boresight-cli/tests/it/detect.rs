//! `boresight detect`.

use super::{boresight, clip, read_csv, stderr, stdout, tracked};

#[test]
fn detections_are_those_that_track_writes() {
    let dir = tempfile::tempdir().unwrap();
    let file = dir.path().join("d.csv");
    let out = boresight().arg("detect").arg(clip()).arg("-o").arg(&file).output().unwrap();
    assert!(out.status.success(), "{}", stderr(&out));
    assert_eq!(std::fs::read(&file).unwrap(), std::fs::read(tracked().join("detections.csv")).unwrap());
    assert!(stderr(&out).contains("302 frames, "), "{}", stderr(&out));
}

#[test]
fn a_dash_writes_to_standard_output_and_a_reader_may_leave() {
    let out = boresight().arg("detect").arg(clip()).args(["-q", "-o", "-"]).output().unwrap();
    assert!(out.status.success());
    assert!(stdout(&out).starts_with("frame,time_s,x_px,y_px,"), "{:.80}", stdout(&out));
    assert_eq!(stdout(&out).lines().count(), 1 + read_csv(&tracked().join("detections.csv")).len());
}

#[test]
fn a_threshold_of_ones_own_replaces_the_chosen_one() {
    let out = boresight()
        .arg("detect")
        .arg(clip())
        .args(["-q", "-o", "-", "--set", "detector.threshold.band={low=225, high=255}"])
        .output()
        .unwrap();
    assert!(out.status.success(), "{}", stderr(&out));
    let text = stdout(&out);
    let mut lines = text.lines();
    let peak = lines.next().unwrap().split(',').position(|c| c == "peak").unwrap();
    let mut n = 0;
    for line in lines {
        let value: f64 = line.split(',').nth(peak).unwrap().parse().unwrap();
        assert!((225.0..=255.0).contains(&value), "{line}");
        n += 1;
    }
    assert!(n > 0);
}
