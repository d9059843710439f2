//! Worker for the comparison with peers, workload W2: 3x3 and 5x5 mean and median of an 8-bit frame.
//!
//! One JSON object a line on standard input, one answer a line on standard output: `load`, `run`, `result`, `quit`.
//! Build: `cargo build --release -p peers --bin peer_w2`; peers entry:
//! `{"name": "boresight", "workload": "W2", "kind": "worker", "command": "target/release/peer_w2"}`.

use boresight::Image;
use boresight::vision::spatial::{SpatialConfig, SpatialFilter, WindowConfig};
use rustix::time::{ClockId, clock_gettime};
use serde_json::{Value, json};
use std::io::{BufRead, Write};
use std::time::Instant;

type Anyhow<T> = Result<T, Box<dyn std::error::Error>>;

struct Job {
    frame: Image<u8>,
    filter: SpatialFilter<u8>,
    out: Image<u8>,
}

fn cpu_s() -> f64 {
    let t = clock_gettime(ClockId::ProcessCPUTime);
    t.tv_sec as f64 + t.tv_nsec as f64 * 1e-9
}

fn status_kb(key: &str) -> u64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find(|l| l.starts_with(key));
    line.and_then(|l| l.split_whitespace().nth(1)?.parse().ok()).unwrap_or(0)
}

fn read_npy(path: &str) -> Anyhow<Image<u8>> {
    let bytes = std::fs::read(path)?;
    let header_len = usize::from(u16::from_le_bytes([*bytes.get(8).ok_or("short")?, *bytes.get(9).ok_or("short")?]));
    let header = std::str::from_utf8(bytes.get(10..10 + header_len).ok_or("short")?)?;
    if !header.contains("'|u1'") || header.contains("'fortran_order': True") {
        return Err(format!("{path}: expected unsigned bytes in C order, found {header}").into());
    }
    let shape = header.split("'shape': (").nth(1).and_then(|s| s.split(')').next()).ok_or("no shape")?;
    let sizes: Vec<usize> = shape.split(',').filter_map(|s| s.trim().parse().ok()).collect();
    let [h, w] = sizes[..] else { return Err(format!("{path}: expected two dimensions").into()) };
    let pixels = bytes.get(10 + header_len..).ok_or("short")?.to_vec();
    Image::from_vec(w, h, pixels).ok_or_else(|| "length and shape differ".into())
}

fn write_npy(path: &str, image: &Image<u8>) -> Anyhow<()> {
    let mut header =
        format!("{{'descr': '<f8', 'fortran_order': False, 'shape': ({}, {}), }}", image.height(), image.width());
    while (11 + header.len()) % 64 != 0 {
        header.push(' ');
    }
    header.push('\n');
    let mut file = std::io::BufWriter::new(std::fs::File::create(path)?);
    file.write_all(b"\x93NUMPY\x01\x00")?;
    file.write_all(&(header.len() as u16).to_le_bytes())?;
    file.write_all(header.as_bytes())?;
    for &v in image.as_slice() {
        file.write_all(&f64::from(v).to_le_bytes())?;
    }
    Ok(file.flush()?)
}

fn load(message: &Value) -> Anyhow<Job> {
    let size = message["params"]["k"].as_u64().ok_or("no k")? as usize;
    let window = WindowConfig { size, ..WindowConfig::default() };
    let config = match message["params"]["kind"].as_str() {
        Some("mean") => SpatialConfig::Mean(window),
        Some("median") => SpatialConfig::Median(window),
        other => return Err(format!("kind {other:?}").into()),
    };
    let frame = read_npy(message["inputs"]["frame"].as_str().ok_or("no frame")?)?;
    Ok(Job { frame, filter: SpatialFilter::new(config)?, out: Image::default() })
}

fn run(job: &mut Job, message: &Value) -> Value {
    let min_time = message["min_time"].as_f64().unwrap_or(0.0);
    let max_iter = message["max_iter"].as_u64().unwrap_or(1);
    // Resets the peak of the resident memory; where that is not allowed the peak is only larger.
    let _ = std::fs::write("/proc/self/clear_refs", "5");
    let base_kb = status_kb("VmRSS");
    let (mut wall, mut cpu) = (Vec::new(), Vec::new());
    let start = Instant::now();
    loop {
        let (cpu_start, wall_start) = (cpu_s(), Instant::now());
        job.filter.apply(&job.frame, &mut job.out);
        wall.push(wall_start.elapsed().as_secs_f64());
        cpu.push(cpu_s() - cpu_start);
        if wall.len() as u64 >= max_iter || start.elapsed().as_secs_f64() >= min_time {
            break;
        }
    }
    json!({"ok": true, "wall": wall, "cpu": cpu, "units": 1.0, "base_kb": base_kb, "peak_kb": status_kb("VmHWM"), "extra": {}})
}

fn answer(job: &mut Option<Job>, line: &str) -> Anyhow<Option<Value>> {
    let message: Value = serde_json::from_str(line)?;
    match message["op"].as_str() {
        Some("load") => {
            *job = Some(load(&message)?);
            Ok(Some(json!({"ok": true, "rss_kb": status_kb("VmRSS")})))
        }
        Some("run") => Ok(Some(run(job.as_mut().ok_or("nothing is loaded")?, &message))),
        Some("result") => {
            let job = job.as_ref().ok_or("nothing is loaded")?;
            write_npy(message["out"].as_str().ok_or("no out")?, &job.out)?;
            Ok(Some(json!({"ok": true})))
        }
        _ => Ok(None),
    }
}

fn main() -> Anyhow<()> {
    let mut job = None;
    for line in std::io::stdin().lock().lines() {
        let line = line?;
        if line.trim().is_empty() {
            continue;
        }
        match answer(&mut job, &line) {
            Ok(Some(reply)) => println!("{reply}"),
            Ok(None) => break,
            Err(e) => println!("{}", json!({"ok": false, "error": e.to_string()})),
        }
        std::io::stdout().flush()?;
    }
    Ok(())
}
