//! Speed of the evaluation from files, beside other tools on the same files: the table of docs/evaluate.md.
//!
//! The scene is a field of boxes with misses, false boxes, new identities and swaps (fixed seed), written as two
//! MOTChallenge tables. Peers run through `scripts/metrics_peers.py` with a Python that has them.

use anyhow::{Context, Result};
use boresight::io::tracks::{Format, ReadOptions, read};
use boresight::metrics::hota::mean;
use boresight::metrics::set::{SetDistance, SetOptions};
use boresight::metrics::{MatchOptions, mot_scores};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::time::Instant;

/// Measures the speed of the evaluation from files.
#[derive(clap::Args)]
pub struct Args {
    /// Frames.
    #[arg(long, default_value_t = 1500)]
    frames: usize,
    /// Tracks.
    #[arg(long, default_value_t = 100)]
    tracks: usize,
    /// Python with the peers (trackeval, motmetrics, trackers, motrics): those it has are run as well.
    #[arg(long)]
    python: Vec<PathBuf>,
    /// Folder for the tables.
    #[arg(long, default_value = "target/bench-metrics")]
    folder: PathBuf,
    /// Runs of each; the quickest counts.
    #[arg(long, default_value_t = 3)]
    runs: usize,
}

fn write_scene(args: &Args, truth: &Path, result: &Path) -> Result<()> {
    let mut rng = ChaCha8Rng::seed_from_u64(6);
    let side = 60.0 * (args.tracks as f64).sqrt();
    let normal = |sigma: f64, rng: &mut ChaCha8Rng| {
        // The sum of twelve uniforms is normal enough for a scene.
        sigma * ((0..12).map(|_| rng.random::<f64>()).sum::<f64>() - 6.0)
    };
    let mut p: Vec<[f64; 2]> =
        (0..args.tracks).map(|_| [rng.random::<f64>() * side, rng.random::<f64>() * side]).collect();
    let mut v: Vec<[f64; 2]> = (0..args.tracks).map(|_| [normal(1.0, &mut rng), normal(1.0, &mut rng)]).collect();
    let mut ids: Vec<usize> = (1..=args.tracks).collect();
    let mut next = args.tracks + 1;
    let mut t = std::io::BufWriter::new(std::fs::File::create(truth)?);
    let mut r = std::io::BufWriter::new(std::fs::File::create(result)?);
    for frame in 1..=args.frames {
        if rng.random::<f64>() < 0.05 && args.tracks > 1 {
            ids.swap(rng.random_range(0..args.tracks), rng.random_range(0..args.tracks));
        }
        for k in 0..args.tracks {
            for c in 0..2 {
                p[k][c] += v[k][c];
                if p[k][c] < 0.0 || p[k][c] > side {
                    v[k][c] = -v[k][c];
                }
            }
            writeln!(t, "{frame},{},{:.2},{:.2},20,20,1,1,1", k + 1, p[k][0] - 10.0, p[k][1] - 10.0)?;
            if rng.random::<f64>() < 0.002 {
                ids[k] = next;
                next += 1;
            }
            if rng.random::<f64>() < 0.9 {
                let (x, y) = (p[k][0] + normal(1.0, &mut rng) - 10.0, p[k][1] + normal(1.0, &mut rng) - 10.0);
                writeln!(r, "{frame},{},{x:.2},{y:.2},20,20,1,-1,-1,-1", ids[k])?;
            }
        }
        for k in 0..args.tracks / 20 {
            let (x, y) = (rng.random::<f64>() * side, rng.random::<f64>() * side);
            writeln!(r, "{frame},{},{x:.2},{y:.2},20,20,1,-1,-1,-1", 10_000_000 + k)?;
        }
    }
    t.flush()?;
    r.flush()?;
    Ok(())
}

fn status_mib(key: &str) -> f64 {
    let text = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = text.lines().find(|l| l.starts_with(key));
    line.and_then(|l| l.split_whitespace().nth(1)?.parse::<f64>().ok()).unwrap_or(f64::NAN) / 1024.0
}

/// Prints the table.
/// # Errors
/// Files that cannot be written or read.
pub fn run(args: &Args) -> Result<()> {
    std::fs::create_dir_all(&args.folder)?;
    let (truth, result) = (args.folder.join("truth.txt"), args.folder.join("result.txt"));
    write_scene(args, &truth, &result)?;
    println!("{} frames x {} tracks, from files to CLEAR + identity + HOTA\n", args.frames, args.tracks);
    println!("| tool | s | peak MiB | MOTA | IDF1 | HOTA |\n| --- | --- | --- | --- | --- | --- |");
    let mut best = f64::INFINITY;
    let mut row = String::new();
    for _ in 0..args.runs.max(1) {
        let begin = Instant::now();
        let t = read(&truth, Some(Format::Mot), ReadOptions::default(), false)?.table;
        let r = read(&result, Some(Format::Mot), ReadOptions::default(), false)?.table;
        let s = mot_scores(&t, &r, &MatchOptions::default())?;
        best = best.min(begin.elapsed().as_secs_f64());
        row = format!("{:.6} | {:.6} | {:.6}", s.clear.mota(), s.identity.idf1(), mean(&s.hota.hota()));
    }
    println!("| boresight | {best:.3} | {:.0} | {row} |", status_mib("VmHWM"));
    for python in &args.python {
        let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("../scripts/metrics_peers.py");
        let out = std::process::Command::new(python)
            .arg(script)
            .args([&truth, &result])
            .arg(args.frames.to_string())
            .output()
            .with_context(|| format!("{} cannot be started", python.display()))?;
        print!("{}", String::from_utf8_lossy(&out.stdout));
        if !out.status.success() {
            println!("(peers of {} ended with {})", python.display(), out.status);
        }
    }
    gospa();
    Ok(())
}

fn gospa() {
    let mut rng = ChaCha8Rng::seed_from_u64(9);
    let truth: Vec<[f64; 2]> =
        (0..1000).map(|_| [rng.random::<f64>() * 1900.0, rng.random::<f64>() * 1900.0]).collect();
    let result: Vec<[f64; 2]> =
        truth.iter().map(|p| [p[0] + 2.0 * rng.random::<f64>(), p[1] - 2.0 * rng.random::<f64>()]).collect();
    let (mut d, o) = (SetDistance::default(), SetOptions::default());
    let (begin, n) = (Instant::now(), 200);
    let mut sum = 0.0;
    for _ in 0..n {
        sum += d.gospa(&truth, &result, &o).distance;
    }
    println!(
        "\nGOSPA of 1000 targets (c = 10 px, p = 2): {:.3} ms a scan (mean {:.3})",
        begin.elapsed().as_secs_f64() * 1e3 / n as f64,
        sum / n as f64
    );
}
