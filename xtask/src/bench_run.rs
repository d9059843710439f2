//! What a whole run costs beside decoding alone: the table of docs/speed.md.
//!
//! Every run is a process of its own, started by another process of its own, which reads its processor time, wall time and largest memory from
//! the operating system (`getrusage` of children) after it has ended. Figures are milliseconds a frame of the quickest of the runs.
//! Clips: the sample, PETS09 if it is here, and scenes of `boresight simulate`'s engine with fixed seeds ([`super::bench_clips`]).

use crate::bench_clips::{Clip, clips};
use anyhow::{Context, Result, ensure};
use nix::sys::resource::{UsageWho, getrusage};
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::Instant;

/// Measures whole runs beside decoding alone.
#[derive(clap::Args)]
pub struct Args {
    /// The program.
    #[arg(long, default_value = "target/release/boresight")]
    program: PathBuf,
    /// Another build of it, to be measured in turn with the first.
    #[arg(long)]
    before: Option<PathBuf>,
    /// Frames of the simulated clips.
    #[arg(long, default_value_t = 60)]
    frames: u64,
    /// Runs of each; the quickest counts.
    #[arg(long, default_value_t = 2)]
    runs: usize,
    /// Only the clips whose name holds this.
    #[arg(long)]
    only: Option<String>,
    /// Python with `av` or `cv2`: they decode the videos as well.
    #[arg(long)]
    python: Option<PathBuf>,
    /// Folder for the clips.
    #[arg(long, default_value = "target/bench-run")]
    folder: PathBuf,
    /// Measures one command and prints its cost (what this chore starts itself).
    #[arg(long, num_args = 1.., allow_hyphen_values = true, hide = true)]
    one: Option<Vec<String>>,
}

/// A detector that only compares each pixel with a band in which none is: what is left is decoding, in the same program.
const NOTHING: &str = "detector.threshold.band={low=1e6,high=2e6}";

/// What a process cost.
#[derive(Clone, Copy, Serialize, Deserialize)]
struct Cost {
    cpu_s: f64,
    wall_s: f64,
    peak_mb: f64,
}

impl Cost {
    /// The better of two runs, figure by figure; the larger memory.
    fn best(self, other: Self) -> Self {
        Self {
            cpu_s: self.cpu_s.min(other.cpu_s),
            wall_s: self.wall_s.min(other.wall_s),
            peak_mb: self.peak_mb.max(other.peak_mb),
        }
    }
}

pub fn run(args: &Args) -> Result<()> {
    if let Some(command) = &args.one {
        println!("{}", serde_json::to_string(&measure_here(command)?)?);
        return Ok(());
    }
    for program in [Some(&args.program), args.before.as_ref(), args.python.as_ref()].into_iter().flatten() {
        // A bare name is looked for along the path.
        Command::new(program).arg("--version").output().with_context(|| {
            let made = "`cargo build --release -p boresight-cli` makes target/release/boresight";
            format!("the program {} cannot be started: {made}", program.display())
        })?;
    }
    let wanted = |name: &str| args.only.as_ref().is_none_or(|o| name.contains(o.as_str()));
    let clips = clips(&args.folder, args.frames, wanted)?;
    ensure!(!clips.is_empty(), "no clip has a name with {:?} in it", args.only.as_deref().unwrap_or_default());
    println!("| clip | work | CPU, ms a frame | wall, ms a frame | beside decoding alone: CPU, wall | peak, MB |");
    println!("| --- | --- | --- | --- | --- | --- |");
    for clip in &clips {
        let decoding = rows(args, clip)?;
        println!("| | | | | {} frames, decoding {:.0} frames/s | |", clip.frames, clip.frames as f64 / decoding.wall_s);
    }
    Ok(())
}

/// Measures and prints the rows of a clip; returns what decoding alone costs.
fn rows(args: &Args, clip: &Clip) -> Result<Cost> {
    let input = clip.input.to_string_lossy().into_owned();
    let program = |p: &Path| p.to_string_lossy().into_owned();
    let track = |p: &Path, more: &[&str]| -> Vec<String> {
        let output = args.folder.join("out").to_string_lossy().into_owned();
        let fixed = ["track", &input, "-q", "-o", &output];
        std::iter::once(program(p)).chain(fixed.iter().chain(more).map(|s| s.to_string())).collect()
    };
    let config = args.folder.join("given.toml");
    std::fs::write(&config, "")?;
    let config = config.to_string_lossy().into_owned();
    let table = args.folder.join("nothing.csv").to_string_lossy().into_owned();
    let detect = ["detect", &input, "-q", "--config", &config, "--set", NOTHING, "-o", &table].map(String::from);
    let decode = std::iter::once(program(&args.program)).chain(detect).collect();
    let mut jobs: Vec<(String, Vec<String>)> = vec![("decoding alone".into(), decode)];
    if let Some(python) = args.python.as_ref().filter(|_| clip.is_video) {
        for (name, script) in [("PyAV decodes", PYAV), ("OpenCV decodes", OPENCV)] {
            jobs.push((name.into(), vec![program(python), "-c".into(), script.into(), input.clone()]));
        }
    }
    let given: Vec<&str> = clip.given.iter().flat_map(|s| ["--set", s]).collect();
    let forms: [(&str, &[&str]); 4] = [
        ("no video, 1 thread", &["--no-video", "--threads", "1"]),
        ("no video, 2 threads", &["--no-video", "--threads", "2"]),
        ("default, 1 thread", &["--threads", "1"]),
        ("default, 2 threads", &["--threads", "2"]),
    ];
    for (name, more) in forms {
        jobs.push((name.into(), track(&args.program, more)));
    }
    if !given.is_empty() {
        let more: Vec<&str> = ["--config", &config, "--no-video", "--no-report"].into_iter().chain(given).collect();
        jobs.push(("detector given, tables only".into(), track(&args.program, &more)));
    }
    if let Some(before) = &args.before {
        jobs.push(("before: no video".into(), track(before, &["--no-video"])));
        jobs.push(("before: default".into(), track(before, &[])));
    }
    let mut costs: Vec<Option<Cost>> = vec![None; jobs.len()];
    // In turn, so that a slower minute of the machine is everybody's.
    for _ in 0..args.runs.max(1) {
        for ((_, command), cost) in jobs.iter().zip(&mut costs) {
            if let Some(now) = measure(command)? {
                *cost = Some(cost.map_or(now, |c| c.best(now)));
            }
        }
    }
    let alone = costs[0].with_context(|| format!("{} cannot be decoded", clip.input.display()))?;
    for ((name, _), cost) in jobs.iter().zip(&costs) {
        let Some(c) = cost else { continue };
        let a_frame = 1e3 / clip.frames as f64;
        println!(
            "| {} | {name} | {:.2} | {:.2} | {:.2}, {:.2} | {:.0} |",
            clip.name,
            c.cpu_s * a_frame,
            c.wall_s * a_frame,
            c.cpu_s / alone.cpu_s,
            c.wall_s / alone.wall_s,
            c.peak_mb
        );
    }
    Ok(alone)
}

/// Runs a command through a process of its own that only waits for it; `None` if it fails.
fn measure(command: &[String]) -> Result<Option<Cost>> {
    let out = Command::new(std::env::current_exe()?)
        .args(["bench-run", "--one"])
        .args(command)
        .stdin(Stdio::null())
        .stderr(Stdio::null())
        .output()?;
    Ok(if out.status.success() { Some(serde_json::from_slice(&out.stdout)?) } else { None })
}

/// Runs a command and waits for it; the only child this process ever has.
fn measure_here(command: &[String]) -> Result<Cost> {
    let (program, rest) = command.split_first().context("no command")?;
    let began = Instant::now();
    let status = Command::new(program).args(rest).stdout(Stdio::null()).status()?;
    let wall_s = began.elapsed().as_secs_f64();
    ensure!(status.success(), "{program} failed");
    let usage = getrusage(UsageWho::RUSAGE_CHILDREN)?;
    let seconds = |t: nix::sys::time::TimeVal| t.tv_sec() as f64 + t.tv_usec() as f64 * 1e-6;
    let cpu_s = seconds(usage.user_time()) + seconds(usage.system_time());
    Ok(Cost { cpu_s, wall_s, peak_mb: usage.max_rss() as f64 / 1024.0 })
}

const PYAV: &str = "
import av, sys
with av.open(sys.argv[1]) as f:
    s = f.streams.video[0]
    s.thread_count = 1
    for frame in f.decode(s):
        frame.planes[0]
";
const OPENCV: &str = "
import cv2, sys
cv2.setNumThreads(1)
v = cv2.VideoCapture(sys.argv[1])
assert v.isOpened()
while v.read()[0]:
    pass
";
