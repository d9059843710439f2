//! Frames of anything that an `ffmpeg` program on the PATH can read, through a pipe, with their true times.
//!
//! The program decodes and converts nothing that need not be: it is asked for the nearest of the layouts read here, so
//! that luma stays what the video holds, and for times in nanoseconds. It is started without a shell; its messages are
//! drained on a thread of their own; it is killed when the source is dropped.
//! Limits: how many frames there are is not known beforehand; a live stream that is silent for 30 s, or that is told to stop, is given up.

use super::log::Log;
use super::pictures::{Message, read_all};
use crate::io::options::{Colour, OpenOptions, StopFlag};
use crate::{Error, ErrorKind, Frame, FrameSource, PixelKind, Pixels, Result, SourceInfo};
use std::ffi::OsStr;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel, sync_channel};
use std::time::{Duration, Instant};

/// Frames read ahead of the caller.
const AHEAD: usize = 4;
/// How long a live source may be silent.
const SILENCE: Duration = Duration::from_secs(30);
/// How often a live source looks whether it shall stop.
const LOOK_AROUND: Duration = Duration::from_millis(50);
/// Layouts whose first plane is luma, or that are RGB: every other one is converted to the nearest of these.
const NATIVE: &str = "format=gray|gray10le|gray12le|gray14le|gray16le|yuv420p|yuvj420p|yuv422p|yuvj422p|yuv444p|\
yuvj444p|yuv440p|yuvj440p|yuv411p|yuv410p|yuv420p10le|yuv422p10le|yuv444p10le|yuv420p12le|yuv422p12le|yuv444p12le|\
yuv420p16le|yuv422p16le|yuv444p16le|rgb24";
/// Layouts when colour is wanted.
const COLOUR: &str = "format=gray|gray10le|gray12le|gray14le|gray16le|rgb24";

/// The source.
struct FfmpegSource {
    info: SourceInfo,
    warnings: Vec<String>,
    messages: Option<Receiver<Message>>,
    first: Option<Frame>,
    spare: Sender<Pixels>,
    child: Child,
    log: Log,
    live: bool,
    stop: StopFlag,
    n_read: u64,
}

impl Drop for FfmpegSource {
    fn drop(&mut self) {
        // It may have ended by itself; either way it must not outlive us or stay a zombie.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// Opens `input` with the program `ffmpeg`.
pub(in crate::io::video) fn open(
    program: &OsStr,
    input: &OsStr,
    options: &OpenOptions,
) -> Result<Box<dyn FrameSource>> {
    let source = match start(program, input, options, "-fps_mode")? {
        Started::Source(source) => source,
        // Programs before 5.1 know the same choice by an older name.
        Started::OldProgram => match start(program, input, options, "-vsync")? {
            Started::Source(source) => source,
            Started::OldProgram => {
                return Err(Error::new(ErrorKind::MissingTool, "the ffmpeg found is too old")
                    .at(input.display())
                    .hint(INSTALL));
            }
        },
    };
    Ok(source)
}

/// How to get the program.
pub(in crate::io::video) const INSTALL: &str = "install ffmpeg: `apt install ffmpeg` (Debian, Ubuntu), `dnf install ffmpeg` (Fedora), \
`brew install ffmpeg` (macOS), `winget install ffmpeg` (Windows); or convert the video to MP4 with H.264, which is read \
without it";

enum Started {
    Source(Box<FfmpegSource>),
    OldProgram,
}

fn start(program: &OsStr, input: &OsStr, options: &OpenOptions, sync_option: &str) -> Result<Started> {
    let live = is_live(input);
    let mut child = command(program, input, options, sync_option)?.spawn().map_err(|e| {
        let missing = e.kind() == std::io::ErrorKind::NotFound;
        let what = if missing {
            "is read through the program ffmpeg, which is not installed (not on the PATH)"
        } else {
            "is read through the program ffmpeg, which cannot be started"
        };
        let error = Error::new(ErrorKind::MissingTool, what).at(input.display()).hint(INSTALL);
        if missing { error } else { error.because(e) }
    })?;
    let (Some(stdout), Some(stderr)) = (child.stdout.take(), child.stderr.take()) else {
        return Err(Error::new(ErrorKind::MissingTool, "ffmpeg gave no pipe").at(input.display()));
    };
    let log = Log::drain(stderr);
    let (send, messages) = sync_channel(AHEAD);
    let (spare, spare_out) = channel();
    let (colour, max_pixels) = (options.colour, options.max_pixels);
    let spawned = std::thread::Builder::new()
        .name("boresight-ffmpeg".into())
        .spawn(move || read_all(stdout, colour, max_pixels, &send, &spare_out));
    let info = SourceInfo {
        label: input.to_string_lossy().into_owned(),
        reader: "ffmpeg pipe".into(),
        width: 0,
        height: 0,
        kind: PixelKind::Gray8,
        n_frames: None,
        rate_hz: None,
        true_times: true,
    };
    let mut source = Box::new(FfmpegSource {
        info,
        warnings: Vec::new(),
        messages: Some(messages),
        first: None,
        spare,
        child,
        log,
        live,
        stop: options.stop.clone().unwrap_or_default(),
        n_read: 0,
    });
    spawned.map_err(|e| Error::new(ErrorKind::NotFound, "no thread can be started").because(e))?;
    match source.receive()? {
        Some(Message::Format { width, height, kind }) => {
            (source.info.width, source.info.height, source.info.kind) = (width, height, kind);
        }
        Some(Message::Broken(why)) => {
            return Err(source.failure(&why));
        }
        Some(Message::Frame(_)) | None => {
            source.messages = None;
            let _ = source.child.wait();
            source.log.wait();
            if source.log.has(&format!("'{}'", sync_option.trim_start_matches('-'))) {
                return Ok(Started::OldProgram);
            }
            return Err(source.failure("no frames came"));
        }
    }
    source.first = source.take()?;
    if source.first.is_none() {
        return Err(source.failure("no frames came"));
    }
    source.info.rate_hz = source.log.rate_hz();
    if source.log.has("displaymatrix: rotation") {
        let what = "the file asks for the picture to be turned for display; frames are given as they were recorded";
        source.warnings.push(what.into());
    }
    Ok(Started::Source(source))
}

/// Whether an input never ends by itself.
fn is_live(input: &OsStr) -> bool {
    input.to_str().is_some_and(|t| t.starts_with("/dev/") || t.contains("://"))
}

fn command(program: &OsStr, input: &OsStr, options: &OpenOptions, sync_option: &str) -> Result<Command> {
    let mut c = Command::new(program);
    c.args(["-hide_banner", "-nostdin", "-nostats", "-loglevel", "repeat+level+info"]);
    let starts = |with: &str| input.to_str().is_some_and(|t| t.starts_with(with));
    if starts("/dev/video") {
        c.args(["-f", "v4l2"]);
    } else if starts("rtsp://") || starts("rtsps://") {
        // Over UDP lost packets become broken pictures.
        c.args(["-rtsp_transport", "tcp"]);
    }
    if !is_live(input) {
        // Times as they are in the file, not counted from its first frame or sound.
        c.arg("-copyts");
    }
    c.arg("-noautorotate").arg("-i");
    if is_live(input) {
        c.arg(input);
    } else {
        let path = Path::new(input);
        if !path.exists() {
            return Err(Error::new(ErrorKind::NotFound, "no such file").at(input.display()));
        }
        // The prefix keeps names with ':', '%' or a leading '-' from being read as something else.
        let mut name = std::ffi::OsString::from("file:");
        name.push(path);
        c.arg(name);
    }
    let formats = if options.colour == Colour::Rgb { COLOUR } else { NATIVE };
    c.args(["-map", "0:V:0", "-vf", formats, sync_option, "passthrough", "-enc_time_base", "1:1000000000"]);
    c.args(["-c:v", "rawvideo", "-f", "nut", "-write_index", "0", "pipe:1"]);
    c.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
    Ok(c)
}

impl FfmpegSource {
    /// Waits for the next message; `None` at the end.
    fn receive(&mut self) -> Result<Option<Message>> {
        let Some(messages) = &self.messages else { return Ok(None) };
        if !self.live {
            return Ok(messages.recv().ok());
        }
        let silent_at = Instant::now() + SILENCE;
        let message = loop {
            let message = messages.recv_timeout(LOOK_AROUND);
            let waits = matches!(message, Err(RecvTimeoutError::Timeout)) && Instant::now() < silent_at;
            if !waits || self.stop.is_stopped() {
                break message;
            }
        };
        match message {
            Ok(message) => Ok(Some(message)),
            Err(RecvTimeoutError::Disconnected) => Ok(None),
            Err(RecvTimeoutError::Timeout) if self.stop.is_stopped() => {
                self.messages = None;
                let _ = self.child.kill();
                Ok(None)
            }
            Err(RecvTimeoutError::Timeout) => {
                self.messages = None;
                let _ = self.child.kill();
                let what = format!("the stream has been silent for {} s", SILENCE.as_secs());
                if self.n_read == 0 {
                    return Err(Error::new(ErrorKind::NotFound, what).at(&self.info.label));
                }
                self.warnings.push(format!("{what}; it ends after {} frames", self.n_read));
                Ok(None)
            }
        }
    }

    fn take(&mut self) -> Result<Option<Frame>> {
        match self.receive()? {
            Some(Message::Frame(frame)) => {
                self.n_read += 1;
                Ok(Some(frame))
            }
            Some(Message::Broken(why)) if self.n_read == 0 => Err(self.failure(&why)),
            Some(Message::Broken(why)) => {
                self.warnings.push(format!("the stream broke off after {} frames: {why}", self.n_read));
                self.end();
                Ok(None)
            }
            Some(Message::Format { .. }) | None => {
                self.end();
                Ok(None)
            }
        }
    }

    /// After the last frame: asks how it went.
    fn end(&mut self) {
        if self.messages.take().is_none() {
            return;
        }
        let status = self.child.wait();
        self.log.wait();
        let (n, last) = self.log.errors();
        let failed = status.map_or(true, |s| !s.success());
        if n > 0 || failed {
            let last = last.unwrap_or_else(|| "no reason given".into());
            let what = if failed { "ffmpeg stopped early" } else { "parts of the video are damaged" };
            self.warnings.push(format!("{what}: {n} messages, the last: {last}"));
        }
    }

    /// The error for an input that gives no frame.
    fn failure(&mut self, why: &str) -> Error {
        self.messages = None;
        let _ = self.child.kill();
        let _ = self.child.wait();
        self.log.wait();
        self.log.failure(why).at(&self.info.label)
    }
}

impl FrameSource for FfmpegSource {
    fn info(&self) -> &SourceInfo {
        &self.info
    }

    fn is_coded(&self) -> bool {
        true
    }

    fn next_frame(&mut self) -> Result<Option<Frame>> {
        if let Some(frame) = self.first.take() {
            return Ok(Some(frame));
        }
        self.take()
    }

    fn recycle(&mut self, frame: Frame) {
        let _ = self.spare.send(frame.pixels);
    }

    fn reads_ahead(&self) -> bool {
        true
    }

    fn warnings(&self) -> &[String] {
        &self.warnings
    }
}

#[cfg(all(test, unix))]
mod tests {
    use super::*;
    use std::os::unix::fs::PermissionsExt;

    #[test]
    fn a_stream_that_is_told_to_stop_ends_its_program_while_it_is_silent() {
        let dir = tempfile::tempdir().unwrap();
        let (program, pid) = (dir.path().join("silent"), dir.path().join("pid"));
        std::fs::write(&program, format!("#!/bin/sh\necho $$ > {}\nexec sleep 600\n", pid.display())).unwrap();
        std::fs::set_permissions(&program, std::fs::Permissions::from_mode(0o755)).unwrap();
        let stop = StopFlag::default();
        let options = OpenOptions { stop: Some(stop.clone()), ..OpenOptions::default() };
        let began = Instant::now();
        let waits =
            std::thread::spawn(move || open(program.as_os_str(), OsStr::new("udp://127.0.0.1:9"), &options).is_err());
        let written = || std::fs::read_to_string(&pid).is_ok_and(|text| text.ends_with('\n'));
        while !written() && began.elapsed() < SILENCE {
            std::thread::sleep(Duration::from_millis(5));
        }
        stop.stop();
        assert!(waits.join().unwrap(), "it gave no frame");
        assert!(began.elapsed() < SILENCE, "it was not waited for");
        let process = std::fs::read_to_string(&pid).unwrap();
        let alive = Command::new("kill").args(["-0", process.trim()]).stderr(Stdio::null()).status().unwrap().success();
        assert!(!alive, "its program has ended");
    }
}
