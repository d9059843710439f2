//! `boresight live --record-video`: after a SIGKILL the video of a record is read by the library and by ffprobe, and its frames and times are those of the tables.
//!
//! Where `ffprobe` is not installed its test shows as ignored.

use boresight::Pixels;
use boresight::io::OpenOptions;
use libtest_mimic::{Arguments, Trial};
use serde_json::Value;
use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

const SCENE: &str = "width-px = 160\nheight-px = 120\nrate-hz = 25.0\nn-frames = 500\nbackground.white = { mean = 50.0, std = 5.0 }\n[[targets]]\nstart-px = [20.0, 30.0]\nvelocity-px-per-s = [4.0, 1.5]\nshape.rectangle = { size-px = [9, 9], mean = 150.0, std = 3.0 }\n";
const CONFIG: &str = "[detector.threshold.band]\nlow = 110\nhigh = 190\n[detector.cluster]\nmin-area-px = 25\n";

struct Killed {
    dir: tempfile::TempDir,
    /// Times of the rows, s, by frame.
    times_s: Vec<f64>,
}

impl Killed {
    fn video(&self) -> PathBuf {
        self.dir.path().join("kept/000001.mp4")
    }

    /// The rows that these times are of: none between them is missing, and few are behind the last.
    fn agrees(&self, times_s: &[f64]) {
        assert!(times_s.len() >= 60, "{} frames", times_s.len());
        for (k, (time_s, row)) in times_s.iter().zip(&self.times_s).enumerate() {
            // Half of a tick of the file's clock, and what ffprobe's six digits leave.
            assert!((time_s - row).abs() < 2e-6, "frame {k} at {time_s} s, its row at {row} s");
        }
    }
}

/// Plays a scene by the clock, and kills the run after four seconds of it.
fn killed() -> Killed {
    let dir = tempfile::tempdir().unwrap();
    std::fs::write(dir.path().join("scene.toml"), SCENE).unwrap();
    std::fs::write(dir.path().join("band.toml"), CONFIG).unwrap();
    let boresight = || {
        let mut command = Command::new(env!("CARGO_BIN_EXE_boresight"));
        command.current_dir(dir.path()).stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
        command
    };
    assert!(
        boresight().args(["simulate", "scene.toml", "--format", "y4m", "-o", "sim"]).output().unwrap().status.success()
    );
    let args = ["live", "sim/frames.y4m", "--pace", "--config", "band.toml", "--record", "kept", "--record-video"];
    let mut child = boresight().args(args).args(["--publish", "-", "--updates-hz", "1000"]).spawn().unwrap();
    let mut events = BufReader::new(child.stdout.take().unwrap()).lines();
    let frame = |line: String| serde_json::from_str::<Value>(&line).unwrap()["frame"].as_u64().unwrap_or(0);
    assert!(events.by_ref().any(|line| frame(line.unwrap()) >= 120));
    child.kill().unwrap();
    let said = child.wait_with_output().unwrap().stderr;
    let said = String::from_utf8_lossy(&said);
    // Coding 160 x 120 pixels is faster than 25 frames/s on any machine that is not stopped altogether.
    assert!(!said.contains("leaves out"), "{said}");
    let text = std::fs::read_to_string(dir.path().join("kept/000001.jsonl")).unwrap();
    let times_s = text.lines().map(|l| serde_json::from_str::<Value>(l).unwrap()["time_s"].as_f64().unwrap()).collect();
    Killed { dir, times_s }
}

fn the_library_reads_what_was_recorded_before_the_kill() {
    let killed = killed();
    let mut video = boresight::io::open(killed.video().display().to_string(), &OpenOptions::default()).unwrap();
    let mut scene =
        boresight::io::open(killed.dir.path().join("sim/frames.y4m").display().to_string(), &OpenOptions::default())
            .unwrap();
    let mut times_s = Vec::new();
    while let Some(frame) = video.next_frame().unwrap() {
        let original = scene.next_frame().unwrap().unwrap();
        let (Pixels::Gray8(got), Pixels::Gray8(put)) = (&frame.pixels, &original.pixels) else { panic!("grey wanted") };
        let error: u32 = got.as_slice().iter().zip(put.as_slice()).map(|(a, b)| u32::from(a.abs_diff(*b))).sum();
        // Noise of 5 levels is coded coarsely; another frame's target would differ by 100 levels on 81 px, another range by 8 everywhere.
        assert!(error < 5 * 160 * 120, "frame {}: mean error {}", times_s.len(), f64::from(error) / (160.0 * 120.0));
        times_s.push(frame.time.as_secs_f64());
    }
    killed.agrees(&times_s);
}

fn ffprobe_reads_the_same_frames_and_times() {
    let killed = killed();
    let mut command = Command::new("ffprobe");
    let entries = ["-v", "error", "-select_streams", "v", "-show_entries", "frame=pts_time", "-of", "csv=p=0"];
    let out = command.args(entries).arg(killed.video()).output().unwrap();
    let (text, said) = (String::from_utf8(out.stdout).unwrap(), String::from_utf8_lossy(&out.stderr));
    assert!(out.status.success() && said.is_empty(), "{said}");
    let times_s: Vec<f64> = text.lines().map(|l| l.trim_end_matches(',').parse().unwrap()).collect();
    killed.agrees(&times_s);
    let n = boresight::io::open(killed.video().display().to_string(), &OpenOptions::default()).unwrap().info().n_frames;
    assert_eq!(n, Some(times_s.len() as u64));
}

fn installed(name: &str) -> bool {
    let path = std::env::var_os("PATH").unwrap_or_default();
    std::env::split_paths(&path).any(|dir| Path::new(&dir).join(name).is_file())
}

fn main() -> std::process::ExitCode {
    let trial = |name: &str, test: fn()| {
        Trial::test(name, move || {
            test();
            Ok(())
        })
    };
    let library = trial(
        "the_library_reads_what_was_recorded_before_the_kill",
        the_library_reads_what_was_recorded_before_the_kill,
    );
    let ffprobe = trial("ffprobe_reads_the_same_frames_and_times", ffprobe_reads_the_same_frames_and_times);
    let ffprobe =
        if installed("ffprobe") { ffprobe } else { ffprobe.with_kind("needs ffprobe").with_ignored_flag(true) };
    libtest_mimic::run(&Arguments::from_args(), vec![library, ffprobe]).exit_code()
}
