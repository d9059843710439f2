//! A table of detections drawn on its pictures: which picture is which frame, what is missing, what does not fit.

use crate::{run, run_ok, stderr};
use boresight::Pixels;
use boresight::io::OpenOptions;
use std::fmt::Write as _;
use std::path::Path;

const SIDES: [usize; 2] = [96, 64];

/// A sequence as MOTChallenge lays it out: `n` pictures from 000001 on, picture k of grey level 8k, and boxes of one target that goes right by 2 px a frame.
fn sequence(folder: &Path, n: usize) {
    std::fs::create_dir_all(folder.join("img1")).unwrap();
    std::fs::create_dir_all(folder.join("det")).unwrap();
    std::fs::write(folder.join("seqinfo.ini"), format!("[Sequence]\nimDir=img1\nframeRate=10\nseqLength={n}\n"))
        .unwrap();
    let mut table = String::new();
    for k in 1..=n {
        let mut picture = format!("P5\n{} {}\n255\n", SIDES[0], SIDES[1]).into_bytes();
        picture.resize(picture.len() + SIDES[0] * SIDES[1], 8 * k as u8);
        std::fs::write(folder.join(format!("img1/{k:06}.pgm")), picture).unwrap();
        writeln!(table, "{k},-1,{},21,9,9,1,-1,-1,-1", 11 + 2 * k).unwrap();
    }
    std::fs::write(folder.join("det/det.txt"), table).unwrap();
}

fn path(p: &Path) -> String {
    p.to_str().unwrap().to_string()
}

/// Runs `track` on the table of a sequence with more arguments.
fn track(folder: &Path, out: &str, more: &[&str]) -> std::process::Output {
    let (table, out) = (path(&folder.join("det/det.txt")), path(&folder.join(out)));
    run([&["track", &table, "-o", &out], more].concat())
}

/// The grey level of the last corner of each annotated picture, and its number.
fn corners(folder: &Path) -> Vec<(u64, u8)> {
    let mut names: Vec<_> = std::fs::read_dir(folder).unwrap().map(|e| e.unwrap().path()).collect();
    names.sort();
    names
        .iter()
        .map(|p| {
            let mut source = boresight::io::open(p.to_str().unwrap(), &OpenOptions::default()).unwrap();
            let Pixels::Rgb8(image) = source.next_frame().unwrap().unwrap().pixels else { panic!("{}", p.display()) };
            let number = p.file_stem().unwrap().to_str().unwrap().trim_start_matches("frame_").parse().unwrap();
            (number, image.as_slice().last().unwrap()[1])
        })
        .collect()
}

#[test]
fn a_table_is_drawn_on_the_pictures_of_its_numbers() {
    let dir = tempfile::tempdir().unwrap();
    sequence(dir.path(), 24);
    let pictures = path(&dir.path().join("img1"));
    let plain = track(dir.path(), "plain", &[]);
    assert!(stderr(&plain).contains("--frames") && plain.status.success(), "{}", stderr(&plain));
    let drawn = track(dir.path(), "drawn", &["--frames", &pictures, "--png", "-q"]);
    assert!(drawn.status.success() && stderr(&drawn).is_empty(), "nothing but errors: {}", stderr(&drawn));
    for name in ["tracks.csv", "detections.csv", "mot.txt"] {
        let of = |run: &str| std::fs::read(dir.path().join(run).join(name)).unwrap();
        assert!(of("plain") == of("drawn"), "{name}");
    }
    let out = dir.path().join("drawn");
    // Frame 0 of ours is frame 1 of the table and the picture 000001.
    let want: Vec<(u64, u8)> = (1..=24u8).map(|k| (u64::from(k) - 1, 8 * k)).collect();
    assert_eq!(corners(&out.join("frames")), want);
    assert!(out.join("annotated.mp4").metadata().unwrap().len() > 1000);
    assert!(std::fs::read_to_string(out.join("report.html")).unwrap().contains("data:image/png;base64,"));
}

#[test]
fn the_annotated_video_has_the_size_that_is_asked_for() {
    let dir = tempfile::tempdir().unwrap();
    sequence(dir.path(), 6);
    let pictures = path(&dir.path().join("img1"));
    let size = |out: &str, more: &[&str]| {
        let of = [&["--frames", &pictures, "--no-report", "-q"], more].concat();
        assert!(track(dir.path(), out, &of).status.success());
        let video = path(&dir.path().join(out).join("annotated.mp4"));
        let source = boresight::io::open(&video, &OpenOptions::default()).unwrap();
        [source.info().width, source.info().height]
    };
    // Small frames are enlarged until numbers can be read.
    assert_eq!(size("as-it-is", &[]), SIDES.map(|n| 8 * n));
    assert_eq!(size("own", &["--video-scale", "1"]), SIDES);
    assert_eq!(size("smaller", &["--video-scale", "1/2"]), SIDES.map(|n| n / 2));
    let wrong = track(dir.path(), "wrong", &["--frames", &pictures, "--video-scale", "0.5"]);
    assert!(wrong.status.code() == Some(2) && stderr(&wrong).contains("1/2 to 1/32"), "{}", stderr(&wrong));
}

#[test]
fn a_missing_picture_is_said_and_the_others_keep_their_frames() {
    let dir = tempfile::tempdir().unwrap();
    sequence(dir.path(), 24);
    for k in [1, 9, 10] {
        std::fs::remove_file(dir.path().join(format!("img1/{k:06}.pgm"))).unwrap();
    }
    let out = track(dir.path(), "out", &["--frames", &path(&dir.path().join("img1/*.pgm")), "--png"]);
    assert!(out.status.success() && stderr(&out).contains("3 frames of the table have no picture"), "{}", stderr(&out));
    let levels = corners(&dir.path().join("out/frames"));
    for (number, level) in levels {
        let black = matches!(number, 0 | 8 | 9);
        assert_eq!(level, if black { 0 } else { 8 * (number as u8 + 1) }, "frame {number}");
    }
}

#[test]
fn pictures_that_do_not_fit_the_table_are_refused_with_a_way_out() {
    let dir = tempfile::tempdir().unwrap();
    sequence(dir.path(), 24);
    let other = dir.path().join("other");
    sequence(&other, 12);
    let pictures = path(&other.join("img1"));
    let shorter = track(dir.path(), "out", &["--frames", &pictures]);
    let words = stderr(&shorter);
    assert!(!shorter.status.success() && words.contains("frames 1 to 24") && words.contains("hint:"), "{words}");
    assert!(!dir.path().join("out/tracks.csv").exists());
    std::fs::write(other.join("seqinfo.ini"), "imWidth=1920\nimHeight=1080\n").unwrap();
    let sized = track(&other, "out", &["--frames", &pictures]);
    assert!(!sized.status.success() && stderr(&sized).contains("seqinfo.ini says 1920 x 1080"), "{}", stderr(&sized));
    std::fs::remove_file(other.join("seqinfo.ini")).unwrap();
    let far: String = (1..=12).map(|k| format!("{k},-1,{},21,9,9,1,-1,-1,-1\n", 400 + 2 * k)).collect();
    std::fs::write(other.join("det/det.txt"), far).unwrap();
    let outside = track(&other, "out", &["--frames", &pictures]);
    assert!(!outside.status.success() && stderr(&outside).contains("lie outside"), "{}", stderr(&outside));
    let of_frames = run(["track", &pictures, "--frames", &pictures, "-o", &path(&dir.path().join("x"))]);
    assert!(!of_frames.status.success() && stderr(&of_frames).contains("leave --frames out"), "{}", stderr(&of_frames));
}

#[test]
fn a_video_gives_its_rate_to_a_table_without_times() {
    let dir = tempfile::tempdir().unwrap();
    let clip = path(&crate::clip());
    let table: String =
        (0..60).fold("frame,x,y\n".to_string(), |t, k| t + &format!("{k},{},{}\n", 100 + k, 100)).to_string();
    let table_path = dir.path().join("points.csv");
    std::fs::write(&table_path, table).unwrap();
    let out = path(&dir.path().join("out"));
    run_ok(["track", &path(&table_path), "--frames", &clip, "-o", &out, "--no-report"]);
    let rows = crate::read_csv(&dir.path().join("out/tracks.csv"));
    let last = rows.last().unwrap();
    assert!((crate::number(last, "time_s") - crate::number(last, "frame") / 30.0).abs() < 1e-3, "{last:?}");
    assert!(dir.path().join("out/annotated.mp4").exists());
}
