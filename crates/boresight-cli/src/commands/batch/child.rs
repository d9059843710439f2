//! One process for one input, ended where it takes too long or too much; whatever happens to it happens to it alone.
//!
//! Its standard input is a pipe that this process holds: where this one ends, in whatever way, the pipe ends and the child with it
//! (`track --end-with-stdin`). Memory is looked at (`VmHWM` of Linux' `/proc`) every 20 ms, no limit of the system is set: those
//! count addresses, not memory.

use boresight::{Error, ErrorKind, Result};
use std::collections::VecDeque;
use std::ffi::OsString;
use std::io::{BufRead, BufReader};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// How often a child is looked at.
const GLANCE: Duration = Duration::from_millis(20);
/// Lines and letters of a child's words that are kept.
const MOST_LINES: usize = 200;
const MOST_LETTERS: usize = 2000;

/// What a child may take.
#[derive(Clone, Copy, Debug, Default)]
pub struct Limits {
    /// Time, s.
    pub time_s: Option<f64>,
    /// Memory, MB.
    pub memory_mb: Option<u64>,
}

/// How a child ended.
#[derive(Clone, Debug, PartialEq)]
pub struct Ended {
    /// Its exit code; `None` if it was ended.
    pub exit_code: Option<i32>,
    /// Why it failed; `None` if it did not.
    pub reason: Option<String>,
    /// How long it took, s.
    pub seconds: f64,
    /// Most memory it took, MB.
    pub peak_memory_mb: Option<u64>,
}

/// Runs this program with other arguments to its end; `None` if `stop` was raised meanwhile, and the child is ended then.
/// # Errors
/// A process that cannot be started.
pub fn run(arguments: &[OsString], limits: Limits, stop: &AtomicBool) -> Result<Option<Ended>> {
    let failed =
        |e: std::io::Error| Error::new(ErrorKind::Output, "a process for an input cannot be started").because(e);
    let mut command = Command::new(std::env::current_exe().map_err(failed)?);
    command.args(arguments).stdin(Stdio::piped()).stdout(Stdio::null()).stderr(Stdio::piped());
    #[cfg(unix)]
    {
        use std::os::unix::process::CommandExt;
        // A terminal's Ctrl-C is for this process, which ends its children.
        command.process_group(0);
    }
    let started = Instant::now();
    let mut child = command.spawn().map_err(failed)?;
    let words = child.stderr.take().map(|pipe| std::thread::spawn(move || last_lines(BufReader::new(pipe))));
    let mut peak = None;
    let mut ended_for = None;
    let status = loop {
        if let Some(status) = child.try_wait().map_err(failed)? {
            break status;
        }
        peak = peak.max(memory_mb(child.id()));
        let late = limits.time_s.filter(|limit| started.elapsed().as_secs_f64() > *limit);
        let large = limits.memory_mb.filter(|limit| peak.is_some_and(|p| p > *limit));
        ended_for = match (stop.load(Ordering::SeqCst), late, large) {
            (true, ..) => {
                end(&mut child);
                return Ok(None);
            }
            (_, Some(limit), _) => Some(format!("took longer than {limit} s (--timeout)")),
            (.., Some(limit)) => Some(format!("took more memory than {limit} MB (--max-memory)")),
            _ => None,
        };
        if ended_for.is_some() {
            break end(&mut child).ok_or_else(|| failed(std::io::Error::other("it cannot be waited for")))?;
        }
        std::thread::sleep(GLANCE);
    };
    let seconds = started.elapsed().as_secs_f64();
    // Where a grandchild still holds the pipe of one that was ended, its words may never end.
    let words = if ended_for.is_some() { Vec::new() } else { words.and_then(|w| w.join().ok()).unwrap_or_default() };
    let exit_code = if ended_for.is_some() { None } else { status.code() };
    let reason = ended_for.or_else(|| (!status.success()).then(|| reason(status, &words)));
    Ok(Some(Ended { exit_code, reason, seconds, peak_memory_mb: peak }))
}

fn end(child: &mut Child) -> Option<ExitStatus> {
    let _ = child.kill();
    child.wait().ok()
}

/// The last lines of what a child says; the pipe is read to its end, or the child would wait.
fn last_lines(mut pipe: impl BufRead) -> Vec<String> {
    let (mut lines, mut line) = (VecDeque::new(), Vec::new());
    while pipe.read_until(b'\n', &mut line).is_ok_and(|n| n > 0) {
        if lines.len() == MOST_LINES {
            lines.pop_front();
        }
        lines.push_back(String::from_utf8_lossy(&line).trim_end().chars().take(MOST_LETTERS).collect::<String>());
        line.clear();
    }
    lines.into()
}

/// What a child says of its end: its errors with their hints, a panic, or its last line.
fn reason(status: ExitStatus, words: &[String]) -> String {
    let told = words.iter().position(|l| l.starts_with("error: ") || l.contains("panicked at"));
    let told = match told {
        Some(at) => words[at..].join("\n"),
        None => words.last().cloned().unwrap_or_default(),
    };
    let told = told.trim_start_matches("error: ").to_string();
    #[cfg(unix)]
    if let Some(signal) = std::os::unix::process::ExitStatusExt::signal(&status) {
        let perhaps = if signal == 9 { ", as the system does when memory runs out" } else { "" };
        return format!("was ended by signal {signal}{perhaps}{}{told}", if told.is_empty() { "" } else { ": " });
    }
    if told.is_empty() { format!("{status}, without a word") } else { told }
}

/// Most memory a process took so far, MB; `None` where the system does not tell.
fn memory_mb(id: u32) -> Option<u64> {
    let text = std::fs::read_to_string(format!("/proc/{id}/status")).ok()?;
    let line = text.lines().find_map(|l| l.strip_prefix("VmHWM:"))?;
    let kb: u64 = line.trim().strip_suffix("kB")?.trim().parse().ok()?;
    Some(kb.div_ceil(1024))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn errors_are_kept_with_their_hints_and_little_else() {
        let said = b"  chosen: x\nerror: a.mp4: is cut\nhint: copy it again\n";
        let words = last_lines(&said[..]);
        assert_eq!(words.len(), 3);
        let status = ExitStatus::default();
        assert_eq!(reason(status, &words), "a.mp4: is cut\nhint: copy it again");
        assert_eq!(reason(status, &["  last".to_string()]), "  last");
        let endless = vec![b'x'; 1 << 20];
        assert!(last_lines(&endless[..])[0].len() == MOST_LETTERS);
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn memory_is_told_of_a_process_that_lives() {
        assert!(memory_mb(std::process::id()).is_some_and(|mb| mb > 0));
        assert_eq!(memory_mb(u32::MAX), None);
    }
}
