//! Frames and tables in and out: images, video, streams; CSV, MOTChallenge, KITTI, COCO and others' tables.

mod atomic;
mod atomic_folder;
// Only video is kept so.
#[cfg_attr(not(feature = "video"), allow(dead_code))]
mod colours_beside;
#[cfg(feature = "images")]
mod folder;
#[cfg(feature = "images")]
mod guard;
mod natural;
#[cfg(feature = "images")]
mod numbered;
mod open;
mod options;
#[cfg(feature = "images")]
mod pattern;
mod pictures;
mod pixels;
mod replay;
mod same_file;
#[cfg(test)]
mod same_rows;
#[cfg(feature = "images")]
mod samples;
mod sniff;
#[cfg(feature = "images")]
mod stack;
#[cfg(feature = "images")]
mod still;
mod stream;
pub(crate) mod tables;
pub mod tracks;
#[cfg(any(feature = "video", feature = "encode"))]
pub mod video;
pub use tables::{TRACKS_HEADER, mot_box_of_extent};

pub use crate::memory_budget::set_memory_budget;
pub use atomic::{AtomicFile, Output, write_whole};
pub use atomic_folder::{AtomicFolder, remove_folder};
pub use colours_beside::{ColoursBeside, KeepColours, KeepOf};
#[cfg(feature = "images")]
pub use folder::ImageFiles;
pub use natural::natural_order;
pub use open::{is_table, open};
pub use options::{Colour, OpenOptions, RawFormat, RawType, StopFlag};
pub use pictures::Pictures;
pub use pixels::gray_of_rgb8;
pub use replay::Replay;
pub(crate) use replay::{MOST_BYTES, MOST_FRAMES, frames_ahead};
pub use same_file::{is_same_file, refuse_to_overwrite};
#[cfg(feature = "images")]
pub use stack::gif::GifFrames;
pub use stream::raw::RawFrames;
pub use stream::y4m::Y4m;
pub use tables::{
    AzimuthFrom, CameraCsv, Columns, DetectionTable, DetectionsCsv, JsonLines, LengthUnit, MeasuredOnly, MotWriter,
    RadarOptions, RadarPicture, SequenceInfo, ShipReports, StateTable, TableOptions, TracksCsv, read_detections,
    read_ship_reports, read_tracks,
};
