//! Opening an input with nobody to say how: the first frames are looked at, of a file also frames further on and in colour.
//!
//! A stream is read once: what its first frames show must do. A file whose camera stands still is opened a second time and looked
//! at over its first [`FURTHER_FRAMES`] frames, because the target may come late and its colour may be what tells it.

use super::{Choice, PROBE_FRAMES, Replay, choose_with};
use crate::io::{Colour, OpenOptions};
use crate::{Config, Frame, FrameSource, Result};
use std::path::Path;

/// Frames of a file that are looked through when its camera stands still.
pub const FURTHER_FRAMES: usize = 400;
/// Most memory taken by the frames kept of them, bytes.
const MAX_BYTES: usize = 256 << 20;

/// Opens an input and proposes its configuration; the source hands out every frame from the first on.
/// # Errors
/// An input that cannot be opened, or whose first frames differ in size or pixel type.
pub fn open_and_choose(input: &str, base: &Config) -> Result<(Replay, Choice)> {
    let mut replay = Replay::new(crate::io::open(input, &base.input.open_options())?, PROBE_FRAMES);
    let info = replay.info().clone();
    let mut further = || if can_be_opened_twice(input) { look_further(input, base) } else { Vec::new() };
    let choice = choose_with(replay.ahead(), &info, base, &mut further)?;
    if choice.config.input.colour != base.input.colour {
        replay = Replay::new(crate::io::open(input, &choice.config.input.open_options())?, PROBE_FRAMES);
    }
    Ok((replay, choice))
}

/// Whether the input is a file or files, which are the same when they are read again.
fn can_be_opened_twice(input: &str) -> bool {
    let on_disk = std::fs::metadata(Path::new(input)).is_ok_and(|m| m.is_file() || m.is_dir());
    on_disk || (input.contains('*') && !input.contains("://"))
}

/// Frames spread evenly over the beginning, in colour if the file has it; what cannot be read ends them.
fn look_further(input: &str, base: &Config) -> Vec<Frame> {
    let options = OpenOptions { colour: Colour::Rgb, ..base.input.open_options() };
    let Ok(mut source) = crate::io::open(input, &options) else { return Vec::new() };
    let info = source.info();
    let bytes = info.width.saturating_mul(info.height).saturating_mul(3).max(1);
    let most = (MAX_BYTES / bytes).clamp(4, PROBE_FRAMES);
    let (mut kept, mut step) = (Vec::with_capacity(most), 1);
    for k in 0..FURTHER_FRAMES {
        let Ok(Some(frame)) = source.next_frame() else { break };
        if k % step != 0 {
            source.recycle(frame);
            continue;
        }
        if kept.len() == most {
            // Twice as far apart, over twice the time.
            let mut i = 0;
            kept.retain(|_| {
                i += 1;
                i % 2 == 1
            });
            step *= 2;
            if k % step != 0 {
                source.recycle(frame);
                continue;
            }
        }
        kept.push(frame);
    }
    kept
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn streams_and_cameras_are_opened_once() {
        for once in ["-", "rtsp://host/stream", "/dev/video0", "/no/such/file.mp4"] {
            assert!(!can_be_opened_twice(once), "{once}");
        }
        assert!(can_be_opened_twice("frames/*.png"));
        assert!(can_be_opened_twice(env!("CARGO_MANIFEST_DIR")));
    }
}
