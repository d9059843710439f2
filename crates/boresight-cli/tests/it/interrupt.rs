//! Ctrl-C keeps what was computed: whole tables up to the last whole frame, exit code 130.
#![cfg(unix)]

use super::{boresight, read_csv, stderr};
use std::io::Write;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

/// A frame with a bright square that moves.
fn frame(k: usize) -> Vec<u8> {
    let mut bytes = b"FRAME\n".to_vec();
    let (w, h, x0) = (64, 48, 4 + k % 50);
    // A fixed pattern of noise, so that the background has a deviation.
    bytes.extend((0..w * h).map(|i| {
        let (x, y) = (i % w, i / w);
        let inside = (x0..x0 + 4).contains(&x) && (20..24).contains(&y);
        if inside { 220 } else { 40 + ((i * 7919 + k * 104_729) % 13) as u8 }
    }));
    bytes
}

#[test]
fn an_interrupted_run_keeps_whole_tables() {
    let dir = tempfile::tempdir().unwrap();
    let mut child = boresight()
        .args(["track", "-", "-o"])
        .arg(dir.path())
        .stdin(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let mut input = child.stdin.take().unwrap();
    input.write_all(b"YUV4MPEG2 W64 H48 F25:1 Cmono\n").unwrap();
    let part = dir.path().join("tracks.csv.part");
    let (mut k, mut told, started) = (0, None, Instant::now());
    loop {
        assert!(started.elapsed() < Duration::from_secs(60), "the run does not end");
        let gone = input.write_all(&frame(k)).is_err();
        k += 1;
        if gone {
            break;
        }
        if told.is_none() && k > 100 && part.exists() {
            assert!(Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap().success());
            told = Some(k);
        }
        if child.try_wait().unwrap().is_some() {
            break;
        }
    }
    drop(input);
    let out = child.wait_with_output().unwrap();
    assert_eq!(out.status.code(), Some(130), "{}", stderr(&out));
    let rows = read_csv(&dir.path().join("tracks.csv"));
    let last = rows.iter().map(|r| r["frame"].parse::<usize>().unwrap()).max();
    assert!(last >= Some(50) && last < Some(k), "{last:?} of {k} frames");
    assert!(!part.exists());
    let report = std::fs::read_to_string(dir.path().join("report.html")).unwrap();
    assert!(report.contains("The run was interrupted"));
    let video = std::fs::read(dir.path().join("annotated.mp4")).unwrap();
    assert!(video.windows(4).any(|w| w == b"moov"));
}

#[test]
fn a_killed_run_leaves_nothing_under_the_final_names() {
    let dir = tempfile::tempdir().unwrap();
    let mut child = boresight().args(["track", "-", "-q", "-o"]).arg(dir.path()).stdin(Stdio::piped()).spawn().unwrap();
    let mut input = child.stdin.take().unwrap();
    input.write_all(b"YUV4MPEG2 W64 H48 F25:1 Cmono\n").unwrap();
    for k in 0..100 {
        input.write_all(&frame(k)).unwrap();
    }
    child.kill().unwrap();
    child.wait().unwrap();
    for name in ["tracks.csv", "detections.csv", "mot.txt", "annotated.mp4", "report.html"] {
        assert!(!dir.path().join(name).exists(), "{name}");
    }
}
