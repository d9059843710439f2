//! Standard error and standard output that are full, closed, or whose reader has gone: no panic, no lost run, a code that tells.
#![cfg(target_os = "linux")] // /dev/full

use super::{boresight, clip, stderr};
use std::fs::File;
use std::path::Path;
use std::process::{Command, Output, Stdio};

fn full() -> Stdio {
    Stdio::from(File::options().write(true).open("/dev/full").unwrap())
}

/// A folder with small inputs for every command: a scene, its tracks, its detections, an image.
pub(super) fn inputs() -> tempfile::TempDir {
    let dir = tempfile::tempdir().unwrap();
    let at = |args: &[&str]| {
        let out = boresight().current_dir(dir.path()).args(args).output().unwrap();
        assert!(out.status.success(), "{args:?}: {}", stderr(&out));
        out
    };
    at(&["simulate", "ds2", "--frames", "24", "--format", "y4m", "-o", "sim"]);
    at(&["track", "sim/frames.y4m", "--config", "sim/track.toml", "-o", "run", "--no-video", "-q"]);
    for (kind, table) in [("truth", "sim/gt.txt"), ("result", "run/mot.txt")] {
        std::fs::create_dir_all(dir.path().join("pairs").join(kind)).unwrap();
        for name in ["a.txt", "b.txt"] {
            std::fs::copy(dir.path().join(table), dir.path().join("pairs").join(kind).join(name)).unwrap();
        }
    }
    std::fs::write(dir.path().join("radars.toml"), "[[radars]]\nname = \"far\"\nscan-period-s = 0.5\n").unwrap();
    dir
}

/// Every command once, with outputs in `out/`: arguments, and the files that are made there.
pub(super) const COMMANDS: [(&str, &[&str]); 18] = [
    (
        "track sim/frames.y4m --config sim/track.toml -o out --json --camera --png --summary --thumbnail \
         --also geff,trackmate-xml,cvat,mot-zip,napari",
        &[
            "tracks.csv",
            "detections.csv",
            "mot.txt",
            "tracks.jsonl",
            "camera.csv",
            "annotated.mp4",
            "frames/frame_000023.png",
            "report.html",
            "summary.json",
            "thumbnail.png",
            "tracks.geff/.zattrs",
            "trackmate.xml",
            "cvat.xml",
            "mot.zip",
            "napari.npy",
            "config.toml",
        ],
    ),
    ("track run/detections.csv -o out", &["tracks.csv", "detections.csv", "mot.txt", "report.html", "config.toml"]),
    ("detect sim/frames.y4m --config sim/track.toml -o out/d.csv", &["d.csv"]),
    (
        "evaluate sim/gt.txt run/tracks.csv --csv out/e.csv --json out/e.json --html out/e.html",
        &["e.csv", "e.json", "e.html"],
    ),
    ("evaluate sim/frames.y4m sim/frames.y4m --csv out/i.csv --json out/i.json", &["i.csv", "i.json"]),
    ("evaluate pairs/truth pairs/result --html out/s.html --json out/s.json", &["s.html", "s.json"]),
    ("fuse run/tracks.csv run/tracks.csv -o out/fused.csv", &["fused.csv"]),
    ("smooth run/tracks.csv -o out/smooth.csv", &["smooth.csv"]),
    ("stitch run/tracks.csv -o out/stitched.txt --smooth", &["stitched.txt"]),
    ("convert run/tracks.csv out/c.csv --to csv", &["c.csv"]),
    ("convert run/tracks.csv out/g --to geff", &["g/edges/ids/0.0"]),
    ("preview sim/frames.y4m -q -o out/p.html", &["p.html"]),
    ("sensor sim/frames.y4m -o out/s.html", &["s.html"]),
    ("track run/detections.csv --frames sim/frames.y4m -o out", &["tracks.csv", "annotated.mp4", "report.html"]),
    ("convert run/tracks.csv out/ctc --to ctc --size 64x64", &["ctc/res_track.txt", "ctc/mask023.tif"]),
    ("reproduce srif-1 --runs 2 -o out", &["index.html", "reproduce.json"]),
    (
        "simulate ds2 --frames 9 -o out",
        &["frames/frame_000008.png", "truth.csv", "gt.txt", "frames.csv", "track.toml", "scene.toml"],
    ),
    ("simulate sim/truth.csv --radars radars.toml -o out", &["far.csv", "far-plots.csv"]),
];

pub(super) fn command(dir: &Path, line: &str) -> Command {
    let mut command = boresight();
    command.current_dir(dir).args(line.split_whitespace());
    command
}

#[test]
fn words_that_cannot_be_said_do_not_lose_a_run() {
    let dir = inputs();
    let out = dir.path().join("out");
    for (line, files) in COMMANDS {
        for how in ["full", "gone"] {
            let _ = std::fs::remove_dir_all(&out);
            std::fs::create_dir(&out).unwrap();
            let mut command = command(dir.path(), line);
            command.stdout(Stdio::null());
            let code = if how == "full" {
                command.stderr(full()).status().unwrap()
            } else {
                let mut child = command.stderr(Stdio::piped()).spawn().unwrap();
                drop(child.stderr.take());
                child.wait().unwrap()
            };
            assert_eq!(code.code(), Some(0), "{line}, standard error {how}");
            for file in files {
                assert!(out.join(file).metadata().is_ok_and(|m| m.len() > 0), "{line}, {how}: {file}");
            }
        }
    }
    // An error that cannot be said keeps its code.
    assert_eq!(command(dir.path(), "track none.mp4").stderr(full()).status().unwrap().code(), Some(3));
    assert_eq!(command(dir.path(), "trak").stderr(full()).status().unwrap().code(), Some(2));
}

/// What prints to standard output.
pub(super) const PRINTING: [&str; 15] = [
    "detect sim/frames.y4m --config sim/track.toml -q -o -",
    "simulate ds2 --frames 24 -o -",
    "simulate ds2 --print",
    "convert run/tracks.csv - --to mot",
    "evaluate sim/gt.txt run/tracks.csv",
    "evaluate sim/frames.y4m sim/frames.y4m",
    "config",
    "config --schema",
    "completions bash",
    "config --list filters",
    "config --explain tracker",
    "sensor sim/frames.y4m -o sensor.html",
    "reproduce --list",
    "reproduce srif-1 --runs 2",
    "--help",
];

fn with_stdout(dir: &Path, line: &str, to: Stdio) -> Output {
    command(dir, line).stdout(to).stderr(Stdio::piped()).output().unwrap()
}

#[test]
fn a_full_standard_output_is_an_error_of_the_output() {
    let dir = inputs();
    for line in PRINTING {
        let out = with_stdout(dir.path(), line, full());
        let text = stderr(&out);
        assert_eq!(out.status.code(), Some(5), "{line}: {text}");
        assert!(text.contains("error: ") && text.contains("No space left") && !text.contains("panicked"), "{text}");
    }
}

#[test]
fn a_reader_that_leaves_ends_a_command_without_a_word() {
    let dir = inputs();
    for line in PRINTING {
        let mut child = command(dir.path(), line).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
        drop(child.stdout.take());
        let out = child.wait_with_output().unwrap();
        let text = stderr(&out);
        assert_eq!(out.status.code(), Some(0), "{line}: {text}");
        assert!(!text.contains("error") && !text.contains("panicked") && !text.contains("pipe"), "{line}: {text}");
    }
}

#[test]
fn scores_that_cannot_be_shown_are_still_written() {
    let dir = inputs();
    let line = "evaluate sim/gt.txt run/tracks.csv --csv e.csv --json none/e.json --html e.html";
    let out = with_stdout(dir.path(), line, full());
    assert_eq!(out.status.code(), Some(5), "{}", stderr(&out));
    assert!(stderr(&out).contains("none/e.json") && stderr(&out).contains("standard output"), "{}", stderr(&out));
    assert!(dir.path().join("e.csv").exists() && dir.path().join("e.html").exists());
}

#[test]
fn a_demand_that_is_not_met_is_told_though_the_reader_left() {
    let dir = inputs();
    let line = "evaluate sim/gt.txt run/tracks.csv --require MOTA=2";
    let mut child = command(dir.path(), line).stdout(Stdio::piped()).stderr(Stdio::null()).spawn().unwrap();
    drop(child.stdout.take());
    assert_eq!(child.wait().unwrap().code(), Some(1));
}

#[test]
fn a_reader_of_the_words_who_leaves_after_the_first_does_not_end_the_run() {
    // The README's own command, with its words cut off: `2>&1 | head -1`.
    let dir = tempfile::tempdir().unwrap();
    let mut child = boresight()
        .arg("track")
        .arg(clip())
        .arg("-o")
        .arg(dir.path())
        .args(["--no-video", "--no-report"])
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let mut first = [0; 1];
    std::io::Read::read_exact(child.stderr.as_mut().unwrap(), &mut first).unwrap();
    drop(child.stderr.take());
    assert_eq!(child.wait().unwrap().code(), Some(0));
    assert!(dir.path().join("tracks.csv").exists());
}

#[test]
fn a_standard_input_that_never_ends_or_is_empty_is_refused() {
    for (file, says) in [("/dev/full", "expected YUV4MPEG2"), ("/dev/null", "nothing came")] {
        for line in ["track - -o out", "detect - -o d.csv"] {
            let dir = tempfile::tempdir().unwrap();
            let out = command(dir.path(), line).stdin(Stdio::from(File::open(file).unwrap())).output().unwrap();
            assert!(out.status.code() == Some(3) && stderr(&out).contains(says), "{line} <{file}: {}", stderr(&out));
            assert_eq!(std::fs::read_dir(dir.path()).unwrap().count(), 0, "{line} <{file}");
        }
    }
}
