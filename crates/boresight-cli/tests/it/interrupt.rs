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

/// Pictures that show nothing, and a table of a target in them.
fn table_with_pictures(dir: &std::path::Path, n: usize) {
    let mut stream = b"YUV4MPEG2 W96 H64 F25:1 Cmono\n".to_vec();
    let mut table = "frame,x,y\n".to_string();
    for k in 0..n {
        stream.extend(b"FRAME\n");
        stream.extend(std::iter::repeat_n((k % 200) as u8, 96 * 64));
        table += &format!("{k},{},{}\n", 10.0 + 0.01 * k as f64, 30);
    }
    std::fs::write(dir.join("film.y4m"), stream).unwrap();
    std::fs::write(dir.join("d.csv"), table).unwrap();
}

#[test]
fn an_interrupted_table_with_pictures_stops_promptly_and_keeps_what_was_computed() {
    let dir = tempfile::tempdir().unwrap();
    let n = 6000;
    table_with_pictures(dir.path(), n);
    let mut child = boresight()
        .current_dir(dir.path())
        .args(["track", "d.csv", "--frames", "film.y4m", "-o", "out"])
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let part = dir.path().join("out/tracks.csv.part");
    let started = Instant::now();
    // Rows of the first scans are there long before the last scan is tracked.
    while part.metadata().map_or(0, |m| m.len()) < 20_000 {
        assert!(started.elapsed() < Duration::from_secs(60), "no rows yet");
        assert!(child.try_wait().unwrap().is_none(), "it was done before it could be told to end");
        std::thread::sleep(Duration::from_millis(2));
    }
    let told = Instant::now();
    assert!(Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap().success());
    let out = child.wait_with_output().unwrap();
    assert_eq!(out.status.code(), Some(130), "{}", stderr(&out));
    assert!(told.elapsed() < Duration::from_secs(5), "{:?}", told.elapsed());
    let rows = read_csv(&dir.path().join("out/tracks.csv"));
    let last = rows.iter().filter_map(|r| r["frame"].parse::<usize>().ok()).max();
    assert!(last > Some(50) && last < Some(n - 1), "{last:?}");
    assert!(!part.exists());
    let video = std::fs::read(dir.path().join("out/annotated.mp4")).unwrap();
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
