//! Where frames or detections come from while they happen.

mod address;
mod detection_lines;
mod feed;
mod names;
mod pace;
mod reader;
mod socket;

pub use address::Address;
pub use feed::{Connect, Content, Feed, Frames};
pub use names::{NamedSource, name_sources};
pub use pace::Paced;
pub use reader::{Arrived, Pauses, start};
