//! What the benchmark workers share: the JSON-lines protocol, `.npy` in and out, CPU time and memory of this process.

use rustix::time::{ClockId, clock_gettime};
use serde_json::{Value, json};
use std::io::{BufRead, Write};
use std::time::Instant;

/// One job of a worker.
pub trait Job {
    /// Does the work once.
    fn run(&mut self);
    /// The result, row by row, and its number of columns.
    fn result(&mut self) -> (Vec<f64>, usize);
    /// Work units of one run.
    fn units(&self) -> f64;
}

/// An error of the harness' input.
pub type Fault = Box<dyn std::error::Error>;

/// Serves the protocol on stdin and stdout until `quit`.
pub fn serve(load: impl Fn(&Value) -> Result<Box<dyn Job>, Fault>) -> Result<(), Fault> {
    let mut job: Option<Box<dyn Job>> = None;
    for line in std::io::stdin().lock().lines() {
        let line = line?;
        if line.trim().is_empty() {
            continue;
        }
        let message: Value = serde_json::from_str(&line)?;
        let answer = match (message["op"].as_str(), &mut job) {
            (Some("quit"), _) => return Ok(()),
            (Some("load"), _) => match load(&message) {
                Ok(loaded) => {
                    job = Some(loaded);
                    json!({"ok": true, "rss_kb": status_kb("VmRSS")})
                }
                Err(e) => json!({"ok": false, "error": e.to_string()}),
            },
            (Some("run"), Some(job)) => timed(job.as_mut(), &message),
            (Some("result"), Some(job)) => {
                let (rows, columns) = job.result();
                write_npy(message["out"].as_str().ok_or("no out")?, &rows, columns)?;
                json!({"ok": true})
            }
            _ => json!({"ok": false, "error": format!("what is {line}?")}),
        };
        println!("{answer}");
        std::io::stdout().flush()?;
    }
    Ok(())
}

fn timed(job: &mut dyn Job, message: &Value) -> Value {
    let min_time = message["min_time"].as_f64().unwrap_or(0.0);
    let max_iter = message["max_iter"].as_u64().unwrap_or(1).max(1);
    // Resets the peak of the resident memory; where that is not allowed the peak is that of the process.
    std::fs::write("/proc/self/clear_refs", "5").ok();
    let base = status_kb("VmRSS");
    let (mut wall, mut cpu) = (Vec::new(), Vec::new());
    let begin = Instant::now();
    loop {
        let (c, w) = (cpu_s(), Instant::now());
        job.run();
        wall.push(w.elapsed().as_secs_f64());
        cpu.push(cpu_s() - c);
        if wall.len() as u64 >= max_iter || begin.elapsed().as_secs_f64() >= min_time {
            break;
        }
    }
    json!({"ok": true, "wall": wall, "cpu": cpu, "units": job.units(), "base_kb": base, "peak_kb": status_kb("VmHWM"), "extra": {}})
}

/// CPU time of this process, all threads, s.
pub fn cpu_s() -> f64 {
    let t = clock_gettime(ClockId::ProcessCPUTime);
    t.tv_sec as f64 + t.tv_nsec as f64 * 1e-9
}

/// A line of `/proc/self/status`, KiB.
pub fn status_kb(key: &str) -> u64 {
    let text = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = text.lines().find(|l| l.starts_with(key));
    line.and_then(|l| l.split_whitespace().nth(1)?.parse().ok()).unwrap_or(0)
}

/// Reads a `.npy` of 8-byte floats, or of 4- or 8-byte integers: values and shape.
pub fn read_npy(bytes: &[u8]) -> Result<(Vec<f64>, Vec<usize>), Fault> {
    if bytes.len() < 12 || &bytes[..6] != b"\x93NUMPY" {
        return Err("not a .npy file".into());
    }
    let (length, start) = if bytes[6] == 1 {
        (usize::from(u16::from_le_bytes([bytes[8], bytes[9]])), 10)
    } else {
        (u32::from_le_bytes([bytes[8], bytes[9], bytes[10], bytes[11]]) as usize, 12)
    };
    let header = std::str::from_utf8(bytes.get(start..start + length).ok_or("header cut off")?)?;
    let kind = header.split("'descr': '").nth(1).and_then(|s| s.split('\'').next()).ok_or("no descr")?;
    let shape = header.split("'shape': (").nth(1).and_then(|s| s.split(')').next()).ok_or("no shape")?;
    let shape: Vec<usize> = shape.split(',').filter_map(|v| v.trim().parse().ok()).collect();
    let data = &bytes[start + length..];
    let values = match kind {
        "<f8" => data.as_chunks::<8>().0.iter().map(|c| f64::from_le_bytes(*c)).collect(),
        "<i8" => data.as_chunks::<8>().0.iter().map(|c| i64::from_le_bytes(*c) as f64).collect(),
        "<i4" => data.as_chunks::<4>().0.iter().map(|c| f64::from(i32::from_le_bytes(*c))).collect(),
        other => return Err(format!("type {other} is not read here").into()),
    };
    Ok((values, shape))
}

/// Reads one member of an uncompressed `.npz`.
pub fn read_npz(bytes: &[u8], member: &str) -> Result<(Vec<f64>, Vec<usize>), Fault> {
    let name = format!("{member}.npy");
    let u16_at = |at: usize| bytes.get(at..at + 2).map(|b| usize::from(u16::from_le_bytes([b[0], b[1]])));
    let mut at = 0;
    while bytes.get(at..at + 4) == Some(b"PK\x03\x04") {
        let (n_name, n_extra) = (u16_at(at + 26).ok_or("cut off")?, u16_at(at + 28).ok_or("cut off")?);
        let body = at + 30 + n_name + n_extra;
        let extra = &bytes[at + 30 + n_name..body];
        // numpy writes 64-bit sizes into the extra field.
        let size = if extra.len() >= 20 && extra[0] == 1 {
            u64::from_le_bytes(extra[12..20].try_into()?) as usize
        } else {
            u32::from_le_bytes(bytes[at + 18..at + 22].try_into()?) as usize
        };
        if &bytes[at + 30..at + 30 + n_name] == name.as_bytes() {
            return read_npy(bytes.get(body..body + size).ok_or("member cut off")?);
        }
        at = body + size;
    }
    Err(format!("no {name} in the .npz").into())
}

/// Writes rows as a 2-D `.npy` of little-endian 8-byte floats.
pub fn write_npy(path: &str, rows: &[f64], columns: usize) -> std::io::Result<()> {
    let n = rows.len() / columns.max(1);
    let mut header = format!("{{'descr': '<f8', 'fortran_order': False, 'shape': ({n}, {columns}), }}");
    while !(10 + header.len() + 1).is_multiple_of(64) {
        header.push(' ');
    }
    header.push('\n');
    let mut file = std::io::BufWriter::new(std::fs::File::create(path)?);
    file.write_all(b"\x93NUMPY\x01\x00")?;
    file.write_all(&(header.len() as u16).to_le_bytes())?;
    file.write_all(header.as_bytes())?;
    for v in rows {
        file.write_all(&v.to_le_bytes())?;
    }
    file.flush()
}
