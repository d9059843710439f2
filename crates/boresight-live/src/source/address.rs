//! From what stands on the command line to a source: an address, a camera, a file played by the clock, detections by TCP, standard input.

use super::detection_lines::DetectionLines;
use super::feed::{Connect, Feed, Frames};
use super::pace::Paced;
use super::socket::Socket;
use boresight::config::InputConfig;
use boresight::io::StopFlag;
use boresight::{Error, ErrorKind, Result, io};
use std::fs::File;
use std::io::{BufRead, BufReader, stdin};

/// A source by its name.
#[derive(Clone, Debug)]
pub struct Address {
    name: String,
    input: InputConfig,
    pace: bool,
    has_rate: bool,
    gives_lines: bool,
    stop: StopFlag,
    /// Where detections come by TCP.
    socket: Option<Socket>,
}

impl Address {
    /// A source: `rtsp://..`, `/dev/video0`, a file, or `-`. `pace` plays by the clock; `has_rate` says that the rate of `input` was given, and holds
    /// for a stream without times of its own.
    pub fn new(name: &str, input: InputConfig, pace: bool, has_rate: bool) -> Self {
        Self {
            name: name.to_string(),
            input,
            pace,
            has_rate,
            gives_lines: false,
            stop: StopFlag::default(),
            socket: None,
        }
    }

    fn is_stream(&self) -> bool {
        self.name.contains("://") || self.name.starts_with("/dev/")
    }

    fn open(&mut self) -> Result<Box<dyn Feed>> {
        self.gives_lines = false;
        if self.socket.is_none()
            && let Some(socket) = Socket::parse(&self.name, self.stop.clone())
        {
            self.socket = Some(socket?);
        }
        if let Some(socket) = &mut self.socket {
            self.gives_lines = true;
            return Ok(Box::new(DetectionLines::new(BufReader::new(socket.connect()?), self.input.late_s)));
        }
        if self.name == "-" {
            if begins_as_json(&mut stdin().lock()) {
                self.gives_lines = true;
                // The lock cannot move to the reader's thread; the buffer beneath is the same.
                return Ok(Box::new(DetectionLines::new(BufReader::new(stdin()), self.input.late_s)));
            }
        } else if !self.is_stream()
            && let Ok(file) = File::open(&self.name)
        {
            let mut reader = BufReader::new(file);
            if begins_as_json(&mut reader) {
                self.gives_lines = true;
                return Ok(Box::new(DetectionLines::new(reader, self.input.late_s)));
            }
            if io::is_table(&self.name) {
                return Err(Error::new(ErrorKind::Unsupported, "a table does not happen: it is there already")
                    .at(&self.name)
                    .hint("`boresight track` takes tables; `live` takes detections as JSON lines"));
            }
        }
        let options = io::OpenOptions { stop: Some(self.stop.clone()), ..self.input.open_options() };
        let source = self.input.mend(io::open(&self.name, &options)?)?;
        let has_stamps = source.info().true_times || self.has_rate || self.pace || !self.never_waits();
        Ok(Box::new(Frames::new(source, has_stamps)))
    }

    /// Whether it goes on while nobody reads it.
    fn never_waits(&self) -> bool {
        self.is_stream() || self.name == "-"
    }
}

/// Whether the first byte opens a JSON object; nothing is taken from the reader.
fn begins_as_json(reader: &mut impl BufRead) -> bool {
    reader.fill_buf().is_ok_and(|head| head.first() == Some(&b'{'))
}

impl Connect for Address {
    fn connect(&mut self) -> Result<Box<dyn Feed>> {
        let feed = self.open()?;
        Ok(if self.pace { Box::new(Paced::new(feed)) } else { feed })
    }

    fn is_endless(&self) -> bool {
        self.is_stream()
    }

    fn stop_flag(&self) -> Option<StopFlag> {
        // Standard input waits whatever it is told.
        self.is_stream().then(|| self.stop.clone())
    }

    fn newest_counts(&self) -> bool {
        // A file that is not paced, and lines of detections, wait for the tracker.
        self.pace || (self.never_waits() && !self.gives_lines)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_of_lines_is_known_by_its_first_byte_and_a_table_is_refused() {
        let dir = tempfile::tempdir().unwrap();
        let open = |name: &str, text: &str| {
            std::fs::write(dir.path().join(name), text).unwrap();
            let path = dir.path().join(name).display().to_string();
            Address::new(&path, InputConfig::default(), false, false).connect()
        };
        assert!(open("a.jsonl", "{\"time_s\":0,\"detections\":[]}\n").unwrap().info().is_none());
        let refused = open("a.csv", "frame,x,y\n0,1,2\n").err().unwrap().to_string();
        assert!(refused.contains("boresight track"), "{refused}");
    }
}
