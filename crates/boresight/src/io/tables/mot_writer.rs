//! MOTChallenge results as a sink: `frame,id,left,top,width,height,conf,-1,-1,-1`, counted from 1 (see `dialect::mot`).

use super::dialect::mot::mot_box_of_extent;
use super::number::{push_f32, push_f64, push_int};
use crate::io::atomic::Output;
use crate::{Result, Sink, TrackStatus, View};
use std::path::PathBuf;

/// Writes MOTChallenge text.
pub struct MotWriter {
    output: Output,
    lines: String,
    coasting: bool,
}

opaque_debug!(MotWriter);

impl MotWriter {
    /// Creates the file; only confirmed tracks with a detection in the frame are written.
    /// # Errors
    /// [`crate::ErrorKind::Output`] if it cannot be written.
    pub fn create(path: impl Into<PathBuf>) -> Result<Self> {
        Ok(Self::to(Output::file(path)?))
    }

    /// Writes to any output.
    pub fn to(output: Output) -> Self {
        Self { output, lines: String::new(), coasting: false }
    }

    /// Writes confirmed tracks also where they are only predicted.
    #[must_use]
    pub fn with_coasting(mut self, coasting: bool) -> Self {
        self.coasting = coasting;
        self
    }
}

impl Sink for MotWriter {
    fn needs_frames(&self) -> bool {
        false
    }

    fn put(&mut self, view: &View<'_>) -> Result<()> {
        let out = &mut self.lines;
        out.clear();
        for track in view.tracks {
            let wanted = match track.status {
                TrackStatus::Tentative => false,
                TrackStatus::Confirmed => true,
                TrackStatus::Coasting => self.coasting,
            };
            if !wanted {
                continue;
            }
            push_int(out, view.scan.index.0 + 1);
            out.push(',');
            push_int(out, track.id.0);
            for v in mot_box_of_extent(&track.extent) {
                out.push(',');
                push_f64(out, v);
            }
            out.push(',');
            push_f32(out, track.score);
            out.push_str(",-1,-1,-1\n");
        }
        self.output.put(out.as_bytes())
    }

    fn finish(self: Box<Self>) -> Result<()> {
        self.output.finish()
    }
}
