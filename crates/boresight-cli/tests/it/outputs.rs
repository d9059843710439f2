//! Outputs are whole or absent: a disk that fills at any byte, and a kill at any moment, leave whole files, new or earlier ones.
#![cfg(target_os = "linux")] // prlimit, /dev/full

use super::streams::{COMMANDS, inputs};
use super::{boresight, stderr};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::time::Duration;

/// Runs the command where no file may grow beyond `bytes`: every write behind them fails, as on a full disk.
fn run_with_room(dir: &Path, line: &str, bytes: u64) -> Output {
    // The signal that a system sends as well must not kill it: a full disk sends none.
    let script = format!("trap '' XFSZ; exec prlimit --fsize={bytes} \"$0\" {line}");
    Command::new("bash")
        .args(["-c", &script, env!("CARGO_BIN_EXE_boresight")])
        .current_dir(dir)
        .stdout(Stdio::null())
        .output()
        .unwrap()
}

/// All files below a folder, by name.
fn files(dir: &Path) -> BTreeMap<PathBuf, Vec<u8>> {
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

#[test]
fn a_disk_that_fills_at_any_byte_leaves_whole_files_and_code_5() {
    let dir = inputs();
    let out = dir.path().join("out");
    let fresh = || {
        let _ = std::fs::remove_dir_all(&out);
        std::fs::create_dir(&out).unwrap();
    };
    for (line, made) in COMMANDS {
        fresh();
        let whole_run = run_with_room(dir.path(), line, 1 << 30);
        assert_eq!(whole_run.status.code(), Some(0), "{line}: {}", stderr(&whole_run));
        let whole = files(&out);
        let largest = whole.values().map(Vec::len).max().unwrap() as u64;
        for bytes in [0, 1, 70, 1000, 5000, largest / 2, largest - 1].into_iter().filter(|b| *b < largest) {
            fresh();
            // What an earlier run left is good, and stays where the new file does not become whole.
            for file in made.iter().filter(|f| !f.contains('/')) {
                std::fs::write(out.join(file), "earlier").unwrap();
            }
            let done = run_with_room(dir.path(), line, bytes);
            let text = stderr(&done);
            assert_eq!(done.status.code(), Some(5), "{line}, {bytes} bytes: {text}");
            assert!(text.contains("error: ") && !text.contains("panicked"), "{line}, {bytes} bytes: {text}");
            let left = files(&out);
            for (path, content) in &left {
                let shown = path.strip_prefix(dir.path()).unwrap().display();
                // A report that tells of missing outputs is another text than one of a run that is whole.
                let page = path.ends_with("report.html") && content.ends_with(b"</html>\n");
                let notes = path.ends_with("config.toml") && content.starts_with(b"# The configuration of this run");
                let told = path.ends_with("summary.json") && content.ends_with(b"\n}\n");
                let sound = content == b"earlier" || whole.get(path) == Some(content) || page || notes || told;
                assert!(sound, "{line}, {bytes} bytes: {shown} is half ({} bytes)", content.len());
            }
            for file in made.iter().filter(|f| !f.contains('/')) {
                let path = out.join(file);
                assert!(left.contains_key(&path), "{line}, {bytes} bytes: {file} is gone");
                let fits = whole[&path].len() as u64 <= bytes;
                let failed_first = left[&path] == b"earlier";
                assert!(fits || failed_first || path.ends_with("report.html"), "{line}, {bytes} bytes: {file}");
            }
        }
    }
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
    let mut n_killed = 0;
    for (k, line) in lines.iter().chain(&lines).enumerate() {
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
