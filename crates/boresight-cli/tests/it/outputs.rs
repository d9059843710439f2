//! Outputs are whole or absent: a kill at any moment leaves whole files, new or earlier ones; an output never takes the input's place. A disk that fills: `faults`.
#![cfg(target_os = "linux")] // the signals' names

use super::streams::{COMMANDS, inputs};
use super::{boresight, stderr};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::Duration;

/// All files below a folder, by name.
pub(super) fn files(dir: &Path) -> BTreeMap<PathBuf, Vec<u8>> {
    let mut all = BTreeMap::new();
    for entry in std::fs::read_dir(dir).into_iter().flatten() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            all.extend(files(&path));
        } else {
            all.insert(path.clone(), std::fs::read(&path).unwrap());
        }
    }
    all
}

/// Frames of a scene as a stream.
fn stream(dir: &Path) -> Vec<u8> {
    std::fs::read(dir.join("sim/frames.y4m")).unwrap()
}

#[test]
fn a_kill_at_any_moment_leaves_whole_files() {
    let dir = inputs();
    let out = dir.path().join("out");
    let lines: Vec<&str> = COMMANDS.iter().map(|(line, _)| *line).collect();
    let (mut n_killed, mut n_runs) = (0, 0);
    // More on request: `BORESIGHT_KILLS=50` kills each command a hundred times.
    let rounds: usize = std::env::var("BORESIGHT_KILLS").ok().and_then(|n| n.parse().ok()).unwrap_or(2);
    for (k, line) in std::iter::repeat_n(&lines, rounds).flatten().enumerate() {
        let _ = std::fs::remove_dir_all(&out);
        std::fs::create_dir(&out).unwrap();
        let run = || {
            let mut command = boresight();
            command.current_dir(dir.path()).args(line.split_whitespace()).stdout(Stdio::null()).stderr(Stdio::null());
            command
        };
        let started = std::time::Instant::now();
        assert!(run().status().unwrap().success(), "{line}");
        let took = started.elapsed();
        let whole = files(&out);
        std::fs::remove_dir_all(&out).unwrap();
        std::fs::create_dir(&out).unwrap();
        for step in 0..2 {
            let mut child = run().spawn().unwrap();
            // Spread over nine tenths of what the run took: where they fall differs from time to time.
            std::thread::sleep(took.mul_f64(0.9 * f64::from((2 * k as u32 + step) % 20) / 19.0));
            child.kill().unwrap();
            n_runs += 1;
            n_killed += u32::from(!child.wait().unwrap().success());
            for (path, content) in files(&out) {
                let name = path.to_string_lossy().into_owned();
                let half = name.ends_with(".part") || name.contains(".part/");
                assert!(half || whole.get(&path) == Some(&content), "{line}: {name} is half");
            }
        }
        // The next run is not in the way of what a killed one left.
        assert!(run().status().unwrap().success(), "{line}");
        assert!(files(&out) == whole, "{line}: the run behind a kill");
    }
    eprintln!("{n_killed} of {n_runs} runs were killed before their end");
    assert!(n_killed > 10, "{n_killed} runs were killed: the moments test nothing");
}

#[test]
fn a_signal_before_the_first_frame_ends_with_130_and_writes_nothing() {
    let dir = inputs();
    let bytes = stream(dir.path());
    for signal in ["-INT", "-TERM"] {
        let mut child = boresight()
            .current_dir(dir.path())
            .args(["track", "-", "-o", "chosen"])
            .stdin(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        let mut input = child.stdin.take().unwrap();
        // Frames enough to open it, too few for the automatic choice: it waits for more.
        std::io::Write::write_all(&mut input, &bytes[..bytes.len() / 4]).unwrap();
        std::thread::sleep(Duration::from_millis(300));
        assert!(Command::new("kill").args([signal, &child.id().to_string()]).status().unwrap().success());
        let out = child.wait_with_output().unwrap();
        drop(input);
        assert_eq!(out.status.code(), Some(130), "{signal}: {}", stderr(&out));
        assert!(!dir.path().join("chosen/tracks.csv").exists());
    }
}

#[test]
fn an_output_that_is_the_input_is_refused_whatever_it_is_called() {
    let dir = inputs();
    let at = |name: &str| dir.path().join(name);
    std::fs::create_dir(at("in")).unwrap();
    std::fs::copy(at("run/detections.csv"), at("in/detections.csv")).unwrap();
    std::fs::copy(at("sim/frames.y4m"), at("annotated.mp4")).unwrap();
    std::fs::copy(at("run/tracks.csv"), at("t.csv")).unwrap();
    std::fs::hard_link(at("t.csv"), at("hard.csv")).unwrap();
    std::os::unix::fs::symlink("../t.csv", at("in/link.csv")).unwrap();
    let made = boresight().current_dir(dir.path()).args(["simulate", "ds2", "--frames", "5", "-o", "png"]).output();
    assert!(made.unwrap().status.success());
    std::fs::write(at("t.toml"), "[[radars]]\nname = \"t\"\n").unwrap();
    std::fs::create_dir(at("sets")).unwrap();
    std::fs::copy(at("sim/gt.txt"), at("sets/a.txt")).unwrap();
    std::fs::copy(at("sim/gt.txt"), at("sets/b.txt")).unwrap();
    let before = files(dir.path());
    for line in [
        "track in/detections.csv -o in",
        "track in/../in/detections.csv -o ./in",
        "track annotated.mp4 -o .",
        "track png/frames -o png --png",
        "track png/frames/frame_%06d.png -o png --png",
        "detect sim/frames.y4m -o sim/../sim/frames.y4m",
        "detect png/frames -o png/frames/frame_000001.png",
        "convert t.csv t.csv --to mot",
        "convert t.csv in/link.csv --to mot",
        "convert t.csv hard.csv --to mot",
        "smooth t.csv -o hard.csv",
        "stitch in/link.csv -o t.csv",
        "fuse run/tracks.csv t.csv -o t.csv",
        "fuse run/tracks.csv t.csv -o run/config.toml --config run/config.toml",
        "evaluate sim/gt.txt t.csv --csv hard.csv",
        "evaluate sim/gt.txt t.csv --compare run/tracks.csv --json run/tracks.csv",
        "evaluate sets sets --csv sets/a.txt",
        "evaluate sim/frames.y4m annotated.mp4 --csv annotated.mp4",
        "simulate sim/scene.toml -o sim",
        "simulate t.csv --radars t.toml -o .",
    ] {
        let out = boresight().current_dir(dir.path()).args(line.split_whitespace()).output().unwrap();
        let text = stderr(&out);
        assert_eq!(out.status.code(), Some(5), "{line}: {text}");
        assert!(text.contains("is the input itself") && text.contains("hint: "), "{line}: {text}");
    }
    for (path, content) in before {
        assert!(std::fs::read(&path).unwrap() == content, "{}", path.display());
    }
}
