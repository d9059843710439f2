//! Detections as JSON lines from a TCP connection: to a server (`tcp://HOST:PORT?detections`), or of whoever calls here (`tcp://ADDRESS:PORT?detections&listen`).
//!
//! `?listen` is named as ffmpeg's is. One client at a time is heard; while it is silent another one that calls takes its place, since one that vanished without a
//! word is silent too. What limits a line is in [`super::detection_lines`]; a reader that is slow makes the sender wait, by TCP itself.
//! Limits: no TLS and no password: listen on this machine's own address, or on a network that is trusted.

use boresight::io::StopFlag;
use boresight::{Error, ErrorKind, Result};
use std::io::{ErrorKind as Io, Read};
use std::net::{TcpListener, TcpStream, ToSocketAddrs};
use std::sync::Arc;
use std::time::Duration;

/// How long one waits for an answer before looking around.
const LOOK_AROUND: Duration = Duration::from_millis(50);
/// How long a server may take to answer.
const ANSWER: Duration = Duration::from_secs(3);

/// A source of lines on the network.
#[derive(Clone, Debug)]
pub struct Socket {
    place: String,
    listens: bool,
    listener: Option<Arc<TcpListener>>,
    stop: StopFlag,
}

impl Socket {
    /// Reads `tcp://HOST:PORT?detections` or `..&listen`; `None` for any other source, ffmpeg's `tcp://` without that word among them.
    /// # Errors
    /// [`ErrorKind::Config`] for words that are not known, or a place that is none.
    pub fn parse(text: &str, stop: StopFlag) -> Option<Result<Self>> {
        let (place, query) = text.strip_prefix("tcp://")?.split_once('?')?;
        let words: Vec<&str> = query.split('&').collect();
        if !words.contains(&"detections") {
            return None;
        }
        let wrong = |what: String| {
            Err(Error::new(ErrorKind::Config, what).at(text).hint(
                "tcp://HOST:PORT?detections asks a server, tcp://127.0.0.1:PORT?detections&listen waits for a client",
            ))
        };
        if let Some(odd) = words.iter().find(|w| !matches!(**w, "detections" | "listen")) {
            return Some(wrong(format!("'{odd}' is not known behind the address")));
        }
        let port = place.rsplit_once(':').filter(|(host, _)| !host.is_empty()).map(|(_, port)| port);
        let listens = words.contains(&"listen");
        // Port 0 takes a free one, which nobody could know.
        if port.and_then(|p| p.parse::<u16>().ok()).is_none_or(|p| p == 0) {
            return Some(wrong("expected HOST:PORT".to_string()));
        }
        Some(Ok(Self { place: place.to_string(), listens, listener: None, stop }))
    }

    /// Asks the server, or waits for a client.
    /// # Errors
    /// [`ErrorKind::NotFound`] if nobody answers, or the address is not this machine's.
    pub fn connect(&mut self) -> Result<Wire> {
        let stream = if self.listens { self.accept()? } else { self.ask()? };
        stream
            .set_nonblocking(false)
            .and_then(|()| stream.set_read_timeout(Some(LOOK_AROUND)))
            .map_err(|e| self.failed("the connection cannot be used", e))?;
        let others = self.listener.clone();
        Ok(Wire { stream, others, stop: self.stop.clone() })
    }

    fn failed(&self, what: &str, e: std::io::Error) -> Error {
        Error::new(ErrorKind::NotFound, what).at(format!("tcp://{}", self.place)).because(e)
    }

    fn ask(&self) -> Result<TcpStream> {
        let all = self.place.to_socket_addrs().map_err(|e| self.failed("is not known", e))?;
        let mut last = std::io::Error::from(Io::AddrNotAvailable);
        for address in all {
            match TcpStream::connect_timeout(&address, ANSWER) {
                Ok(stream) => return Ok(stream),
                Err(e) => last = e,
            }
            if self.stop.is_stopped() {
                break;
            }
        }
        Err(self.failed("does not answer", last))
    }

    fn accept(&mut self) -> Result<TcpStream> {
        if self.listener.is_none() {
            let bound = TcpListener::bind(&self.place).and_then(|l| l.set_nonblocking(true).map(|()| l));
            self.listener = Some(Arc::new(bound.map_err(|e| self.failed("cannot be listened on", e))?));
        }
        while !self.stop.is_stopped() {
            match self.listener.as_ref().map(|listener| listener.accept()) {
                Some(Ok((stream, _))) => return Ok(stream),
                // Nobody yet, or one who left while he was let in.
                _ => std::thread::sleep(LOOK_AROUND),
            }
        }
        Err(self.failed("was stopped while it waited", Io::Interrupted.into()))
    }
}

/// A connection; reading ends when the run does.
#[derive(Debug)]
pub struct Wire {
    stream: TcpStream,
    /// Where other clients call.
    others: Option<Arc<TcpListener>>,
    stop: StopFlag,
}

impl Wire {
    /// Another client that called while this one is silent.
    fn other(&self) -> Option<TcpStream> {
        let (stream, _) = self.others.as_ref()?.accept().ok()?;
        let usable = stream.set_nonblocking(false).and_then(|()| stream.set_read_timeout(Some(LOOK_AROUND)));
        usable.is_ok().then_some(stream)
    }
}

impl Read for Wire {
    fn read(&mut self, into: &mut [u8]) -> std::io::Result<usize> {
        while !self.stop.is_stopped() {
            match self.stream.read(into) {
                Err(e) if matches!(e.kind(), Io::WouldBlock | Io::TimedOut | Io::Interrupted) => {
                    if let (Some(other), Some(first)) = (self.other(), into.first_mut()) {
                        self.stream = other;
                        // What the silent one had begun is no part of the other's first line.
                        *first = b'\n';
                        return Ok(1);
                    }
                }
                read => return read,
            }
        }
        Ok(0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_detections_are_ours_and_what_is_not_understood_is_said() {
        let parse = |text: &str| Socket::parse(text, StopFlag::default());
        for others in ["tcp://h:1", "tcp://h:1?listen", "udp://h:1?detections", "a.mp4", "rtsp://h/?detections"] {
            assert!(parse(others).is_none(), "{others}");
        }
        assert!(!parse("tcp://[::1]:9?detections").unwrap().unwrap().listens);
        assert!(parse("tcp://h:9?listen&detections").unwrap().unwrap().listens);
        for wrong in ["tcp://h?detections", "tcp://:1?detections", "tcp://h:0?detections", "tcp://h:1?detections&fast"]
        {
            let said = parse(wrong).unwrap().unwrap_err().to_string();
            assert!(said.contains("hint: tcp://HOST:PORT?detections"), "{said}");
        }
    }
}
