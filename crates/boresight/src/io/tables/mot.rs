//! MOTChallenge results: `frame,id,left,top,width,height,conf,-1,-1,-1`, frames and pixels counted from 1.
//!
//! A MOTChallenge box that starts at the top-left pixel has left = top = 1; here that pixel's left edge is -0.5. So left
//! and top shift by 1.5 px, sizes do not change. Source: Leal-Taixé et al., *MOTChallenge 2015*, section on data format.

use super::number::{push_f32, push_f64};
use crate::io::atomic::Output;
use crate::{Extent, Result, Sink, TrackStatus, View};
use std::fmt::Write;
use std::path::PathBuf;

/// From a pixel's edge counted from the centre of pixel 0 to the box coordinate counted from pixel 1.
const SHIFT_PX: f64 = 1.5;

/// Returns left, top, width, height as MOTChallenge counts them, px.
pub fn mot_box_of_extent(extent: &Extent) -> [f64; 4] {
    [extent.left_px + SHIFT_PX, extent.top_px + SHIFT_PX, extent.width_px, extent.height_px]
}

/// Returns the box of MOTChallenge's left, top, width, height, px.
pub fn extent_of_mot_box([left, top, width_px, height_px]: [f64; 4]) -> Extent {
    Extent { left_px: left - SHIFT_PX, top_px: top - SHIFT_PX, width_px, height_px }
}

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
            let _ = write!(out, "{},{}", view.scan.index.0 + 1, track.id.0);
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
