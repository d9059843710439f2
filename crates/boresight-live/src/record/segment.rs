//! One segment of a record: JSON lines, two tables and the configuration, each written line by line so that a kill loses nothing; what a full disk cuts off is taken
//! back to the last whole line.
//!
//! `000001.jsonl` holds every scan with its detections and tracks, and can be given to `boresight live` again; `000001.detections.csv` and
//! `000001.tracks.csv` are the tables of `boresight track`, `000001.config.toml` is the run's configuration, `000001.mp4` ([`super::film`]) its pictures.

use super::entry::{ENDINGS, Entry, path};
use crate::motion::MotionLine;
use crate::output::Shown;
use boresight::io::{self, DetectionsCsv, JsonLines, Output, TracksCsv};
use boresight::track::TrackerParameters;
use boresight::{Error, ErrorKind, Result, Scan, Sink, View};
use std::fs::{File, OpenOptions};
use std::io::Write;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

/// Memory that a sink of the library writes to.
#[derive(Clone, Default)]
struct Memory(Arc<Mutex<Vec<u8>>>);

impl Memory {
    fn with<T>(&self, f: impl FnOnce(&mut Vec<u8>) -> T) -> T {
        f(&mut self.0.lock().unwrap_or_else(PoisonError::into_inner))
    }
}

impl Write for Memory {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        self.with(|memory| memory.extend_from_slice(bytes));
        Ok(bytes.len())
    }

    fn flush(&mut self) -> std::io::Result<()> {
        Ok(())
    }
}

struct Part {
    sink: Box<dyn Sink>,
    memory: Memory,
    file: File,
    /// Bytes of whole lines in it.
    bytes: u64,
    path: PathBuf,
}

/// A segment that is being written.
pub struct Segment {
    parts: Vec<Part>,
    /// What the manifest says.
    pub entry: Entry,
}

impl Segment {
    /// Creates the files of a number that is not taken.
    /// # Errors
    /// [`ErrorKind::Output`] if they cannot be written.
    pub fn create(dir: &Path, number: u64, config: &str) -> Result<Self> {
        let config_path = path(dir, number, "config.toml");
        io::write_whole(config_path, config.as_bytes())?;
        let mut parts = Vec::new();
        for ending in &ENDINGS[..3] {
            let memory = Memory::default();
            let output = Output::Stream(Box::new(memory.clone()));
            let sink: Box<dyn Sink> = match *ending {
                "jsonl" => Box::new(JsonLines::to(output)),
                "tracks.csv" => Box::new(TracksCsv::to(output)?),
                _ => Box::new(DetectionsCsv::to(output)?),
            };
            let path = path(dir, number, ending);
            let opened = OpenOptions::new().append(true).create_new(true).open(&path);
            let file =
                opened.map_err(|e| Error::new(ErrorKind::Output, "cannot be written").at(path.display()).because(e))?;
            parts.push(Part { sink, memory, file, bytes: 0, path });
        }
        let entry = Entry { number, open: true, bytes: config.len() as u64, ..Entry::default() };
        let mut segment = Self { parts, entry };
        segment.write_out("")?;
        Ok(segment)
    }

    /// Writes a frame: each file by one write, so that a kill leaves whole lines; `parameters`: what the tracker assumed from it on.
    /// # Errors
    /// [`ErrorKind::Output`] if it cannot be written.
    pub fn put(&mut self, shown: &Shown<'_>, parameters: Option<&TrackerParameters>) -> Result<()> {
        for part in &mut self.parts {
            part.sink.put(&shown.view)?;
        }
        let (frame, time_s, at) = (shown.when.frame, shown.when.time.as_secs_f64(), shown.when.arrived_unix_s);
        let blind = if shown.view.scan.blind { "\"blind\":true," } else { "" };
        let motion = shown.view.scan.camera_motion.as_ref().and_then(MotionLine::of);
        let motion = motion.and_then(|m| serde_json::to_string(&m).ok());
        let motion = motion.map_or(String::new(), |m| format!("\"camera_motion\":{m},"));
        let parameters = parameters.and_then(|p| serde_json::to_string(p).ok());
        let parameters = parameters.map_or(String::new(), |p| format!("\"parameters\":{p},"));
        self.write_out(&format!("{{\"arrived_unix_s\":{at},{blind}{motion}{parameters}"))?;
        let entry = &mut self.entry;
        entry.frames = Some([entry.frames.map_or(frame, |f| f[0]), frame]);
        entry.times_s = Some([entry.times_s.map_or(time_s, |t| t[0]), time_s]);
        entry.arrived_unix_s = Some([entry.arrived_unix_s.map_or(at, |a| a[0]), at]);
        Ok(())
    }

    /// Writes a scan that came late, to the lines alone: the tables are in the order of time.
    /// # Errors
    /// [`ErrorKind::Output`] if it cannot be written.
    pub fn put_late(&mut self, scan: &Scan, arrived_unix_s: f64) -> Result<()> {
        // The lines are the first part.
        let Some(lines) = self.parts.first_mut() else { return Ok(()) };
        lines.sink.put(&View { frame: None, scan, tracks: &[] })?;
        self.write_out(&format!("{{\"arrived_unix_s\":{arrived_unix_s},\"late\":true,"))
    }

    /// Hands what the sinks made to the files; the line of JSON begins with `head` instead of its brace.
    fn write_out(&mut self, head: &str) -> Result<()> {
        for part in &mut self.parts {
            part.memory.with(|memory| {
                if !head.is_empty() && memory.first() == Some(&b'{') {
                    memory.splice(..1, head.bytes());
                }
                let written = part.file.write_all(memory);
                match &written {
                    Ok(()) => {
                        part.bytes += memory.len() as u64;
                        self.entry.bytes += memory.len() as u64;
                    }
                    // No half line: whoever reads on a full disk reads frames.
                    Err(_) => drop(part.file.set_len(part.bytes)),
                }
                memory.clear();
                let failed = |e| Error::new(ErrorKind::Output, "cannot be written").at(part.path.display()).because(e);
                written.map_err(failed)
            })?;
        }
        Ok(())
    }
}
