//! Drawing on frames: boxes, labels, trails, ellipses; and annotated video.

mod annotate;
#[cfg(feature = "encode")]
mod annotated_video;
mod canvas;
mod colours;
mod labels;
mod options;
mod png_folder;
mod reduced;
mod steady_view;
mod text;
mod thumbnail;
mod tone;

pub use crate::palette::track_colour;
pub use annotate::Annotator;
#[cfg(feature = "encode")]
pub use annotated_video::AnnotatedVideo;
pub use canvas::{Canvas, Pen, Rgb};
pub use colours::Colours;
pub use options::DrawOptions;
pub use png_folder::{PngFolder, write_png};
pub use steady_view::SteadyView;
pub use text::Lettering;
pub use thumbnail::Thumbnail;
pub use tone::{Tone, legible_scale};
