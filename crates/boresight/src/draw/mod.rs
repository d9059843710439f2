//! Drawing on frames: boxes, labels, trails, ellipses; and annotated video.

mod annotate;
mod canvas;
mod palette;
mod sinks;
mod text;
mod tone;

pub use annotate::{Annotator, DrawOptions};
pub use canvas::{Canvas, Pen, Rgb};
pub use palette::track_colour;
pub use sinks::{AnnotatedVideo, PngFolder, write_png};
pub use text::Lettering;
pub use tone::{Tone, legible_scale};
