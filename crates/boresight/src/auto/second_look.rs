//! The second look at a file whose camera stands still: over its first [`SECOND_LOOK_FRAMES`] frames and in colour.
//!
//! The target may come late, and its colour may be what tells it; the first frames, read as the configuration says (grey), show neither.

use crate::io::{Colour, OpenOptions};
use crate::{Config, Frame, FrameSource};
use std::path::Path;

/// Frames of a file that are looked through when its camera stands still.
pub const SECOND_LOOK_FRAMES: usize = 400;
/// Most memory taken by the frames kept of them, bytes.
const MAX_BYTES: usize = 256 << 20;

/// Whether the input is a file or files, which are the same when they are read again.
pub(super) fn can_be_opened_twice(input: &str) -> bool {
    let on_disk = std::fs::metadata(Path::new(input)).is_ok_and(|m| m.is_file() || m.is_dir());
    on_disk || (input.contains('*') && !input.contains("://"))
}

/// At most `n_kept` frames spread evenly over the beginning, in colour if the file has it; what cannot be read ends them.
pub(super) fn frames(input: &str, base: &Config, n_kept: usize) -> Vec<Frame> {
    let options = OpenOptions { colour: Colour::Rgb, ..base.input.open_options() };
    match crate::io::open(input, &options) {
        Ok(mut source) => spread(source.as_mut(), n_kept),
        Err(_) => Vec::new(),
    }
}

/// At most `n_kept` frames spread evenly over the beginning of a source.
pub(super) fn spread(source: &mut dyn FrameSource, n_kept: usize) -> Vec<Frame> {
    let info = source.info();
    let bytes = info.width.saturating_mul(info.height).saturating_mul(3).max(1);
    let most = (MAX_BYTES / bytes).clamp(4, n_kept);
    let (mut kept, mut step) = (Vec::with_capacity(most), 1);
    for k in 0..SECOND_LOOK_FRAMES {
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
